"""Constant tables of the polynomial filter (methods, polynomial; firmware: polynomial.h).

A plant is x+ = f(x) + w, y = h(x) + v with f and h polynomials; `variables` makes them by plain Python arithmetic, `expand` puts the Taylor polynomial of any other
function in, about a fixed point, and `cut` bounds what that leaves out. The filter expands f and h itself about where it is, in every sample.

Monomials are tuples of exponents, in graded order: by degree, then the larger exponent of the first variable that differs first.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from hullguard.core.library import library
from hullguard.errors import InputError

if TYPE_CHECKING:
    from hullguard.model.table import Array  # model files need this module to be read

Exponents = tuple[int, ...]

DEGREE_MAX = 3
NONE = 255  # HG_POLYNOMIAL_NONE
TOO_LARGE = 2**32 - 1  # what hg_polynomial_reals() answers where the tables' indices do not suffice
BYTES = {"f32": 4, "f64": 8}


def count(variables: int, degree: int) -> int:
    """Monomials of so many variables up to a degree."""
    return math.comb(variables + degree, degree)


def monomials(variables: int, degree: int) -> list[Exponents]:
    """All of them up to a degree, in graded order."""
    found: list[Exponents] = []
    for total in range(degree + 1):
        for chosen in itertools.combinations_with_replacement(range(variables), total):
            found.append(tuple(chosen.count(i) for i in range(variables)))
    return found


@dataclass(frozen=True)
class Polynomial:
    """A polynomial in `size` variables: exponents to coefficient. Adds, subtracts, multiplies, and takes whole powers."""

    size: int
    terms: dict[Exponents, float]

    def __add__(self, other: Polynomial | float) -> Polynomial:
        right = self._of(other)
        found = dict(self.terms)
        for m, c in right.terms.items():
            found[m] = found.get(m, 0.0) + c
        return Polynomial(self.size, {m: c for m, c in found.items() if c != 0.0})

    def __mul__(self, other: Polynomial | float) -> Polynomial:
        right = self._of(other)
        found: dict[Exponents, float] = {}
        for (a, x), (b, y) in itertools.product(self.terms.items(), right.terms.items()):
            m = tuple(i + j for i, j in zip(a, b, strict=True))
            found[m] = found.get(m, 0.0) + x * y
        return Polynomial(self.size, {m: c for m, c in found.items() if c != 0.0})

    def __neg__(self) -> Polynomial:
        return self * -1.0

    def __sub__(self, other: Polynomial | float) -> Polynomial:
        return self + self._of(other) * -1.0

    def __rsub__(self, other: float) -> Polynomial:
        return self._of(other) - self

    def __truediv__(self, other: float) -> Polynomial:
        return self * (1.0 / other)

    def __pow__(self, exponent: int) -> Polynomial:
        found = self._of(1.0)
        for _ in range(exponent):
            found = found * self
        return found

    __radd__ = __add__
    __rmul__ = __mul__

    def _of(self, other: Polynomial | float) -> Polynomial:
        if isinstance(other, Polynomial):
            if other.size != self.size:
                raise InputError(f"polynomial: {self.size} variables here and {other.size} there; make all of a plant's with one call of variables()")
            return other
        return Polynomial(self.size, {(0,) * self.size: float(other)} if other else {})

    def __call__(self, x: Sequence[float] | Array) -> float:
        """Its value at x [size]."""
        return float(sum(c * math.prod(float(v) ** e for v, e in zip(x, m, strict=True)) for m, c in self.terms.items()))

    @property
    def degree(self) -> int:
        """Of its highest term."""
        return max((sum(m) for m in self.terms), default=0)


def variables(size: int) -> tuple[Polynomial, ...]:
    """The variables x_0 .. x_(size - 1) as polynomials."""
    return tuple(Polynomial(size, {tuple(int(i == j) for j in range(size)): 1.0}) for i in range(size))


def expand(derivatives: Sequence[float], argument: Polynomial, centre: float) -> Polynomial:
    """Taylor polynomial of g(argument) about g(centre): derivatives are g, g', g'', .. there."""
    found = argument * 0.0
    for k, value in enumerate(derivatives):
        found = found + (argument - centre) ** k * (value / math.factorial(k))
    return found


def cut(bound: float, reach: float, order: int) -> float:
    """Largest error of `expand` with `order` derivatives beyond the value, |argument - centre| <= reach, |next derivative| <= bound there (Lagrange)."""
    return bound * reach ** (order + 1) / math.factorial(order + 1)


