"""No confirmed false alarm, whatever the detector is made of: banks, zonotopes, prediction, uncertain plants and all of them together, driven,
silent, under losses and against disturbances that are chosen for the purpose. And each part's share of the threshold is needed: without it there are.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from host_support import SEED, SILENT_1, SILENT_2, Models, build_library
from hullguard.campaign import case as campaign_case
from hullguard.campaign.case import Case, Rows, chunk, setup_of
from hullguard.core.library import Library, library
from hullguard.core.native import Batch, Native

SAMPLES, RUNS = 200, 300
PLANTS = 200  # drawn, where the plant is uncertain
ATTACKED = 0.4  # of the runs
BURSTS: dict[str, Any] = {"loss": 0.1, "burst": 5}


@dataclass(frozen=True)
class Variant:
    """A detector, the plants it watches, and how near to its threshold a healthy plant must get under attack: 1 is as near as can be."""

    model: str
    overrides: dict[str, Any]
    nearest: float
    plants: int = 0


def drag(pm: float) -> dict[str, Any]:
    return {"plant.drag_per_s": {"value": 1.0, "pm": pm}}


ZONOTOPE = {"detector.threshold": "zonotope", "detector.zonotope.columns": 6}  # few: much of the set is in its spread
PREDICTION = {"detector.prediction": True}
TOGETHER = drag(0.1) | PREDICTION | ZONOTOPE
VARIANTS = {
    "bank": Variant("platoon_bank", {}, 0.95),
    "zonotope": Variant("platoon", ZONOTOPE, 0.9),
    "prediction": Variant("platoon", PREDICTION, 0.9),
    # The threshold holds for a plant that is another one in every sample, too; a plant that stays what it is does not get there.
    "uncertain": Variant("platoon", drag(0.1), 0.75, PLANTS),
    "together": Variant("platoon_bank", TOGETHER, 0.95, PLANTS),
}


def rows_of(models: Models, variant: Variant, runs: int = RUNS, silent: bool = False, **chosen: Any) -> Rows:
    """A case's runs under manoeuvres, as a campaign makes them."""
    made = models.design(variant.overrides | (SILENT_1 if silent else {}), "manoeuvres", variant.model)
    case = Case(setup_of(made, "f32"), SAMPLES, made.model.scenario("manoeuvres").reference, (), SEED, plants=variant.plants, **chosen)
    rows = chunk(case, 0, runs)
    assert len(rows["run"]) == runs
    return rows


def quiet(rows: Rows) -> bool:
    return not rows["false_provisional"].any() and not rows["false_confirmed"].any()


@pytest.mark.parametrize("silent", [False, True], ids=["manoeuvres", "a silent sample"])
@pytest.mark.parametrize("name", VARIANTS)
def test_a_healthy_plant_raises_no_alarm(models: Models, name: str, silent: bool) -> None:
    rows = rows_of(models, VARIANTS[name], silent=silent)
    assert quiet(rows) and rows["margin"].max() <= 1.0
    assert (rows["silent"] > 0).all() == silent


@pytest.mark.parametrize("name", VARIANTS)
def test_no_alarm_is_confirmed_when_frames_are_lost(models: Models, name: str) -> None:
    rows = rows_of(models, VARIANTS[name], **BURSTS)
    assert not rows["false_confirmed"].any()
    assert rows["false_provisional"].any(), "these losses hurt nobody: this test shows nothing"


@pytest.mark.parametrize("name", VARIANTS)
def test_the_worst_disturbance_raises_no_alarm_and_almost_does(models: Models, name: str) -> None:
    variant = VARIANTS[name]
    rows = rows_of(models, variant, attack=ATTACKED)
    assert rows["attacked"].sum() == ATTACKED * RUNS
    assert quiet(rows)
    assert variant.nearest <= rows["margin_settled"].max() <= 1.0


