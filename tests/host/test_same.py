"""One seed, one run: whoever makes it, sample by sample or in C, from structures filled at run time or from generated tables, with one worker or two."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from host_support import FLOATS, REALS, SEED, SILENT_1, Cli, Models, Ready, build_library
from hullguard.codegen import emit_c
from hullguard.core.library import Library, library
from hullguard.core.native import (
    MOVING,
    PLANT_STATES,
    REST,
    Batch,
    Frame,
    Native,
    Node,
    Plant,
    Sender,
    bus_of,
)
from hullguard.design.design import Design
from hullguard.design.tables import Tables
from hullguard.model import parse_fault
from hullguard.plant.run import InProcess, Pace, Run, Trace

FAULTS = ("controller2:bias:1.0@60", "gap12_m:freeze@100..120", "speed1_mps:noise:0.1@130", "controller1:gain:0.5@20..40", "gap23_m:drift:0.2@140")


def sample_by_sample(ready: Ready, samples: int, faults: tuple[str, ...], seed: int, pace: Pace) -> Trace:
    source = Plant(ready.native, ready.design, ready.reference, [parse_fault(f) for f in faults], seed)
    return Run(ready.design, ready.native, InProcess(), pace).samples(source, samples)


@pytest.mark.parametrize("real", REALS)
@pytest.mark.parametrize("scenario", ["rest", "manoeuvres", "adaptive", "default"])
@pytest.mark.parametrize("faults", [(), FAULTS], ids=["healthy", "faulty"])
def test_a_run_in_python_differs_in_no_number_from_the_same_run_in_c(models: Models, real: str, scenario: str, faults: tuple[str, ...]) -> None:
    ready = models.platoon(scenario, None, real)
    for seed, lockstep in ((SEED, False), (SEED + 1, True)):
        slow, fast = sample_by_sample(ready, 160, faults, seed, Pace(lockstep, 1e9)), ready.batch(160, faults, seed).trace(0)
        for name in ("reading", "value", "radius", "r", "J"):
            assert np.array_equal(np.array(getattr(slow, name)), fast[name]), name
        assert [PLANT_STATES.index(v.plant) for v in slow.verdict] == fast["plant"].tolist()
        assert [v.bus for v in slow.verdict] == [bus_of(int(b), 2) for b in fast["bus"]]
        assert [sum(1 << g for g in e) for e in slow.events] == fast["events"].tolist()
        if not lockstep:  # replies move the counter of the verdict frames, and with it their stuff bits
            assert slow.bits == fast["bits"].tolist()


def test_another_seed_gives_another_run(models: Models) -> None:
    ready = models.platoon("manoeuvres")
    assert not np.array_equal(ready.batch(50, (), SEED).trace(0)["reading"], ready.batch(50, (), SEED + 1).trace(0)["reading"])


@pytest.mark.parametrize("real", REALS)
def test_batches_and_traces_of_one_run_agree(models: Models, real: str) -> None:
    ready = models.platoon("manoeuvres", SILENT_1, real)
    batch = ready.batch(150, ("controller2:bias:1.5@60",))
    for run, row in enumerate(batch.runs(0, 5)):
        trace = batch.trace(run)
        alarm = np.flatnonzero(trace["plant"][60:] >= PLANT_STATES.index("provisional")) + 60
        assert row["provisional_at"] == (alarm[0] if len(alarm) else -1)
        assert row["measurement"] == int((trace["events"] & 1).sum())
        assert row["margin"] == pytest.approx(float((np.abs(trace["r"]) / trace["J"])[:60].max()), rel=1e-12)
        assert row["bits"] == trace["bits"].sum()


# ---- generated tables ----

DRAG = {"plant.drag_per_s": {"value": 1.0, "pm": 0.1}}
UNCERTAIN = DRAG | {"detector.prediction": True}
VARIANTS: dict[str, tuple[str, dict[str, Any]]] = {
    "plain": ("platoon", {}),
    "bank": ("platoon_bank", {}),
    "drag": ("platoon_bank", DRAG),
    "uncertain": ("platoon", UNCERTAIN),
    "zonotope": ("platoon", UNCERTAIN | {"detector.threshold": "zonotope"}),
    "published": ("platoon", {"detector.threshold": "zonotope_published"}),
    "everything": ("platoon_bank", UNCERTAIN | {"detector.threshold": "zonotope"}),
}
FIXED = ("plain", "bank", "drag")  # those that fixed point can hold


def variants(real: str) -> tuple[str, ...]:
    """Those that a number type can hold."""
    return FIXED if real == "q31" else tuple(VARIANTS)


def compiled(*names: str) -> pytest.MarkDecorator:
    """These variants, in each number type that can hold them."""
    pairs = [(real, name) for real in REALS for name in names if name in variants(real)]
    return pytest.mark.parametrize(("real", "name"), pairs)


class Generated(Native):
    """A model whose node and senders are those of its generated C; only what the emulator needs is filled at run time."""

    def __init__(self, lib: Library, made: Design) -> None:
        super().__init__(lib, made.tables)
        # cffi takes a const structure of a library for a number.
        lib.ffi.cdef(f"extern hg_node_config hg_{made.tables.name}_config; extern hg_sender_config hg_{made.tables.name}_sender[];")
        self.node, self.senders = lib.ffi.addressof(lib.lib, f"hg_{made.tables.name}_config"), getattr(lib.lib, f"hg_{made.tables.name}_sender")


def renamed(tables: Tables, name: str) -> Tables:
    """Another model with the same numbers: its name is part of its hash, which fixed point shares."""
    made = replace(tables, name=name)
    return replace(made, fixed=replace(made.fixed, float_hash=made.hash)) if made.fixed is not None else made


Compiled = Callable[[str], dict[str, tuple[Ready, Generated]]]


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory, models: Models) -> Compiled:
    """By number type: every variant's generated C compiled into one library, each under a name of its own, beside the structures that Python fills."""

    @cache
    def of(real: str) -> dict[str, tuple[Ready, Generated]]:
        designs: dict[str, Design] = {}
        extra: dict[str, str] = {}
        for name in variants(real):
            model, overrides = VARIANTS[name]
            made = models.design(overrides, "manoeuvres", model)
            designs[name] = replace(made, tables=renamed(made.tables, f"model_{name}"))
            extra[f"model_{name}.h"], extra[f"model_{name}.c"] = emit_c(designs[name])
        lib = build_library(tmp_path_factory.mktemp(f"generated_{real}") / "lib", real, extra=extra)
        scenario = designs["plain"].model.scenario("manoeuvres")
        return {n: (Ready(d, Native(library(real), d.tables), scenario.reference, scenario.samples), Generated(lib, d)) for n, d in designs.items()}

    return of


