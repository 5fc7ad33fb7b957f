"""Libraries without a part of the detector that a model may do without, and libraries with the sizes of one model: they compile without a warning,
refuse what needs the part or has another size, and are the same to the bit for everything else.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from host_support import SILENT_1, Models, build_library
from hullguard.codegen.config import emit_config
from hullguard.core.library import Library, library
from hullguard.core.native import REST, Native, Node
from hullguard.errors import InputError
from test_codegen import WARNINGS

PARTS = ("ZONOTOPE", "BANK", "PREDICT", "MISMATCH", "MODES")
WITHOUT = [*((p,) for p in PARTS[:-1]), PARTS]
NEEDS: dict[str, tuple[str, dict[str, Any]]] = {
    "ZONOTOPE": ("platoon", {"detector.threshold": "zonotope"}),
    "BANK": ("platoon_bank", {}),
    "PREDICT": ("platoon", {"detector.prediction": True}),
    "MODES": ("suspension", {}),
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
        tables = models.design(overrides, scenario="default" if part == "MODES" else "rest", name=name).tables
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


def sized(folder: Path, real: str, config: str) -> Library:
    """A library with a NAME_config.h of this text."""
    folder.mkdir()
    (folder / "only.h").write_text(config, encoding="ascii")
    return build_library(folder, real, options=("-O1", *WARNINGS, '-DHG_CONFIG_HEADER="only.h"', f"-I{folder}"))


@pytest.mark.parametrize("real", ["f32", "q31"])
def test_with_the_sizes_of_its_model_alone_it_is_the_same_to_the_bit(models: Models, tmp_path: Path, real: str) -> None:
    config = emit_config(models.design())
    assert all(re.search(rf"^#define HG_ONLY_{size} [1-9]", config, re.MULTILINE) for size in ("GROUPS", "WIDTH", "HISTORY", "ORDER", "RESIDUALS", "READ", "IN_ORDER"))
    only = sized(tmp_path / "only", real, config)
    for run in range(5):
        whole, part = (models.platoon("manoeuvres", lib=lib).batch(200, ("controller2:bias:1@150",), loss=0.1).trace(run) for lib in (library(real), only))
        for key, values in whole.items():
            assert np.asarray(values).tobytes() == np.asarray(part[key]).tobytes(), key


def test_a_model_of_another_size_is_refused(models: Models, tmp_path: Path) -> None:
    """A size alone, one more than the model has."""
    made = models.design()
    sizes = [(name, int(size)) for name, size in re.findall(r"^#define (HG_ONLY_\w+) (\d+)U$", emit_config(made), re.MULTILINE)]
    assert len(sizes) == 10
    for name, size in sizes:
        if name in ("HG_ONLY_GROUP_SIGNALS", "HG_ONLY_HISTORY", "HG_ONLY_ORDER"):
            other = sized(tmp_path / name, "f32", f"#define {name} {size + 1}U\n")
            with pytest.raises(InputError, match=f"status {other.lib.HG_E_CONFIG}"):
                Node(Native(other, made.tables), REST)
