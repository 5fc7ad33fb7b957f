"""Functions of a plant as a model file writes them, as programs for a stack, and what is known of them near a point.

One program serves three readers: the emulator in C runs it as it stands, SymPy takes it for Taylor polynomials, and intervals bound what these cut off.
"""

from __future__ import annotations

import ast
import itertools
import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from hullguard.errors import InputError
from hullguard.model.table import LARGEST

CONSTANT, VARIABLE, ADD, SUBTRACT, MULTIPLY, DIVIDE, POWER, NEGATE = range(8)
FUNCTIONS = ("sin", "cos", "tan", "atan", "exp", "log", "sqrt", "tanh")  # operations from FIRST on
FIRST = 8
DEPTH_MAX = 64  # HGH_STACK
CELLS = 256  # of a box, about
_OF_TWO: dict[int, Callable[[Any, Any], Any]] = {
    ADD: operator.add,
    SUBTRACT: operator.sub,
    MULTIPLY: operator.mul,
    DIVIDE: operator.truediv,
    POWER: operator.pow,
}
_BINARY: dict[type[ast.operator], int] = {ast.Add: ADD, ast.Sub: SUBTRACT, ast.Mult: MULTIPLY, ast.Div: DIVIDE, ast.Pow: POWER}


@dataclass(frozen=True)
class Program:
    """An expression in reverse Polish order: (operation, place of its constant or variable)."""

    code: tuple[tuple[int, int], ...]
    constants: tuple[float, ...]


def compiled(text: str, names: Sequence[str], parameters: dict[str, float], where: str) -> Program:
    """A program of an expression in the named variables; parameters are constants in it."""
    try:
        tree = ast.parse(text, mode="eval")
    except (SyntaxError, ValueError) as error:
        raise InputError(f"{where}: '{text}' is no expression ({error})") from error
    except (RecursionError, MemoryError) as error:
        raise _too_deep(where) from error
    code: list[tuple[int, int]] = []
    constants: list[float] = []

    def constant(value: float) -> None:
        if abs(value) > LARGEST:  # an integer of any size, or what 1e999 is read as
            raise InputError(f"{where}: a number beyond {LARGEST:g}; choose other units")
        code.append((CONSTANT, len(constants)))
        constants.append(float(value))

    def walk(node: ast.expr) -> None:
        if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
            constant(node.value)
        elif isinstance(node, ast.Name) and node.id in names:
            code.append((VARIABLE, list(names).index(node.id)))
        elif isinstance(node, ast.Name) and node.id in parameters:
            constant(parameters[node.id])
        elif isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
            walk(node.left)
            walk(node.right)
            code.append((_BINARY[type(node.op)], 0))
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            walk(node.operand)
            code.extend([(NEGATE, 0)] * isinstance(node.op, ast.USub))
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS and len(node.args) == 1 and not node.keywords:
            walk(node.args[0])
            code.append((FIRST + FUNCTIONS.index(node.func.id), 0))
        else:
            known = ", ".join([*names, *parameters])
            raise InputError(f"{where}: '{ast.unparse(node)}' is none of + - * / **, numbers, {', '.join(FUNCTIONS)} and {known}")

    try:
        walk(tree.body)
    except RecursionError as error:
        raise _too_deep(where) from error
    if _depth(code) > DEPTH_MAX:
        raise _too_deep(where)
    return Program(tuple(code), tuple(constants))


def _too_deep(where: str) -> InputError:
    return InputError(f"{where}: nested more deeply than {DEPTH_MAX}; write it as a sum of simpler terms")


def of_terms(terms: Sequence[tuple[float, Sequence[int]]]) -> Program:
    """A program of a polynomial: coefficients with the exponents of all variables."""
    code, constants = [(CONSTANT, 0)], [0.0]
    for coefficient, exponents in terms:
        code.append((CONSTANT, len(constants)))
        constants.append(float(coefficient))
        for variable, power in enumerate(exponents):
            code += [(VARIABLE, variable), (MULTIPLY, 0)] * power
        code.append((ADD, 0))
    return Program(tuple(code), tuple(constants))


def _depth(code: Sequence[tuple[int, int]]) -> int:
    depth = most = 0
    for op, _ in code:
        depth += 1 if op <= VARIABLE else -1 if op <= POWER else 0
        most = max(most, depth)
    return most


def evaluated(program: Program, variables: Sequence[Any], functions: Callable[[str, Any], Any], number: Callable[[float], Any] = float) -> Any:
    """Its value over whatever the variables are."""
    stack: list[Any] = []
    for op, place in program.code:
        if op == CONSTANT:
            stack.append(number(program.constants[place]))
        elif op == VARIABLE:
            stack.append(variables[place])
        elif op == NEGATE:
            stack.append(-stack.pop())
        elif op >= FIRST:
            stack.append(functions(FUNCTIONS[op - FIRST], stack.pop()))
        else:
            right, left = stack.pop(), stack.pop()
            stack.append(_OF_TWO[op](left, right))
    return stack[0]


