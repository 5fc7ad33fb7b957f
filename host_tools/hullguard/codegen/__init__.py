"""Files made from a design: C tables for the ECU and a DBC for every other CAN tool."""

from __future__ import annotations

from pathlib import Path

from hullguard.codegen.c import emit_c
from hullguard.codegen.config import emit_config
from hullguard.codegen.dbc import emit_dbc
from hullguard.codegen.uio import emit_uio
from hullguard.design.design import Design

__all__ = ["emit_c", "emit_config", "emit_dbc", "emit_uio", "write_all"]


def write_all(design: Design, out_dir: Path) -> tuple[Path, ...]:
    """Write NAME.h, NAME.c, NAME_config.h and NAME.dbc, and of unknown-input observers NAME_uio.h and NAME_uio.c.

    A file that already holds the same bytes is left alone, so that nothing is rebuilt for it.
    Returns the files that changed.
    """
    name = design.tables.name
    header, source = emit_c(design)
    changed = []
    out_dir.mkdir(parents=True, exist_ok=True)
    files = [(".h", header), (".c", source), ("_config.h", emit_config(design)), (".dbc", emit_dbc(design))]
    if design.uios:
        files += zip(("_uio.h", "_uio.c"), emit_uio(design), strict=True)
    for suffix, text in files:
        path, data = out_dir / (name + suffix), text.encode("ascii")
        if not path.is_file() or path.read_bytes() != data:
            path.write_bytes(data)
            changed.append(path)
    return tuple(changed)
