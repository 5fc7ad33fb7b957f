"""A suspension from the model file to verdict, estimates and report; its generated C; and every wrong input in one line."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.integrate
from host_support import FLAGS, INCLUDE, ROOT, SEED, Cli, Models
from hullguard.core.library import library
from hullguard.core.native import Native
from hullguard.core.native_uio import Uio
from hullguard.design.uio_generator import uio_table
from hullguard.design.uio_isolate import isolations
from hullguard.errors import InputError
from hullguard.model import load_model
from hullguard.model.builders import BUILDERS
from hullguard.model.faults import parse_fault
from hullguard.model.road import RoadSpec
from hullguard.model.schema import Reference, Scenario
from hullguard.model.table import Table
from hullguard.model.uio import weakened
from hullguard.plant.road import road
from hullguard.plant.unknown import emulate
from uio_support import HALF, quarter_car

FULL = HALF | {"plant.corners": 4, "plant.body_kg": 960, "plant.track_m": 1.5, "plant.roll_kgm2": 400}

# ---- the plant ----


def made_of(**changes: float) -> Any:
    given = {"corners": 1, "wheel_kg": 36, "body_kg": 240, "spring_npm": 16000, "damper_nspm": 1650, "tyre_npm": 160000}
    return BUILDERS["suspension"].make(Table(given | changes, "plant"))


def test_one_corner_is_the_quarter_car() -> None:
    A, B, _ = quarter_car(36.0, 240.0)
    made = made_of()
    assert np.allclose(made.A, A) and np.allclose(made.B, B)


@pytest.mark.parametrize("overrides", [HALF, FULL])
def test_a_rigid_body_keeps_its_momentum(overrides: dict[str, Any]) -> None:
    """Forces between body and wheels add up to nothing: total momentum changes by the tyres' forces alone, and where the body pitches so does its own."""
    model = load_model("suspension", overrides)
    known = model.plant.unknown
    assert known is not None
    corners = len(known.names)
    rng = np.random.default_rng(SEED)
    x = rng.standard_normal(4 * corners)
    if corners == 4:  # a rigid body does not twist
        b = x[1::4]
        x[1::4] = b - np.array([1, -1, -1, 1]) * (np.array([1, -1, -1, 1]) @ b) / 4
    rate = known.A @ x
    body, wheel = rate[1::4], rate[3::4]
    tyres = -160000.0 * x[2::4].sum()
    # The velocity of the centre of gravity: between front and rear axle as 1.4 to 1.2, left and right alike.
    front, rear = (body[:1], body[1:]) if corners == 2 else (body[:2], body[2:])
    centre = (1.4 * front.mean() + 1.2 * rear.mean()) / 2.6
    assert model.plant.n == 4 * corners
    assert 480.0 * corners / 2 * centre + 36.0 * wheel.sum() == pytest.approx(tyres, rel=1e-9)
    assert np.linalg.eigvals(known.A).real.max() < 1e-9


def test_a_weaker_part_is_the_plant_with_less_of_it() -> None:
    known = load_model("suspension").plant.unknown
    assert known is not None
    for name, key, whole in (("spring1", "spring_npm", 16000.0), ("damper1", "damper_nspm", 1650.0), ("tyre1", "tyre_npm", 160000.0)):
        assert np.allclose(weakened(known, {name: 0.7}), made_of(**{key: 0.7 * whole}).A)
    half = load_model("suspension", HALF).plant.unknown
    assert half is not None
    weak = weakened(half, {"spring2": 0.5})
    assert np.array_equal(weak[:, :4], half.A[:, :4]) and np.allclose(weak[:, 4], half.A[:, 4] / 2)


