"""`hullguard monitor` on a bus; its tests run where vcan0 exists."""

from __future__ import annotations

from pathlib import Path

from node_support import run_inside


def test_monitor_on_vcan(tmp_path: Path) -> None:
    run_inside("monitor_inside.py", out=tmp_path)
