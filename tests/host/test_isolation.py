"""Isolation: no course of its own fault moves a hypothesis' bank, so that the true fault is never excluded; which pairs can be told apart is said beforehand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from host_support import SEED, Models
from hullguard.campaign.tasks import Emulator
from hullguard.design.bank import BankSpec, alarm_delay, candidates, evaluate, make_bank, usual_scale
from hullguard.design.bank_table import FAULT_SIZE, bank_table, moved
from hullguard.design.bank_types import StoredBank
from hullguard.design.design import Design, usual_radius
from hullguard.design.isolation import Pair, hypotheses, isolability, isolation_banks
from hullguard.design.limit import Explanation, first_unexplained
from hullguard.design.window import fault_response, window_form
from hullguard.errors import InputError
from hullguard.model.faults import FaultSpec
from hullguard.model.schema import Model, Reference
from hullguard.model.table import Array
from scipy.optimize import linprog
from window_support import faulty, random_designs, with_faults

REST = Reference("rest", 0.0, 1)
ACTUATORS, EVERY = (0, 1, 2), (0, 1, 2, 3, 4, 5)
SPEC = BankSpec(30, 4, ACTUATORS, (REST,), sizes=(1.0, 2.0), runs=6, seed=SEED % 1000)
UNSEEN = 2**62  # seed of runs that no training has
START, SAMPLES = 60, 110


@pytest.fixture(scope="module")
def platoon(models: Models) -> Design:
    return models.design()


@pytest.fixture(scope="module")
def banks(platoon: Design) -> list[StoredBank]:
    return isolation_banks(platoon, SPEC)


@pytest.fixture(scope="module")
def pairs(platoon: Design) -> dict[tuple[int, int], Pair]:
    return {(p.truth, p.hypothesis): p for p in isolability(platoon.model, 30, EVERY)}


def random_hypothesis(rng: np.random.Generator, model: Model, hypothesis: int, window: int) -> StoredBank:
    """Certificates in random directions of what neither the states nor the hypothesis' fault reach."""
    form, fault = window_form(model.plant, window), model.faults[hypothesis]
    duals = rng.standard_normal((6, window, model.plant.m))
    if fault.signal in model.outputs:
        duals[:, :, model.outputs.index(fault.signal)] = 0.0
    return StoredBank(window, candidates(model, form, duals, hypothesis), 0, hypothesis)


def largest_ratio(design: Design, model: Model, bank: StoredBank, rng: np.random.Generator) -> float:
    """Largest |r| / J with the hypothesis' fault at both ends of its range, states at the ends of theirs, disturbances as bad as they can be."""
    table, plant = bank_table(model, design.stored, bank), model.plant
    form, fault = window_form(plant, bank.window), model.faults[bank.hypothesis or 0]
    limits = design.stored.state_range + FAULT_SIZE * moved(model, fault)
    largest = 0.0
    for c in range(table.certificates):
        w = np.array(table.weight)[::-1, :, c]
        own = w[:, model.outputs].ravel()
        sign = float(rng.choice([-1, 1]))
        courses = [sign * np.sign(own @ fault_response(model, form, fault)), rng.choice([-1, 1], bank.window), np.ones(bank.window), rng.uniform(-1, 1, bank.window)]
        for course in courses:
            x, d = sign * np.sign(own @ form.O) * limits, sign * np.sign(own @ form.Md).reshape(bank.window, -1)
            u = rng.uniform(-1, 1, (bank.window, plant.p))
            radius = np.tile(usual_radius(model), (bank.window, 1))
            value = faulty(model, fault, FAULT_SIZE * course, x, u, d) + sign * np.sign(w) * radius
            r, J = evaluate(table, value, radius)
            largest = max(largest, float(np.abs(r[0, c]) / J[0, c]))
    return largest


def test_no_course_of_its_own_fault_moves_a_hypothesis(platoon: Design, banks: list[StoredBank]) -> None:
    rng = np.random.default_rng(SEED)
    for bank in banks:
        assert 0.99 < largest_ratio(platoon, platoon.model, bank, rng) <= 1.0


def test_nor_in_random_plants_with_faults_of_every_kind(platoon: Design) -> None:
    rng = np.random.default_rng(SEED)
    seen = 0
    for design in random_designs(SEED, 5):
        model = with_faults(design.model)
        for j in range(len(model.faults)):
            bank = random_hypothesis(rng, model, j, 2 * model.plant.n + 2)
            if len(bank.weight):
                seen += 1
                assert largest_ratio(design, model, bank, rng) <= 1.0, model.faults[j]
                own = fault_response(model, window_form(model.plant, bank.window), model.faults[j])
                assert np.abs(bank.weight.reshape(len(bank.weight), -1) @ own).max() <= 1e-5 * np.abs(own).max()
    assert seen >= 5


def test_a_sensor_hypothesis_does_not_read_its_sensor(platoon: Design) -> None:
    bank = make_bank(platoon, replace(SPEC, hypothesis=3, faults=ACTUATORS, size=2, runs=2))
    place = platoon.model.faults[3].signal
    table = bank_table(platoon.model, platoon.stored, bank)
    assert not np.array(table.weight)[:, place].any()
    assert bank.faults & 1 << 3 == 0


