"""Freeze frames and model hashes on vcan: the tests of freeze_inside.py in one guest."""

from __future__ import annotations

from pathlib import Path

from node_support import run_inside


def test_freeze_frames_and_model_hashes_on_vcan(tmp_path: Path) -> None:
    run_inside("freeze_inside.py", out=tmp_path)
