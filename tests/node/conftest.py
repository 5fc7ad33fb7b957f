"""The 60 seconds of test_timing.py pass in a guest of their own while the other tests run."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from node_support import BUS_TIMER, HERE, NODE, SEED, environment, in_guest

TICKS = {"steady": (6000, 0), "dropped": (500, 100)}
_started: list[tuple[subprocess.Popen[str], Path]] = []


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "quick: of bus_inside.py, what `make check` runs on boards")


def pytest_report_header() -> str:
    return f"tests/node: HULLGUARD_SEED={SEED}"


def pytest_collection_finish(session: pytest.Session) -> None:
    if not session.config.option.collectonly and any("timing_files" in getattr(item, "fixturenames", ()) for item in session.items):
        out = Path(tempfile.mkdtemp(prefix="hullguard-timing-"))
        runs = [f"{name}:{ticks}:{drop}" for name, (ticks, drop) in TICKS.items()]
        command = in_guest("sh", HERE / "timing.sh", out, NODE["f32"], BUS_TIMER, *runs, timeout_s=300)
        _started.append((subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment()), out))


def pytest_sessionfinish() -> None:
    for process, out in _started:
        if process.poll() is None:
            process.terminate()
            process.wait(20)
        for file in out.iterdir():
            file.unlink()
        out.rmdir()


@pytest.fixture(scope="session")
def timing_files() -> Iterator[Path]:
    """Folder with the files of the runs in real time."""
    process, out = _started[0]
    said, _ = process.communicate(timeout=330)
    assert process.returncode == 0, f"exit status {process.returncode}: {said}"
    yield out


os.environ["HULLGUARD_SEED"] = str(SEED)  # one seed for tests/host and tests/node