def test_the_emulation_is_the_solution_of_the_differential_equation(models: Models) -> None:
    made = models.design(scenario="default", name="suspension")
    model = made.model
    known = model.plant.unknown
    assert known is not None
    spec, samples = RoadSpec("sine", 0.01, 3.0), 300
    run = emulate(made, Native(library("f64"), made.tables), Scenario("t", samples, Reference("rest", 0.0, 1), (), road=spec), [parse_fault("actuator1:bias:150@100")], samples, SEED % 99)
    wave = road(spec, 1)

    def rate(t: float, x: Any) -> Any:
        return known.A @ x + known.G[:, 0] * float(wave.velocity(np.array(t))) + known.B[:, 0] * 150.0 * (t >= 0.1)

    found = scipy.integrate.solve_ivp(rate, (0.0, 0.299), run.state[0], t_eval=np.arange(samples) * 1e-3, rtol=1e-9, atol=1e-12, max_step=1e-3)
    assert np.abs(found.y.T - run.state).max() < 1e-5
    assert np.array_equal(run.readings[:, model.outputs], run.state @ model.plant.C.T)


# ---- run ----


def test_an_actuator_that_pushes_is_found(cli: Cli, tmp_path: Path) -> None:
    done = cli("run", "suspension", "--bus", "inprocess", "--json", "--samples", 1500, "--fault", "actuator1:bias:200@1000", "--out", tmp_path / "run", "--seed", SEED % 1000)
    assert done.status == 0, done.err
    found = done.json
    assert found["false_alarms"] == {"provisional": 0, "confirmed": 0}
    assert found["faults"][0]["detected_at"] is not None and found["faults"][0]["delay"] < 100
    rows = {(e["observer"], e["name"]): e for e in found["estimates"]}
    assert rows[1, "actuator1"]["last"] == pytest.approx(200.0, abs=25.0)
    assert abs(rows[2, "body1_sensor"]["last"]) < rows[2, "body1_sensor"]["radius"]
    assert {e["kind"] for e in found["estimates"]} == {"faults", "unknown", "states"}
    assert found["isolation"][0]["actuator"] == "actuator1"
    header, *lines = (tmp_path / "run" / "estimates.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1500 and "1.actuator1.truth" in header.split(",") and "2.body1_sensor.radius" in header.split(",")
    page = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    for name in ("estimates-states", "estimates-unknown", "estimates-errors", "estimates-faults"):
        assert name in page
    again = cli("replay", "suspension", "--csv", tmp_path / "run" / "signals.csv", "--bus", "inprocess", "--json")
    assert again.status == 0, again.err
    alarms = [v["k"] for v in again.json["verdicts"] if v["plant"] == "confirmed"]
    assert len(alarms) == 1 and 1000 < alarms[0] < 1200, "the recording has the fault in it; what starts in a moving plant finds it a little later"
    assert {(e["observer"], e["name"]) for e in again.json["estimates"]} == set(rows) and "error_max" not in again.json["estimates"][0]


def test_damaged_frames_accuse_no_suspension(cli: Cli) -> None:
    """Every action of the injector, at both senders: the node's counters are the ledger's."""
    done = cli("campaign", "suspension", "--inject", "all", "--runs", 1, "--samples", 120, "--no-fault", "--workers", 1, "--seed", SEED % 1000, "--json", "-q")
    assert done.status == 0, done.err
    assert not done.json["failures"] and all(r["equal"] for r in done.json["rows"]) and done.json["injected"] > 1000
    assert all(r["confirmed"] == 0 for r in done.json["rows"] if r["class"] == "seen")


def test_a_monitor_says_what_the_node_says(cli: Cli, tmp_path: Path) -> None:
    assert cli("run", "suspension", "--bus", "inprocess", "--quiet", "--samples", 300, "--fault", "actuator1:bias:600@200", "--out", tmp_path).status == 0
    verdicts = json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))["verdicts"]
    done = cli("monitor", "suspension", "--log", tmp_path / "run.log", "--rest", "--json")
    assert done.status == 0, done.err
    lines = [json.loads(line) for line in done.out.splitlines()]
    for who in ("monitor", "ecu"):
        said = [(x[who]["k"] if who == "monitor" else x[who]["verdict"]["k"]) for x in lines if x["event"] == who]
        assert said == [v["k"] for v in verdicts]
    assert lines[-1]["monitor"]["plant"] == "confirmed" == verdicts[-1]["plant"] and lines[-1]["samples"] == 300


