"""A finished run as it lies in its directory: run.json, signals.csv, labels.csv; checked when it is read."""

from __future__ import annotations

import csv
import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hullguard.bus.bits import bit_times
from hullguard.design.judges import HYPOTHESIS, KINDS, OBSERVER, Judge, residual_columns, residual_names
from hullguard.errors import InputError
from hullguard.model.table import Array

PLANT = ("starting", "none", "provisional", "confirmed")
BUS = ("good", "absent", "lossy", "stale")  # in the order in which they matter
RESIDUALS_MAX = 255  # of one judge


@dataclass(frozen=True)
class FaultRun:
    """A fault that was injected, and when it was found; in samples."""

    label: str  # F1 ..
    name: str
    kind: str
    spec: str
    start: int
    end: int | None
    detected: int | None
    confirmed: int | None
    delay: float | None
    fault: str | None  # the model's fault that it is
    candidates: tuple[str, ...]  # when it was detected
    narrowed_at: int | None  # since when a confirmed alarm left as few candidates as it ever did
    narrowed_to: tuple[str, ...]


@dataclass(frozen=True)
class GroupRun:
    """What one sender did."""

    name: str
    frames: int
    interval_min: float | None
    interval_max: float | None
    interval_mean: float | None
    histogram: dict[int, int]
    event: Array  # 0 or 1 a sample


@dataclass(frozen=True)
class Residual:
    """One residual and its threshold."""

    name: str  # for people
    column: str  # 1.2: in signals.csv
    judge: int  # 1 ..
    kind: str  # of the judge
    r: Array
    J: Array
    ratio: Array  # |r| / J, 0 where there is no threshold


@dataclass(frozen=True)
class SignalRun:
    """One signal: what the sensor read, what the detector held, how wrong that could be."""

    name: str
    reading: Array
    value: Array
    radius: Array


@dataclass(frozen=True)
class VerdictRun:
    """What the detector said from a sample on."""

    k: int
    plant: str
    candidates: tuple[str, ...]
    bus: dict[str, str]


@dataclass(frozen=True)
class Run:
    """Everything a report shows."""

    info: dict[str, Any]
    samples: int
    sample_time_s: float
    bitrate: float
    k: Array
    time: Array
    plant: Array  # index into PLANT, a sample
    bus: dict[str, Array]  # index into BUS, a sample
    bits: Array  # on the bus, a sample; bit times of the nominal rate where data phases have another
    signals: tuple[SignalRun, ...]
    judges: tuple[Judge, ...]
    residuals: tuple[Residual, ...]
    before: tuple[Array, ...]  # each residual of an observer before its post-filter; none where the run did not ask for them
    groups: tuple[GroupRun, ...]
    faults: tuple[FaultRun, ...]
    known_faults: tuple[str, ...]  # of the model
    verdicts: tuple[VerdictRun, ...]

    @property
    def observing(self) -> tuple[Residual, ...]:
        """The residuals of observers."""
        return tuple(r for r in self.residuals if r.kind == OBSERVER)

    @property
    def detecting(self) -> tuple[Residual, ...]:
        """The residuals that tell a fault from none: those of observers and banks for detection."""
        return tuple(r for r in self.residuals if r.kind != HYPOTHESIS)

    @property
    def isolating(self) -> tuple[Residual, ...]:
        """The residuals that tell one fault from another."""
        return tuple(r for r in self.residuals if r.kind == HYPOTHESIS)

    def at(self, k: float) -> float:
        """Time of a sample."""
        return float(self.time[0] + (k - self.k[0]) * self.sample_time_s)

    @property
    def end(self) -> float:
        """Time behind the last sample."""
        return self.at(float(self.k[-1]) + 1)


class _Json:
    """A JSON object that names the file and the key when something is not as it should be."""

    def __init__(self, data: object, where: str) -> None:
        if not isinstance(data, dict):
            raise InputError(f"{where}: expected an object; run hullguard again to write it anew")
        self.data, self.where = data, where

    def raw(self, key: str) -> Any:
        if key not in self.data:
            raise InputError(f"{self.where}: key '{key}' is missing; run hullguard again to write it anew")
        return self.data[key]

    def number(self, key: str) -> float:
        value = self.raw(key)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= sys.float_info.max:
            raise InputError(f"{self.where}: '{key}' is {value!r}, expected a finite number")
        return float(value)

    def maybe(self, key: str) -> float | None:
        return None if self.raw(key) is None else self.number(key)

    def count(self, key: str) -> int | None:
        value = self.maybe(key)
        return None if value is None else round(value)

    def text(self, key: str) -> str:
        value = self.raw(key)
        if not isinstance(value, str):
            raise InputError(f"{self.where}: '{key}' is {value!r}, expected text")
        return value

    def object(self, key: str) -> _Json:
        return _Json(self.raw(key), f"{self.where}: {key}")

    def list(self, key: str) -> list[Any]:
        value = self.raw(key)
        if not isinstance(value, list):
            raise InputError(f"{self.where}: '{key}' is {value!r}, expected a list")
        return value


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; give the directory that a finished hullguard run --out wrote") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error


