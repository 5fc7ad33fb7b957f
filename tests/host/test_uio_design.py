"""The unknown-input observer against the published one, and against what it promises; suspension, sections 1.1 to 1.5."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from host_support import SEED, Cli
from hullguard.design import uio_sensors
from hullguard.design.design import design
from hullguard.design.uio import Unknown, augment, explain, free_poles, gains, invariant_zeros, observable_part, observer, obstacle
from hullguard.design.uio_discrete import between_samples, check_euler, discretised, estimator, first_order_hold, left_inverse, measured, sampled
from hullguard.design.uio_sensors import without_feedthrough
from hullguard.errors import InputError
from hullguard.model import load_model
from hullguard.model.table import Array
from uio_support import C_PRINTED, HALF, PRINTED, driven, known, published, quarter_car, rough, sensors

FIXED = -2 * 160000.0 / 276.0  # -2 k1 / (m1 + m2), whichever mass is which


def off(found: Array, printed: Array) -> float:
    """Largest difference as a share of the matrix' largest entry."""
    return float(np.abs(found - printed).max() / np.abs(found).max())


# ---- what is printed, and what is wrong with it ----


def test_plant_H_and_T_are_as_printed() -> None:
    """Acceptance (a): H and T."""
    A, B, _ = quarter_car(240.0, 36.0)
    made = gains(published(), PRINTED["K1"])
    assert off(A, PRINTED["A"][:4, :4]) < 1e-4
    assert off(B, PRINTED["B"][:4]) < 1e-2  # 1/240 is printed as 0.0042
    assert off(made.H, PRINTED["H"]) < 1e-3 and off(made.T, PRINTED["T"]) < 1e-3


def test_F_K2_and_K_follow_from_the_printed_K1_with_the_true_A1() -> None:
    """Acceptance (a): F and K."""
    made = gains(published(), PRINTED["K1"])
    for name, found in (("F", made.F), ("K2", made.K2), ("K", made.K)):
        assert off(found, PRINTED[name]) < 1e-3, name


def test_the_printed_A1_is_the_formula_without_a_transpose() -> None:
    """Acceptance (a): the erratum."""
    p = published()
    CG = p.C @ p.G
    without = p.A - p.G @ np.linalg.inv(CG.T @ CG) @ CG @ p.C @ p.A
    assert off(without, PRINTED["A1"]) < 1e-3
    true = gains(p, PRINTED["K1"]).A1
    assert off(true, PRINTED["A1"]) > 1.0
    # The printed claim of complete observability is made on that matrix, and so was the placement.
    assert observable_part(without, p.C).shape[1] == 5 and observable_part(true, p.C).shape[1] == 3
    assert np.trace(PRINTED["A1"] - PRINTED["K1"] @ p.C) == pytest.approx(PRINTED["poles"].sum(), rel=1e-2)


def test_poles_of_the_printed_observer_are_not_the_requested_ones() -> None:
    made = gains(published(), PRINTED["K1"])
    assert sorted(made.fixed.real) == pytest.approx([FIXED, -1.0], rel=1e-6)
    assert sorted(np.linalg.eigvals(made.F).real) == pytest.approx([-3440.63, FIXED, -2.1557, -1.0, -1.0], rel=1e-4)
    assert not np.allclose(sorted(np.linalg.eigvals(made.F).real), sorted(PRINTED["poles"]), rtol=0.1)


def test_printed_gains_by_forward_euler_at_one_kilohertz_are_refused() -> None:
    """Acceptance (g)."""
    with pytest.raises(InputError, match=r"forward Euler with 0\.001 s grows by .* sample every 0\.000581 s or faster, or use the first-order hold"):
        check_euler(PRINTED["F"], 1e-3, "printed")
    check_euler(PRINTED["F"], 5.8e-4, "printed")
    F, z = PRINTED["F"], np.full(5, 1e-3)
    for _ in range(200):
        z = z + 1e-3 * F @ z
    assert np.abs(z).max() > 1e50
    recomputed = observer(published(), [-10, -20, -20])
    check_euler(recomputed.F, 1.725e-3, "recomputed")


