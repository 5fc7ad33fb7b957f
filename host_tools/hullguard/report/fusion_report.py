"""The report of a fusion run."""

from __future__ import annotations

from pathlib import Path

from hullguard.design.fusion_model import FusionDesign
from hullguard.report.page import page


def write_fusion_report(directory: Path, made: FusionDesign) -> Path:
    """Write report.html."""
    path = directory / "report.html"
    path.write_text(page(made.model.name, []), encoding="utf-8")
    return path