def value_of(program: Program, variables: Sequence[float]) -> float:
    """At a point."""
    return float(evaluated(program, [float(v) for v in variables], lambda name, x: getattr(math, name)(x)))


@dataclass(frozen=True)
class Expansion:
    """What is known of a function of the states and inputs near a point."""

    terms: dict[tuple[int, ...], float]  # Taylor coefficients by exponents of (x - point)
    input: tuple[float, ...]  # what each input adds a unit
    remainder: float  # largest error of the terms on the box


def expanded(
    program: Program, point: Sequence[float], inputs: Sequence[float], orders: Sequence[tuple[int, ...]], box: Sequence[float], where: str, names: Sequence[str]
) -> Expansion:
    """Taylor polynomial with the exponents `orders` (all up to a degree), about a state and an input; inputs must enter linearly and alone."""
    import sympy

    x, u = [sympy.Symbol(f"x{i}", real=True) for i in range(len(point))], [sympy.Symbol(f"u{i}", real=True) for i in range(len(inputs))]
    whole = evaluated(program, [*x, *u], lambda name, a: getattr(sympy, name)(a), _exact)
    gains = []
    for symbol, name in zip(u, names, strict=True):
        gain = sympy.expand(sympy.diff(whole, symbol))
        if gain.free_symbols:
            raise InputError(f"{where}: input '{name}' must enter linearly and apart from the states; give it a first-order lag of its own as a state")
        gains.append(float(gain))
    own = whole.subs(dict(zip(u, map(_exact, inputs), strict=True)))
    at = dict(zip(x, map(_exact, point), strict=True))
    degree = max(map(sum, orders))
    found, left = {}, 0.0
    higher = [tuple(chosen.count(i) for i in range(len(x))) for chosen in itertools.combinations_with_replacement(range(len(x)), degree + 1)]
    for exponents in (*orders, *higher):
        derivative = sympy.diff(own, *itertools.chain.from_iterable(zip(x, exponents, strict=True))) if any(exponents) else own
        factorials = math.prod(math.factorial(e) for e in exponents)
        if sum(exponents) <= degree:
            number = sympy.N(derivative.subs(at), 30)
            if not number.is_real or not number.is_finite:
                raise InputError(f"{where}: no finite Taylor coefficient at the operating point; choose another one")
            if number != 0:
                found[exponents] = float(number) / factorials
        elif derivative != 0:
            reach = math.prod(b**e for b, e in zip(box, exponents, strict=True))
            left += _largest(derivative, x, point, box, where) / factorials * reach
    return Expansion(found, tuple(gains), left)


def _exact(value: float) -> Any:
    """A decimal number as what it was written as."""
    import sympy

    return sympy.Rational(repr(float(value)))


def _largest(expression: Any, symbols: Sequence[Any], point: Sequence[float], box: Sequence[float], where: str) -> float:
    """Largest magnitude on the box, from above: intervals over cells of it."""
    from mpmath import iv

    parts = max(1, round(CELLS ** (1.0 / len(symbols))))
    edges = [[c - b + 2.0 * b * k / parts for k in range(parts + 1)] for c, b in zip(point, box, strict=True)]
    most = 0.0
    for cell in itertools.product(range(parts), repeat=len(symbols)):
        ranges = {s: iv.mpf([e[k], e[k + 1]]) for s, e, k in zip(symbols, edges, cell, strict=True)}
        try:
            bound = abs(_interval(expression, ranges))
        except (ZeroDivisionError, ValueError, TypeError) as error:
            raise InputError(f"{where}: it has no finite derivatives everywhere on the box; make the box smaller") from error
        if not math.isfinite(float(bound.b)):
            raise InputError(f"{where}: it has no finite derivatives everywhere on the box; make the box smaller")
        most = max(most, float(bound.b))
    return most


def _interval(expression: Any, ranges: dict[Any, Any]) -> Any:
    """An expression over intervals."""
    import mpmath
    from mpmath import iv

    if expression.is_Symbol:
        return ranges[expression]
    if expression.is_Rational:
        return iv.mpf(int(expression.p)) / int(expression.q)
    parts = [_interval(a, ranges) for a in expression.args]
    if expression.is_Add:
        return sum(parts[1:], parts[0])
    if expression.is_Mul:
        return math.prod(parts[1:], start=parts[0])
    if expression.is_Pow:
        exponent = expression.args[1]
        if exponent.is_Integer:
            return parts[0] ** int(exponent)
        return iv.exp(parts[1] * iv.log(parts[0]))
    name = type(expression).__name__
    if name in ("sin", "cos", "exp", "log"):
        return getattr(iv, name)(parts[0])
    if name == "tan":
        return iv.sin(parts[0]) / iv.cos(parts[0])
    rising = getattr(mpmath, name)  # atan, tanh
    slack = 1e-12
    return iv.mpf([rising(mpmath.mpf(parts[0].a)) - slack, rising(mpmath.mpf(parts[0].b)) + slack])
