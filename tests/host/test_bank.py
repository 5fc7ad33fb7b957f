"""Certificate banks: no data within the bounds alarm, however they are chosen; faults are found nearly as early as any sound detector can."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from host_support import SEED, Models
from hullguard.campaign.tasks import Emulator
from hullguard.design.arith import nearest32
from hullguard.design.bank import (
    BankSpec,
    Training,
    alarm_delay,
    candidates,
    cases,
    collect,
    evaluate,
    first_alarms,
    make_bank,
    project,
    select,
    shortened,
    stored_weight,
    usual_scale,
)
from hullguard.design.bank_table import bank_table, moved
from hullguard.design.bank_types import BankTable, StoredBank
from hullguard.design.design import Design, usual_radius
from hullguard.design.limit import Explanation, first_unexplained
from hullguard.design.reach import largest
from hullguard.design.window import Varying, fault_response, window_form
from hullguard.errors import InputError
from hullguard.model.faults import FaultSpec
from hullguard.model.schema import Model, Reference
from hullguard.model.table import Array
from numpy.typing import NDArray
from window_support import random_designs, simulate

REST = Reference("rest", 0.0, 1)
SPEC = BankSpec(30, 8, (0, 1, 2), (REST,), runs=4, seed=SEED % 1000)
EVERY = 2**62  # seed of runs that no training has


@pytest.fixture(scope="module")
def platoon(models: Models) -> Design:
    return models.design()


@pytest.fixture(scope="module")
def bank(platoon: Design) -> StoredBank:
    return make_bank(platoon, SPEC)


def random_bank(rng: np.random.Generator, model: Model, window: int, count: int) -> StoredBank:
    """Certificates in random directions of the left null space of O, some of them sparse."""
    form = window_form(model.plant, window)
    duals = rng.standard_normal((count, *(window, model.plant.m)))
    duals[::2, : window // 3] = 0.0
    return StoredBank(window, candidates(model, form, duals, None), 0, None)


def in_single(table: BankTable, value: Array, radius: Array) -> tuple[Array, Array]:
    """r and J of one full window as an ECU adds them up, term by term in float32."""
    r, J = np.zeros(table.certificates, np.float32), np.array(table.bias, np.float32)
    widen = np.float32(table.widen)
    for lag, weights in enumerate(table.weight):
        v, b = value[-1 - lag].astype(np.float32), radius[-1 - lag].astype(np.float32)
        for place, column in zip(table.signal, weights, strict=True):
            w = np.array(column, np.float32)
            r += w * v[place]
            J += np.abs(w) * widen * b[place]
    return r.astype(np.float64), J.astype(np.float64)


def worst_window(design: Design, table: BankTable, certificate: int, sign: float, radius: Array) -> Array:
    """Held values of a healthy window, states, inputs, disturbances and errors at those ends of their bounds that move the certificate most."""
    model, plant = design.model, design.model.plant
    form = window_form(plant, table.window)
    full = np.array(table.weight)[::-1, :, certificate]
    w, w_u = full[:, model.outputs].ravel(), full[:, model.inputs].ravel()
    reach = np.array([largest(model, design.stored.signal_reach, i) for i in model.inputs])
    x = sign * np.sign(w @ form.O) * design.stored.state_range
    d = sign * np.sign(w @ form.Md).reshape(table.window, -1)
    u = sign * np.sign(w @ form.Mu + w_u).reshape(table.window, -1) * reach
    v = np.zeros((table.window, len(model.signals)))
    v[:, model.outputs], v[:, model.inputs] = simulate(plant, x, u, d), u
    return v + sign * radius * np.sign(full)


def test_no_window_within_the_bounds_alarms_and_the_bounds_are_tight(platoon: Design, bank: StoredBank) -> None:
    rng = np.random.default_rng(SEED)
    tight = []
    for design in [platoon, *random_designs(SEED, 6)]:
        model = design.model
        stored = bank if design is platoon else random_bank(rng, model, int(rng.integers(model.plant.n + 2, 14)), 6)
        table = bank_table(model, design.stored, stored)
        for c in range(table.certificates):
            radius = np.tile(usual_radius(model), (table.window, 1)) * rng.uniform(0, 2, (table.window, len(model.signals)))
            radius = nearest32(radius)
            value = worst_window(design, table, c, float(rng.choice([-1, 1])), radius)
            r, J = evaluate(table, value, radius)
            ratio = float(np.abs(r[0, c]) / J[0, c])
            assert ratio <= 1.0
            tight.append(ratio)
            r32, J32 = in_single(table, nearest32(value), radius)
            assert np.abs(r32[c]) <= J32[c]
    assert min(tight[: len(bank.weight)]) > 0.99  # the platoon's
    assert np.median(tight) > 0.9


def test_a_smaller_bias_would_alarm(platoon: Design, bank: StoredBank) -> None:
    table = bank_table(platoon.model, platoon.stored, bank)
    radius = np.tile(usual_radius(platoon.model), (table.window, 1))
    smaller = replace(table, bias=tuple(0.97 * b for b in table.bias))
    for c in range(table.certificates):
        r, J = evaluate(smaller, worst_window(platoon, table, c, 1.0, radius), radius)
        assert abs(r[0, c]) > J[0, c]


@pytest.mark.parametrize("hypothesis", [None, 0, 3])
def test_the_bias_is_the_stated_sum_whatever_the_weights(platoon: Design, bank: StoredBank, hypothesis: int | None) -> None:
    # Weights so coarse that the certificates see the states, the inputs and the hypothesis' fault: each term counts.
    model, plant = platoon.model, platoon.model.plant
    coarse = replace(bank, weight=bank.weight.round(1), hypothesis=hypothesis)
    table = bank_table(model, platoon.stored, coarse, fault_size=2.0)
    form, full = window_form(plant, 30), np.array(table.weight)[::-1].transpose(2, 0, 1)
    w, w_u = full[:, :, model.outputs].reshape(len(full), -1), full[:, :, model.inputs].reshape(len(full), -1)
    state, values = platoon.stored.state_range, np.array([largest(model, platoon.stored.signal_reach, i) for i in range(len(model.signals))])
    left = np.zeros(len(full))
    if hypothesis is not None:
        fault = model.faults[hypothesis]
        values = np.array([max(abs(s.low), abs(s.high)) for s in model.signals])
        state = state + 2.0 * moved(model, fault)
        left = 2.0 * np.abs(w @ fault_response(model, form, fault)).sum(1)
        assert left.max() > 0.0
    u = np.tile(values[model.inputs], 30)
    own = np.abs(w @ form.O) @ state + np.abs(w @ form.Md).sum(1) + np.abs(w @ form.Mu + w_u) @ u + left
    rounding = 2.0**-24 * 30 * len(model.signals) * (np.abs(full).sum(1) @ values)
    bias = np.array(table.bias)
    assert np.all(bias >= own + rounding)
    assert np.all(bias <= (own + 1.05 * rounding) * (1 + 1e-4))
    assert np.max(np.abs(w @ form.O) @ state / own) > 1e-3


@pytest.mark.parametrize("fault", [0, 3])
def test_no_course_of_a_fault_moves_the_states_further_than_said(platoon: Design, fault: int) -> None:
    plant, named = platoon.model.plant, platoon.model.faults[fault]
    assert plant.feedback is not None
    rng = np.random.default_rng(SEED)
    bound, furthest = moved(platoon.model, named), np.zeros(plant.n)
    courses = [np.ones(300), *(rng.choice([-1.0, 1.0], 300) for _ in range(20)), *(np.sign(np.sin(np.arange(300) * f)) for f in (0.02, 0.05, 0.1, 0.2, 0.5))]
    for course in courses:
        x = np.zeros(plant.n)
        for f in course:
            believed = x.copy()
            if named.type == "sensor":
                believed += plant.C[platoon.model.outputs.index(named.signal)] * f
            x = plant.A @ x - plant.B @ (plant.feedback.gain @ believed)
            if named.type == "actuator":
                x += plant.B[:, platoon.model.inputs.index(named.signal)] * f
            furthest = np.maximum(furthest, np.abs(x))
    assert np.all(furthest <= bound)
    assert np.max(furthest / bound) > 0.5


@pytest.mark.parametrize("scenario", ["rest", "manoeuvres"])
def test_no_healthy_run_alarms(platoon: Design, bank: StoredBank, scenario: str) -> None:
    table, emulator = bank_table(platoon.model, platoon.stored, bank), Emulator(platoon.model, platoon.stored)
    for run in range(20):
        trace = emulator.trace(200, platoon.model.scenario(scenario).reference, (), SEED, run)
        r, J = evaluate(table, trace["value"], trace["radius"])
        assert len(r) == 200 - table.window + 1
        assert np.all(np.abs(r) <= J)


def test_a_small_bank_comes_close_to_the_limit(platoon: Design, bank: StoredBank) -> None:
    model, emulator = platoon.model, Emulator(platoon.model, platoon.stored)
    table, programme = bank_table(model, platoon.stored, bank), Explanation(model, 30, usual_scale(model))
    for fault in ("controller1", "controller2", "controller3"):
        spec = FaultSpec(fault, "bias", 1.0, 60, None)
        traces = [emulator.trace(110, REST, [spec], EVERY, run) for run in range(15)]
        limits = [first_unexplained(programme, t, 60, 110) for t in traces]
        delays = [alarm_delay(table, t, 60, 110) for t in traces]
        assert all(d is not None and x is not None and d >= x for d, x in zip(delays, limits, strict=True))
        mean, limit = np.mean([d for d in delays if d is not None]), np.mean([x for x in limits if x is not None])
        assert mean <= max(1.3 * limit, limit + 1.0)
        assert [alarm_delay(table, t, 30, 60) for t in traces] == [None] * 15


def test_the_same_spec_gives_the_same_bank_with_any_number_of_workers(platoon: Design) -> None:
    small = replace(SPEC, faults=(1,), sizes=(1.0, 2.0), runs=6)
    alone, together = make_bank(platoon, small, 1), make_bank(platoon, small, 2)
    assert np.array_equal(alone.weight, together.weight)
    assert bank_table(platoon.model, platoon.stored, alone) == bank_table(platoon.model, platoon.stored, together)
    assert not np.array_equal(alone.weight, make_bank(platoon, replace(small, seed=small.seed + 1)).weight)


def test_a_small_bank_is_the_beginning_of_a_large_one(platoon: Design) -> None:
    # So many runs that eight certificates do not reach the limit in all of them.
    training = collect(platoon, replace(SPEC, runs=8))
    model = platoon.model
    delays = first_alarms(model, window_form(model.plant, 30), training.weight, training)
    large = select(delays, training, 16)
    assert 8 < len(large) == len(set(large)) <= 16
    for size in (4, 8):
        assert select(delays, training, size) == large[:size]
    means = [delays[large[:size]].min(0).mean() for size in (1, 4, 8, 16)]
    assert means == sorted(means, reverse=True)
    assert means[3] < means[0]
    assert np.all(delays.min(0) >= training.limit)


def drawn(delays: list[list[int]], limit: float) -> tuple[NDArray[np.float32], Training]:
    """Delays of candidates, and a training of two runs a class."""
    runs, none = len(delays[0]), np.zeros((0, 0, 0))
    return np.array(delays, np.float32), Training(np.repeat(np.arange(float(runs // 2)), 2), np.full(runs, limit), none, none, none)


def test_the_choice_serves_the_worst_class_first() -> None:
    assert select(*drawn([[10, 10, 14, 14], [13, 13, 13, 13], [13, 13, 13, 14]], 10.0), 1) == [1]
    # Beside those that are as early as the limit in one class each no other helps.
    assert sorted(select(*drawn([[10, 10, 40, 40], [40, 40, 10, 10], [11, 11, 11, 11], [10, 10, 40, 40]], 10.0), 3)) == [0, 1]


def test_every_training_run_has_a_number_of_its_own() -> None:
    spec = replace(SPEC, runs=23, references=(REST, Reference("mixed", 1.0, 60)))
    taken = [run for _, c in cases(spec) for run in range(c.first, c.first + c.count)]
    assert sorted(taken) == list(range(3 * 3 * 2 * 2 * 23))
    assert {g for g, _ in cases(spec)} == set(range(18))


def test_stored_certificates_keep_their_single_precision_numbers(bank: StoredBank) -> None:
    assert np.array_equal(stored_weight(nearest32(bank.weight)), bank.weight)
    assert np.all(np.abs(nearest32(bank.weight) - bank.weight) <= 1e-8 * np.abs(bank.weight))
    assert not np.signbit(bank.weight[bank.weight == 0.0]).any()
    assert bank.faults == 0b111111
    assert len(shortened(bank, 3).weight) == 3


def test_a_projection_keeps_zeros_and_leaves_nothing_of_the_basis() -> None:
    rng = np.random.default_rng(SEED)
    basis, w = rng.standard_normal((40, 6)), rng.standard_normal(40)
    w[:20] = 0.0
    out = project(w, basis)
    assert not out[:20].any()
    assert np.abs(out @ basis).max() < 1e-12
    assert np.abs(out - w).max() > 0.0
    assert not project(np.zeros(40), basis).any()


def test_tables_are_laid_out_by_lag(platoon: Design, bank: StoredBank) -> None:
    model = platoon.model
    table = bank_table(model, platoon.stored, bank)
    assert (len(table.weight), len(table.weight[0]), len(table.weight[0][0])) == (30, len(model.signals), len(bank.weight))
    for place, row in ((model.outputs[2], 2), (model.outputs[0], 0)):
        assert table.weight[4][place][2] == nearest32(bank.weight[2, 30 - 1 - 4, row])
    assert table.widen >= 1.0
    assert table.feeds == 0b11
    assert table.extra_weight == ()


def test_derived_signals_widen_the_threshold_by_what_they_can_do(platoon: Design, bank: StoredBank) -> None:
    model, plant = platoon.model, platoon.model.plant
    rng = np.random.default_rng(SEED)
    varying = Varying(rng.standard_normal((plant.n, 2)), np.zeros((plant.m, 2)))
    table = bank_table(model, platoon.stored, bank, varying)
    form = window_form(plant, 30, varying)
    exact = np.abs(nearest32(bank.weight).reshape(len(bank.weight), -1) @ form.Me).reshape(-1, 30, 2)
    held = np.array(table.extra_weight)[::-1].transpose(2, 0, 1)
    assert np.all(held >= exact - 1e-12)
    assert np.allclose(held, exact, 1e-4, 1e-7)


def test_states_without_a_bound_are_refused(platoon: Design, bank: StoredBank) -> None:
    boundless = replace(platoon.stored, state_range=np.full(platoon.model.plant.n, np.inf))
    with pytest.raises(InputError, match="plant.state_range"):
        bank_table(platoon.model, boundless, bank)
    open_loop = replace(platoon.model, plant=replace(platoon.model.plant, feedback=None))
    with pytest.raises(InputError, match="feedback"):
        bank_table(open_loop, platoon.stored, replace(bank, hypothesis=0))


def test_a_fault_that_never_shows_makes_no_bank(platoon: Design) -> None:
    with pytest.raises(InputError, match="larger sizes"):
        make_bank(platoon, replace(SPEC, faults=(1,), sizes=(1e-4,), runs=1))
