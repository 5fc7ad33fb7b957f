"""Campaigns of faulty frames: counters against the ledger, the three classes, and that each check can fail."""

from __future__ import annotations

import contextlib
import io
import json
import math
from collections import Counter
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import pytest
from host_support import PERIODIC, ROOT, SEED
from hullguard.campaign.frames import Course, FaultyRun, Tally
from hullguard.campaign.frames_all import HEAVY, SEEN, VALID, all_cases, case_of
from hullguard.campaign.frames_command import _judged
from hullguard.campaign.frames_study import codec_for, differences, failures, residual_rate, row
from hullguard.cli import main
from hullguard.core.library import library
from hullguard.core.native import Native, Verdict
from hullguard.core.protect import Protector
from hullguard.design.design import Design, design
from hullguard.design.protection import own_protection
from hullguard.design.tables import MessageTable
from hullguard.inject.actions import ACTIONS
from hullguard.model import load_model, parse_fault


def command(*arguments: object) -> tuple[int, str, str]:
    """Exit status and output of a command."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main([str(a) for a in arguments])
    return status, out.getvalue(), err.getvalue()


def designed(name: str, overrides: dict[str, object] | None = None) -> Design:
    return design(load_model(name, overrides))[0]


def verdicts(made: Design, spec: str | None, faults: tuple[str, ...], scenario: str, run: int) -> tuple[list[Verdict], Tally]:
    """One run's verdicts, with a directive or without any that ever fires."""
    case = case_of(spec or "drop@nth=1000000")
    course = Course(made.model.scenario(scenario), 200, 200, tuple(parse_fault(f) for f in faults), SEED, run)
    it = FaultyRun(made, Native(library("f32"), made.tables), codec_for(made), case, course)
    return it.verdicts, it.go()


# With every sample sent, a sensor fault in front of the trigger and one in the frames are the same codes; sizes are multiples of the resolution.
ALIKE = [
    ("bias:signal=gap12_m,size=0.5@k=50..", "gap12_m:bias:0.5@50"),
    ("bias:signal=gap23_m,size=-0.123@k=50..120", "gap23_m:bias:-0.123@50..120"),
    ("bias:signal=speed1_mps,size=1.5@k=20..", "speed1_mps:bias:1.5@20"),
    ("drift:signal=gap12_m,rate=0.05@k=50..", "gap12_m:drift:0.05@50"),
    ("freeze:signal=speed1_mps@k=50..", "speed1_mps:freeze@50"),
    ("spike:signal=gap12_m,size=2,sign=plus@k=50..51", "gap12_m:bias:2@50..51"),
]


@pytest.mark.parametrize(("spec", "fault"), ALIKE)
@pytest.mark.parametrize("scenario", ["rest", "manoeuvres"])
def test_a_forged_value_is_judged_as_the_sensor_fault_it_looks_like(spec: str, fault: str, scenario: str) -> None:
    made = designed("platoon", PERIODIC)
    for run in range(5):
        forged, tally = verdicts(made, spec, (), scenario, run)
        faulty, _ = verdicts(made, None, (fault,), scenario, run)
        assert tally.injected > 0 and forged == faulty
        assert any(v.plant == "confirmed" for v in forged) == any(v.plant == "confirmed" for v in faulty)


def test_forged_values_are_found() -> None:
    """The comparison above would hold for a detector that finds nothing."""
    made = designed("platoon", PERIODIC)
    said, _ = verdicts(made, ALIKE[0][0], (), "rest", 0)
    assert any(v.plant == "confirmed" for v in said) and all(v.plant == "none" for v in said if v.k < 50 and v.plant != "starting")


def test_every_action_is_among_all() -> None:
    for name in ("platoon", "openacc"):
        made = designed(name)
        cases = all_cases(made.model, made.tables, codec_for(made), 20, 100)
        assert {c.directive.action for c in cases} == set(ACTIONS)
        assert {c.kind for c in cases} == {SEEN, HEAVY, VALID}


