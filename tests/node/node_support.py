"""Where things are, with-vcan, and the pytest inside it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
BUILD = ROOT / "build"
NODE = {"f32": BUILD / "bin" / "detector_node", "f64": BUILD / "bin" / "detector_node_f64"}
BUS_TIMER = BUILD / "node" / "bus_timer"
VIRTUAL_NODE = BUILD / "node" / "virtual_node"
ORACLE_RUN = BUILD / "oracle" / "oracle_run"
WITH_VCAN = BUILD / "with-vcan" / "with-vcan"
# The seed of tests/host when both run in one session.
SEED = getattr(sys.modules.get("host_support"), "SEED", None) or int(os.environ.get("HULLGUARD_SEED") or int.from_bytes(os.urandom(4), "little"))

Result = subprocess.CompletedProcess[str]


def environment(**more: str) -> dict[str, str]:
    """What commands find the package and the seed by."""
    path = os.pathsep.join([str(ROOT / "host_tools"), *filter(None, [os.environ.get("PYTHONPATH")])])
    return os.environ | {"PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1", "HULLGUARD_SEED": str(SEED)} | more


def command(arguments: list[str], timeout_s: float = 120, **more: str) -> Result:
    """A program to its end."""
    return subprocess.run(arguments, check=False, capture_output=True, text=True, timeout=timeout_s, env=environment(**more), cwd=ROOT)


def hullguard(*arguments: object) -> list[str]:
    """The command line of the command."""
    return [sys.executable, "-m", "hullguard", *map(str, arguments)]


def in_guest(*arguments: object, interfaces: int = 1, timeout_s: int = 100) -> list[str]:
    """A command line inside with-vcan."""
    return [str(WITH_VCAN), "-n", str(interfaces), "-t", str(timeout_s), *map(str, arguments)]


def run_inside(*files: str, out: Path, interfaces: int = 1, timeout_s: int = 600) -> str:
    """Run the tests of files where vcan0 exists, and give what they printed; what fails there fails here, with its text."""
    options = ["-q", "-rfEP", "--tb=short", "-p", "no:cacheprovider", "-p", "no:hypothesispytest", "--durations=5", f"--basetemp={out}/inside"]
    done = command(in_guest(sys.executable, "-m", "pytest", *options, *(HERE / f for f in files), interfaces=interfaces, timeout_s=timeout_s), timeout_s + 30)
    print(done.stdout)
    assert done.returncode == 0, f"{', '.join(files)} inside with-vcan: exit status {done.returncode}\n{done.stdout[-8000:]}\n{done.stderr[-4000:]}"
    return done.stdout