def test_first_order_hold_of_the_printed_gains_is_stable_at_any_sample_time() -> None:
    for period in (1e-4, 1e-3, 1e-2, 0.1, 1.0):
        assert np.abs(np.linalg.eigvals(first_order_hold(PRINTED["F"], PRINTED["K"], period)[0])).max() < 1.0


def test_the_road_is_known_after_four_seconds_with_the_printed_matrices() -> None:
    """Acceptance (f)."""
    plant, p = quarter_car(240.0, 36.0), published()
    printed = replace(gains(p, PRINTED["K1"]), **{name: PRINTED[name] for name in ("H", "T", "F", "K")})
    t, x = driven(plant, 1e-3, 4.5, road=lambda t: 0.02 * 2 * np.pi * np.cos(2 * np.pi * t))
    d = discretised(printed, 1e-3)
    y = x @ C_PRINTED.T
    z, states = np.array([0.05, 0.5, 0.02, 0.5, 0.05]), []
    for k in range(len(t)):
        states.append(z + d.H @ y[k])
        if k + 1 < len(t):
            z = d.Fd @ z + d.K0 @ y[k] + d.K1d @ y[k + 1]
    e = np.array(states)
    found = (e[1:] - e[:-1] @ d.Ad.T) @ d.P.T
    wrong = np.abs(found[:, 1] - 0.02 * 2 * np.pi * np.cos(2 * np.pi * (t[:-1] + 5e-4)))
    assert wrong[4000] <= 2e-3  # of 0.126
    assert wrong[1000] > 1e-2  # and no earlier: the fixed pole at -1 sets the pace


# ---- the observer ----


@pytest.mark.parametrize(("wheel", "body"), [(36.0, 240.0), (240.0, 36.0)])
def test_poles_are_the_fixed_ones_and_the_chosen_ones(wheel: float, body: float) -> None:
    """Acceptance (b) and (c)."""
    p = augment(known(C_PRINTED, wheel, body), [2], [0.0])
    assert free_poles(p) == 3
    made = observer(p, [-10.0, -20.0, -25.0])
    assert sorted(np.linalg.eigvals(made.F).real) == pytest.approx([FIXED, -25.0, -20.0, -10.0, -1.0], rel=1e-6)
    assert np.abs(p.C @ made.A1).max() < 1e-9
    assert np.abs(made.K - made.A1 @ made.H).max() < 1e-9
    assert np.abs(made.TB).max() < 1e-12 and np.abs(made.T @ p.G).max() < 1e-12


def test_gain_of_the_corrected_masses() -> None:
    made = observer(augment(known(C_PRINTED), [2], [0.0]), [-10, -20, -20])
    H = [[0, 0, 0], [0, -0.130435, 0], [2, 1.73913, 0], [0, 0.869565, 0], [0, 0, 1]]
    K = [[0, -1, 0], [-1159.420, -1008.061, 0], [-2318.841, -2016.122, 0], [-1159.420, -1009.061, 0], [0, 0, 0]]
    assert np.allclose(made.H, H, atol=1e-6) and np.allclose(made.K, K, atol=1e-3)


def random_plant(rng: np.random.Generator) -> tuple[Unknown, int]:
    """A random plant that has an observer, now and then with a hidden motion of its own; and how many motions are hidden."""
    n, q = int(rng.integers(3, 8)), int(rng.integers(1, 3))
    m = int(rng.integers(q, n + 1))
    A, G, C = rng.standard_normal((n, n)), rng.standard_normal((n, q)), rng.standard_normal((m, n))
    hidden = 0
    if m < n and rng.random() < 0.5:
        # A direction that C does not see and that [A, G] keeps: an invariant zero at a chosen place.
        v = scipy.linalg.null_space(C)[:, 0]
        A = A + np.outer((-rng.uniform(0.5, 3.0) * v + G @ rng.standard_normal(q)) - A @ v, v)
        hidden = 1
    B = rng.standard_normal((n, 1))
    return Unknown(A, B, C, G, tuple(f"x{i}" for i in range(n)), tuple(f"f{i}" for i in range(q)), tuple(f"y{i}" for i in range(m))), hidden