@pytest.mark.parametrize("name", ["platoon", "openacc"])
def test_counters_equal_the_ledger(name: str, tmp_path: Path) -> None:
    fault = "controller1:bias:2@50" if name == "platoon" else "speed2_mps:bias:4@50"
    scenario = () if name == "openacc" else ("--scenario", "manoeuvres")
    status, out, err = command("campaign", name, "--inject", "all", "--runs", 4, "--samples", 160, *scenario, "--fault", fault, "--seed", SEED, "--json", "-q", "--out", tmp_path)
    assert status == 0, err
    result = json.loads(out)
    assert result == json.loads((tmp_path / "frames.json").read_text()) and not result["failures"]
    assert all(r["equal"] and r["injected"] > 0 for r in result["rows"])
    seen = [r for r in result["rows"] if r["class"] == SEEN]
    assert all(r["confirmed"] == 0 and r["found"] == r["faults"] > 0 for r in seen)
    passes = (tmp_path / "passes.csv").read_text().splitlines()[1:]
    assert len(passes) == sum(r["passed"] for r in result["rows"] if r["class"] == HEAVY)


def test_workers_do_not_matter() -> None:
    specs = ("--inject", "corrupt:bits=6@p=0.5", "--inject", "replay:frames=2,age=0.7@p=0.2")
    options = ("campaign", "platoon", *specs, "--runs", 30, "--samples", 60, "--scenario", "rest", "--json", "-q")
    one, two = (command(*options, "--workers", n) for n in (1, 2))
    assert one[0] == two[0] == 0 and one[1] == two[1]


@pytest.mark.parametrize("name", ["lost", "crc", "good", "numeric", "unknown", "late"])
def test_a_wrong_counter_is_told(name: str) -> None:
    made = designed("platoon")
    case = case_of("corrupt:bits=2@p=0.5")
    course = Course(made.model.scenario("rest"), 60, 60, (), SEED, 0)
    tally = FaultyRun(made, Native(library("f32"), made.tables), codec_for(made), case, course).go()
    assert not differences(case, tally)
    tally.health[name] += 1
    assert (not differences(case, tally)) == (name == "lost")  # what was damaged counts as lost later; the ledger promises no number
    tally.health[name] -= 1
    tally.told["crc"] += 1
    assert differences(case, tally)


def damaged(seen: int, passed: int) -> Tally:
    counts = Counter({"crc": seen, "good": passed})
    return Tally(runs=1, told=counts, counted=counts, statuses=counts, health=counts)


def test_what_must_not_be_is_told() -> None:
    made = designed("platoon")
    good = row(case_of("drop@p=0.1"), Tally(runs=1, faults=1, found=1), made)
    assert not failures([good])
    assert "confirmed" in failures([good | {"confirmed": 1}])[0]
    assert "not found" in failures([good | {"found": 0}])[0]
    assert "differ" in failures([good | {"equal": False, "differences": ["x"]}])[0]
    heavy = row(case_of("corrupt:bits=6@p=0.5"), damaged(1000, 40), made)
    assert "passed" in failures([heavy])[0]
    assert not failures([row(case_of("corrupt:bits=6@p=0.5"), damaged(1000, 9), made)])


