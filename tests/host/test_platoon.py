"""The platoon model as shipped against the figures it has to reach, on runs that no design has seen."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from host_support import REALS, SILENT_1, Alarms, Models, Ready, alarms

RUNS = 1000
SAMPLES = 200
START = 100
VEHICLES = (1, 2, 3)
MOTIONS = ("rest", "manoeuvres")

pytestmark = pytest.mark.parametrize("real", REALS)


def found(ready: Ready, vehicle: int, size: float, runs: int = 100) -> list[dict[str, Any]]:
    return ready.batch(SAMPLES, (f"controller{vehicle}:bias:{size}@{START}",)).runs(0, runs)


def delays(rows: list[dict[str, Any]], key: str = "provisional_at") -> np.ndarray[Any, Any]:
    return np.array([r[key] - START for r in rows if r[key] >= 0])


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("silence", [0, 1])
def test_no_false_alarm_without_a_fault(models: Models, real: str, motion: str, silence: int) -> None:
    rows = models.platoon(motion, SILENT_1 if silence else None, real).batch(SAMPLES).runs(0, RUNS)
    assert alarms(rows) == Alarms(0, 0)
    assert max(r["margin"] for r in rows) <= 1.0


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("silence", [0, 1])
def test_events_are_never_nearer_than_the_silence_nor_further_than_interval_max(models: Models, real: str, motion: str, silence: int) -> None:
    ready = models.platoon(motion, SILENT_1 if silence else None, real)
    rows = ready.batch(SAMPLES).runs(0, RUNS)
    assert min(r["interval_min"] for r in rows) == silence + 1
    assert max(r["interval_max"] for r in rows) == ready.native.tables.groups[0].interval_max == 5


def test_at_most_a_quarter_of_the_periodic_measurement_frames_at_rest(models: Models, real: str) -> None:
    rows = models.platoon("rest", None, real).batch(SAMPLES).runs(0, RUNS)
    assert sum(r["measurement"] for r in rows) <= 0.25 * RUNS * SAMPLES


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("vehicle", VEHICLES)
@pytest.mark.parametrize("size", [1.0, 2.0, -1.0])
def test_every_controller_fault_is_found_and_confirmed_in_every_run(models: Models, real: str, motion: str, vehicle: int, size: float) -> None:
    rows = found(models.platoon(motion, None, real), vehicle, size)
    assert len(delays(rows)) == len(rows) == len(delays(rows, "confirmed_at"))
    assert alarms(rows) == Alarms(0, 0)
    assert all(r["candidates"] >> (vehicle - 1) & 1 for r in rows), "the true fault is not among the candidates"


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("vehicle", VEHICLES)
def test_mean_delay_of_a_fault_of_1_is_at_most_12_samples(models: Models, real: str, motion: str, vehicle: int) -> None:
    assert delays(found(models.platoon(motion, None, real), vehicle, 1.0)).mean() <= 12.0


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("vehicle", VEHICLES)
def test_every_fault_of_2_is_found_with_a_silent_sample_after_each_frame(models: Models, real: str, motion: str, vehicle: int) -> None:
    rows = found(models.platoon(motion, SILENT_1, real), vehicle, 2.0)
    assert len(delays(rows)) == len(rows) == len(delays(rows, "confirmed_at"))


@pytest.mark.parametrize("motion", MOTIONS)
def test_mean_delay_on_vehicle_2_is_at_most_14_with_a_silent_sample_after_each_frame(models: Models, real: str, motion: str) -> None:
    rows = found(models.platoon(motion, SILENT_1, real), 2, 1.0, 400)
    assert len(delays(rows)) == len(rows)
    assert delays(rows).mean() <= 14.0


@pytest.mark.parametrize("silence", [0, 1])
def test_no_false_alarm_is_confirmed_while_every_tenth_frame_is_lost(models: Models, real: str, silence: int) -> None:
    rows = models.platoon("manoeuvres", SILENT_1 if silence else None, real).batch(SAMPLES, loss=0.1).runs(0, RUNS)
    assert sum(r["lost"] for r in rows) > 0.09 * sum(r["measurement"] for r in rows), "the losses did not happen: this test shows nothing"
    assert alarms(rows).provisional > 0, "no provisional alarm had to be withdrawn: this test shows nothing"
    assert alarms(rows).confirmed == 0


@pytest.mark.parametrize("loss", [0.0, 0.1])
def test_no_false_alarm_is_confirmed_with_the_adaptive_trigger(models: Models, real: str, loss: float) -> None:
    ready = models.platoon("adaptive", None, real)
    assert ready.native.tables.groups[0].levels == 4
    rows = ready.batch(ready.samples, loss=loss).runs(0, RUNS)
    assert alarms(rows).confirmed == 0
    if loss == 0.0:
        assert alarms(rows).provisional == 0


def test_a_fault_is_still_found_and_confirmed_while_every_tenth_frame_is_lost(models: Models, real: str) -> None:
    ready = models.platoon("manoeuvres", None, real)
    rows = ready.batch(SAMPLES, ("controller2:bias:2.0@100",), loss=0.1).runs(0, 300)
    assert len(delays(rows, "confirmed_at")) == len(rows)


def test_all_number_types_see_the_same_events_and_raise_the_same_alarms(models: Models, real: str) -> None:
    """A verdict may differ between builds only where | |r| - J | <= eps_r: rare enough to show in none of these runs' delays by more than a sample.

    Both float types have float32's tables. Fixed point has smaller thresholds, by what rounding costs less there: where that is more than a sample
    earlier, float32's residual was as close to its own threshold.
    """
    other = "f64" if real == "f32" else "f32"
    rows = found(models.platoon("manoeuvres", None, real), 2, 1.0)
    ready = models.platoon("manoeuvres", None, other)
    twins = found(ready, 2, 1.0)
    assert [a["measurement"] for a in rows] == [b["measurement"] for b in twins]
    moved = {a["run"]: a["provisional_at"] - b["provisional_at"] for a, b in zip(rows, twins, strict=True)}
    assert max(moved.values()) <= 1
    early = [run for run, by in moved.items() if by < -1]
    assert real == "q31" or not early
    rounding = ready.design.generators[0].tables.rounding + np.array(ready.design.fixed_rounding)
    for run in early:
        trace, at = ready.batch(SAMPLES, (f"controller2:bias:1.0@{START}",)).trace(run), rows[run]["provisional_at"]
        assert np.any(trace["J"][at] - np.abs(trace["r"][at]) <= rounding)