def test_a_worn_damper_is_told_from_the_actuator(cli: Cli) -> None:
    done = cli("run", "suspension", "--bus", "inprocess", "--json", "--scenario", "damper", "--samples", 10000)
    found = done.json["isolation"][0]
    assert (found["cause"], found["candidates"]) == ("component", ["damper1"])
    assert found["share"]["damper1"] == pytest.approx(0.5, abs=0.02)


def test_a_half_car_says_which_corner(cli: Cli) -> None:
    sets = [x for key, value in HALF.items() for x in ("--set", f"{key}={value}")]
    done = cli("run", "suspension", *sets, "--bus", "inprocess", "--json", "--samples", 1100, "--fault", "actuator2:bias:300@1000", "--seed", SEED % 1000)
    assert done.status == 0, done.err
    found = done.json
    assert found["false_alarms"] == {"provisional": 0, "confirmed": 0} and found["faults"][0]["delay"] < 100
    assert {(i["actuator"], i["cause"]) for i in found["isolation"]} == {("actuator1", "input"), ("actuator2", "undecided")}


def test_a_weaker_tyre_is_another_road(cli: Cli) -> None:
    done = cli("run", "suspension", "--bus", "inprocess", "--json", "--samples", 2500, "--fault", "tyre1:gain:0.6@1000", "--expect", "quiet", "--scenario", "tyre")
    assert done.status == 0 and done.json["faults"][0]["detected_at"] is None


def test_the_published_observer_runs(cli: Cli) -> None:
    done = cli("run", "suspension_published", "--bus", "inprocess", "--json")
    found = done.json
    assert found["false_alarms"]["confirmed"] == 0
    assert all(f["detected_at"] == 1000 for f in found["faults"])
    rows = {e["name"]: e for e in found["estimates"]}
    assert rows["actuator1"]["last"] == pytest.approx(200.0, abs=2.0) and rows["y3_sensor"]["last"] == pytest.approx(0.05, abs=1e-4)


def test_a_campaign_raises_no_false_alarm(cli: Cli) -> None:
    done = cli("campaign", "suspension", "--runs", 4, "--samples", 800, "--json", "--workers", 1, "--seed", SEED, "--no-fault")
    assert done.status == 0, done.err
    assert done.json["false_alarm_runs"] == 0


# ---- generated C ----

PROGRAM = r"""
#include "suspension_uio.h"
#include <stdio.h>
static hg_suspension_uio uio;
static hg_real rows[HG_RING_REALS(%(width)d, 255)];
int main(void)
{
    static hg_detector detector; /* as far as it is followed */
    double v[2 * %(width)d];
    hg_real value[%(width)d], radius[%(width)d];
    detector.value = value;
    detector.beginnings = 1U;
    if ((hg_ring_start(&detector.radii, %(width)d, 255, rows) != HG_OK) || (hg_suspension_uio_start(&uio, &detector, HG_START_REST) != HG_OK)) {
        return 1;
    }
    for (;;) {
        for (int i = 0; i < 2 * %(width)d; i++) {
            if (scanf("%%lf", &v[i]) != 1) {
                return 0;
            }
        }
        for (int i = 0; i < %(width)d; i++) {
            value[i] = (hg_real)v[i];
            radius[i] = (hg_real)v[%(width)d + i];
        }
        if ((hg_ring_push(&detector.radii, radius) != HG_OK) || (hg_suspension_uio_follow(&uio, &detector) != HG_OK)) {
            return 2;
        }
        for (unsigned i = 0; i < HG_SUSPENSION_UIO_ESTIMATES; i++) {
            printf("%%a %%a ", (double)uio.estimate[i], (double)uio.radius[i]);
        }
#if !HG_REAL_Q31
        printf("%%d", (int)uio.found[0].cause);
#endif
        printf("\n");
    }
}
"""