def test_the_true_fault_stays_and_the_others_go(platoon: Design, banks: list[StoredBank]) -> None:
    model, emulator = platoon.model, Emulator(platoon.model, platoon.stored)
    tables = {b.hypothesis: bank_table(model, platoon.stored, b) for b in banks}
    assert set(tables) == set(ACTUATORS)
    programme = Explanation(model, 30, usual_scale(model))
    alone = runs = 0
    for truth in ACTUATORS:
        for size in (1.0, -2.0):
            for run in range(8):
                trace = emulator.trace(SAMPLES, REST, [FaultSpec(model.faults[truth].name, "bias", size, START, None)], UNSEEN, run)
                detected = first_unexplained(programme, trace, START, SAMPLES)
                assert detected is not None
                excluded = {j: alarm_delay(t, trace, 30, SAMPLES) for j, t in tables.items()}
                assert excluded[truth] is None
                runs += 1
                alone += all(at is not None and at + 30 - START <= detected + 10 for j, at in excluded.items() if j != truth)
    assert alone >= 0.95 * runs


def test_a_healthy_plant_excludes_nothing(platoon: Design, banks: list[StoredBank]) -> None:
    emulator = Emulator(platoon.model, platoon.stored)
    for scenario in ("rest", "manoeuvres"):
        for run in range(10):
            trace = emulator.trace(150, platoon.model.scenario(scenario).reference, (), SEED, run)
            assert all(alarm_delay(bank_table(platoon.model, platoon.stored, b), trace, 0, 150) is None for b in banks)


def test_only_an_actuator_and_the_sensor_behind_it_alone_cannot_be_told_apart(platoon: Design, pairs: dict[tuple[int, int], Pair]) -> None:
    names = [f.name for f in platoon.model.faults]
    assert len(pairs) == 30
    apart = {(names[i], names[j]) for (i, j), p in pairs.items() if not p.separable}
    assert apart == {("controller3", "gap23_sensor"), ("gap23_sensor", "controller3")}
    for p in pairs.values():
        assert (p.smallest is None) == (p.reason != "") == (not p.separable)
        assert p.smallest is None or 0.0 < p.smallest < FAULT_SIZE
    assert "gap23_sensor" in pairs[2, 4].reason
    assert [s.faults for s in hypotheses(platoon.model, replace(SPEC, faults=EVERY))][2] == (0, 1, 3, 5)


def largest_excess(model: Model, truth: int, hypothesis: int, course: Array) -> float:
    """Largest w'g over certificates of threshold 1 decoupled from the hypothesis, g the response to this course; the dual, dense."""
    form = window_form(model.plant, len(course))
    g = fault_response(model, form, model.faults[truth]) @ course
    ry, ru = (np.tile(usual_radius(model)[places], len(course)) for places in (model.outputs, model.inputs))
    own = model.faults[hypothesis].signal
    terms = [np.diag(ry), form.Md, form.Mu * ru]
    if own in model.outputs:
        terms[0] = np.diag(np.where(np.arange(len(ry)) % model.plant.m == model.outputs.index(own), 0.0, ry))
    T = np.hstack(terms)
    T = T[:, np.any(T, axis=0)]
    rows, count = T.shape
    basis = np.hstack([form.O, fault_response(model, form, model.faults[hypothesis])])
    # max g'w with |T'w| <= s, sum s <= 1, basis'w = 0
    A = np.vstack([np.hstack([T.T, -np.eye(count)]), np.hstack([-T.T, -np.eye(count)]), np.concatenate([np.zeros(rows), np.ones(count)])[None]])
    found = linprog(
        np.concatenate([-g, np.zeros(count)]),
        A_ub=A,
        b_ub=np.append(np.zeros(2 * count), 1.0),
        A_eq=np.hstack([basis.T, np.zeros((basis.shape[1], count))]),
        b_eq=np.zeros(basis.shape[1]),
        bounds=[(None, None)] * (rows + count),
        method="highs",
    )
    assert found.status == 0, found.message
    return -float(found.fun)


@pytest.mark.parametrize(("truth", "hypothesis"), [(1, 2), (2, 1), (0, 5), (3, 1), (4, 0)])
def test_the_smallest_excluded_size_is_what_the_best_certificate_reaches(platoon: Design, truth: int, hypothesis: int) -> None:
    window, within = 12, 4
    pair = next(p for p in isolability(platoon.model, window, (truth, hypothesis), within) if p.truth == truth)
    best = max(largest_excess(platoon.model, truth, hypothesis, np.where(np.arange(window) >= window - 1 - ago, 1.0, 0.0)) for ago in range(within + 1))
    assert pair.smallest == pytest.approx(1.0 / best, rel=1e-4)


def test_faults_that_cannot_be_told_apart_make_no_banks(platoon: Design) -> None:
    with pytest.raises(InputError, match="measure more"):
        isolation_banks(platoon, replace(SPEC, faults=(2, 4)))