@dataclass(frozen=True)
class Noise:
    """A distribution without mean.

    kind: normal, exponential (scale times (Exp(1) - 1)), uniform (+-scale), atoms (values with weights), laplace, student (values: degrees of freedom), contaminated (normal;
    values: share of the numbers that are wider, and how many times).
    """

    kind: str
    scale: float = 0.0
    values: tuple[float, ...] = ()
    weights: tuple[float, ...] = ()

    def moment(self, order: int) -> float:
        """E w^order."""
        if self.kind == "normal":
            return 0.0 if order % 2 else float(self.scale**order) * math.prod(range(1, order, 2))
        if self.kind == "exponential":  # subfactorials
            return float(self.scale**order) * sum((-1 if i % 2 else 1) * math.factorial(order) // math.factorial(i) for i in range(order + 1))
        if self.kind == "uniform":
            return 0.0 if order % 2 else float(self.scale**order) / (order + 1)
        if self.kind in SYMMETRIC:
            return 0.0 if order % 2 else float(self.scale**order) * SYMMETRIC[self.kind](self.values, order)
        return float(sum(p * float(v**order) for v, p in zip(self.values, self.weights, strict=True)))

    def scaled(self, factor: float) -> Noise:
        """In another unit."""
        values = tuple(v * factor for v in self.values) if self.kind == "atoms" else self.values
        return replace(self, scale=self.scale * factor, values=values)


def _student(values: tuple[float, ...], order: int) -> float:
    freedom = values[0]
    if order >= freedom:
        raise InputError(f"polynomial: Student's t with {freedom:g} degrees of freedom has no moment of order {order}; take more, a lower degree, or no bound")
    return math.prod(freedom * (k - 1) / (freedom - k) for k in range(2, order + 1, 2))


def _contaminated(values: tuple[float, ...], order: int) -> float:
    share, ratio = values
    return (1.0 - share + share * float(ratio**order)) * math.prod(range(1, order, 2))


# Even moments of scale 1.
SYMMETRIC: dict[str, Callable[[tuple[float, ...], int], float]] = {
    "laplace": lambda _, order: float(math.factorial(order)),
    "student": _student,
    "contaminated": _contaminated,
}


def laplace(deviation: float) -> Noise:
    """Double exponential with this standard deviation."""
    return Noise("laplace", deviation / math.sqrt(2.0))


def student(deviation: float, freedom: float) -> Noise:
    """Student's t with this standard deviation: heavy tails, no moments from `freedom` on."""
    if freedom <= 2.0:
        raise InputError(f"polynomial: Student's t with {freedom:g} degrees of freedom has no variance; take more than 2")
    return Noise("student", deviation * math.sqrt((freedom - 2.0) / freedom), (freedom,))


def contaminated(deviation: float, share: float, ratio: float) -> Noise:
    """Normal, but for a share of the numbers, which are `ratio` times as wide; this standard deviation in all."""
    if not 0.0 < share < 1.0 or ratio <= 0.0:
        raise InputError(f"polynomial: contaminated noise with a share of {share:g} and a ratio of {ratio:g}; the share is within 0 .. 1, the ratio above 0")
    return Noise("contaminated", deviation / math.sqrt(1.0 - share + share * ratio**2), (share, ratio))


def normal(deviation: float) -> Noise:
    """Normal with this standard deviation."""
    return Noise("normal", deviation)


def exponential(deviation: float) -> Noise:
    """Exponential, its mean taken off; skewness 2."""
    return Noise("exponential", deviation)


def uniform(half: float) -> Noise:
    """Uniform within +-half."""
    return Noise("uniform", half)


def two_point(deviation: float, probability: float) -> Noise:
    """Two values, the upper one with this probability."""
    other = 1.0 - probability
    spread = deviation / math.sqrt(probability * other)
    return Noise("atoms", 0.0, (-probability * spread, other * spread), (other, probability))


def atoms(values: Sequence[float], weights: Sequence[float]) -> Noise:
    """Few values with their probabilities."""
    total, mean = sum(weights), sum(v * p for v, p in zip(values, weights, strict=True))
    if min(weights) < 0.0 or abs(total - 1.0) > 1e-9 or abs(mean) > 1e-9 * max(map(abs, values)):
        raise InputError(f"polynomial: noise with probabilities that add up to {total:g} and mean {mean:g}; they must be 1 and 0: put the mean into the plant")
    return Noise("atoms", 0.0, tuple(map(float, values)), tuple(map(float, weights)))


def samples(drawn: Sequence[float] | Array) -> Noise:
    """As measured, each value as likely as it was; their mean is taken off."""
    x = np.asarray(drawn, dtype=float)
    if x.size < 2 or not np.all(np.isfinite(x)):
        raise InputError("polynomial: moments of noise need two or more finite samples")
    return Noise("atoms", 0.0, tuple(map(float, x - x.mean())), (1.0 / x.size,) * x.size)


@dataclass(frozen=True)
class Plant:
    """x+ = f(x) + w, y = h(x) + v; before the first sample x is normal with mean x0 [n] and variances P0 [n]."""

    f: tuple[Polynomial, ...]
    h: tuple[Polynomial, ...]
    w: tuple[Noise, ...]
    v: tuple[Noise, ...]
    x0: tuple[float, ...]
    P0: tuple[float, ...]

    def __post_init__(self) -> None:
        n, p = len(self.f), len(self.h)
        if not n or not p:
            raise InputError("polynomial: a plant needs a state and an output")
        if (len(self.w), len(self.v), len(self.x0), len(self.P0)) != (n, p, n, n):
            raise InputError(f"polynomial: {n} states and {p} outputs want as many noises w and v, and x0 and P0 of {n}")
        if any(q.size != n for q in (*self.f, *self.h)):
            raise InputError(f"polynomial: f and h must be polynomials in all {n} states; make them with variables({n})")
        if min(v.moment(2) for v in self.v) <= 0.0:
            raise InputError("polynomial: a sensor without noise; give every sensor a standard deviation above 0")

    @property
    def states(self) -> int:
        """Number of states n."""
        return len(self.f)

    @property
    def outputs(self) -> int:
        """Number of outputs p."""
        return len(self.h)


@dataclass(frozen=True)
class Map:
    """hg_polynomial_map."""

    width: int
    end: tuple[int, ...]
    coefficient: tuple[float, ...]
    factor: tuple[int, ...]


@dataclass(frozen=True)
class Tables:
    """What hg_polynomial_config holds of a plant and a degree; arrays as they are there."""

    plant: Plant
    degree: int
    bounded: bool
    f: Map
    h: Map
    start: tuple[int, ...]
    product: tuple[int, ...]
    parent: tuple[int, ...]
    factor: tuple[int, ...]
    noise: tuple[int, ...]
    moment: tuple[int, ...]
    mean: tuple[float, ...]
    covariance: Array  # [noises, noises]
    cut_moment: tuple[int, ...]
    cut_state: tuple[int, ...]
    cut_scale: tuple[float, ...]
    M0: Array  # [lifted + 1, lifted + 1]
    reals: int  # numbers of RAM
    sizes: dict[str, int] = field(default_factory=dict)  # lifted, measured, judged, noises, ring, lower

    @property
    def flash(self) -> int:
        """Bytes of the tables in float32, without the plant's own terms."""
        words = 2 * (len(self.start) + len(self.product))
        numbers = 4 * (len(self.mean) + self.covariance.size + len(self.cut_scale) + self.M0.size)
        return words + numbers + 2 * len(self.parent) + 2 * len(self.noise) + 2 * len(self.cut_moment)


def reals(states: int, outputs: int, degree: int, bounded: bool) -> int | None:
    """Numbers of RAM a filter takes (the library says); None: its indices do not suffice."""
    if not (1 <= states < NONE and 1 <= outputs < NONE and 1 <= degree <= DEGREE_MAX):
        return None
    found = int(library("f32").lib.hg_polynomial_reals(states, outputs, degree, bounded))
    return None if found == TOO_LARGE else found


def fitting(states: int, outputs: int, ram: int, real: str = "f32") -> list[tuple[int, bool, int]]:
    """(degree, bounded, bytes) of all filters that fit into so many bytes, the largest first."""
    found = []
    for degree, bounded in itertools.product(range(1, DEGREE_MAX + 1), (False, True)):
        size = reals(states, outputs, degree, bounded)
        if size is not None and size * BYTES[real] <= ram:
            found.append((degree, bounded, size * BYTES[real]))
    return sorted(found, key=lambda f: -f[2])


def _map(rows: Iterable[Polynomial]) -> Map:
    end, coefficient, factors = [], [], []
    for row in rows:
        for m, c in sorted(row.terms.items(), key=lambda t: (sum(t[0]), [-e for e in t[0]])):
            coefficient.append(c)
            factors.append([i for i, e in enumerate(m) for _ in range(e)])
        end.append(len(coefficient))
    width = max(1, *map(len, factors)) if factors else 1
    return Map(width, tuple(end), tuple(coefficient), tuple(i for f in factors for i in (*f, *(NONE,) * (width - len(f)))))


def _powers(order: list[Exponents], size: int) -> tuple[list[int], list[int]]:
    """Each monomial but 1 as one before it times a variable, both counted from 0 without the 1; for the variables themselves what is not read."""
    place = {m: i for i, m in enumerate(order)}
    parent, factor = [], []
    for m in order[1:]:
        variable = next(i for i in range(size) if m[i])
        less = tuple(e - (i == variable) for i, e in enumerate(m))
        parent.append(max(place[less] - 1, 0))
        factor.append(variable)
    return parent, factor


def _products(order: list[Exponents], degree: int) -> tuple[list[int], list[int]]:
    """start, product: the ring's multiplication."""
    place = {m: i for i, m in enumerate(order)}
    size = len(order[0])
    start, product = [0], list[int]()
    for a in order:
        partners = order[: count(size, degree - sum(a))]
        product.extend(place[tuple(map(sum, zip(a, b, strict=True)))] for b in partners)
        start.append(len(product))
    return start, product


def _cuts(order: list[Exponents], lower: int, place: dict[Exponents, int], mu: int, noise: Sequence[Noise]) -> tuple[list[int], list[int], list[float]]:
    """Monomials of degree mu + 1 as xi^g' of degree <= mu, at most one more state, and sqrt(E nu^2b): by Cauchy and Schwarz (2.2, step 3)."""
    n = len(next(iter(place)))
    moment, state, scale = [], [], []
    for m in order[lower:]:
        inner, left = [0] * n, mu
        for i in range(n):
            inner[i] = min(m[i], left)
            left -= inner[i]
        over = [i for i in range(n) if m[i] > inner[i]]
        moment.append(place[tuple(inner)])
        state.append(over[0] if over else NONE)
        scale.append(math.sqrt(math.prod(d.moment(2 * e) for d, e in zip(noise, m[n:], strict=True))))
    return moment, state, scale


def make(plant: Plant, degree: int, bounded: bool = False, ram: int | None = None, real: str = "f32") -> Tables:
    """Tables of a filter of degree mu = 1, 2, 3; ram: refused when it takes more bytes of the number type `real`."""
    n, p = plant.states, plant.outputs
    if not 1 <= degree <= DEGREE_MAX:
        raise InputError(f"polynomial: degree {degree}; choose 1 .. {DEGREE_MAX}")
    size = reals(n, p, degree, bounded)
    limit = math.inf if ram is None else ram
    if size is None or size * BYTES[real] > limit:
        found = [f"degree {d}{' bounded' if b else ''} ({u} bytes)" for d, b, u in fitting(n, p, 2**31 if ram is None else ram, real)]
        takes = "more than the library can index" if size is None else f"{size * BYTES[real]} bytes"
        raise InputError(f"polynomial: degree {degree}{' bounded' if bounded else ''} with {n} states and {p} outputs takes {takes}; what fits: {', '.join(found) or 'nothing'}")
    return _tables(plant, degree, bounded, size)


def _tables(plant: Plant, mu: int, bounded: bool, size: int) -> Tables:
    n, p = plant.states, plant.outputs
    drive = (*plant.w, *plant.v)
    states, outputs, noises = monomials(n, mu), monomials(p, mu), monomials(n + p, mu)
    ring = monomials(2 * n + p, mu + 1 if bounded else mu)
    lower = count(2 * n + p, mu)
    place, noise_place = {m: i for i, m in enumerate(states)}, {m: i for i, m in enumerate(noises)}

    def mean(b: Sequence[int]) -> float:
        return math.prod(d.moment(e) for d, e in zip(drive, b, strict=True))

    def prior(a: Sequence[int]) -> float:
        return math.prod(Noise("normal", math.sqrt(v)).moment(e) for v, e in zip(plant.P0, a, strict=True))

    def joint(a: Exponents, b: Exponents) -> list[int]:
        return [i + j for i, j in zip(a, b, strict=True)]

    start, product = _products(ring, mu + 1 if bounded else mu)
    powers = [_powers(states, n), _powers(outputs, p)]
    cut_moment, cut_state, cut_scale = _cuts(ring, lower, place, mu, drive)
    return Tables(
        plant,
        mu,
        bounded,
        _map(plant.f),
        _map(plant.h),
        tuple(start),
        tuple(product),
        tuple(i for parent, _ in powers for i in parent),
        tuple(i for _, factor in powers for i in factor),
        tuple(noise_place[m[n:]] for m in ring[:lower]),
        tuple(place[m[:n]] for m in ring[:lower]),
        tuple(mean(b) for b in noises),
        np.array([[mean(joint(a, b)) - mean(a) * mean(b) for b in noises] for a in noises]),
        tuple(cut_moment),
        tuple(cut_state),
        tuple(cut_scale),
        np.array([[prior(joint(a, b)) for b in states] for a in states]),
        size,
        {"lifted": len(states) - 1, "measured": len(outputs) - 1, "judged": count(p, min(mu, 2)) - 1, "noises": len(noises), "ring": len(ring), "lower": lower},
    )
