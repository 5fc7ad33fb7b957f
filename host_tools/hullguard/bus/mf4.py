"""ASAM MDF 4 with bus logging, as asammdf and the tools that read it lay it out: a group each for data, error and remote frames.

python-can's own writer dates a file to the moment of writing, and takes each frame through a call of asammdf; here a file has the date of its
first frame and is written at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from hullguard.bus.candump import BRS, ERROR, EXTENDED, FD, REMOTE, Entry
from hullguard.errors import InputError

FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)
_COMMON = [("BusChannel", "<u1"), ("ID", "<u4"), ("IDE", "<u1"), ("DLC", "<u1"), ("DataLength", "<u1")]
_FD = [("EDL", "<u1"), ("BRS", "<u1"), ("ESI", "<u1")]
FIELDS = {
    "CAN_DataFrame": [*_COMMON, ("DataBytes", "(64,)u1"), ("Dir", "<u1"), *_FD],
    "CAN_ErrorFrame": [*_COMMON, ("DataBytes", "(64,)u1"), ("Dir", "<u1"), *_FD],
    "CAN_RemoteFrame": [*_COMMON, ("Dir", "<u1")],
}


def package() -> Any:
    """asammdf, which is not a part of every installation."""
    try:
        import asammdf
    except ImportError as error:
        raise InputError("MF4 files need the package asammdf; pip install 'hullguard[mf4]', or use .blf") from error
    return asammdf


def _kind(entry: Entry) -> str:
    if entry.frame.flags & ERROR:
        return "CAN_ErrorFrame"
    return "CAN_RemoteFrame" if entry.frame.flags & REMOTE else "CAN_DataFrame"


def _code(length: int) -> int:
    """DLC of a length; that of the next larger one for a length that FD does not have."""
    return next(i for i, n in enumerate(FD_LENGTHS) if n >= length)


def _record(name: str, entry: Entry, channel: int) -> dict[str, Any]:
    frame = entry.frame
    length = len(frame.data)
    row = {
        "BusChannel": channel, "ID": frame.id, "IDE": int(bool(frame.flags & EXTENDED)), "DataLength": length, "Dir": int(entry.direction == "T"),
        "DLC": entry.asked if frame.flags & REMOTE else _code(length),
        "EDL": int(bool(frame.flags & FD)), "BRS": int(bool(frame.flags & BRS)), "ESI": int(entry.passive),
        "DataBytes": np.frombuffer(frame.data.ljust(64, b"\0"), dtype=np.uint8),
    }  # fmt: skip
    return {f"{name}.{field}": row[field] for field, _ in FIELDS[name]}


def write(path: Path, entries: Sequence[Entry], channel: Mapping[str, int], start_s: float) -> None:
    """A file that begins at `start_s`; `channel` gives each channel's number."""
    asammdf = package()
    from asammdf.blocks.v4_blocks import SourceInformation
    from asammdf.blocks.v4_constants import BUS_TYPE_CAN, SOURCE_BUS

    with asammdf.MDF(version="4.10") as file:
        file.header.start_time = datetime.fromtimestamp(start_s, UTC)
        for name, fields in FIELDS.items():
            chosen = [e for e in entries if _kind(e) == name]
            samples = np.zeros(len(chosen), dtype=[(f"{name}.{field}", kind) for field, kind in fields])
            for i, e in enumerate(chosen):
                for field, value in _record(name, e, channel[e.channel]).items():
                    samples[field][i] = value
            times = np.array([e.time_s - start_s for e in chosen], dtype="<f8")
            file.append(asammdf.Signal(name=name, samples=samples, timestamps=times, source=SourceInformation(source_type=SOURCE_BUS, bus_type=BUS_TYPE_CAN)))
        with path.open("w+b") as out:  # given a name, asammdf would choose the suffix
            file.save(out, compression=2)
