"""detector_node on a bus, and rows of the table in firmware/README.md that only a real socket shows: bus_inside.py, which runs on boards as well."""

from __future__ import annotations

from pathlib import Path

from node_support import run_inside


def test_a_node_on_vcan(tmp_path: Path) -> None:
    run_inside("bus_inside.py", out=tmp_path, interfaces=2)
