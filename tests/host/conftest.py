"""One seed for all that is random: HULLGUARD_SEED repeats a run, otherwise every run is another one and prints the seed it had."""

from __future__ import annotations

import os
import sys

import hypothesis
import hypothesis.core
import pytest
from host_support import ROOT, SEED, Cli, Models

hypothesis.settings.register_profile("hullguard", deadline=None, database=None, print_blob=True, suppress_health_check=list(hypothesis.HealthCheck))
hypothesis.settings.load_profile("hullguard")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "wrong: with a library that is wrong on purpose; `make check` runs them")
    if getattr(config.option, "hypothesis_seed", None) is None:
        hypothesis.core.global_force_seed = SEED
    # Commands that are run as processes find the package where the tests do.
    path = os.environ.get("PYTHONPATH", "")
    os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT / "host_tools"), *([path] if path else [])])


def pytest_report_header() -> str:
    return f"HULLGUARD_SEED={SEED}"


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> object:  # type: ignore[misc]
    outcome = yield
    report = outcome.get_result()  # type: ignore[attr-defined]
    if report.failed:
        report.sections.append(("seed", f"repeat with HULLGUARD_SEED={SEED}"))


@pytest.fixture(scope="session")
def models() -> Models:
    return Models()


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Cli:
    monkeypatch.setattr(sys, "argv", ["hullguard"])
    return Cli(capsys)
