"""Libraries without a part of the detector that a model may do without: they compile without a warning, refuse what needs the part, and are
the same to the bit for everything else.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from host_support import SILENT_1, Models, build_library
from hullguard.core.library import Library, library
from hullguard.core.native import REST, Native, Node
from hullguard.errors import InputError
from test_codegen import WARNINGS

PARTS = ("ZONOTOPE", "BANK", "PREDICT", "MISMATCH")
WITHOUT = [*((p,) for p in PARTS), PARTS]
NEEDS: dict[str, tuple[str, dict[str, Any]]] = {
    "ZONOTOPE": ("platoon", {"detector.threshold": "zonotope"}),
    "BANK": ("platoon_bank", {}),
    "PREDICT": ("platoon", {"detector.prediction": True}),
    "MISMATCH": ("platoon", {"plant.drag_per_s": {"value": 1.0, "pm": 0.1}}),
}


@pytest.fixture(scope="module", params=WITHOUT, ids=lambda parts: "+".join(parts).lower())
def reduced(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[tuple[str, ...], Library]:
    """The parts left out, and a library without them."""
    parts: tuple[str, ...] = request.param
    folder: Path = tmp_path_factory.mktemp("parts")
    return parts, build_library(folder, "f32", options=("-O1", *WARNINGS, *(f"-DHG_WITH_{p}=0" for p in parts)))


def test_what_needs_a_part_is_refused_without_it_and_nothing_else(models: Models, reduced: tuple[tuple[str, ...], Library]) -> None:
    parts, without = reduced
    for part, (name, overrides) in NEEDS.items():
        tables = models.design(overrides, name=name).tables
        Node(Native(library("f32"), tables), REST)
        if part in parts:
            with pytest.raises(InputError, match=f"status {without.lib.HG_E_CONFIG}"):
                Node(Native(without, tables), REST)
        elif len(parts) == 1:
            Node(Native(without, tables), REST)


@pytest.mark.parametrize("overrides", [None, SILENT_1], ids=["usual", "silent"])
def test_the_platoon_is_the_same_to_the_bit(models: Models, reduced: tuple[tuple[str, ...], Library], overrides: dict[str, Any] | None) -> None:
    fault = ("controller2:bias:1@150",)
    for run in range(5):
        whole, part = (models.platoon("manoeuvres", overrides, lib=lib).batch(200, fault, loss=0.1).trace(run) for lib in (library("f32"), reduced[1]))
        assert whole.keys() == part.keys()
        for key, values in whole.items():
            assert np.asarray(values).tobytes() == np.asarray(part[key]).tobytes(), key
        assert np.any(np.abs(whole["r"]) > whole["J"])