def test_random_plants() -> None:
    rng = np.random.default_rng(SEED)
    made_count = hidden_count = 0
    for _ in range(300):
        p, hidden = random_plant(rng)
        zeros = invariant_zeros(p)
        V = observable_part(observer_A1(p), p.C)
        fixed = np.linalg.eigvals(complement(V).T @ observer_A1(p) @ complement(V)) if V.shape[1] < len(p.A) else np.zeros(0)
        # The zeros of the pencil are the modes that no gain moves, found by two routes.
        # Far ones, nearly at infinity, are rounding by either route.
        near = [z for z in zeros if abs(z.value) < 1e3]
        assert len(near) == np.sum(np.abs(fixed) < 1e3)
        assert all(np.abs(fixed - z.value).min() < 1e-5 * (1 + abs(z.value)) for z in near)
        assert len(zeros) >= hidden
        for z in zeros:
            assert np.abs((p.A - z.value * np.eye(len(p.A))) @ z.state + p.G @ z.input).max() < 1e-6 * (1 + np.abs(z.input).max())
            assert np.abs(p.C @ z.state).max() < 1e-6
        stable = all(z.value.real < 0 for z in zeros)
        assert (obstacle(p) is None) == stable
        if stable:
            made = observer(p, list(-np.arange(1.0, V.shape[1] + 1)))
            assert np.abs(made.T @ p.G).max() < 1e-9 * max(1.0, np.abs(made.T).max())
            assert np.abs(made.T @ p.A - made.F @ made.T - made.K @ p.C).max() < 1e-8 * max(1.0, np.abs(made.K).max())
            assert np.linalg.eigvals(made.F).real.max() < 0
            made_count += 1
            hidden_count += hidden
    assert made_count > 50 and hidden_count > 10


def observer_A1(p: Unknown) -> Array:
    CG = p.C @ p.G
    return (np.eye(len(p.A)) - p.G @ np.linalg.pinv(CG) @ p.C) @ p.A


def complement(V: Array) -> Array:
    return np.asarray(scipy.linalg.null_space(V.T))


# ---- which sensors will do, and why not ----

WILL_DO = [("deflection", "tyre", "wheel"), ("deflection", "tyre", "body"), ("deflection", "tyre", "wheel", "body")]
WONT = {
    ("deflection", "tyre"): "rank CG is 1, of 2 unknown inputs: the rate of no output tells actuator",
    ("deflection", "wheel"): "rank CG is 1, of 2 unknown inputs: the rate of no output tells road",
    ("tyre", "wheel"): "zero at s = 0: a constant offset of deflection hides in the unknown actuator",
    ("tyre", "wheel", "body"): "zero at s = 0: a constant offset of deflection hides in the unknown actuator",
}


@pytest.mark.parametrize("names", WILL_DO)
def test_sensor_sets_that_do(names: tuple[str, ...]) -> None:
    p = sensors(*names)
    assert obstacle(p) is None and invariant_zeros(p) == [] and free_poles(p) == 4


@pytest.mark.parametrize("names", WONT)
def test_sensor_sets_that_do_not(names: tuple[str, ...]) -> None:
    with pytest.raises(InputError, match=f"no unknown-input observer with .*{WONT[names]}"):
        observer(sensors(*names), [-1, -2, -3, -4])


def test_faults_of_sensors() -> None:
    p = sensors("deflection", "tyre", "wheel", "body")
    reason = obstacle(augment(p, [0], [0.0]))
    assert reason == "zero at s = 0: a constant offset common to deflection and fault of deflection hides in the unknown actuator"
    for place in (2, 3):
        faulty = augment(p, [place], [0.0])
        assert obstacle(faulty) is None and invariant_zeros(faulty) == [] and free_poles(faulty) == 5
    assert "tells road and change of fault of tyre apart" in (obstacle(augment(p, [1], [0.0])) or "")
    with pytest.raises(InputError, match="a decay of -1 a second is a fault that grows by itself"):
        augment(p, [2], [-1.0])