def read_csv(path: Path) -> dict[str, Array]:
    """Columns of numbers by name."""
    lines = _text(path).splitlines()
    if not lines:
        raise InputError(f"{path}: empty; it should begin with a line of column names")
    names = [n.strip() for n in next(csv.reader(lines[:1]))]
    if len(set(names)) != len(names):
        raise InputError(f"{path}: a column name is there twice")
    rows = [line for line in lines[1:] if line.strip()]
    if not rows:
        raise InputError(f"{path}: no samples below the column names")
    try:
        data = np.loadtxt(rows, delimiter=",", ndmin=2)
        if data.shape[1] != len(names):
            raise ValueError
    except ValueError:
        data = _slow_csv(path, names, lines)
    return {name: np.ascontiguousarray(data[:, i]) for i, name in enumerate(names)}


def _slow_csv(path: Path, names: list[str], lines: list[str]) -> Array:
    """The same with an eye on every field: an empty one is no number; anything else is refused by line and column."""
    rows = []
    for number, fields in enumerate(csv.reader(lines[1:]), start=2):
        if not fields:
            continue
        if len(fields) != len(names):
            raise InputError(f"{path}: line {number} has {len(fields)} fields, the first line names {len(names)} columns")
        row = []
        for name, field in zip(names, fields, strict=True):
            try:
                row.append(float(field) if field.strip() else math.nan)
            except ValueError as error:
                raise InputError(f"{path}: line {number}, column '{name}': '{field}' is not a number") from error
        rows.append(row)
    return np.array(rows)


def _labels(path: Path) -> list[dict[str, str]]:
    rows = list(csv.DictReader(_text(path).splitlines()))
    for row in rows:
        for key in ("start", "end", "name", "kind"):
            if row.get(key) is None:
                raise InputError(f"{path}: column '{key}' is missing")
        for key in ("start", "end"):
            if row[key].strip() and not row[key].strip().isdigit():
                raise InputError(f"{path}: {key} '{row[key]}' is not a sample index")
    return rows


def _faults(top: _Json, labels: list[dict[str, str]]) -> tuple[FaultRun, ...]:
    found = []
    for i, data in enumerate(top.list("faults")):
        f = _Json(data, f"{top.where}: faults[{i}]")
        name, start = f.text("name"), round(f.number("start"))
        ends = [row["end"].strip() for row in labels if row["name"] == name and row["start"].strip() == str(start)]
        found.append(
            FaultRun(
                label=f"F{i + 1}",
                name=name,
                kind=f.text("kind"),
                spec=f.text("spec"),
                start=start,
                end=int(ends[0]) if ends and ends[0] else None,
                detected=f.count("detected_at"),
                confirmed=f.count("confirmed_at"),
                delay=f.maybe("delay"),
                fault=None if f.raw("fault") is None else f.text("fault"),
                candidates=tuple(str(c) for c in f.list("candidates")),
                narrowed_at=f.count("narrowed_at"),
                narrowed_to=tuple(str(c) for c in f.list("narrowed_to")),
            )
        )
    return tuple(found)


def _groups(top: _Json, column: dict[str, Array], where: Path) -> tuple[GroupRun, ...]:
    groups = []
    per_group = top.object("per_group")
    for name in per_group.data:
        g = per_group.object(name)
        try:
            histogram = {int(k): int(v) for k, v in sorted(g.object("histogram").data.items(), key=lambda kv: int(kv[0]))}
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError(f"{g.where}: 'histogram' is not a count of each interval") from error
        groups.append(
            GroupRun(
                name=name,
                frames=round(g.number("frames")),
                interval_min=g.maybe("interval_min"),
                interval_max=g.maybe("interval_max"),
                interval_mean=g.maybe("interval_mean"),
                histogram=histogram,
                event=_column(column, f"event.{name}", where),
            )
        )
    return tuple(groups)


def _column(column: dict[str, Array], name: str, where: Path) -> Array:
    if name not in column:
        raise InputError(f"{where}: column '{name}' is missing; run hullguard again to write it anew")
    return column[name]


def _judges(top: _Json) -> tuple[Judge, ...]:
    made = []
    for i, data in enumerate(top.list("judges")):
        j = _Json(data, f"{top.where}: judges[{i}]")
        kind, count = j.text("kind"), j.number("residuals")
        if kind not in KINDS:
            raise InputError(f"{j.where}: kind '{kind}' is not one of {', '.join(KINDS)}")
        if not 1 <= count <= RESIDUALS_MAX:
            raise InputError(f"{j.where}: 'residuals' is {count:g}, expected 1 to {RESIDUALS_MAX}")
        made.append(Judge(j.text("name"), kind, round(count)))
    if not made:
        raise InputError(f"{top.where}: 'judges' is empty: no residual to show; run hullguard again to write it anew")
    return tuple(made)