@pytest.mark.parametrize("real", ["f32", "q31"])
def test_generated_tables_are_those_of_python(models: Models, tmp_path: Path, real: str) -> None:
    made = models.design(scenario="default", name="suspension")
    width = len(made.model.signals)
    (tmp_path / "main.c").write_text(PROGRAM % {"width": width}, encoding="ascii")
    sources = [str(p) for p in sorted((ROOT / "firmware" / "src").glob("*.c"))] + [str(ROOT / "firmware" / "models" / "suspension_uio.c"), str(tmp_path / "main.c")]
    program = tmp_path / "main"
    subprocess.run(["gcc", *FLAGS, "-Wall", "-Wextra", "-Werror", f"-DHG_REAL_{real.upper()}=1", *INCLUDE, "-I", str(ROOT / "firmware" / "models"), *sources, "-lm", "-o", str(program)], check=True)
    rng = np.random.default_rng(SEED)
    value, radius = 0.01 * rng.standard_normal((150, width)), 1e-3 * rng.random((150, width))
    assert made.tables.fixed is not None
    units = np.array(made.tables.fixed.units[:width] if real == "q31" else [31] * width)  # hg_real holds x 2^(31 - unit)
    if real == "q31":
        value, radius = (np.rint(np.ldexp(x, 31 - units)) * np.ldexp(1.0, units - 31) for x in (value, radius))
    lines = "\n".join(" ".join(f"{x:.17g}" for x in np.ldexp([v, r], 31 - units).ravel()) for v, r in zip(value, radius, strict=True))
    done = subprocess.run([str(program)], input=lines, capture_output=True, text=True, check=True)
    told = [line.split() for line in done.stdout.splitlines()]
    place = 0
    for k, u in enumerate(made.uios):
        table = uio_table(u, real)
        found = Uio(library(real), table, isolations(made.model, u)[0].table if k == 0 and real == "f32" else None, width).run(value, radius)
        for j in range(len(u.names)):
            step = 2.0 ** (table.units[j] - 31) if table.units else 1.0
            assert [float.fromhex(row[2 * place]) * step for row in told] == found.estimate[:, j].tolist()
            assert [float.fromhex(row[2 * place + 1]) * step for row in told] == found.radius[:, j].tolist()
            place += 1


# ---- wrong input ----

WRONG: list[tuple[dict[str, Any], str]] = [
    ({"kind": "linear"}, "unknown key 'uio'|'observers' is missing"),
    ({"plant.corners": 3}, "expected 1 .a quarter car., 2 .a half car. or 4"),
    ({"plant.corners": 2}, "'front_m' is missing"),
    ({"plant.body_kg": -1}, r"plant\.body_kg: -1 is outside"),
    ({"plant.unknown.road.bound": -1}, r"unknown\.road\.bound: -1 is outside"),
    ({"plant.unknown.road.limit": 1}, r"unknown\.road: unknown key 'limit'"),
    ({"plant.unknown.wind": {"bound": 1, "rate": 1}}, "unknown: unknown key 'wind'"),
    ({"plant.state_range": [0.1, 2.0, 0.03, 4.0], "detector.bank": {}}, r"detector\.bank cannot be had with inputs that nobody knows"),
    ({"detector.prediction": True}, r"detector\.prediction cannot be had"),
    ({"detector.threshold": "zonotope"}, r"detector\.threshold cannot be had"),
    ({"detector.uio": []}, "0 observers; 1 .. 32 are possible"),
    ({"detector.uio.1.poles": [-1, 2, -3, -4]}, r"poles: 2 does not die out"),
    ({"detector.uio.1.poles": [[-1, 2], -3, -4]}, "comes without its conjugate"),
    ({"detector.uio.1.poles": [-1, -2]}, "2 poles, 5 can be chosen; none is fixed"),
    ({"detector.uio.1.poles": {"slow": -20, "fast": -10}}, "fast = -10 is not left of slow = -20"),
    ({"detector.uio.1.poles": "fast"}, "expected a list of poles"),
    ({"detector.uio.1.poles": [-20, -20, -20, -20, -20, -20]}, "6 poles, 5 can be chosen"),
    ({"detector.uio.0.faults": []}, "an observer that looks for no fault raises no alarm"),
    ({"detector.uio.0.faults": ["steering"]}, "'steering' is not one of actuator1"),
    ({"detector.uio.0.outputs": ["deflection1_m", "tyre1_m", "wheel1_mps"], "detector.uio.0.faults": ["body1_sensor"]}, "the fault of a sensor that this observer does not read"),
    ({"detector.uio.0.form": "euler"}, "'euler' is not one of discrete, first-order hold, direct"),
    ({"detector.uio.0.poles": [-1]}, "states that sensors tell directly need no observer, which alone has poles"),
    ({"detector.uio": [{"faults": ["actuator1"], "form": "direct", "outputs": ["deflection1_m", "tyre1_m", "wheel1_mps"]}]}, 'form = "direct": .* do not tell every one of'),
    ({"detector.uio": [{"faults": ["actuator1", "body1_sensor"], "form": "direct"}]}, "do not tell every one of .*, fault of body1_mps directly"),
    ({"detector.uio.0.trust": {"deflection": 1}}, "nothing for 'body1_mps'"),
    ({"detector.uio.0.trust": [0, 1, 1, 1]}, r"trust\[0\]: 0 is outside"),
    ({"detector.uio.0.low_pass_s": -1}, r"low_pass_s: -1 is outside"),
    ({"detector.uio.0.fault_decay_per_s": -1}, r"fault_decay_per_s: -1 is outside"),
    ({"detector.uio.0.isolate": {"excitation": 0}}, r"excitation: 0 is outside"),
    ({"detector.uio.0.isolate": {}}, "'excitation' is missing"),
    ({"detector.uio.0.gains": {"F": [[1]], "K": [[1]], "H": [[1]]}}, "expected 4 x 4, found 1 x 1"),
    ({"plant.state_range": {"deflection": 0.1, "body": 1e31, "tyre": 0.03, "wheel": 4.0}}, "beyond 1e.30"),
    ({"signals.deflection1_m.slew": "reachable"}, "declare the slew as a list"),
    ({"scenarios.default.road.kind": "gravel"}, "'gravel' is not one of smooth"),
]