@pytest.mark.parametrize("lockstep", [True, False])
@pytest.mark.parametrize("loss", [0.0, 0.2])
@compiled("plain", "drag", "everything")
def test_generated_tables_give_the_same_frames_as_structures_filled_at_run_time(generated: Compiled, real: str, name: str, lockstep: bool, loss: float) -> None:
    ready, tables = generated(real)[name]
    rng = np.random.default_rng(SEED)
    for start in (REST, 0):
        source = Plant(ready.native, ready.design, ready.reference, [parse_fault(f) for f in FAULTS], SEED)
        nodes = (Node(ready.native, start), Node(tables, start))
        senders = (Sender(ready.native), Sender(tables))
        answers = 0
        for k in range(200):
            reading = source.read()
            for g in range(2):
                frames = [s.step(g, k, reading) for s in senders]
                assert frames[0] == frames[1]
                frame = frames[0]
                if frame is None or (g == 0 and rng.random() < loss):
                    continue
                if rng.random() < loss / 4:
                    damaged = bytearray(frame.data)
                    damaged[int(rng.integers(8))] ^= 1 << int(rng.integers(8))
                    if g == 0:
                        frame = Frame(frame.id, frame.flags, bytes(damaged))
                assert nodes[0].receive(frame) == nodes[1].receive(frame)
            verdicts = [n.step() for n in nodes]
            assert verdicts[0] == verdicts[1]
            reports = [n.report(lockstep) for n in nodes]
            assert reports[0] == reports[1], f"sample {k}"
            answers += len(reports[0])
            assert nodes[0].r == nodes[1].r
            assert nodes[0].J == nodes[1].J
            source.move()
        assert answers > 20
        assert nodes[0].health() == nodes[1].health()