def test_a_zero_in_words() -> None:
    said = [explain(z, published()) for z in invariant_zeros(published())]
    assert said == [
        "zero at s = -1159.42: a motion that dies out common to body, tyre and wheel hides in the unknown actuator and road",
        "zero at s = -1: a motion that dies out common to deflection and wheel hides in the unknown actuator",
    ]


def test_wrong_poles_are_refused() -> None:
    p = published()
    with pytest.raises(InputError, match=r"2 poles, 3 can be chosen; 2 are fixed, at .*-1"):
        observer(p, [-1, -2])
    with pytest.raises(InputError, match=r"a pole at 0 does not die out; choose it left of the imaginary axis"):
        observer(p, [0, -2, -3])
    with pytest.raises(InputError, match="these poles cannot be placed"):
        observer(sensors("deflection", "tyre", "wheel"), [-1, -1, -1, -1])
    with pytest.raises(InputError, match="act on the states in the same way"):
        A, B, G = quarter_car(36.0, 240.0)
        observer(Unknown(A, B, np.eye(4), np.hstack([G, G[:, :1]]), ("a", "b", "c", "d"), ("f", "road", "g"), ("a", "b", "c", "d")), [-1, -2, -3, -4])


# ---- discrete form ----


def run(p: Unknown, poles: list[complex], period_s: float, seconds: float, direct: bool) -> tuple[Array, Array]:
    """Errors of the reconstructed actuator fault and road, no initial error, on the road of section 1.5 with 200 N from 5 s on."""
    t, x = driven(quarter_car(36.0, 240.0), period_s, seconds, lambda t: 200.0 * (t >= 5.0), rough)
    faulty = augment(p, [2], [0.0]) if len(p.C) == 3 and not p.C[2].any() else p
    made = observer(sampled(faulty, period_s), np.exp(np.array(poles) * period_s)) if direct else observer(faulty, poles)
    d = discretised(made, period_s)
    y = x @ p.C.T
    z, states = np.zeros(len(faulty.A)), []
    for k in range(len(t)):
        states.append(z + d.H @ y[k])
        if k + 1 < len(t):
            z = d.Fd @ z + d.K0 @ y[k] + d.K1d @ y[k + 1]
    e = np.array(states)
    found = (e[1:] - e[:-1] @ d.Ad.T) @ d.P.T
    middle = t[:-1] + period_s / 2
    return found[:, 0] - 200.0 * (middle >= 5.0), found[:, 1] - np.array([rough(v) for v in middle])


@pytest.mark.parametrize("direct", [False, True])
def test_reconstruction_at_one_kilohertz(direct: bool) -> None:
    """Acceptance (d)."""
    force, road = run(known(C_PRINTED), [-10, -20, -20], 1e-3, 20.0, direct)
    assert np.sqrt(np.mean(force**2)) <= 2.0 and np.sqrt(np.mean(road**2)) <= 3e-3


def test_reconstruction_at_a_hundred_hertz() -> None:
    force, road = run(known(C_PRINTED), [-10, -20, -20], 1e-2, 20.0, False)
    assert np.sqrt(np.mean(force**2)) <= 3.0 and np.sqrt(np.mean(road**2)) <= 0.1


