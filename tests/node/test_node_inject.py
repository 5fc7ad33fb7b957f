"""The injector as a tap on a bus; what needs a bus is in inject_inside.py."""

from __future__ import annotations

from pathlib import Path

from node_support import run_inside


def test_injection_on_vcan(tmp_path: Path) -> None:
    run_inside("inject_inside.py", out=tmp_path)
