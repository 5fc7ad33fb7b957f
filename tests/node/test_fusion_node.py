"""Fusion filters on vcan, where the node is a process of its own: the same frames and the same states to the bit as in process, whichever node it is, and a faulty sensor found.
Over 10^5 samples: make fusion-bus."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from hullguard.bus import candump
from node_support import HERE, NODE, SEED, command, hullguard, in_guest

CASES = {
    "fusion5": ["fusion5", "--scenario", "lossy", "--samples", "150", "--fault", "y1_m:bias:0.6@90"],
    "delayed": ["fusion5_fast", "--scenario", "delayed", "--samples", "150", "--fault", "y1_m:bias:0.6@90"],
    "tracking": ["tracking", "--samples", "130", "--fault", "wheel2_mps:freeze@90"],
    "double": ["fusion5", "--samples", "40", "--no-fault", "--real", "f64"],
    "changed": ["fusion5", "--samples", "40", "--no-fault", "--set", "trigger.heartbeat=12"],
}


def arguments(name: str, out: Path, bus: str) -> list[str]:
    return ["run", *CASES[name], "--seed", str(SEED), "--bus", bus, "--json", "--out", str(out / bus / name)]


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], dict[str, Any]]:
    """Every case without a bus and on vcan0; what each printed."""
    out = tmp_path_factory.mktemp("fusion")
    found = {}
    for bus, launch in (("inprocess", []), ("vcan0", in_guest())):
        folder = out / bus
        folder.mkdir()
        every = {name: arguments(name, out, bus) for name in CASES}
        if bus == "vcan0":
            every["timed"] = ["run", "fusion5", "--samples", "25", "--no-fault", "--speed", "1", "--bus", bus, "--json"]
        (folder / "commands").write_text(json.dumps(every))
        done = command([*launch, sys.executable, str(HERE / "commands_inside.py"), str(folder / "commands")], HULLGUARD_INSIDE="1")
        assert done.returncode == 0, f"{bus}: exit status {done.returncode}: {done.stdout} {done.stderr}"
        for name in every:
            told = json.loads((folder / f"{name}.json").read_text())
            assert told["status"] == 0, f"{name} on {bus}: {told['err']}"
            found[name, bus] = json.loads(told["out"]) | {"err": told["err"], "log": folder / name / "run.log"}
    return found


@pytest.mark.parametrize("name", CASES)
def test_the_node_on_a_bus_has_the_states_of_the_run_in_process(name: str, runs: dict[tuple[str, str], dict[str, Any]]) -> None:
    here, there = runs[name, "inprocess"], runs[name, "vcan0"]
    assert there["copies"]["digest"] == here["copies"]["digest"] and there["copies"]["samples_unequal"] == 0
    compiled = name != "changed"
    assert ("node: detector_node" in there["err"]) == compiled
    assert there["copies"]["node_digest"] == (here["copies"]["digest"] if compiled else None), "equal to the bit over every sample"
    assert there["verdicts"] == here["verdicts"] and there["frames"] == here["frames"]
    assert [e.frame for e in candump.read(there["log"])] == [e.frame for e in candump.read(here["log"])], "and it sent every byte of it"


@pytest.mark.parametrize(("name", "sensor"), [("fusion5", "y1_m"), ("tracking", "wheel2_mps")])
def test_a_faulty_sensor_is_told_on_the_bus(name: str, sensor: str, runs: dict[tuple[str, str], dict[str, Any]]) -> None:
    fault = runs[name, "vcan0"]["faults"][0]
    assert fault["delay"] is not None and fault["delay"] <= 50 and fault["candidates"] == [sensor]


def test_in_real_time_the_nodes_timer_closes_nothing_early(runs: dict[tuple[str, str], dict[str, Any]]) -> None:
    told = runs["timed", "vcan0"]
    assert told["samples"] == 25 and told["verdicts"][-1]["plant"] in ("starting", "none")
    assert all(state == "good" for state in told["verdicts"][-1]["bus"].values())


def test_the_node_lists_and_refuses(tmp_path: Path) -> None:
    for binary in NODE.values():
        assert {"fusion5", "fusion5_fast", "tracking"} <= {line.split()[0] for line in command([str(binary), "--list"]).stdout.splitlines()}
        done = command([str(binary), "--model", "fusion6"])
        assert done.returncode == 2 and "tracking" in done.stderr and done.stderr.count("\n") == 1
    refused = command(hullguard("run", "fusion5", "--bus", "vcan7", "--samples", "9", "--no-fault", "--json", "--out", tmp_path))
    assert (refused.returncode, refused.stdout) == (3, "") and refused.stderr.count("\n") == 1
