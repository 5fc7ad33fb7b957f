"""State-space matrices from files and from the command line; nothing that is read can run code."""

from __future__ import annotations

import csv
import json
import resource
import tomllib
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hullguard.errors import InputError
from hullguard.files import is_file
from hullguard.model.table import Array

KEYS = ("A", "B", "C", "D")
TIMES = ("Ts", "dt", "sample_time_s")
MAT_S = 3  # of the processor, for a file of matrices


@dataclass(frozen=True)
class StateSpace:
    """dx/dt or x(k+1) = A x + B u, y = C x + D u."""

    A: Array  # n x n
    B: Array  # n x p
    C: Array  # m x n
    D: Array  # m x p
    sample_time_s: float | None  # None: the source does not say
    discrete: bool


def read_file(path: Path) -> StateSpace:
    """A .mat, .npz, .json or .csv file."""
    readers = {".mat": _mat, ".npz": _npz, ".json": _json, ".csv": _csv}
    if path.suffix.lower() not in readers:
        raise InputError(f"--from {path}: expected {', '.join(readers)}")
    if not is_file(path):
        raise InputError(f"--from {path}: no such file")
    try:
        found = readers[path.suffix.lower()](path)
    except Exception as error:  # what SciPy, NumPy and zlib raise for a damaged file is of any class
        raise InputError(f"--from {path}: cannot be read as {path.suffix} ({' '.join(str(error).split()) or type(error).__name__})") from error
    return state_space(found, str(path.name))


def read_inline(texts: dict[str, str | None]) -> StateSpace:
    """Matrices of the command line."""
    return state_space({k: _matrix_text(k, t) for k, t in texts.items() if t is not None}, "the command line")


def state_space(found: dict[str, Any], where: str) -> StateSpace:
    """Matrices that fit one another."""
    for key in ("A", "C"):
        if key not in found:
            raise InputError(f"{where}: there is no matrix {key}; found {', '.join(sorted(found)) or 'nothing'}")
    made = {key: _matrix(found[key], key, where) for key in KEYS if key in found}
    A, C = made["A"], made["C"]
    n, m = A.shape[0], C.shape[0]
    B = made.get("B", np.zeros((n, 0)))
    D = made.get("D", np.zeros((m, B.shape[1])))
    for key, shape, wanted in (("A", A.shape, (n, n)), ("B", B.shape, (n, B.shape[1] if len(B) == n else 1)), ("C", C.shape, (m, n)), ("D", D.shape, (m, B.shape[1]))):
        if shape != wanted:
            cure = '; a row a state, and rows end with a semicolon: "0; 1"' if key == "B" else ""
            raise InputError(f"{where}: {key} is {shape[0]} x {shape[1]}, expected {wanted[0]} x {wanted[1]}{cure}")
    time = next((found[k] for k in TIMES if k in found), None)
    if time is None:
        return StateSpace(A, B, C, D, None, False)
    try:
        value = np.asarray(time).ravel()
    except ValueError:  # a list of lists of any lengths
        value = np.asarray(["none"])
    # python-control: None says nothing, True is discrete without a time, 0 continuous.
    if value.dtype in (bool, object):
        return StateSpace(A, B, C, D, None, bool(value.dtype == bool and value.size and value[0]))
    seconds = float(value[0]) if value.size == 1 and value.dtype.kind in "fiu" else np.nan
    if not np.isfinite(seconds):
        raise InputError(f"{where}: the sample time is no number: {' '.join(str(time).split())}")
    # Matlab gives -1 to a discrete system whose sample time is not known.
    return StateSpace(A, B, C, D, seconds if seconds > 0.0 else None, seconds != 0.0)


def _matrix(value: Any, key: str, where: str) -> Array:
    try:
        made = np.atleast_2d(np.asarray(value))
        if np.iscomplexobj(made):
            raise ValueError("complex")
        made = made.astype(np.float64)
    except (ValueError, TypeError, OverflowError) as error:
        raise InputError(f"{where}: {key} is no matrix of real numbers ({error})") from error
    if made.ndim != 2 or not np.all(np.isfinite(made)):
        raise InputError(f"{where}: {key} is no matrix of finite numbers")
    return made


def _matrix_text(key: str, text: str) -> list[list[float]]:
    """Rows between semicolons, or a TOML array."""
    try:
        if text.strip().startswith("["):
            made = tomllib.loads(f"m = {text}")["m"]
            rows = made if made and isinstance(made[0], list) else [made]
            return [[float(x) for x in row] for row in rows]
        rows = [[float(x) for x in row.replace(",", " ").split()] for row in text.split(";") if row.strip()]
    except (ValueError, TypeError, IndexError, OverflowError, RecursionError) as error:
        raise InputError(f"--{key} '{text}': expected rows of numbers, \"0.9 0.1; 0 0.8\"") from error
    if not rows or any(len(r) != len(rows[0]) for r in rows):
        raise InputError(f"--{key} '{text}': its rows differ in length")
    return rows


def _loaded(path: Path) -> dict[str, Any]:
    import scipy.io

    used = resource.getrusage(resource.RUSAGE_SELF)
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (int(used.ru_utime + used.ru_stime) + MAT_S, hard))
    try:
        return {k: v for k, v in scipy.io.loadmat(path).items() if not k.startswith("__")}
    except NotImplementedError as error:
        raise ValueError("version 7.3 is HDF5; save it with -v7") from error


def _mat(path: Path) -> dict[str, Any]:
    # In a process of its own: on some damaged files SciPy's reader dies of a segmentation fault, and on some it never ends.
    with ProcessPoolExecutor(1) as apart:
        try:
            held = apart.submit(_loaded, path).result()
        except BrokenProcessPool as error:
            raise ValueError("damaged: its reader broke off") from error
    if "A" in held:
        return held
    structs = [v for v in held.values() if isinstance(v, np.ndarray) and v.dtype.names and "A" in v.dtype.names and v.size == 1]
    if len(structs) != 1:
        raise ValueError("neither a variable A nor one struct with a field A; an ss object must be saved as its matrices")
    return {name: structs[0][name].item() for name in structs[0].dtype.names}


def _npz(path: Path) -> dict[str, Any]:
    found = {}
    with np.load(path, allow_pickle=False) as held:
        for k in held.files:
            try:
                found[k] = held[k]
            except ValueError:  # an object: dt = None of python-control
                if k in KEYS:
                    raise
    return found


def _json(path: Path) -> dict[str, Any]:
    found = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(found, dict):
        raise ValueError("expected an object with A, B, C, D")
    return {k: v for k, v in found.items() if v is not None}


def _csv(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = {}
    with path.open(newline="", encoding="utf-8-sig") as file:
        for row in csv.reader(file):
            cells = [c.strip() for c in row if c.strip()]
            if not cells or cells[0].startswith("#"):
                continue
            if cells[0] in TIMES:
                found[cells[0]] = float(cells[1])
            elif cells[0] in KEYS:
                found.setdefault(cells[0], []).append([float(c) for c in cells[1:]])
            else:
                raise ValueError(f"a line begins with '{cells[0]}', expected {', '.join(KEYS)} or dt")
    return found