@pytest.mark.parametrize("period_s", [1e-3, 1e-2])
@pytest.mark.parametrize("direct", [False, True])
def test_the_estimator_is_the_recursion(period_s: float, direct: bool) -> None:
    """One linear system gives what observer, reconstruction and low pass give one after another."""
    rng = np.random.default_rng(SEED)
    p = augment(sensors("deflection", "tyre", "wheel", "body"), [2], [0.3])
    poles = np.array([-10.0, -12.0, -14.0, -16.0, -18.0])
    made = observer(sampled(p, period_s), np.exp(poles * period_s)) if direct else observer(p, poles)
    d, tau = discretised(made, period_s), 0.05
    e = estimator(d, 4, [0], [0], [1], tau)
    assert np.abs(d.P @ d.Gd - np.eye(3)).max() < 1e-9
    y, u, a = rng.standard_normal((50, 4)), rng.standard_normal((50, 1)), period_s / (tau + period_s)
    s, z = np.zeros(len(e.state)), d.K1d @ y[0]
    low_f, low_0, before = np.zeros(3), 0.0, np.zeros(5)
    for k in range(50):
        x = z + d.H @ y[k]
        move = x - d.Ad @ before - (d.Bd @ u[k - 1] if k else 0.0)
        low_f, low_0 = low_f + a * (d.P @ move - low_f), low_0 + a * (x[4] - low_0)
        before = x
        v = np.concatenate([y[k], u[k]])
        estimate, s = e.output @ s + e.direct @ v, e.state @ s + e.input @ v
        assert np.allclose(estimate, [low_f[0], low_0, low_f[1], *x[:4]], rtol=1e-7, atol=1e-7 * np.abs(low_f).max())
        if k + 1 < 50:
            z = d.Fd @ z + d.K0 @ y[k] + d.K1d @ y[k + 1] + d.Bz @ u[k]


def test_sensors_that_tell_every_state_are_an_observer() -> None:
    """C^-1 y, mixed rows of the states and in other units, with the low pass: what moves the state beyond the model, and nothing is remembered but that."""
    rng = np.random.default_rng(SEED)
    for _ in range(20):
        period_s, tau, C = float(rng.choice([1e-3, 1e-2])), float(rng.choice([0.0, 0.2])), rng.standard_normal((4, 4)) + 3.0 * np.eye(4)
        p = known(C)
        d = measured(p, period_s)
        e, a = estimator(d, 4, [0], [], [1], tau), period_s / (tau + period_s)
        assert len(e.state) == 2 and obstacle(p) is None
        Ad, BG = sampled(p, period_s).A, np.hstack([sampled(p, period_s).B, sampled(p, period_s).G])
        x, s, low = rng.standard_normal(4), np.zeros(2), np.zeros(2)
        before = a * (d.P @ x)  # what a start out of nothing seems to have moved
        for _ in range(60):
            u, f = rng.standard_normal(1), rng.standard_normal(2)
            v = np.concatenate([C @ x, u])
            estimate, s = e.output @ s + e.direct @ v, e.state @ s + e.input @ v
            rounding = 1e-15 * np.linalg.cond(C) * np.linalg.norm(d.P) * np.linalg.norm(x)  # of the states, times what makes disturbances of them
            assert np.allclose(estimate, [*(low + before), *x], rtol=1e-6, atol=10.0 * rounding)
            x, low, before = Ad @ x + BG @ np.concatenate([u, f]), low + a * (f - low), (1 - a) * before


def test_what_lies_between_samples_is_bounded() -> None:
    """An unknown input that moves as fast as it may, in the direction that does most, reaches the bound and never exceeds it."""
    A, _, G = quarter_car(36.0, 240.0)
    follows = np.vstack([np.eye(4), np.random.default_rng(SEED).standard_normal((2, 4))])
    for period_s in (1e-3, 1e-2, 0.05):
        bound = between_samples(A, G[:, 1], follows, period_s, 50.0)
        fine, total = period_s / 4000, np.zeros(6)
        step = scipy.linalg.expm(A * fine)
        x = scipy.linalg.expm(A * fine / 2) @ G[:, 1]
        for i in range(4000):
            total += np.abs(follows @ x) * abs((i + 0.5) * fine - period_s / 2) * fine
            x = step @ x
        assert np.all(total * 50.0 <= bound) and np.all(bound <= 1.4 * 50.0 * total + 1e-9)


def test_left_inverse() -> None:
    rng = np.random.default_rng(SEED)
    G = rng.standard_normal((5, 2))
    for weight in (None, rng.uniform(1e-3, 1.0, 5)):
        assert np.abs(left_inverse(G, weight) @ G - np.eye(2)).max() < 1e-9


# ---- the table of sensor sets ----


