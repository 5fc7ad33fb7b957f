"""NAME.design.toml: the numbers a search or a solver found, rounded, so that everything after them is plain arithmetic."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from hullguard.design.bank_types import StoredBank
from hullguard.design.uio_types import UIO_MATRICES, StoredUio
from hullguard.errors import InputError
from hullguard.model.table import Array, Table

VERSION = 3  # rises when the same model would give other numbers
HEADER = "# Made by `hullguard design` from {name}.toml. Do not edit: run it again.\n\n"


@dataclass(frozen=True)
class StoredObserver:
    """One generator: parity vector, poles' companion column, output map, post-filter, and what the search reached."""

    v: Array
    gamma: Array
    W: Array
    V: Array
    Lo: Array
    Mo: Array
    regularised: float
    smallest: Array
    first: Array  # smallest faults of the search's first draw, NaN where nothing was searched for
    weight: float  # of the event error in the post-filter


@dataclass(frozen=True)
class Stored:
    """A design file."""

    model_sha256: str
    A: Array
    B: Array
    gain: Array | None
    state_range: Array
    signal_reach: Array
    slew: Array
    observers: tuple[StoredObserver, ...]
    dA: Array | None = None  # of an uncertain plant only
    dB: Array | None = None
    banks: tuple[StoredBank, ...] = ()
    uios: tuple[StoredUio, ...] = ()


def path_of(model_path: Path) -> Path:
    """Where the design of a model file lives."""
    return model_path.with_name(model_path.stem + ".design.toml")


def write(path: Path, name: str, stored: Stored) -> None:
    """Write a design file; the same data gives the same bytes."""
    data: dict[str, Any] = {
        "version": VERSION,
        "model_sha256": stored.model_sha256,
        "plant": {"A": stored.A.tolist(), "B": stored.B.tolist(), "state_range": stored.state_range.tolist()},
        "signals": {"reach": [float(x) if np.isfinite(x) else -1.0 for x in stored.signal_reach], "slew": stored.slew.tolist()},
        "observers": [
            {
                "parity": o.v.tolist(),
                "gamma": o.gamma.tolist(),
                "W": o.W.tolist(),
                "V": o.V.tolist(),
                "Lo": o.Lo.tolist(),
                "Mo": o.Mo.tolist(),
                "regularised": o.regularised,
                "smallest_fault": [float(x) if np.isfinite(x) else -1.0 for x in o.smallest],
            }
            | ({} if o.weight == 1.0 else {"event_weight": o.weight})
            | ({} if np.isnan(o.first).any() else {"smallest_fault_first_draw": [float(x) if np.isfinite(x) else -1.0 for x in o.first]})
            for o in stored.observers
        ],
    }
    if stored.gain is not None:
        data["plant"]["gain"] = stored.gain.tolist()
    if stored.dA is not None and stored.dB is not None:
        data["plant"] |= {"dA": stored.dA.tolist(), "dB": stored.dB.tolist()}
    if stored.uios:
        data["uio"] = [{name: getattr(u, name).tolist() for name in UIO_MATRICES} | {"fixed": [[z.real, z.imag] for z in u.fixed]} for u in stored.uios]
    if stored.banks:
        data["banks"] = [_bank(b) for b in stored.banks]
    path.write_text(HEADER.format(name=name) + tomli_w.dumps(data), encoding="utf-8")


def _bank(b: StoredBank) -> dict[str, Any]:
    """Every certificate on its own, window x outputs in one row, the oldest sample first."""
    kept: dict[str, Any] = {"window": b.window, "faults": b.faults, "certificates": b.weight.reshape(len(b.weight), -1).tolist()}
    return kept if b.hypothesis is None else kept | {"hypothesis": b.hypothesis}


def _read_bank(t: Table) -> StoredBank:
    window, rows = t.whole("window", 2, 10_000), t.matrix("certificates")
    if rows.shape[1] % window:
        raise t.error("certificates", f"{rows.shape[1]} numbers in a row, which is no multiple of the window of {window}")
    hypothesis = t.whole("hypothesis", 0, 31) if "hypothesis" in t else None
    bank = StoredBank(window, rows.reshape(len(rows), window, -1), t.whole("faults", 0, 2**32 - 1), hypothesis)
    t.close()
    return bank


def _read_uio(t: Table) -> StoredUio:
    found = {name: t.matrix(name) for name in UIO_MATRICES[:-1]}
    fixed = t.raw("fixed")
    made = StoredUio(**found, passing=t.vector("passing", len(found["state"]), 0.0), fixed=t.matrix("fixed", None, 2) @ np.array([1, 1j]) if fixed else np.zeros(0))
    t.close()
    return made


def opened(path: Path, version: int) -> Table | None:
    """A design file; None when there is none, or one of another version, whose numbers are not today's."""
    if not path.exists():
        return None
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError, OSError) as error:
        raise InputError(f"{path.name}: not a readable design file ({error}); run hullguard design again") from error
    top = Table(data, path.name)
    return top if top.whole("version", 0, 10_000) == version else None


def read(path: Path) -> Stored | None:
    """Read a design file; None where opened() says so."""
    top = opened(path, VERSION)
    if top is None:
        return None
    plant, signals = top.table("plant"), top.table("signals")
    observers = []
    for t in top.tables("observers"):
        v = t.matrix("parity")
        order, m = v.shape[0] - 1, v.shape[1]
        W = t.matrix("W", None, order)
        rows = W.shape[0]
        smallest = t.vector("smallest_fault")
        first = t.vector("smallest_fault_first_draw", len(smallest)) if "smallest_fault_first_draw" in t else np.full(len(smallest), np.nan)
        observers.append(
            StoredObserver(
                v=v,
                gamma=t.vector("gamma", order),
                W=W,
                V=t.matrix("V", rows, m),
                Lo=t.matrix("Lo", order, rows),
                Mo=t.matrix("Mo", rows, rows),
                regularised=t.number("regularised", 0.0),
                weight=t.number("event_weight", 0.0, default=1.0),
                smallest=np.where(smallest < 0, np.inf, smallest),
                first=np.where(first < 0, np.inf, first),
            )
        )
        t.close()
    A = plant.matrix("A")
    inputs = plant.raw("B")
    B = plant.matrix("B", A.shape[0]) if not isinstance(inputs, list) or (inputs and inputs[0]) else np.zeros((A.shape[0], 0))
    reach = signals.vector("reach")
    stored = Stored(
        model_sha256=top.text("model_sha256"),
        A=A,
        B=B,
        gain=plant.matrix("gain", B.shape[1], A.shape[0]) if "gain" in plant else None,
        state_range=plant.vector("state_range", A.shape[0], 0.0),
        signal_reach=np.where(reach < 0, np.nan, reach),
        slew=signals.matrix("slew", len(reach)),
        observers=tuple(observers),
        dA=plant.matrix("dA", *A.shape) if "dA" in plant else None,
        dB=(plant.matrix("dB", *B.shape) if B.size else B) if "dB" in plant else None,
        banks=tuple(_read_bank(t) for t in top.tables("banks", optional=True)),
        uios=tuple(_read_uio(t) for t in top.tables("uio", optional=True)),
    )
    for t in (plant, signals, top):
        t.close()
    return stored
