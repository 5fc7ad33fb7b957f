"""The shipped models dc_motor and battery_pack against what their files say of them, on runs that no design has seen."""

from __future__ import annotations

from typing import Any

import pytest
from host_support import SEED, Cli

RUNS = 60
PLANTS = 20
START = 100
SAMPLES = 250


def campaign(cli: Cli, model: str, *options: object) -> dict[str, Any]:
    plants = ("--plants", PLANTS) if model == "battery_pack" else ()  # its parameters are uncertain
    done = cli("campaign", model, "--runs", RUNS, "--samples", SAMPLES, "--seed", SEED, "--workers", 1, "--json", *plants, *options)
    assert done.status == 0, done.err
    return done.json


# Shares of the periodic measurement frames: what the file says, and room for another seed.
@pytest.mark.parametrize(
    ("model", "scenario", "share"), [("dc_motor", "default", 0.40), ("dc_motor", "mixed", 0.70), ("dc_motor", "load_steps", 0.30), ("battery_pack", "mixed", 0.45)]
)
def test_no_false_alarm_and_few_frames(cli: Cli, model: str, scenario: str, share: float) -> None:
    found = campaign(cli, model, "--no-fault", "--scenario", scenario)
    assert found["false_alarm_runs"] == found["provisional_alarm_runs"] == 0 and found["margin_max"] <= 1.0
    assert found["measurement_share"] <= share


@pytest.mark.parametrize(
    ("model", "fault", "latest"),
    [
        ("dc_motor", "encoder:bias:5", 2),
        ("dc_motor", "current_sensor:bias:2", 2),
        ("dc_motor", "bridge:bias:1", 4),
        ("dc_motor", "friction:bias:0.4", 15),
        ("battery_pack", "inner_sensor:bias:0.6", 5),
        ("battery_pack", "coolant_sensor:bias:0.7", 5),
        ("battery_pack", "current_sensor:bias:4", 15),
        ("battery_pack", "pump:gain:0", 5),
    ],
)
def test_every_fault_is_found_in_time_in_every_run(cli: Cli, model: str, fault: str, latest: int) -> None:
    found = campaign(cli, model, "--fault", f"{fault}@{START}")
    assert found["detected_runs"] == found["confirmed_runs"] == RUNS and found["false_alarm_runs"] == 0
    assert found["delay_max"] <= latest
    if model == "dc_motor":
        assert found["true_candidate_runs"] == RUNS and found["isolated_runs"] >= 0.8 * RUNS


def test_a_frozen_encoder_and_a_stuck_temperature_are_found_once_they_should_have_moved(cli: Cli) -> None:
    for model, fault in (("dc_motor", f"encoder:freeze@{START}"), ("battery_pack", f"inner_sensor:freeze@{START}")):
        found = campaign(cli, model, "--fault", fault, "--samples", 700)
        assert found["detected_runs"] == RUNS and found["false_alarm_runs"] == 0
