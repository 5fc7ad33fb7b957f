"""Polynomial filter: its tables and the library's step against an expansion by plain polynomial arithmetic, moments, sizes, and the acceptance numbers of its study."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import pytest
from host_support import SEED
from hullguard.campaign import polynomial_study as study
from hullguard.core.library import library
from hullguard.core.polynomial import Levels, Node
from hullguard.design import polynomial as design
from hullguard.errors import InputError
from hullguard.model.table import Array

QUICK = 100  # runs
MARGIN = 7  # seed of limits with little margin: 300 runs of this one, of 1001 and of 2002 meet them (make polynomial-study), 100 of any other need not


def hold(checks: Iterable[study.Check]) -> None:
    """All of them, with what each found."""
    found = list(checks)
    assert found
    assert all(c.passed for c in found), "\n" + "\n".join(str(c) for c in found)


# ---- an independent filter: expansions by polynomial arithmetic, expectations term by term ----


def truncated(q: design.Polynomial, degree: int) -> design.Polynomial:
    return design.Polynomial(q.size, {m: c for m, c in q.terms.items() if sum(m) <= degree})


def composed(q: design.Polynomial, arguments: Sequence[design.Polynomial], degree: int) -> design.Polynomial:
    found = arguments[0] * 0.0
    for m, c in q.terms.items():
        term = arguments[0] * 0.0 + c
        for argument, e in zip(arguments, m, strict=True):
            for _ in range(e):
                term = truncated(term * argument, degree)
        found = found + term
    return found


class Reference:
    """The plain form of the method, 2.2 and 2.3, in float64."""

    def __init__(self, plant: design.Plant, mu: int) -> None:
        self.plant, self.mu, n = plant, mu, plant.states
        self.X, self.Y = design.monomials(n, mu), design.monomials(plant.outputs, mu)[1:]
        self.c, self.Pe = np.array(plant.x0), np.diag(plant.P0)
        prior = [design.normal(math.sqrt(v)) for v in plant.P0]
        self.M = np.array([[math.prod(d.moment(i + j) for d, i, j in zip(prior, a, b, strict=True)) for b in self.X] for a in self.X])
        self.z, self.P = self.M[0, 1:].copy(), self.M[1:, 1:] - np.outer(self.M[0, 1:], self.M[0, 1:])

    def power(self, rows: Sequence[design.Polynomial], m: Sequence[int]) -> design.Polynomial:
        return composed(design.Polynomial(len(rows), {tuple(m): 1.0}), rows, self.mu)

    def split(self, q: design.Polynomial) -> dict[tuple[int, ...], Array]:
        """Monomial of the noise to coefficients of [1; X]."""
        n = self.plant.states
        found: dict[tuple[int, ...], Array] = {}
        for m, c in q.terms.items():
            found.setdefault(m[n:], np.zeros(len(self.X)))[self.X.index(m[:n])] += c
        return found

    def mean(self, *b: Sequence[int]) -> float:
        return math.prod(d.moment(sum(e)) for d, *e in zip((*self.plant.w, *self.plant.v), *b, strict=True))

    def step(self, y: Array) -> tuple[Array, Array]:
        plant, mu, n, p = self.plant, self.mu, self.plant.states, self.plant.outputs
        v = design.variables(2 * n + p)
        at = [float(c) for c in self.c]
        heights = [composed(h, [v[i] + at[i] for i in range(n)], mu) for h in plant.h]
        eta = y - np.array([h(at) for h in plant.h])
        H = [q - h(at) + v[2 * n + j] for j, (q, h) in enumerate(zip(heights, plant.h, strict=True))]
        H1 = np.array([[q.terms.get(tuple(int(k == i) for k in range(2 * n + p)), 0.0) for i in range(n)] for q in H])
        Se = H1 @ self.Pe @ H1.T + np.diag([d.moment(2) for d in plant.v])
        L = self.Pe @ H1.T @ np.linalg.inv(Se)
        there = self.c + L @ eta
        moved = []
        for i in range(n):
            q = v[i] + float(there[i])
            for j in range(p):
                q = q - H[j] * float(L[i, j])
            moved.append(q)
        after = np.array([f(there) for f in plant.f])
        F = [composed(f, moved, mu) - float(after[i]) + v[n + i] for i, f in enumerate(plant.f)]
        gradient = np.array([[q.terms.get(tuple(int(k == i) for k in range(2 * n + p)), 0.0) for i in range(2 * n + p)] for q in F])
        noise = np.diag([d.moment(2) for d in (*plant.w, *plant.v)])
        parts = [self.split(self.power(F, m)) for m in self.X[1:]] + [self.split(self.power(H, m)) for m in self.Y]
        linear = np.array([sum(self.mean(b) * q for b, q in part.items()) for part in parts])
        size, N = len(parts), len(self.X) - 1
        cov = np.zeros((size, size))
        for i, j in np.ndindex(size, size):
            cov[i, j] = sum((self.mean(b, d) - self.mean(b) * self.mean(d)) * (q @ self.M @ r) for b, q in parts[i].items() for d, r in parts[j].items())
        A, U = linear[:, 1:], linear[:, 0]
        J = A @ self.P @ A.T + cov
        S = J[N:, N:]
        r = np.array([math.prod(e**k for e, k in zip(eta, m, strict=True)) for m in self.Y]) - A[N:] @ self.z - U[N:]
        Kf, K = self.P @ A[N:].T @ np.linalg.inv(S), J[:N, N:] @ np.linalg.inv(S)
        estimate, spread = self.c + (self.z + Kf @ r)[:n], (self.P - Kf @ S @ Kf.T)[:n, :n]
        self.z, self.P = A[:N] @ self.z + U[:N] + K @ r, J[:N, :N] - K @ S @ K.T
        full = linear[:N] @ self.M @ linear[:N].T + cov[:N, :N]
        mean = linear[:N] @ self.M[:, 0]
        self.M = np.block([[np.ones((1, 1)), mean[None]], [mean[:, None], full]])
        self.Pe = gradient[:, :n] @ self.Pe @ gradient[:, :n].T + gradient[:, n:] @ noise @ gradient[:, n:].T
        self.c = after
        return estimate, spread


def two_outputs() -> design.Plant:
    x1, x2 = design.variables(2)
    rng = np.random.default_rng(SEED)
    a, b, c, d = rng.uniform(-0.1, 0.1, 4)
    f = (0.9 * x1 + 0.1 * x2 + float(a) * x1 * x2, 0.8 * x2 - float(b) * x1**3 + 0.1)
    h = (x1 + float(c) * x2**2, x2 + float(d) * x1 * x2)
    return design.Plant(f, h, (design.exponential(0.1), design.uniform(0.2)), (design.exponential(0.2), design.normal(0.3)), (0.1, 0.2), (0.04, 0.09))


@pytest.mark.parametrize(("degree", "samples"), [(1, 20), (2, 12), (3, 3)])
def test_the_library_does_what_polynomial_arithmetic_says(degree: int, samples: int) -> None:
    made = two_outputs()
    reference, node = Reference(made, degree), Node(library("f64"), design.make(made, degree))
    narrow = Node(library("f32"), design.make(made, degree))
    rng = np.random.default_rng(SEED)
    for _ in range(samples):
        y = rng.normal(0.0, 0.5, 2)
        estimate, spread = reference.step(y)
        assert node.step(y) == library("f64").lib.HG_OK
        assert narrow.step(y) == library("f32").lib.HG_OK
        np.testing.assert_allclose(node.vector("x"), estimate, atol=1e-9)
        np.testing.assert_allclose(node.matrix("Px"), spread, atol=1e-9)
        np.testing.assert_allclose(narrow.vector("x"), estimate, atol=2e-4)


# ---- design ----


def test_moments_are_those_of_what_is_drawn() -> None:
    rng = np.random.default_rng(SEED)
    drawn = {
        design.normal(0.7): 0.7 * rng.standard_normal(300_000),
        design.exponential(0.7): 0.7 * (rng.exponential(1.0, 300_000) - 1.0),
        design.uniform(0.7): rng.uniform(-0.7, 0.7, 300_000),
        design.atoms((-0.7, 0.3), (0.3, 0.7)): rng.choice((-0.7, 0.3), 300_000, p=(0.3, 0.7)),
        design.laplace(0.7): rng.laplace(0.0, 0.7 / 2.0**0.5, 300_000),
        design.student(0.7, 9.0): 0.7 * (7.0 / 9.0) ** 0.5 * rng.standard_t(9.0, 300_000),
        design.contaminated(1.0, 0.1, 3.0): rng.standard_normal(300_000) * rng.choice((1.0, 3.0), 300_000, p=(0.9, 0.1)) / 1.8**0.5,
    }
    for noise, x in drawn.items():
        for order in range(5):
            assert noise.moment(order) == pytest.approx(np.mean(x**order), abs=6.0 * np.std(x**order) / 300_000**0.5 + 1e-12)
    measured = design.samples((1.0, 2.0, 6.0))
    assert [measured.moment(k) for k in (1, 2, 3)] == pytest.approx([0.0, 14.0 / 3.0, 6.0])


def test_other_functions_come_in_by_taylor_and_their_remainder_is_bounded() -> None:
    x, y = design.variables(2)
    rng = np.random.default_rng(SEED)
    for order in (1, 2, 3, 5):
        taylor = design.expand([math.sin(0.3 + k * math.pi / 2) for k in range(order + 1)], x + 2.0 * y, 0.3)
        worst = 0.0
        for a, b in rng.uniform(-0.1, 0.1, (200, 2)):
            worst = max(worst, abs(taylor((0.3 + a - 2.0 * b, b)) - math.sin(0.3 + a)))
        bound = design.cut(1.0, 0.1, order)
        assert 0.01 * bound < worst <= bound
        assert taylor.degree == order


def test_a_filter_that_does_not_fit_is_refused_with_what_would() -> None:
    plant = study.suspension("exp")
    assert design.make(plant, 2, ram=1244).reals == 311
    with pytest.raises(InputError, match=r"takes 4220 bytes; what fits: degree 2 \(1244 bytes\), degree 1 bounded"):
        design.make(plant, 3, ram=1300)
    assert design.reals(20, 5, 3, True) is None
    x = design.variables(20)
    large = design.Plant(x, x[:5], (design.normal(1.0),) * 20, (design.normal(1.0),) * 5, (0.0,) * 20, (1.0,) * 20)
    with pytest.raises(InputError, match="more than the library can index"):
        design.make(large, 3)


# n, mu, p: bytes in float32 by the method's table of sizes (2.6, reduced), which counts states, covariances, [A; C] and gains of the lifted filter.
SIZES = {(2, 2, 1): 560, (2, 3, 1): 1600, (4, 2, 1): 3000, (4, 2, 3): 4700, (4, 3, 1): 15900, (4, 3, 3): 24600, (5, 2, 3): 7900, (5, 3, 3): 52000}


@pytest.mark.parametrize("shape", SIZES)
def test_memory_is_that_of_the_method(shape: tuple[int, int, int]) -> None:
    """Beside what the table counts: the auxiliary filter, and the powers of the polynomials, which the gains need all at once."""
    n, mu, p = shape
    rows, ring = design.count(n, mu) - 1 + design.count(p, mu) - 1, design.count(2 * n + p, mu)
    auxiliary = 2 * n * n + 3 * n + n * p + 4 * p  # x, Px, ekf, c, Pe, L; mean, eta, radius, width
    found = design.reals(n, p, mu, False)
    assert found is not None
    assert 4 * (found - rows * ring - auxiliary) <= 1.05 * SIZES[shape]


def test_what_cannot_be_designed_is_refused_in_one_line() -> None:
    x = design.variables(2)
    good = study.suspension("exp")
    for attempt in (
        lambda: design.make(good, 4),
        lambda: design.atoms((0.0, 1.0), (0.5, 0.5)),
        lambda: design.samples((1.0,)),
        lambda: design.student(1.0, 2.0),
        lambda: design.student(1.0, 5.0).moment(6),
        lambda: design.contaminated(1.0, 1.0, 3.0),
        lambda: x[0] + design.variables(3)[0],
        lambda: design.Plant(good.f, good.h, good.w[:1], good.v, good.x0, good.P0),
        lambda: design.Plant(good.f, good.h, good.w, (design.normal(0.0),), good.x0, good.P0),
        lambda: design.Plant(design.variables(3)[:2], good.h, good.w, good.v, good.x0, good.P0),
        lambda: design.Plant((), good.h, (), good.v, (), ()),
        lambda: Node(library("f64"), design.make(good, 2), Levels(kappa=0.0)),
    ):
        with pytest.raises(InputError) as error:
            attempt()
        assert "\n" not in str(error.value)


# ---- the study ----


def test_linear_and_normal_is_the_kalman_filter() -> None:
    hold(study.linear(study.Study(30, SEED)))


def test_errors_beside_the_extended_kalman_filter() -> None:
    hold(study.errors(study.Study(QUICK, MARGIN)))


def test_the_bound_holds_on_average() -> None:
    hold(study.bounds(study.Study(2 * QUICK, MARGIN)))


def test_abrupt_faults_are_seen_and_false_alarms_are_rare() -> None:
    hold(study.detection(study.Study(QUICK, SEED)))


def test_false_alarms_are_as_rare_as_promised_whatever_the_noise() -> None:
    hold(study.promises(study.Study(QUICK // 5, MARGIN)))


def test_silence_is_worth_its_radius() -> None:
    hold(study.events(study.Study(QUICK, SEED)))


def test_float32_is_as_good_as_float64() -> None:
    hold(study.precision(study.Study(30, SEED)))
