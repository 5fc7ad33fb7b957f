"""Silence by prediction: what the plant's model says between frames is true, never worse than the held value, and worth having."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from host_support import FLOATS, SEED, SILENT_2, Alarms, Models, alarms, build_library
from hullguard.core.library import library
from hullguard.core.native import MOVING, Batch, Native
from hullguard.design.design import Design, design
from hullguard.errors import InputError
from hullguard.model import load_model
from hullguard.model.schema import Reference, parse_model
from test_soundness import PATH, random_source

PREDICTED = {"detector.prediction": True}
SIGNALS = 6
TWINS = slice(6, 9)  # of the three outputs
PLANTS = 25


def twins_hold(trace: dict[str, Any], places: list[int], first: int) -> None:
    """Every reading lies within its twin's radius, which is never wider than the held one's."""
    own, twin = places, list(range(first, first + len(places)))
    assert np.all(np.abs(trace["reading"][:, own] - trace["value"][:, twin]) <= trace["radius"][:, twin] * (1 + 1e-6))
    assert np.all(trace["radius"][:, twin] <= trace["radius"][:, own])


@pytest.mark.parametrize("real", FLOATS)
@pytest.mark.parametrize("silence", [0, 2])
@pytest.mark.parametrize("loss", [0.0, 0.2])
def test_predictions_are_true_and_tighter(models: Models, real: str, silence: int, loss: float) -> None:
    ready = models.platoon("manoeuvres", PREDICTED | (SILENT_2 if silence else {}), real)
    tighter = 0
    for run in range(10):
        trace = ready.batch(300, loss=loss).trace(run)
        if loss == 0.0:
            twins_hold(trace, [0, 1, 2], SIGNALS)
        tighter += int(np.sum(trace["radius"][:, TWINS] < trace["radius"][:, :3]))
    assert tighter > 500


@pytest.mark.parametrize("real", FLOATS)
@pytest.mark.parametrize("overrides", [{}, SILENT_2], ids=["no silent time", "two silent samples"])
def test_no_false_alarm_with_prediction(models: Models, real: str, overrides: dict[str, Any]) -> None:
    ready = models.platoon("manoeuvres", PREDICTED | overrides, real)
    assert alarms(ready.batch(200).runs(0, 300)) == Alarms(0, 0)
    lossy = ready.batch(200, loss=0.2).runs(0, 300)
    assert sum(r["lost"] for r in lossy) > 0
    assert alarms(lossy).confirmed == 0


def delay(models: Models, overrides: dict[str, Any]) -> float:
    rows = models.platoon("manoeuvres", overrides).batch(220, ("controller2:bias:1.0@100",), seed=12).runs(0, 100)
    assert all(r["provisional_at"] >= 0 for r in rows)
    return float(np.mean([r["provisional_at"] - 100 for r in rows]))


def test_prediction_is_worth_having_where_the_sender_may_be_silent(models: Models) -> None:
    assert delay(models, SILENT_2 | PREDICTED) <= 0.7 * delay(models, SILENT_2)
    assert delay(models, PREDICTED) <= delay(models, {})


def predicted(source: dict[str, Any]) -> Design:
    source["detector"]["prediction"] = True
    return design(parse_model(source, PATH), fresh=True)[0]


def test_predictions_of_random_plants_are_true_and_raise_no_alarm() -> None:
    number, made, tighter = 0, 0, 0
    while made < PLANTS:
        number += 1
        assert number < 20 * PLANTS, "nearly everything is refused"
        try:
            found = predicted(random_source(np.random.default_rng([SEED, number])))
        except InputError:
            continue
        made += 1
        native = Native(library("f32"), found.tables)
        places = [g for p in found.tables.predictors for g in range(p.first, p.first + len(p.output))]
        for how, reference in (("corners", "rest"), ("random", "mixed")):
            rng = np.random.default_rng([SEED, number, 1])
            options: dict[str, Any] = {}
            if how == "corners":
                plant = found.model.plant
                options = {"disturbance": rng.choice([-1.0, 1.0], (150, plant.Ed.shape[1])), "initial": plant.initial_range * rng.choice([-1.0, 1.0], plant.n)}
            batch = Batch(native, found, 150, Reference(reference, 1.0, 20), (), SEED + number, **options)
            trace = batch.trace(0)
            twins_hold(trace, places, found.tables.signals)
            tighter += int(np.sum(trace["radius"][:, found.tables.signals :] < trace["radius"][:, places]))
            assert alarms(batch.runs(0, 10)) == Alarms(0, 0), f"plant {number}"
        lossy = Batch(native, found, 150, Reference("mixed", 1.0, 20), (), SEED + number, loss=0.3, start=MOVING).runs(0, 20)
        assert alarms(lossy).confirmed == 0, f"plant {number}"
    assert tighter > 0


# A prediction that goes on after an input was lost, or before it has settled, must not go unnoticed.
HASTY = {"predict.c": [("self->sure = self->k >= config->settle;", "self->sure = true;")]}


def test_a_prediction_that_does_not_wait_is_wrong(models: Models, tmp_path: Any) -> None:
    ready = models.platoon("manoeuvres", PREDICTED, lib=build_library(tmp_path, "f32", HASTY))
    wrong = 0
    for run in range(20):
        trace = ready.batch(60).trace(run)
        wrong += int(np.sum(np.abs(trace["reading"][:, :3] - trace["value"][:, TWINS]) > trace["radius"][:, TWINS] * 1.01))
    assert wrong > 0


def test_a_plant_whose_hidden_part_does_not_forget_is_refused() -> None:
    model = load_model("platoon", PREDICTED | {"plant.drag_per_s": 0.0, "plant.feedback.state_weights": [1, 10, 1, 10, 1]})
    with pytest.raises(InputError, match=r"detector\.prediction.*not stable.*remove it"):
        design(model, fresh=True)
