"""Polynomial filters in NAME.c: their tables, and hg_statistic_config polynomial[]."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from hullguard.design.statistic import FILTER_NUMBERS, MapTable
from hullguard.design.tables import Tables

Emit = Callable[[str, str, str, Sequence[Sequence[str]], str], list[str]]  # table() of codegen/c.py
NONE = "HG_POLYNOMIAL_NONE"
GROUPS = (
    ("start", "product", "parent", "factor"),
    ("noise", "moment", "mean", "covariance"),
    ("cut_moment", "cut_state", "cut_scale"),
    ("box", "x0", "P0", "M0"),
    ("Q", "R", "range", "fresh"),
)  # of hg_polynomial_config, a line each
ABOUT = {
    "start": "where the products of each monomial begin",
    "product": "index of monomial i times monomial j at start[i] + j",
    "parent": "lifted and measured monomials: one before it",
    "factor": "and the variable that makes it of that",
    "noise": "ring monomials: part of the noise",
    "moment": "and part of the state's error",
    "mean": "means of the noise's monomials",
    "covariance": "their covariances",
    "cut_moment": "monomials cut off: part of the state's error,",
    "cut_state": "one more state,",
    "cut_scale": "and root of the noise's moment",
    "box": "the state's error is at most this",
    "x0": "initial state: mean,",
    "P0": "covariance,",
    "M0": "and moments of its powers",
    "Q": "variances of the plant's noise",
    "R": "variances of the sensors' noise",
    "range": "largest measurement",
    "fresh": "radius of a value that has just arrived",
    "gain": "filter units a signal unit",
    "zero": "value at which an input does nothing, signal units",
    "drive": "next state from inputs, filter units a signal unit",
    "direct": "measurements from inputs, filter units a signal unit",
    "known": "radius up to which an input is known, signal units",
}


def _square(values: Sequence[str]) -> list[Sequence[str]]:
    side = math.isqrt(len(values))
    return [values[i : i + side] for i in range(0, len(values), side)]


def _map_tables(m: MapTable, n: str, table: Emit, reals: Callable[[Sequence[float]], list[str]]) -> list[str]:
    lines = table("uint16_t", f"{n}_end", f"{len(m.end)}", [[f"{x}U" for x in m.end]], "where the terms of each row end")
    lines += table("hg_real", f"{n}_coefficient", f"{len(m.coefficient)}", [reals(m.coefficient)], "of the terms")
    rows = [[_place(x) for x in m.factor[i : i + m.width]] for i in range(0, len(m.factor), m.width)]
    return lines + table("uint8_t", f"{n}_factor", f"{len(rows)}][{m.width}", rows, "and the states that each is times")


def _place(x: int) -> str:
    return NONE if x == 255 else f"{x}U"


def statistic_tables(tables: Tables, signals: Sequence[str], table: Emit, reals: Callable[[Sequence[float]], list[str]]) -> list[str]:
    """Tables of every filter."""
    lines: list[str] = []
    for i, t in enumerate(tables.polynomials):
        n = f"polynomial{i + 1}"
        lines += [f"/* ---- Polynomial filter {i + 1}: degree {t.degree} of {', '.join(signals[k] for k in t.signal)} ---- */", ""]
        lines += _map_tables(t.f, f"{n}_f", table, reals) + _map_tables(t.h, f"{n}_h", table, reals)
        for name in ("start", "product"):
            lines += table("uint16_t", f"{n}_{name}", f"{len(getattr(t, name))}", [[f"{x}U" for x in getattr(t, name)]], ABOUT[name])
        for name in ("parent", "factor", "noise", "moment", "cut_moment", "cut_state"):
            lines += table("uint8_t", f"{n}_{name}", f"{len(getattr(t, name))}", [[_place(x) for x in getattr(t, name)]], ABOUT[name])
        for name in ("mean", "cut_scale", "box", "x0", "Q", "R", "range", "fresh", "gain", "zero", "known"):
            lines += table("hg_real", f"{n}_{name}", f"{len(getattr(t, name))}", [reals(getattr(t, name))], ABOUT[name])
        for name in ("covariance", "P0", "M0"):
            rows = _square(reals(getattr(t, name)))
            lines += table("hg_real", f"{n}_{name}", f"{len(rows)}][{len(rows)}", rows, ABOUT[name])
        for name, count in (("drive", t.states), ("direct", t.outputs)):
            lines += table("hg_real", f"{n}_{name}", f"{count}][{len(t.input)}", [reals(getattr(t, name))], ABOUT[name])
        lines += table("uint8_t", f"{n}_signal", f"{len(t.signal)}", [[f"{x}U" for x in t.signal]], "places of the signals it reads")
        lines += table("uint8_t", f"{n}_input", f"{len(t.input)}", [[f"{x}U" for x in t.input]], "places of the inputs: " + ", ".join(signals[k] for k in t.input))
    return lines


def _map_config(name: str, m: MapTable, n: str) -> str:
    return f".{name} = {{.width = {m.width}U, .end = {n}_{name}_end, .coefficient = {n}_{name}_coefficient, .factor = {n}_{name}_factor}}"


def statistic_configs(tables: Tables, real: Callable[[float], str]) -> list[str]:
    """The configurations; nothing for a model without filters."""
    if not tables.polynomials:
        return []
    lines = [f"/* polynomial [{len(tables.polynomials)}]: the polynomial filters */", "static const hg_statistic_config polynomial[] = {"]
    for i, t in enumerate(tables.polynomials):
        n = f"polynomial{i + 1}"
        tied = {name: f"{n}_{name}" if getattr(t, name) else "NULL" for name in (*ABOUT, "signal", "input")}
        lines += [
            f"    {{.filter = {{.states = {t.states}U, .outputs = {t.outputs}U, .degree = {t.degree}U, .bounded = {'true' if t.bounded else 'false'},",
            f"                .lifted = {t.lifted}U, .measured = {t.measured}U, .judged = {t.judged}U, .noises = {t.noises}U, .ring = {t.ring}U, .lower = {t.lower}U,",
            f"                {_map_config('f', t.f, n)},",
            f"                {_map_config('h', t.h, n)},",
        ]
        for group in GROUPS:
            lines.append("                " + ", ".join(f".{name} = {tied[name]}" for name in group) + ",")
        numbers = [f".{name} = {real(getattr(t, name))}" for name in FILTER_NUMBERS]
        lines += [f"                {', '.join(numbers[:2])},", f"                {', '.join(numbers[2:])}}},"]
        lines += [f"     .signal = {tied['signal']}, .gain = {tied['gain']}, .inputs = {len(t.input)}U, .input = {tied['input']}, .zero = {tied['zero']},"]
        lines.append(f"     .drive = {tied['drive']}, .direct = {tied['direct']}, .known = {tied['known']}, .settle = {t.settle}U}},")
    return [*lines, "};", ""]
