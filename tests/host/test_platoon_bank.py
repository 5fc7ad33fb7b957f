"""What the shipped platoon_bank is there for: faults found nearly as early as any sound detector can, and told from one another, on runs that its training has not seen."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from host_support import SEED, Models, build_library
from hullguard.core.library import library
from hullguard.core.native import Batch, Native
from hullguard.design.bank import alarm_delay, shortened, usual_scale
from hullguard.design.bank_table import bank_table
from hullguard.design.design import Design, used_banks
from hullguard.design.isolation import separable
from hullguard.design.limit import Explanation, first_unexplained
from hullguard.model.faults import FaultSpec
from hullguard.model.table import Array

START, SAMPLES, RUNS = 60, 120, 100
CONTROLLERS = ("controller1", "controller2", "controller3")
SENSORS = ("gap12_sensor", "gap23_sensor", "speed1_sensor")
SIZES = (0.5, 1.0, 2.0)
# Bank: mean delay over the limit, or samples beyond it.
TARGETS = {4: (1.5, 0.0), 8: (1.15, 1.0), 16: (1.1, 0.5)}


@pytest.fixture(scope="module")
def bank(models: Models) -> Design:
    return models.design({}, "rest", "platoon_bank")


@pytest.fixture(scope="module")
def native(bank: Design) -> Native:
    return Native(library("f32"), bank.tables)


# ---- the limit ----


@dataclass(frozen=True)
class Delays:
    """Of one fault at one size, run by run."""

    limit: Array
    bank: dict[int, Array]  # by size


@pytest.fixture(scope="module")
def delays(bank: Design, native: Native) -> dict[tuple[str, float], Delays]:
    model, reference = bank.model, bank.model.scenario("rest").reference
    programme, whole = Explanation(model, 30, usual_scale(model)), used_banks(model, bank.stored)[0]
    tables = {size: bank_table(model, bank.stored, shortened(whole, size)) for size in TARGETS}
    assert tables[16] == bank.tables.banks[0]
    found = {}
    for fault in CONTROLLERS:
        for size in SIZES:
            batch = Batch(native, bank, SAMPLES, reference, [FaultSpec(fault, "bias", size, START, None)], SEED)
            traces = [batch.trace(run) for run in range(RUNS)]
            limit = [first_unexplained(programme, t, START, SAMPLES) for t in traces]
            of_bank = {n: np.array([alarm_delay(table, t, START, SAMPLES) for t in traces], dtype=float) for n, table in tables.items()}
            found[fault, size] = Delays(np.array(limit, dtype=float), of_bank)
    return found


@pytest.mark.parametrize("size", TARGETS)
def test_mean_delays_stay_within_their_share_of_the_limit(delays: dict[tuple[str, float], Delays], size: int) -> None:
    share, beyond = TARGETS[size]
    late = []
    for case, found in delays.items():
        limit, mean = float(found.limit.mean()), float(found.bank[size].mean())  # NaN where one run found nothing
        if not mean <= max(share * limit, limit + beyond):
            late.append(f"{case[0]} {case[1]}: {mean:.2f} samples, limit {limit:.2f}, ratio {mean / limit:.3f}")
    assert not late


def test_no_bank_is_earlier_than_the_limit_and_larger_ones_are_no_later(delays: dict[tuple[str, float], Delays]) -> None:
    for found in delays.values():
        assert np.all(found.bank[16] >= found.limit)
        assert np.all(found.bank[16] <= found.bank[8]) and np.all(found.bank[8] <= found.bank[4])


@pytest.mark.parametrize("size", TARGETS)
def test_the_bank_in_c_alarms_at_the_sample_that_was_evaluated(models: Models, size: int) -> None:
    made = models.design({"detector.bank.size": size}, "rest", "platoon_bank")
    assert made.tables.banks[0].certificates == size
    place = made.tables.residuals - len(made.tables.banks)
    number = Native(library("f64"), made.tables)
    for fault in CONTROLLERS:
        batch = Batch(number, made, SAMPLES, made.model.scenario("rest").reference, [FaultSpec(fault, "bias", 1.0, START, None)], SEED)
        for run in range(20):
            trace = batch.trace(run)
            alarm = np.flatnonzero(np.abs(trace["r"][START:, place]) > trace["J"][START:, place])
            assert alarm_delay(made.tables.banks[0], trace, START, SAMPLES) == alarm[0]


# ---- isolation ----


def told(native: Native, bank: Design, spec: FaultSpec, scenario: str, runs: int = RUNS, **options: Any) -> list[dict[str, Any]]:
    """Rows of runs with one fault; in none of them a confirmed alarm may exclude it."""
    true = 1 << [f.name for f in bank.model.faults].index(spec.name)
    rows = Batch(native, bank, 200, bank.model.scenario(scenario).reference, [spec], SEED, **options).runs(0, runs)
    excluded = [r["run"] for r in rows if not r["candidates_always"] & true]
    assert not excluded, f"{spec}, {scenario}: the true fault is excluded in runs {excluded}"
    return rows


def bits(bank: Design, *names: str) -> int:
    return sum(1 << i for i, f in enumerate(bank.model.faults) if f.name in names)


def like(bank: Design, name: str) -> int:
    """A fault and those that nothing can tell from it."""
    known = [f.name for f in bank.model.faults]
    i = known.index(name)
    apart = separable(bank.model, 30, tuple(range(len(known))))
    return sum(1 << j for j in range(len(known)) if i == j or not apart[i, j])


@pytest.mark.parametrize("scenario", ["rest", "manoeuvres"])
@pytest.mark.parametrize("size", [1.0, 2.0])
@pytest.mark.parametrize("name", [*CONTROLLERS, *SENSORS])
def test_the_fault_is_soon_the_only_candidate(bank: Design, native: Native, name: str, size: float, scenario: str) -> None:
    rows = told(native, bank, FaultSpec(name, "bias", size, START, None), scenario)
    assert all(r["confirmed_at"] >= START for r in rows)
    same, own = like(bank, name), bits(bank, name)
    among, alone = (bits(bank, *CONTROLLERS), own) if name in CONTROLLERS else ((1 << len(bank.model.faults)) - 1, same)
    assert sum(r["candidates_later"] & among == alone for r in rows) >= 0.95 * RUNS


def test_only_the_last_controller_and_the_gap_behind_it_look_alike(bank: Design) -> None:
    pair = bits(bank, "controller3", "gap23_sensor")
    assert [like(bank, n) for n in (*CONTROLLERS, *SENSORS)] == [
        bits(bank, "controller1"),
        bits(bank, "controller2"),
        pair,
        bits(bank, "gap12_sensor"),
        pair,
        bits(bank, "speed1_sensor"),
    ]


@pytest.mark.parametrize("scenario", ["rest", "manoeuvres"])
@pytest.mark.parametrize("name", [*CONTROLLERS, *SENSORS])
def test_the_true_fault_is_never_excluded_whatever_it_does(bank: Design, native: Native, name: str, scenario: str) -> None:
    fault = next(f for f in bank.model.faults if f.name == name)
    assert fault.size_max == 3.0
    for kind, size in (("bias", 0.5), ("bias", 3.0), ("bias", -3.0), ("drift", 0.2), ("freeze", 0.0), ("noise", 1.5), ("gain", 0.5), ("gain", -0.5)):
        told(native, bank, FaultSpec(name, kind, size, START, None), scenario, 50)


BURSTS = {"loss": 0.1, "burst": 5}


@pytest.mark.parametrize("name", [*CONTROLLERS, *SENSORS])
def test_nor_when_frames_are_lost(bank: Design, native: Native, name: str) -> None:
    for size in (0.5, 1.0, 2.0, 3.0):
        rows = told(native, bank, FaultSpec(name, "bias", size, START, None), "manoeuvres", **BURSTS)
        assert sum(r["lost"] for r in rows) > 0


# A provisional alarm, which may yet be taken back, narrows what the confirmed ones say.
HASTY = {"decision.c": [("} else if (alarm->state == plant) {", "} else if (plant != HG_PLANT_NONE) {")]}


def test_a_provisional_alarm_must_not_narrow_a_confirmed_one(bank: Design, tmp_path: Path) -> None:
    hasty = Native(build_library(tmp_path, "f32", HASTY), bank.tables)
    with pytest.raises(AssertionError, match="excluded"):
        for name in CONTROLLERS:
            told(hasty, bank, FaultSpec(name, "bias", 1.0, START, None), "manoeuvres", **BURSTS)
