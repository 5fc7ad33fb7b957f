"""A design must not depend on the processor: the package asks OpenBLAS to compute alike on all that can."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

CPU = Path("/proc/cpuinfo")


def asked(**more: str) -> str:
    """What OpenBLAS is asked for, in a process that was told nothing, or this."""
    env = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"} | more
    return subprocess.run([sys.executable, "-c", "import hullguard, os; print(os.environ.get('OPENBLAS_CORETYPE'))"], env=env, capture_output=True, text=True, check=True).stdout.strip()


@pytest.mark.skipif(not CPU.exists(), reason="no /proc/cpuinfo")
def test_openblas_is_asked_for_one_order_of_additions() -> None:
    able = {"avx2", "fma"} <= set(CPU.read_text(encoding="utf-8").split())
    assert asked() == ("Haswell" if able else "None")


def test_what_the_user_asks_for_stays() -> None:
    assert asked(OPENBLAS_CORETYPE="Prescott") == "Prescott"
