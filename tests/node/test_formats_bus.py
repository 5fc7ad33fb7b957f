"""Formats and latencies on vcan: the tests of formats_inside.py and latency_inside.py in one guest, and the figures they print."""

from __future__ import annotations

from pathlib import Path

from node_support import run_inside


def test_formats_and_latency_on_vcan(tmp_path: Path) -> None:
    said = run_inside("formats_inside.py", "latency_inside.py", out=tmp_path, interfaces=2)
    figures = [line.removeprefix("TIMING ") for line in said.splitlines() if line.startswith("TIMING ")]
    assert any("closing frame to verdict" in f for f in figures)
    print("\n".join(figures))
