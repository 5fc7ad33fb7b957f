"""One case of a campaign: everything that a worker needs for its runs, and nothing that lies on the machine it was made on."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hullguard.campaign.attack import Attack
from hullguard.core.library import library
from hullguard.core.native import REST, RESULT, Batch, Native
from hullguard.design.design import Design, finish
from hullguard.design.store import Stored
from hullguard.errors import InputError
from hullguard.model.faults import FaultSpec
from hullguard.model.plant import draw
from hullguard.model.schema import Model, Reference

Rows = dict[str, NDArray[Any]]  # a column a name, a place a run

PLANTS = 0x91A27  # keeps the draws of plants apart from those of anything else that the seed feeds
VERSION = 1  # rises when the same case would give other rows, or other columns
FLOATS = ("margin", "margin_settled", "margin_after")
COLUMNS = ("run", "attacked", *RESULT)


class Keyed:
    """Equal to what has the same key: models hold arrays, which have no equality of their own."""

    @property
    def key(self) -> str:
        """Digest of all that counts."""
        raise NotImplementedError

    def __eq__(self, other: object) -> bool:
        """By key."""
        return isinstance(other, type(self)) and self.key == other.key

    def __hash__(self) -> int:
        """By key."""
        return hash(self.key)


def _digest(facts: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True, eq=False)
class Setup(Keyed):
    """A designed model and the build of the library that runs it."""

    model: Model
    stored: Stored
    model_hash: int  # of the finished tables
    real: str
    build: str  # of the C library: its digest

    @cached_property
    def key(self) -> str:
        """Digest of all that a run depends on here."""
        plant = self.model.plant
        matrices = (self.stored.A, self.stored.B, plant.C, plant.D, plant.Ed, plant.Fd) + (() if self.stored.gain is None else (self.stored.gain,))
        numbers = [hashlib.sha256(np.ascontiguousarray(m).tobytes()).hexdigest() for m in matrices]
        return _digest({"model": self.model.sha256, "tables": self.model_hash, "plant": numbers, "real": self.real, "build": self.build})


def setup_of(made: Design, real: str) -> Setup:
    """A finished design with this machine's library."""
    return Setup(made.model, made.stored, made.tables.hash, real, library(real).digest)


@dataclass(frozen=True, eq=False)
class Case(Keyed):
    """Two cases with the same key give the same rows, on any machine with the same build of the library."""

    setup: Setup
    samples: int
    reference: Reference
    faults: tuple[FaultSpec, ...]
    seed: int
    loss: float = 0.0
    burst: int = 0  # samples
    attack: float = 0.0  # share of the runs
    plants: int = 0  # drawn from the model's intervals, one after another; 0: the model's own
    start: int = REST
    varied: tuple[tuple[str, Any], ...] = ()  # keys of the model with their values in this case

    @cached_property
    def key(self) -> str:
        """Digest of all that the rows depend on."""
        facts = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("setup", "varied", "reference", "faults")}
        return _digest(facts | {"version": VERSION, "setup": self.setup.key, "reference": asdict(self.reference), "faults": [asdict(f) for f in self.faults]})

    @property
    def fault_start(self) -> int | None:
        """First faulty sample."""
        return min((f.start for f in self.faults), default=None)

    @property
    def senders(self) -> int:
        """Groups that would send a frame every sample if they knew no trigger; the closing one does."""
        return sum(1 for g in self.setup.model.groups if not g.closing)

    def attacked(self, run: int) -> bool:
        """Whether this run is one of the attacked ones, which are spread evenly."""
        return math.floor((run + 1) * self.attack) > math.floor(run * self.attack)

    @property
    def fault(self) -> str:
        """All faults of a run, as on a command line."""
        return " ".join(str(f) for f in self.faults)

    @property
    def size(self) -> float | None:
        """Size of the faults where they all have one and the same."""
        sizes = {f.size for f in self.faults if f.kind != "freeze"}
        return sizes.pop() if len(sizes) == 1 else None

    def labels(self) -> dict[str, Any]:
        """What tells this case from the others."""
        return {
            **dict(self.varied),
            "model_hash": f"{self.setup.model_hash:08x}",
            "seed": self.seed,
            "fault": self.fault,
            "size": self.size,
            "loss": self.loss,
            "loss_burst": self.burst,
            "attack": self.attack,
            "plants": self.plants,
        }


@lru_cache(maxsize=4)  # tables cost as much as many runs
def _native(setup: Setup) -> tuple[Native, Design]:
    if library(setup.real).digest != setup.build:
        raise InputError("a worker has another build of the C library, and could get other results: copy the caller's build/lib there, or name its copy in HULLGUARD_LIB")
    design = finish(setup.model, setup.stored)
    return Native(library(setup.real), design.tables), design


@lru_cache(maxsize=4)  # of the cases whose chunks are worked off at a time
def _ready(case: Case) -> tuple[Batch, Attack | None]:
    """The case's runs as they come, and those under attack."""
    native, design = _native(case.setup)
    return _batch(case, native, design), _attack(case, native, design) if case.attack > 0.0 else None


def _batch(case: Case, native: Native, design: Design, **chosen: Any) -> Batch:
    """The only place where a case becomes a configuration of the batch loop."""
    plants = [draw(case.setup.model.plant, np.random.default_rng([case.seed, i, PLANTS])) for i in range(case.plants)]
    return Batch(native, design, case.samples, case.reference, case.faults, case.seed, case.loss, case.start, case.burst, plants=plants, **chosen)


def _attack(case: Case, native: Native, design: Design) -> Attack:
    plant = design.model.plant
    disturbance, initial = np.zeros((case.samples, plant.Ed.shape[1])), np.zeros(plant.n)
    last = (case.samples if case.fault_start is None else case.fault_start) - 1
    return Attack(_batch(case, native, design, disturbance=disturbance, initial=initial), design, disturbance, initial, case.seed, last)


def configured(case: Case) -> tuple[Batch, Design]:
    """The case's runs as they come, and its design."""
    return _ready(case)[0], _native(case.setup)[1]


def columns(rows: Sequence[dict[str, Any]]) -> Rows:
    """Rows as columns."""
    return {name: np.array([r[name] for r in rows], dtype=np.float64 if name in FLOATS else np.int64) for name in COLUMNS}


def chunk(case: Case, first: int, count: int) -> Rows:
    """Runs first .. first + count - 1 of a case."""
    batch, attack = _ready(case)
    rows = batch.runs(first, count)
    for i in range(count):
        attacked = attack is not None and case.attacked(first + i)
        if attack is not None and attacked:
            rows[i] = attack.run(first + i)
        rows[i]["attacked"] = int(attacked)
    return columns(rows)


def runs_a_chunk(case: Case) -> int:
    """About half a second of work."""
    cost_s = case.samples / 5e5 + 0.05 * case.attack
    return max(1, min(2000, round(0.5 / cost_s)))