def test_accelerometers_and_deflection_leave_a_zero_at_the_origin() -> None:
    """Body and wheel acceleration contain forces at once; what is left of them is the tyre, and a common offset of both velocities hides in the road."""
    A, B, G = quarter_car(36.0, 240.0)
    C = np.vstack([np.eye(4)[0], A[1], A[3]])
    E = np.vstack([np.zeros(2), G[1], G[3]])
    raw = Unknown(A, B, C, G, ("deflection", "body", "tyre", "wheel"), ("actuator", "road"), ("deflection", "body acceleration", "wheel acceleration"))
    reason = obstacle(without_feedthrough(raw, E))
    assert reason == "zero at s = 0: a constant offset common to body and wheel hides in the unknown road"
    # One velocity more takes it away.
    more = replace(raw, C=np.vstack([C, np.eye(4)[3]]), outputs=(*raw.outputs, "wheel"))
    assert obstacle(without_feedthrough(more, np.vstack([E, np.zeros(2)]))) is None
    # Without feedthrough nothing changes.
    assert without_feedthrough(sensors("deflection", "tyre", "wheel"), np.zeros((3, 2))).A is not None
    # The balance of the two accelerations is the tyre's compression: neither force nor spring nor damper is in it.
    balance = 36.0 * A[3] + 240.0 * A[1]
    assert np.allclose(balance, [0, 0, -160000.0, 0]) and abs(36.0 * G[3, 0] + 240.0 * G[1, 0]) < 1e-12


def test_zeros_with_feedthrough_are_those_of_the_whole_pencil() -> None:
    rng = np.random.default_rng(SEED)
    found = 0
    for _ in range(100):
        n, q, m = 5, 2, 3
        p = Unknown(rng.standard_normal((n, n)), np.zeros((n, 1)), rng.standard_normal((m, n)), rng.standard_normal((n, q)), tuple("abcde"), ("f", "g"), tuple("xyz"))
        v, w = rng.standard_normal(n), rng.standard_normal(q)
        s, E = -rng.uniform(0.5, 2.0), np.outer(rng.standard_normal(m), rng.standard_normal(q))
        p = replace(p, A=p.A - np.outer(p.A @ v - s * v + p.G @ w, v) / (v @ v), C=p.C - np.outer(p.C @ v + E @ w, v) / (v @ v))
        values = [z.value for z in invariant_zeros(without_feedthrough(p, E))]
        found += any(abs(z - s) < 1e-6 for z in values)
    assert found == 100


def test_table_of_sensor_sets() -> None:
    model = load_model("suspension")
    rows = uio_sensors.as_json(model)["sensor_sets"]
    by = {(r["observer"], tuple(r["sensors"]), tuple(r["unknown"])): r["why_not"] for r in rows}
    every = ("deflection1_m", "tyre1_m", "wheel1_mps", "body1_mps")
    assert by[1, every, ("actuator1", "road1_mps")] is None
    assert by[1, every[1:], ("actuator1", "road1_mps")] == "zero at s = 0: a constant offset of deflection1_m hides in the unknown actuator1"
    assert by[1, (every[0], *every[2:]), ("actuator1", "road1_mps")].startswith("rank CG is 1, of 2 unknown inputs: the rate of no output tells road1_mps")
    assert by[1, every[:3], ("actuator1", "road1_mps")] is None
    assert by[1, every, ("actuator1", "road1_mps", "wheel1_sensor")] is None
    hidden = "zero at s = 0: a constant offset common to deflection1_m and fault of deflection1_m hides in the unknown actuator1"
    assert by[1, every, ("actuator1", "road1_mps", "deflection1_sensor")] == hidden
    assert "apart" in by[1, every, ("actuator1", "road1_mps", "tyre1_sensor")]
    words = uio_sensors.component_words(model)
    assert words["tyre1"].startswith("not observable") and words["spring1"].startswith("shows as a fault of force1_n")