@pytest.mark.parametrize("name", VARIANTS)
def test_nor_is_one_confirmed_when_frames_are_lost_under_attack(models: Models, name: str) -> None:
    rows = rows_of(models, VARIANTS[name], 100, attack=ATTACKED, **BURSTS)
    assert not rows["false_confirmed"].any()
    assert rows["lost"].sum() > 0


def test_a_truncated_zonotope_is_not_sound(models: Models) -> None:
    rows = rows_of(models, Variant("platoon", {"detector.threshold": "zonotope_published"}, 1.0))
    assert rows["false_confirmed"].sum() > RUNS / 30


# ---- what each part adds to the threshold is needed ----

NO_MISMATCH = {"mismatch.c": [("out[i] = hg_real_min(hg_real_add(config->constant[i], hg_acc_real(sum, config->exponent)), HG_REAL_MAX);", "out[i] = hg_real_mul(hg_acc_real(sum, 0), HG_REAL_ZERO);")]}
MUTANTS: dict[str, tuple[Variant, dict[str, list[tuple[str, str]]]]] = {
    "a bank takes radii as smaller": (VARIANTS["bank"], {"bank.c": [("hg_real_widen(radius[config->signal[g]], config->widen)", "hg_real_widen(radius[config->signal[g]], HG_REAL_C(0.9))")]}),
    "an uncertain plant counts as certain": (Variant("platoon", drag(0.3), 0.0, PLANTS), NO_MISMATCH),
    "and beside a bank": (VARIANTS["together"], NO_MISMATCH),
    "a prediction does not wait": (Variant("platoon", PREDICTION | SILENT_2, 0.0), {"predict.c": [("self->sure = self->k >= config->settle;", "self->sure = true;")]}),
    "columns do not go into the spread": (VARIANTS["zonotope"], {"zonotope.c": [("            enclose(self, column_of(self, i));\n", "            (void)enclose;\n")]}),
}


def use(monkeypatch: pytest.MonkeyPatch, mutant: Library) -> None:
    """Campaigns run this library from here on; it has another digest, so that nothing remembered is mistaken for its work."""

    def instead(real: str) -> Library:
        assert real == mutant.real
        return mutant

    monkeypatch.setattr(campaign_case, "library", instead)


@pytest.mark.wrong
@pytest.mark.parametrize("name", MUTANTS)
def test_without_its_share_there_are_false_alarms(models: Models, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str) -> None:
    variant, patch = MUTANTS[name]
    use(monkeypatch, build_library(tmp_path, "f32", patch))
    rows = rows_of(models, variant, 150, attack=1.0)
    assert rows["false_confirmed"].any() and rows["margin"].max() > 1.0


# Radii of uncertain states do not grow with those that turn out wider behind a gap.
NO_GROWTH = {"mismatch.c": [("out[i] = hg_real_min(hg_real_add(out[i], hg_acc_real(sum, config->exponent)), HG_REAL_MAX);", "out[i] = hg_real_min(out[i], hg_acc_real(sum, 0) + HG_REAL_MAX);")]}


@pytest.mark.wrong
def test_thresholds_behind_a_gap_count_what_uncertain_states_did_meanwhile(models: Models, tmp_path: Path) -> None:
    """Its share is too small for an alarm of its own: it shows in the thresholds, which a hull never has higher without it."""
    made = models.design(VARIANTS["uncertain"].overrides, "manoeuvres")
    natives = [Native(lib, made.tables) for lib in (library("f32"), build_library(tmp_path, "f32", NO_GROWTH))]
    right, wrong = (Batch(n, made, SAMPLES, made.model.scenario("manoeuvres").reference, (), SEED, **BURSTS).trace(0) for n in natives)
    gap = np.flatnonzero(right["lost"])
    assert len(gap) and np.array_equal(right["reading"], wrong["reading"])
    assert np.array_equal(right["J"][: gap[0]], wrong["J"][: gap[0]])
    assert np.any(wrong["J"] < right["J"]) and not np.any(wrong["J"] > right["J"])