@pytest.mark.parametrize(("overrides", "said"), WRONG)
def test_wrong_models_are_refused_in_one_line(overrides: dict[str, Any], said: str, models: Models) -> None:
    with pytest.raises(InputError, match=said) as caught:
        Models().design(overrides, "default", "suspension")
    assert "\n" not in str(caught.value)


def test_gains_that_do_not_go_together() -> None:
    gains = {"F": np.eye(5).tolist(), "K": np.zeros((5, 4)).tolist(), "H": np.zeros((5, 4)).tolist()}
    with pytest.raises(InputError, match="chosen gains have poles of their own"):
        load_model("suspension", {"detector.uio.1.gains": gains})
    with pytest.raises(InputError, match="chosen gains are those of continuous time"):
        load_model("suspension", {"detector.uio": [{"faults": ["actuator1", "body1_sensor"], "form": "direct", "gains": gains}]})
    with pytest.raises(InputError, match="F has a pole at 1: its observer does not forget"):
        Models().design({"detector.uio.0.gains.F": np.eye(5).tolist()}, "default", "suspension_published")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--fault", "spring1:bias:5@100"), "a component's fault is what is left of it, as in spring1:gain:0.8@100"),
        (("--fault", "spring2:gain:0.5@100"), "neither a signal nor a fault of model suspension"),
        (("--set", "plant.unknown.road.bound=0.01"), r"the scenario's road reaches .* m/s, the model promises at most 0.01"),
        (("--set", "plant.unknown.road.rate=1"), r"m/s2, the model promises at most 1;"),
    ],
)
def test_wrong_runs_are_refused_in_one_line(cli: Cli, arguments: tuple[str, ...], said: str) -> None:
    done = cli("run", "suspension", "--bus", "inprocess", "--quiet", "--samples", 200, *(arguments if "--fault" in arguments else ("--no-fault", *arguments)))
    assert done.status == 2 and done.err.count("\n") == 1
    with pytest.raises(AssertionError, match=said):
        raise AssertionError(done.err)


def test_a_campaign_cannot_weaken_parts(cli: Cli) -> None:
    done = cli("campaign", "suspension", "--runs", 1, "--samples", 200, "--fault", "spring1:gain:0.5@100", "--workers", 1)
    assert done.status == 2 and "only `run` and `plant` emulate" in done.err
