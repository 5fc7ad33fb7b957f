"""Rows of the table in firmware/README.md that only a real socket shows, in robust_inside.py."""

from __future__ import annotations

from pathlib import Path

from node_support import run_inside


def test_misbehaviour_on_vcan(tmp_path: Path) -> None:
    run_inside("robust_inside.py", out=tmp_path, interfaces=2)
