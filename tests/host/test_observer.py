"""Observer and post-filter on random plants, every order that exists, against their own defining equations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from host_support import SEED, Models
from hullguard.design.checks import all_pass, riccati
from hullguard.design.observer import ObserverMatrices, PostFilter, SubPlant, fused, gamma_of, parity_basis, post_filter, smallest_order
from hullguard.design.search import FaultPath, make, poles_from, smallest_faults

Array = np.ndarray[Any, np.dtype[np.float64]]
PLANTS = 200
KINDS = ("stable", "marginal", "unstable")


@dataclass(frozen=True)
class Case:
    """One generator of one plant."""

    plant: SubPlant
    kind: str
    order: int
    aware: bool
    observer: ObserverMatrices
    filter: PostFilter


def dynamics(rng: np.random.Generator, n: int, kind: str) -> Array:
    """Spectral radius 0.9, 1 or 1.3; marginal ones have an integrator, and a double integrator or an oscillator where there is room."""
    if kind != "marginal":
        A = rng.standard_normal((n, n))
        return np.asarray(A * (0.9 if kind == "stable" else 1.3) / np.abs(np.linalg.eigvals(A)).max())
    A = np.diag(rng.uniform(-0.9, 0.9, n))
    A[0, 0] = 1.0
    if n >= 3 and rng.random() < 0.5:
        w = rng.uniform(0.1, 3.0)
        A[1:3, 1:3] = [[np.cos(w), np.sin(w)], [-np.sin(w), np.cos(w)]]
    elif n >= 2:
        A[:2, :2] = [[1.0, 0.1], [0.0, 1.0]]
    turn = np.linalg.qr(rng.standard_normal((n, n)))[0]
    return np.asarray(turn @ A @ turn.T)


def plant_of(rng: np.random.Generator, i: int) -> SubPlant:
    """m = 1 .. n outputs, C = I among them, every other plant with D."""
    n, p = int(rng.integers(1, 6)), int(rng.integers(1, 4))
    m = int(rng.integers(1, n + 1))
    C = np.eye(n) if m == n and i % 2 else rng.standard_normal((m, n))
    D = rng.standard_normal((m, p)) if i // 3 % 2 else np.zeros((m, p))
    Ed, Fd = np.hstack([0.01 * np.eye(n), np.zeros((n, m))]), np.hstack([np.zeros((m, n)), 0.01 * np.eye(m)])
    return SubPlant(dynamics(rng, n, KINDS[i % 3]), rng.standard_normal((n, p)), C, D, Ed, Fd, np.full(m, 0.05), np.full(p, 0.01))


def cases() -> list[Case]:
    rng, made = np.random.default_rng(SEED), []
    for i in range(PLANTS):
        plant = plant_of(rng, i)
        m, n = plant.C.shape
        paths = [FaultPath(plant.B[:, j], np.concatenate([plant.D[:, j], np.zeros(plant.B.shape[1])])) for j in range(plant.B.shape[1])]
        for s in range(1, n + 3):
            basis = parity_basis(plant, s)
            if not basis.size:
                continue
            v = (rng.standard_normal(basis.shape[0]) @ basis).reshape(s + 1, m)
            gamma = gamma_of(poles_from(rng.standard_normal(s), -0.3, 0.8))
            aware = bool(rng.integers(0, 2))
            made.append(Case(plant, KINDS[i % 3], s, aware, *make(plant, v / np.linalg.norm(v), gamma, m, paths, aware)))
    return made


@pytest.fixture(scope="module")
def every() -> list[Case]:
    return cases()


def test_the_sample_holds_what_it_should(every: list[Case]) -> None:
    assert {c.kind for c in every} == set(KINDS)
    assert {np.sign(c.order - c.plant.A.shape[0]) for c in every} == {-1, 0, 1}
    assert any(np.array_equal(c.plant.C, np.eye(len(c.plant.A))) and len(c.plant.A) > 1 for c in every)
    assert any(c.plant.D.any() for c in every)
    assert any(np.iscomplex(np.linalg.eigvals(c.observer.G)).any() for c in every)
    assert {c.plant.C.shape[0] for c in every} >= {1, 2, 3, 4}
    assert len(every) > 3 * PLANTS


def test_every_order_that_should_exist_does(every: list[Case]) -> None:
    """(s + 1) m > n leaves a parity vector, whatever the plant; none is lost by a tolerance."""
    found = {(id(c.plant), c.order) for c in every}
    plants = {id(c.plant): c.plant for c in every}
    for key, plant in plants.items():
        m, n = plant.C.shape
        assert all(((key, s) in found) == ((s + 1) * m > n) for s in range(1, n + 3))


def test_the_luenberger_equations_hold_to_1e_9(every: list[Case]) -> None:
    for c in every:
        p, o = c.plant, c.observer
        gaps = [o.T @ p.A - o.G @ o.T - o.L @ p.C, o.T @ p.B - o.L @ p.D - o.H, o.V @ p.C - o.W @ o.T, o.V @ p.D - o.Qu]
        assert max(float(np.abs(g).max()) for g in gaps) <= 1e-9, (c.kind, p.C.shape, c.order)


def test_the_post_filter_is_all_pass_and_stable(every: list[Case]) -> None:
    for c in every:
        limit = 1e-9 if np.linalg.cond(c.filter.S) <= 1e3 else 1e-7
        where = (c.kind, c.plant.C.shape, c.order, c.aware)
        assert all_pass(c.observer, c.filter) <= limit, where
        residual, asymmetry, largest = riccati(c.observer, c.filter)
        assert (residual <= 1e-8, asymmetry <= 1e-12, largest < 1.0) == (True, True, True), (where, residual, asymmetry, largest)


def test_as_many_residuals_as_the_method_allows(every: list[Case]) -> None:
    """max(1, s - n + m) rows of W in general position, at most m are kept, all of them regular."""
    for c in every:
        m, n = c.plant.C.shape
        assert c.observer.W.shape[0] == min(m, max(1, c.order - n + m)), (c.kind, c.plant.C.shape, c.order)
        assert c.filter.regularised == 0.0


def test_residuals_do_not_depend_on_the_state_of_a_healthy_plant(every: list[Case]) -> None:
    """From z = T x on, without disturbance, r is 0 whatever u is: simulated, a few steps so that unstable plants stay small."""
    rng = np.random.default_rng(SEED + 1)
    for c in every[::7]:
        p = c.plant
        state, inputs, output, direct = fused(c.observer, c.filter)
        x: Array = np.asarray(rng.standard_normal(p.A.shape[0]))
        z: Array = np.asarray(c.observer.T @ x)
        scale = float(np.abs(output).max() * (1 + np.abs(z).max()) + np.abs(direct).max())
        for _ in range(20):
            u = rng.standard_normal(p.B.shape[1])
            v = np.concatenate([p.C @ x + p.D @ u, u])
            scale = max(scale, float(np.abs(output).max() * np.abs(z).max() + np.abs(direct).max() * np.abs(v).max()))
            assert np.abs(output @ z + direct @ v).max() <= 1e-9 * scale
            z, x = state @ z + inputs @ v, np.asarray(p.A @ x + p.B @ u)


def test_one_inverse_is_the_product_of_the_two_transfer_functions(models: Models) -> None:
    """all_pass() evaluates R G_rd in closed form; here R and G_rd are multiplied."""
    g = models.design().generators[0]
    o, f, eye = g.observer, g.filter, np.eye(g.observer.G.shape[0])
    for w in np.linspace(0.0, np.pi, 64):
        z = np.exp(1j * w)
        from_d = f.Fb + o.W @ np.linalg.solve(z * eye - o.G, f.Eb)
        R = f.Mo - f.Mo @ o.W @ np.linalg.solve(z * eye - o.G + f.Lo @ o.W, f.Lo)
        assert np.abs(np.linalg.svd(R @ from_d, compute_uv=False) - 1.0).max() <= 1e-9


def test_all_pass_sees_a_wrong_filter(every: list[Case]) -> None:
    c = every[-1]
    bent = PostFilter(c.filter.Lo * (1 + 1e-5), c.filter.Mo, c.filter.X, c.filter.S, c.filter.Eb, c.filter.Fb, 0.0)
    assert all_pass(c.observer, bent) > 1e-9


def test_fewer_disturbances_than_rows_keep_fewer_rows() -> None:
    """A post-filter for more rows than disturbances can move does not exist: W is cut to that rank instead of being regularised."""
    rng = np.random.default_rng(SEED + 2)
    A = dynamics(rng, 4, "stable")
    plant = SubPlant(A, rng.standard_normal((4, 1)), rng.standard_normal((3, 4)), np.zeros((3, 1)), rng.standard_normal((4, 1)), np.full((3, 1), 0.1), np.zeros(3), np.zeros(1))
    basis = parity_basis(plant, 5)
    v = (rng.standard_normal(basis.shape[0]) @ basis).reshape(6, 3)
    o, f = make(plant, v, gamma_of(np.full(5, 0.3)), 3, [FaultPath(plant.B[:, 0], np.zeros(4))], False)
    assert o.W.shape[0] == 1
    assert f.regularised == 0.0
    assert all_pass(o, f) <= 1e-9


def test_newton_from_nothing_finds_what_scipy_finds(monkeypatch: pytest.MonkeyPatch, models: Models) -> None:
    from hullguard.design import observer

    g = models.design().generators[0]
    o = g.observer

    def fails(*_: Array) -> Array:
        raise np.linalg.LinAlgError("Reordering failed")

    usual = post_filter(g.plant, o.G, o.L, o.H, o.T, o.W, o.V, o.Qu, True)
    monkeypatch.setattr(observer, "_riccati", fails)
    alone = post_filter(g.plant, o.G, o.L, o.H, o.T, o.W, o.V, o.Qu, True)
    assert np.abs(alone.Lo - usual.Lo).max() <= 1e-10 * np.abs(usual.Lo).max()
    assert np.abs(alone.Mo - usual.Mo).max() <= 1e-10 * np.abs(usual.Mo).max()


def test_poles_do_not_matter_behind_the_optimal_post_filter_unless_rows_are_left_out(models: Models) -> None:
    """G = G0 + gamma e_s' only feeds a residual back: whatever the poles, the post-filter makes the same r of it."""
    g = models.design().generators[0]
    rng, peaks = np.random.default_rng(SEED + 3), []
    path = [FaultPath(g.plant.B[:, j], np.zeros(6)) for j in range(3)]
    for poles in ([0.0] * 4, [0.3, 0.5, 0.8, 0.1], [0.5 + 0.3j, 0.5 - 0.3j, *rng.uniform(0, 0.9, 2)]):
        o, f = make(g.plant, g.observer.v, gamma_of(np.array(poles)), 2, path, True)
        peaks.append(smallest_faults(g.plant, o, f, path, g.radius))
    assert np.ptp(np.array(peaks), axis=0).max() <= 1e-9


def test_the_smallest_order_is_the_first_with_a_parity_vector(models: Models) -> None:
    plant = models.design().generators[0].plant
    assert smallest_order(plant, 9) == 1
