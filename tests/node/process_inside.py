"""Run inside with-vcan by test_node_process.py: detector_node as a process and the commands on a bus; what concerns any node on a bus: bus_inside.py."""

from __future__ import annotations

import json
import re
import signal
import sys
from pathlib import Path

import pytest
from inside_support import Drive, collect, detect, exchange, link, node, ready, silent
from node_support import NODE, command, hullguard


def alarmed(verdicts: list, state: str) -> bool:
    return any(v.plant == state for v in verdicts)


# ---- start and end ----


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT], ids=lambda n: n.name)
@pytest.mark.parametrize("options", [("--lockstep",), ("--rest",), ()], ids=lambda o: "".join(o) or "timed")
@pytest.mark.parametrize("traffic", [False, True], ids=["silent", "traffic"])
def test_a_signal_ends_it_cleanly(number: signal.Signals, options: tuple[str, ...], traffic: bool, tmp_path: Path) -> None:
    missed = tmp_path / "missed"
    with link() as bus, node("--status", "--timing", missed, *options) as n:
        if traffic:
            drive = Drive()
            for _ in range(5):
                frames, tick = drive.sample()
                for f in [*frames, tick]:
                    bus.send(f)
            collect(bus, {drive.verdict_id}, 1)
        n.stop(number)
    assert (n.status, n.err) == (0, "")
    assert n.lines[-1].startswith("k=") and missed.read_text().startswith("# samples ")


def test_it_ends_after_its_samples() -> None:
    drive = Drive()
    with link() as bus, node("--lockstep", "--rest", "--samples", 7) as n:
        for _ in range(7):
            frames, tick = drive.sample()
            exchange(bus, drive, [*frames, tick])
        n.wait()
    assert (n.status, n.err) == (0, "")


def test_a_timing_file_that_cannot_be_written_is_status_1(tmp_path: Path) -> None:
    with node("--timing", tmp_path / "no" / "such" / "file") as n:
        n.stop()
    assert n.status == 1 and re.fullmatch(r"detector_node: [^\n]+\n", n.err)


# ---- what it says ----


@pytest.mark.parametrize("model", ["platoon", "openacc"])
def test_the_model_hash_is_the_same_everywhere(model: str) -> None:
    drive = Drive(model, "default")
    listed = dict(line.split() for line in command([str(NODE["f32"]), "--list"]).stdout.splitlines())
    assert listed[model] == f"{drive.design.tables.hash:08x}"
    with link() as bus, node("--model", model, "--lockstep", "--rest"):
        frames, tick = drive.sample()
        for f in [*frames, tick]:
            bus.send(f)
        (status,) = collect(bus, {drive.status_id}, 1)
    assert f"{int.from_bytes(status.data[2:6], 'little'):08x}" == listed[model]


# ---- the commands ----

ON_BUS = ("-i", "socketcan", "-c", "vcan0")


def test_plant_and_detect_by_hand() -> None:
    with detect("platoon", *ON_BUS, "--lockstep", "--rest", "--ready", "--json") as n:
        plant = command(hullguard("plant", "platoon", *ON_BUS, "--lockstep", "--speed", "max", "--json"))
        n.stop()
    assert plant.returncode == 0, plant.stderr
    result = json.loads(plant.stdout)
    assert result["faults"][0]["confirmed_at"] is not None and result["false_alarms"] == {"provisional": 0, "confirmed": 0}
    assert n.status == 0
    told = json.loads(n.lines[-1])
    assert told["verdicts"] == result["verdicts"] and told["samples"] == result["samples"]
    assert told["communication"] | {"unknown": 0} == result["communication"]


def test_plant_notices_a_node_that_says_something_else() -> None:
    with node("--lockstep"):  # without --rest it knows less
        plant = command(hullguard("plant", "platoon", *ON_BUS, "--lockstep", "--speed", "max", "--scenario", "rest"))
    assert plant.returncode == 1
    assert re.fullmatch(r"hullguard: the node's verdicts differ[^\n]*\n", plant.stderr)


def test_plant_without_a_node_says_so() -> None:
    """Ten seconds of patience, shortened here; the message names the cure."""
    code = "import hullguard.plant.run as r, sys; r.ANSWER_TIMEOUT_S = 0.3; from hullguard.cli import main; sys.exit(main(sys.argv[1:]))"
    done = command([sys.executable, "-c", code, "plant", "platoon", *ON_BUS, "--lockstep", "--speed", "max"])
    assert done.returncode == 3 and re.fullmatch(r"hullguard: [^\n]*did not answer sample 0[^\n]*--lockstep[^\n]*\n", done.stderr)


def test_detect_listens_and_says_nothing_on_the_bus() -> None:
    drive = Drive("platoon", "default", ("controller2:bias:3@60",))
    verdicts = []
    with link() as bus, detect("platoon", *ON_BUS, "--rest", "--lockstep", "--listen", "--ready", "--json", "--samples", 120) as n:
        for _ in range(120):
            frames, tick = drive.sample()
            verdicts += drive.take([*frames, tick])[0]
            for f in [*frames, tick]:
                bus.send(f)
        n.wait(20)
        assert silent(bus, {drive.verdict_id, drive.status_id}, 0.3)
    assert n.status == 0, n.err
    told = json.loads(n.lines[-1])
    assert told["samples"] == 120
    changes = [v for i, v in enumerate(verdicts) if i == 0 or (v.plant, v.bus) != (verdicts[i - 1].plant, verdicts[i - 1].bus)]
    assert [(c["k"], c["plant"], tuple(c["bus"].values())) for c in told["verdicts"]] == [(v.k, v.plant, v.bus) for v in changes]
    assert alarmed(changes, "confirmed")


def test_detect_ends_by_signal() -> None:
    with detect("platoon", *ON_BUS, "--ready", "--json") as n:
        n.stop(signal.SIGINT)
    assert n.status == 0, n.err
    assert json.loads(n.lines[-1])["model_hash"] == f"{ready()[0].tables.hash:08x}"