@pytest.mark.parametrize(("profile", "length"), [("P22", 4), ("P05", 4), ("P11", 3)])
def test_residual_rates_by_trying_all(profile: str, length: int) -> None:
    """The count of code words against the C library, every pattern of up to 4 bits in a short frame. A forbidden counter value of P11 is refused besides."""
    table, _ = own_protection(profile, "both", 0x1234)
    if table.stamp // 8 >= length:
        table = replace(table, stamp=0xFFFF)
    message = MessageTable("m", 1, 0, length, table)
    protector = Protector(library("f32"), table)
    frame = protector.protect(bytes(length), 5, 9)
    for bits in range(1, 5):
        passed = 0
        for chosen in combinations(range(8 * length), bits):
            data = bytearray(frame)
            for b in chosen:
                data[b // 8] ^= 1 << b % 8
            passed += protector.check(bytes(data)) is not None
        expected = residual_rate(message, bits) * math.comb(8 * length, bits)
        assert passed == pytest.approx(expected, abs=1e-6) if profile != "P11" else passed <= expected + 1e-6


@pytest.mark.parametrize(
    ("spec", "kind"),
    [
        ("spoof:message=measurement@period=1", VALID),
        ("spoof:message=measurement,stamp=9@period=0.7", VALID),  # once in 16 samples it is the open one's
        ("spoof:message=measurement,valid=yes@period=1", VALID),
        ("spoof:message=measurement,valid=false@period=1", SEEN),
        ("corrupt:bits=3", SEEN),
        ("corrupt:bits=4", HEAVY),
        ("corrupt:repair=yes", VALID),
    ],
)
def test_classes(spec: str, kind: str) -> None:
    assert case_of(spec).kind == kind


@pytest.mark.parametrize(("profile", "kind"), [("P22", SEEN), ("P05", SEEN), ("P11", HEAVY)])
def test_three_bits_are_seen_where_the_checksum_sees_them(profile: str, kind: str) -> None:
    """e2e.h: with profiles 01 and 11 some errors of 3 bits pass."""
    made = designed("platoon", {"groups.measurement.frame.protection": profile})
    for bits, wanted in ((2, SEEN), (3, kind)):
        assert _judged(case_of(f"corrupt:bits={bits}@id=measurement"), made, codec_for(made)).kind == wanted


def test_a_directive_without_a_time_gets_the_windows() -> None:
    """What is dropped before the first frame or after the last one, no counter can tell."""
    status, out, _ = command("campaign", "platoon", "--scenario", "rest", "--inject", "drop@p=0.5", "--inject", "error@period=0.5", "--runs", 4, "--workers", 1, "--json", "-q")
    found = json.loads(out)["rows"]
    assert status == 0 and [r["spec"] for r in found] == ["drop@p=0.5,k=20..100", "error@period=0.5,from=2,to=10"] and all(r["equal"] for r in found)


def test_frames_without_a_sample_index_are_not_compared() -> None:
    model = ROOT / "tests" / "fixtures" / "network" / "network.toml"
    for spec in ("delay:by=0.2@id=wheels", "drop@p=0.1"):
        status, out, err = command("campaign", model, "--inject", spec, "--runs", 1)
        assert status == 2 and out == "" and "no sample index" in err and len(err.splitlines()) == 1


@pytest.mark.parametrize("name", ["platoon_bank", "openacc"])
def test_forged_frames_of_all_never_have_the_open_stamp(name: str) -> None:
    made = designed(name)
    cases = [c for c in all_cases(made.model, made.tables, codec_for(made), 20, 200) if "stamp=" in c.spec]
    assert len(cases) == 4 and all(c.kind == SEEN for c in cases)
    for c in cases:
        course = Course(made.model.scenario(None), 200, 200, (), SEED, 0)
        tally = FaultyRun(made, Native(library("f32"), made.tables), codec_for(made), c, course).go()
        assert tally.counted["stamp"] == tally.injected > 0 and not differences(c, tally)


def test_lost_closing_frames_are_counted_past_a_turn_of_the_counter() -> None:
    made = designed("platoon")
    case = case_of("silence:lasts=3.05@id=control,k=40..41")  # 30 samples, the counter has 16 values
    course = Course(made.model.scenario("rest"), 120, 60, (), SEED, 0)
    tally = FaultyRun(made, Native(library("f32"), made.tables), codec_for(made), case, course).go()
    assert tally.health["lost"] == tally.told["lost"] == tally.injected > 16 and not differences(case, tally)


def test_a_run_is_long_enough_for_the_scenarios_own_fault() -> None:
    status, out, _ = command("campaign", "platoon", "--inject", "duplicate@p=0.1", "--runs", 2, "--workers", 1, "--json", "-q")
    result = json.loads(out)
    assert status == 0 and result["faults"] and result["tampered_until"] > 150


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--inject", "bogus@p=0.1"), "bogus"),
        (("--inject", "bias:signal=nothing,size=1@p=0.1"), "nothing"),
        (("--inject", "all", "--loss", "0.1"), "--loss"),
        (("--inject", "all", "--attack", "0.1"), "--attack"),
        (("--inject", "all", "--fault", "controller1:bias:2@150", "--samples", 200), "half of the run"),
    ],
)
def test_bad_input(options: tuple[object, ...], said: str) -> None:
    status, out, err = command("campaign", "platoon", "--scenario", "rest", "--runs", 2, *options)
    assert status == 2 and out == "" and said in err and len(err.splitlines()) == 1
