"""From one recording to another, and to signals: what `hullguard convert` and `--formats` do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cantools

from hullguard.bus import formats
from hullguard.bus.candump import ERROR, EXTENDED, REMOTE, Entry
from hullguard.errors import InputError


@dataclass(frozen=True)
class Converted:
    """What was done: frames read, and what the target could not keep, a line each."""

    frames: int
    losses: list[str]


def convert(source: Path, target: Path, channel: str | None = None, dbc: Path | None = None) -> Converted:
    """Write the frames of `source`, those of one channel or all, into `target`: another format, or with a DBC its signals as CSV."""
    signals = target.suffix.lower() == ".csv"
    if signals != (dbc is not None):
        raise InputError(f"{target}: a .csv takes its signals from a DBC; give --dbc with a .csv, and only there")
    if not signals:
        formats.of(target)
    if target.exists() and source.exists() and target.samefile(source):
        raise InputError(f"{target}: is the file that is read; name another")
    every = list(formats.read(source))
    entries = [e for e in every if channel in (None, e.channel)]
    if not entries:
        known = ", ".join(dict.fromkeys(e.channel for e in every)) or "none"
        raise InputError(f"{source}: no frames" + (f" of channel {channel}; its channels are: {known}" if channel else ""))
    return Converted(len(entries), formats.write(target, entries) if dbc is None else write_signals(target, entries, dbc))


def wanted(text: str, out: Path | None) -> list[str]:
    """The suffixes that --formats names."""
    names = [f".{name.strip().lower()}" for name in text.split(",") if name.strip()]
    known = [f for f in formats.FORMATS if f != ".log"]
    for name in names:
        if name not in known:
            raise InputError(f"--formats '{name[1:]}': expected of {', '.join(f[1:] for f in known)}")
    if names and out is None:
        raise InputError("--formats: there is no log without --out; give --out DIR")
    return names


def beside(log: Path, suffixes: Sequence[str]) -> list[str]:
    """The log in other formats, in the same folder; lines for people."""
    entries = list(formats.read(log)) if suffixes else []
    told = []
    for suffix in suffixes:
        target = log.with_suffix(suffix)
        told += [f"{target.name}: {line}" for line in formats.write(target, entries)]
    return told


# ---- signals ----


def _database(path: Path) -> Any:
    try:
        return cantools.database.load_file(path)
    except Exception as error:  # cantools raises what its parsers do
        raise InputError(f"{path}: not a readable DBC ({' '.join(str(error).split())})") from error


def _decoded(messages: dict[tuple[int, bool], Any], entry: Entry) -> dict[str, float] | None:
    """MESSAGE.SIGNAL -> physical value; None for a frame that the DBC does not know, or with another length than it says."""
    frame = entry.frame
    message = messages.get((frame.id, bool(frame.flags & EXTENDED)))
    if message is None or frame.flags & (REMOTE | ERROR) or len(frame.data) != message.length:
        return None
    try:
        found = message.decode(frame.data, decode_choices=False)
    except (cantools.Error, ValueError):  # a multiplexer with a value that has no signals
        return None
    return {f"{message.name}.{name}": float(value) for name, value in found.items()}


def write_signals(path: Path, entries: Sequence[Entry], dbc: Path) -> list[str]:
    """Signals for PlotJuggler: time_s, then a column each, all numbers; a row a time stamp, empty where no frame of it carries the signal."""
    messages = {(m.frame_id, m.is_extended_frame): m for m in _database(dbc).messages}
    names = [f"{m.name}.{s.name}" for m in messages.values() for s in m.signals]
    rows: list[tuple[float, dict[str, float]]] = []
    unknown = 0
    for e in sorted(entries, key=lambda e: e.time_s):
        values = _decoded(messages, e)
        if values is None:
            unknown += 1
        elif rows and rows[-1][0] == e.time_s and not rows[-1][1].keys() & values.keys():
            rows[-1][1].update(values)
        else:
            rows.append((e.time_s, values))
    seen = [n for n in names if any(n in values for _, values in rows)]
    lines = [",".join(["time_s", *seen])]
    lines += [",".join([f"{time_s:.6f}", *(f"{values[n]:.12g}" if n in values else "" for n in seen)]) for time_s, values in rows]
    try:
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from error
    return [f"{unknown} of {len(entries)} frames are not decoded: {dbc.name} has no message with their identifier and length"] if unknown else []
