"""Plants that are made from a few parameters, in continuous time, and the names of their parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hullguard.model import builders_car
from hullguard.model.table import Array, Table

SIZE_MAX = 20  # vehicles or cars


@dataclass(frozen=True)
class Interval:
    """dx/dt = A x + B u with every entry known to within a bound: |A - its true value| <= A_pm, entry by entry, and B alike."""

    A: Array  # n x n
    B: Array  # n x p
    A_pm: Array  # n x n, not negative
    B_pm: Array  # n x p, not negative


@dataclass(frozen=True)
class Builder:
    """One kind of plant. `size` is the key of its number of vehicles; the functions take that number."""

    size: str
    make: Callable[[Table], Interval]
    states: Callable[[int], tuple[str, ...]]
    inputs: Callable[[int], tuple[str, ...]]
    families: Callable[[int], dict[str, list[dict[str, int]]]]  # what a template's `each` can name, with the values of its placeholders
    least: int = 2  # of its size
    unknown: Callable[[Table], Array] | None = None  # columns of inputs that nobody knows, n x q; with
    unknown_names: Callable[[int], tuple[str, ...]] = lambda size: ()
    components: tuple[str, ...] = ()  # parameters that can lose a share of themselves


def _gaps(count: int) -> list[dict[str, int]]:
    """Vehicle ahead and vehicle behind of every gap."""
    return [{"i": i, "j": i + 1} for i in range(1, count)]


def string_of_vehicles(table: Table) -> Interval:
    """A single-lane string (Levine and Athans 1966): speed deviations w_i and gap deviations g_(i,i+1); platoon, section 1.

    dw_i/dt = -drag w_i + u_i      dg_(i,i+1)/dt = w_i - w_(i+1)
    """
    vehicles = table.whole("vehicles", 2, SIZE_MAX)
    drag, pm = table.interval("drag_per_s", 0.0)
    n = 2 * vehicles - 1
    A, B, A_pm = np.zeros((n, n)), np.zeros((n, vehicles)), np.zeros((n, n))
    for i in range(vehicles):
        A[2 * i, 2 * i], A_pm[2 * i, 2 * i], B[2 * i, i] = -drag, pm, 1.0
        if i + 1 < vehicles:
            A[2 * i + 1, 2 * i], A[2 * i + 1, 2 * i + 2] = 1.0, -1.0
    return Interval(A, B, A_pm, np.zeros_like(B))


def _string_states(vehicles: int) -> tuple[str, ...]:
    names = [n for g in _gaps(vehicles) for n in (f"speed{g['i']}_mps", f"gap{g['i']}{g['j']}_m")]
    return (*names, f"speed{vehicles}_mps")


def car_following(table: Table) -> Interval:
    """Cars behind one another whose accelerations are measured: dv_i/dt = a_i, dg_i/dt = v_(i-1) - v_i; platoon, section 9."""
    cars = table.whole("cars", 2, SIZE_MAX)
    n = 2 * cars - 1
    A, B = np.zeros((n, n)), np.zeros((n, cars))
    B[0, 0] = 1.0
    for i in range(2, cars + 1):
        speed, gap, ahead = 2 * i - 3, 2 * i - 2, max(2 * i - 5, 0)
        B[speed, i - 1] = 1.0
        A[gap, ahead], A[gap, speed] = 1.0, -1.0
    return Interval(A, B, np.zeros_like(A), np.zeros_like(B))


def _car_states(cars: int) -> tuple[str, ...]:
    return ("speed1_mps", *(n for i in range(2, cars + 1) for n in (f"speed{i}_mps", f"gap{i}_m")))


def _each(count: int) -> list[dict[str, int]]:
    return [{"i": i} for i in range(1, count + 1)]


def _suspension(table: Table) -> Interval:
    A, B, _ = builders_car.suspension(table)
    return Interval(A, B, np.zeros_like(A), np.zeros_like(B))


BUILDERS = {
    "string_of_vehicles": Builder(
        "vehicles",
        string_of_vehicles,
        _string_states,
        lambda count: tuple(f"control{i}_mps2" for i in range(1, count + 1)),
        lambda count: {"vehicle": _each(count), "gap": _gaps(count)},
    ),
    "car_following": Builder(
        "cars",
        car_following,
        _car_states,
        lambda count: tuple(f"accel{i}_mps2" for i in range(1, count + 1)),
        lambda count: {"car": _each(count), "gap": _gaps(count)},
    ),
    "suspension": Builder(
        "corners",
        _suspension,
        builders_car.state_names,
        lambda corners: tuple(f"force{i}_n" for i in range(1, corners + 1)),
        lambda corners: {"corner": _each(corners)},
        least=1,
        unknown=lambda table: builders_car.suspension(table)[2],
        unknown_names=lambda corners: tuple(f"road{i}_mps" for i in range(1, corners + 1)),
        components=builders_car.COMPONENTS,
    ),
}