def _residuals(judges: tuple[Judge, ...], column: dict[str, Array], where: Path) -> tuple[Residual, ...]:
    out = []
    for name, place in zip(residual_names(judges), residual_columns(judges), strict=True):
        r, J = _column(column, f"r{place}", where), _column(column, f"J{place}", where)
        usable = np.isfinite(r) & np.isfinite(J) & (J > 0)
        ratio = np.where(usable, np.abs(r) / np.where(usable, J, 1.0), 0.0)
        judge = int(place.partition(".")[0])
        out.append(Residual(name, place, judge, judges[judge - 1].kind, r, J, ratio))
    return tuple(out)


def _verdicts(top: _Json) -> tuple[VerdictRun, ...]:
    out = []
    for i, data in enumerate(top.list("verdicts")):
        v = _Json(data, f"{top.where}: verdicts[{i}]")
        plant, bus = v.text("plant"), {str(g): str(h) for g, h in v.object("bus").data.items()}
        if plant not in PLANT:
            raise InputError(f"{v.where}: plant '{plant}' is not one of {', '.join(PLANT)}")
        for health in bus.values():
            if health not in BUS:
                raise InputError(f"{v.where}: bus '{health}' is not one of {', '.join(BUS)}")
        out.append(VerdictRun(round(v.number("k")), plant, tuple(str(c) for c in v.list("candidates")), bus))
    return tuple(sorted(out, key=lambda v: v.k))


def _bus(verdicts: tuple[VerdictRun, ...], groups: tuple[GroupRun, ...], k: Array) -> dict[str, Array]:
    out = {}
    for g in groups:
        health = np.full(len(k), BUS.index("absent"))
        for v in verdicts:
            if g.name in v.bus:
                health[np.searchsorted(k, v.k) :] = BUS.index(v.bus[g.name])
        out[g.name] = health
    return out


def _bit_times(top: _Json, column: dict[str, Array], where: Path) -> Array:
    bits = _column(column, "bits", where)
    if "data_bitrate" not in top.data:
        return bits
    fast = _column(column, "data_bits", where)
    return np.array([bit_times(b, f, top.number("bitrate"), top.number("data_bitrate")) for b, f in zip(bits, fast, strict=True)])


def read_run(directory: Path) -> Run:
    """Read and check a run's directory."""
    path = directory / "run.json"
    try:
        top = _Json(json.loads(_text(path)), str(path))
    except json.JSONDecodeError as error:
        raise InputError(f"{path}: not valid JSON: {error.msg} in line {error.lineno}") from error
    except RecursionError as error:
        raise InputError(f"{path}: not the JSON of a run: nested too deeply") from error
    where = directory / "signals.csv"
    column = read_csv(where)
    labels = _labels(directory / "labels.csv")
    k, time = _column(column, "k", where), _column(column, "time_s", where)
    if not (np.all(np.isfinite(k)) and np.all(np.isfinite(time)) and np.all(np.diff(k) > 0) and np.all(np.diff(time) > 0)):
        raise InputError(f"{where}: columns 'k' and 'time_s' must be numbers that grow from line to line")
    plant = _column(column, "plant", where)
    if not np.all(np.isin(plant, range(len(PLANT)))):
        raise InputError(f"{where}: column 'plant' holds something else than 0 .. {len(PLANT) - 1}")
    signals = tuple(
        SignalRun(s, _column(column, s, where), _column(column, f"{s}.value", where), _column(column, f"{s}.radius", where))
        for s in [name.removesuffix(".value") for name in column if name.endswith(".value")]
    )
    groups, verdicts = _groups(top, column, where), _verdicts(top)
    for key in ("model", "model_hash", "real", "bus", "scenario", "seed", "threshold"):
        top.raw(key)
    for key in ("measurement", "periodic", "total", "bits", "bits_periodic", "load_mean", "load_p99", "load_bound"):
        top.object("frames").number(key)
    for key in ("provisional", "confirmed"):
        top.object("false_alarms").number(key)
    for key in ("communication", "events"):
        top.object(key)
    top.maybe("margin_max")
    judges = _judges(top)
    residuals = _residuals(judges, column, where)
    before = tuple(_column(column, f"before{r.column}", where) for r in residuals if r.kind == OBSERVER) if top.data.get("figures") else ()
    sample_time_s, bitrate = top.number("sample_time_s"), top.number("bitrate")
    if sample_time_s <= 0 or bitrate <= 0:
        raise InputError(f"{path}: 'sample_time_s' and 'bitrate' must be above 0")
    return Run(
        info=top.data,
        samples=round(top.number("samples")),
        sample_time_s=sample_time_s,
        bitrate=bitrate,
        k=k,
        time=time,
        plant=plant.astype(int),
        bus=_bus(verdicts, groups, k),
        bits=_bit_times(top, column, where),
        signals=signals,
        judges=judges,
        residuals=residuals,
        before=before,
        groups=groups,
        faults=_faults(top, labels),
        known_faults=tuple(str(f) for f in top.list("known_faults")),
        verdicts=verdicts,
    )