def assert_same(one: Batch, other: Batch, runs: int) -> None:
    """Rows and traces of some runs equal to the bit."""
    assert one.runs(0, runs) == other.runs(0, runs)
    for run in range(runs):
        traces = one.trace(run), other.trace(run)
        for part in traces[0]:
            assert traces[0][part].tobytes() == traces[1][part].tobytes(), f"run {run}: {part}"


@compiled(*VARIANTS)
@pytest.mark.parametrize(("loss", "burst", "start"), [(0.0, 0, REST), (0.1, 3, REST), (0.3, 5, MOVING)])
def test_runs_with_generated_tables_differ_in_no_bit(generated: Compiled, real: str, name: str, loss: float, burst: int, start: int) -> None:
    ready, own = generated(real)[name]
    faults = [parse_fault(f) for f in FAULTS]
    options: dict[str, Any] = {"loss": loss, "burst": burst, "start": start}
    filled, tables = (Batch(n, ready.design, 160, ready.reference, faults, SEED, **options) for n in (ready.native, own))
    rows = filled.runs(0, 5)
    # Under bursts of losses a few runs may well end without an alarm; without losses the faults are always found.
    assert sum(r["lost"] for r in rows) > 0 if loss > 0.0 else any(r["plant"] > 1 or r["provisional_at"] >= 0 for r in rows)
    assert_same(filled, tables, 5)


def nudged(tables: Tables) -> list[Tables]:
    """Tables with one number of one part by a unit in its last place larger."""

    def larger(row: tuple[float, ...]) -> tuple[float, ...]:
        return (float(np.nextafter(np.float32(row[0]), np.float32(np.inf))), *row[1:])

    bank, predictor, g, m = tables.banks[0], tables.predictors[0], tables.generators[0], tables.mismatch
    assert m is not None and g.zonotope is not None
    z = replace(g.zonotope, output_growth=larger(g.zonotope.output_growth))
    return [
        replace(tables, banks=(replace(bank, bias=tuple(larger((b,))[0] for b in bank.bias)), *tables.banks[1:])),
        replace(tables, predictors=(replace(predictor, state=(larger(predictor.state[0]), *predictor.state[1:])),)),
        replace(tables, generators=(replace(g, zonotope=z),)),
        replace(tables, mismatch=replace(m, constant=larger(m.constant))),
    ]


@pytest.mark.parametrize("real", FLOATS)
def test_one_number_of_any_part_makes_a_difference(generated: Compiled, real: str) -> None:
    ready, own = generated(real)["everything"]
    batch = Batch(own, ready.design, 160, ready.reference, (), SEED)
    for i, tables in enumerate(nudged(ready.design.tables)):
        other = Batch(Native(ready.native.library, tables), ready.design, 160, ready.reference, (), SEED)
        with pytest.raises(AssertionError):
            assert_same(batch, other, 5)
        assert batch.runs(0, 1) == Batch(ready.native, ready.design, 160, ready.reference, (), SEED).runs(0, 1), i


def test_the_committed_tables_are_those_of_the_design(models: Models) -> None:
    header, source = emit_c(models.design())
    folder = Path(__file__).resolve().parents[2] / "firmware" / "models"
    assert (folder / "platoon.h").read_text(encoding="ascii") == header, "run: make models"
    assert (folder / "platoon.c").read_text(encoding="ascii") == source, "run: make models"


# ---- campaigns ----


def test_a_campaign_is_the_batch_it_says_it_is(models: Models, cli: Cli) -> None:
    rows = cli("campaign", "platoon", "--scenario", "manoeuvres", "--runs", 7, "--workers", 1, "--seed", 5, "--samples", 90, "--json", "-q").json["rows"]
    assert rows == [r | {"attacked": 0} for r in models.platoon("manoeuvres").batch(90, seed=5).runs(0, 7)]


def test_native_structures_do_not_change_while_runs_use_them(models: Models) -> None:
    ready = models.platoon("manoeuvres")
    before = ready.batch(60).trace(0)
    other = Native(ready.native.library, models.design(SILENT_1, "manoeuvres").tables)
    after = ready.batch(60).trace(0)
    assert other.node.model_hash != ready.native.node.model_hash
    assert all(np.array_equal(before[name], after[name]) for name in before)
