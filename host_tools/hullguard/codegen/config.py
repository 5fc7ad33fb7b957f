"""NAME_config.h: the options of config.h that give a library with what one model needs and no more."""

from __future__ import annotations

from hullguard.codegen.c import banner, limits, only, parts
from hullguard.design.design import Design


def emit_config(design: Design) -> str:
    """Text of NAME_config.h. The number type is left to who compiles."""
    tables = design.tables
    guard = f"HULLGUARD_MODEL_{tables.name.upper()}_CONFIG_H"
    lines = [
        *banner(design, "what it needs of the library, for HG_CONFIG_HEADER."),
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        *(f"#define {macro} {least}U" for macro, least in limits(tables)),
        *(f"#define {macro} {int(used)}" for macro, used in parts(design)),
        *(f"#define {macro} {size}U" for macro, size in only(design)),
        "",
        "#endif",
    ]
    return "\n".join(lines) + "\n"