def test_a_half_car_needs_the_same_of_each_corner() -> None:
    model = load_model("suspension", HALF)
    every = tuple(model.signals[i].name for i in model.outputs)
    unknown = ("actuator1", "actuator2", "road1_mps", "road2_mps")
    by = {(tuple(r["sensors"]), tuple(r["unknown"])): r["why_not"] for r in uio_sensors.as_json(model)["sensor_sets"] if r["observer"] == 1}
    assert by[every, unknown] is None
    for corner in (1, 2):
        less = {n: by[tuple(x for x in every if x != f"{n}{corner}_{unit}"), unknown] for n, unit in (("deflection", "m"), ("tyre", "m"), ("wheel", "mps"), ("body", "mps"))}
        assert less["deflection"] == f"zero at s = 0: a constant offset of deflection{corner}_m hides in the unknown actuator{corner}"
        assert str(less["tyre"]).startswith(f"rank CG is 3, of 4 unknown inputs: the rate of no output tells road{corner}_mps")
        assert less["wheel"] is None and less["body"] is None
        assert uio_sensors.component_words(model)[f"tyre{corner}"].startswith("not observable")


def test_any_set_of_sensors_can_be_asked_about(cli: Cli, tmp_path: Path) -> None:
    accelerations = "deflection1_m,rate:body1_mps,rate:wheel1_mps"
    done = cli("design", "suspension", "--out", tmp_path, "--sensors", accelerations, "--sensors", f"{accelerations},wheel1_mps", "--json")
    assert done.status == 0, done.err
    assert [r["why_not"] for r in done.json["asked"]] == ["zero at s = 0: a constant offset common to body1_mps and wheel1_mps hides in the unknown road1_mps", None]
    assert f"sensors {accelerations.replace(',', ', ')}: no unknown-input observer: zero at s = 0" in done.err
    for model, sensors, said in (("suspension", "speed", "'speed' is none of deflection1_m, .*rate:wheel1_mps"), ("platoon", "gap12_m", "--sensors is for kind")):
        wrong = cli("design", model, "--out", tmp_path, "--sensors", sensors)
        assert wrong.status == 2 and re.search(said, wrong.err) and wrong.err.count("\n") == 1


def test_a_model_that_asks_for_the_impossible_is_refused_with_the_reason() -> None:
    hidden = {"detector.uio.1.faults": ["actuator1", "deflection1_sensor"]}
    with pytest.raises(InputError, match=r"detector\.uio\[1\]: no unknown-input observer with .*: zero at s = 0: a constant offset common to deflection1_m and fault of deflection1_m"):
        design(load_model("suspension", hidden))
    with pytest.raises(InputError, match=r"detector\.uio\[0\]: .*rank CG is 1"):
        design(load_model("suspension", {"detector.uio.0.outputs": ["deflection1_m", "wheel1_mps"]}))


def test_leaky_integration_is_as_wrong_as_its_bound_says() -> None:
    """From -height to +height after long rest reaches it, offset against the step; nothing exceeds it."""
    leak, height, offset, period = 0.5, 0.05, 0.01, 1e-3
    bound = uio_sensors.leaky_integration_error(leak, height, offset)
    t = np.arange(0.0, 60.0, period)
    rng = np.random.default_rng(SEED)
    wave = sum(np.sin(2 * np.pi * f * t + p) for f, p in zip(rng.uniform(0.02, 3.0, 9), rng.uniform(0, 6, 9), strict=True))
    worst = -np.ones_like(t)
    worst[(t > 39.9) & (t <= 40.0)] = np.linspace(-1, 1, int(np.sum((t > 39.9) & (t <= 40.0))))
    worst[t > 40.0] = 1.0
    reached = []
    for course in (worst, np.asarray(wave) / np.abs(wave).max()):
        velocity = np.gradient(height * course, period)
        found, v = np.zeros_like(t), velocity[0]
        for k in range(len(t) - 1):
            v = np.exp(-leak * period) * v + (velocity[k + 1] - velocity[k]) - offset * period
            found[k + 1] = v
        wrong = np.abs(velocity - found)[t > 30.0].max()
        assert wrong <= bound * 1.001
        reached.append(wrong)
    assert reached[0] >= 0.9 * bound
    assert uio_sensors.leaky_integration_error(0.03, 0.05, 6e-5) == pytest.approx(0.005)  # the noise of suspension.toml
