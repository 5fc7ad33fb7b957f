"""detector_node and the commands as processes: options and exit status here, what needs a bus in process_inside.py and canutils_inside.py."""

from __future__ import annotations

import json
import os
import re
import shutil
from pathlib import Path

import pytest
from hullguard.bus import choose
from node_support import NODE, command, hullguard, in_guest, run_inside

WRONG = [
    ["--speed", "3"],
    ["-x"],
    ["vcan0"],
    ["--model"],
    ["--model", "nosuch"],
    ["--model", "Platoon"],
    ["--period", "0"],
    ["--period", "ten"],
    ["--period", "10ms"],
    ["--deadline", "-1"],
    ["--samples", "-1"],
    ["--samples", "1e3"],
    ["--samples", "99999999999999999999999"],
    ["--lockstep=yes"],
]


@pytest.mark.parametrize("options", WRONG, ids=" ".join)
@pytest.mark.parametrize("real", NODE)
def test_a_wrong_option_is_refused_in_one_line(options: list[str], real: str) -> None:
    done = command([str(NODE[real]), *options], timeout_s=60)
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(r"detector_node: [^\n]+\n", done.stderr)


@pytest.mark.parametrize("real", NODE)
def test_what_it_says_of_itself(real: str) -> None:
    assert command([str(NODE[real]), "--version"]).stdout.rstrip().endswith(f"({real})")
    assert "--lockstep" in command([str(NODE[real]), "--help"]).stdout
    listed = command([str(NODE[real]), "--list"])
    assert listed.returncode == 0
    assert {line.split()[0] for line in listed.stdout.splitlines()} >= {"platoon", "openacc"}


def test_no_such_bus_is_status_3_in_one_line() -> None:
    """Here, with or without CAN in the kernel; the guest has CAN."""
    for guest in ([], in_guest()):
        node = command([*guest, str(NODE["f32"]), "--interface", "vcan9"])
        assert (node.returncode, node.stdout) == (3, "")
        assert re.fullmatch(r"detector_node: [^\n]+\n", node.stderr)
        run = command([*guest, *hullguard("run", "platoon", "--bus", "vcan9", "--scenario", "rest", "--json")])
        assert (run.returncode, run.stdout) == (3, "")
        assert re.fullmatch(r"hullguard: [^\n]+\n", run.stderr)
    assert "vcan9" in node.stderr and "vcan9" in run.stderr


def test_bus_auto_finds_a_bus_and_says_which(tmp_path: Path) -> None:
    """Where this machine has no vcan, the command runs itself again inside with-vcan."""
    made_here = choose.existing_vcan()
    done = command(hullguard("run", "platoon", "--samples", "20", "--no-fault", "--out", tmp_path))
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    how = [f"bus: {made_here}"] if made_here else ["bus: vcan0 in a network namespace of its own", "bus: vcan0 in User-Mode Linux, because this kernel has no CAN"]
    assert [line for line in lines if line.startswith("bus: ")] in [[x] for x in how]
    assert "node: detector_node, a process of its own" in lines
    result = json.loads((tmp_path / "run.json").read_text())
    assert f"bus: {result['bus']}" in how and result["samples"] == 20
    assert (tmp_path / "report.html").is_file() and (tmp_path / "run.log").is_file()
    shown = command(hullguard("run", "platoon", "--samples", "20", "--no-fault", "--json"))
    assert json.loads(shown.stdout)["bus"] == result["bus"], "one JSON object through the guest"


def test_without_a_launcher_auto_is_in_process_and_says_so(tmp_path: Path) -> None:
    if choose.existing_vcan():
        return  # nothing is launched here; the test above has seen it
    moved = tmp_path / "host_tools"
    shutil.copytree(Path(choose.__file__).parents[1], moved / "hullguard", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(choose.ROOT / "host_tools" / "models", moved / "models")
    shutil.copytree(choose.ROOT / "build" / "lib", tmp_path / "build" / "lib")
    path = os.pathsep.join(p for p in os.environ["PATH"].split(os.pathsep) if not (Path(p) / "with-vcan").exists())
    done = command(hullguard("run", "platoon", "--samples", "20", "--no-fault"), PYTHONPATH=str(moved), PATH=path)
    assert done.returncode == 0, done.stderr
    assert "bus: in process (no CAN bus)" in done.stdout.splitlines()


def test_processes_on_vcan(tmp_path: Path) -> None:
    run_inside("process_inside.py", out=tmp_path, interfaces=2)


def test_can_utils(tmp_path: Path) -> None:
    run_inside("canutils_inside.py", out=tmp_path)
