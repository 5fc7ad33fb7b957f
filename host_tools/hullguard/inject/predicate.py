"""Conditions on signals by name, for example abs(gap12_m) > 1 and speed1_mps < 3: comparisons, and, or, not, arithmetic, abs."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from typing import Any

from hullguard.errors import InputError

LENGTH_MAX = 400  # also what keeps a tree from being deeper than the interpreter's stack
_COMPARE: dict[type[ast.cmpop], Callable[[float, float], bool]] = {
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge, ast.Eq: operator.eq, ast.NotEq: operator.ne,
}  # fmt: skip
_ARITHMETIC: dict[type[ast.operator], Callable[[float, float], float]] = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv}


class Predicate:
    """A condition. `names`: the signals it looks at. False as long as one of them has no value."""

    def __init__(self, text: str) -> None:
        self.text = text
        if len(text) > LENGTH_MAX:
            raise InputError(f"condition '{text[:40]}..': {len(text)} characters, more than {LENGTH_MAX}; use several directives")
        try:
            self._tree = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError) as error:
            raise InputError(f"condition '{text}': not an expression; for example gap12_m > 1.0 and speed1_mps < 3") from error
        self.names = tuple(dict.fromkeys(self._check(self._tree, truth=True)))

    def _check(self, node: ast.AST, truth: bool) -> list[str]:
        """Names of a tree that has nothing in it but what evaluates; `truth`: a truth value is due here, not a number."""
        if isinstance(node, ast.BoolOp) and truth:
            return [n for v in node.values for n in self._check(v, True)]
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not) and truth:
            return self._check(node.operand, True)
        if isinstance(node, ast.Compare) and truth and all(type(op) in _COMPARE for op in node.ops):
            return [n for v in (node.left, *node.comparators) for n in self._check(v, False)]
        if not truth:
            return self._number(node)
        raise InputError(f"condition '{self.text}': '{ast.unparse(node)}' is no comparison; for example gap12_m > 1.0")

    def _number(self, node: ast.AST) -> list[str]:
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
            return []
        if isinstance(node, ast.Name):
            return [node.id]
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            return [f"{node.value.id}.{node.attr}"]
        if isinstance(node, ast.BinOp) and type(node.op) in _ARITHMETIC:
            return self._number(node.left) + self._number(node.right)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
            return self._number(node.operand)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "abs" and len(node.args) == 1 and not node.keywords:
            return self._number(node.args[0])
        raise InputError(f"condition '{self.text}': '{ast.unparse(node)}' is none of number, signal, + - * /, abs()")

    def holds(self, values: Mapping[str, float]) -> bool:
        """Whether it holds for the signals' values."""
        if any(math.isnan(values.get(n, math.nan)) for n in self.names):
            return False
        try:
            return bool(_evaluate(self._tree, values))
        except (ZeroDivisionError, OverflowError):
            return False


def _evaluate(node: Any, values: Mapping[str, float]) -> float:
    if isinstance(node, ast.BoolOp):
        return (all if isinstance(node.op, ast.And) else any)(_evaluate(v, values) for v in node.values)
    if isinstance(node, ast.Compare):
        sides = [_evaluate(v, values) for v in (node.left, *node.comparators)]
        return all(_COMPARE[type(op)](a, b) for op, a, b in zip(node.ops, sides, sides[1:], strict=False))
    if isinstance(node, ast.BinOp):
        return _ARITHMETIC[type(node.op)](_evaluate(node.left, values), _evaluate(node.right, values))
    if isinstance(node, ast.UnaryOp):
        inner = _evaluate(node.operand, values)
        return (not inner) if isinstance(node.op, ast.Not) else -inner if isinstance(node.op, ast.USub) else inner
    if isinstance(node, ast.Call):
        return abs(_evaluate(node.args[0], values))
    if isinstance(node, ast.Constant):
        return float(node.value)  # type: ignore[arg-type] # _check has let numbers through only
    return values[ast.unparse(node)]
