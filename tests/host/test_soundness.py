"""Random plants through the whole design: what the method note promises of the matrices holds, a healthy plant raises no alarm, and a design that
cannot be made is refused in words.
"""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from host_support import REALS, SEED, Alarms, alarms
from hullguard.core.library import library
from hullguard.core.native import MOVING, REST, Batch, Native
from hullguard.design.design import Design, design
from hullguard.errors import InputError
from hullguard.model.schema import Reference, parse_model
from hypothesis import given, settings
from hypothesis import strategies as st

PLANTS = 40
SAMPLES = 150
PATH = Path("random.toml")


def random_trigger(rng: np.random.Generator, width: int) -> dict[str, Any]:
    interval = int(rng.integers(1, 11))
    silence = int(rng.integers(0, min(interval, 4)))
    trigger: dict[str, Any] = {"interval_max": interval, "sigma": rng.uniform(0.02, 0.3, width).tolist(), "margin": int(rng.integers(0, 5))}
    if rng.random() < 0.3:
        trigger |= {"delta": [0.01, 0.1], "silence": [0, silence], "levels": int(rng.integers(2, 6))}
    else:
        trigger |= {"delta": float(rng.choice([0.0, 0.05, 0.2])), "silence": silence}
    return trigger


def random_source(rng: np.random.Generator) -> dict[str, Any]:
    """A model's data: 2 to 5 states, 1 to 3 outputs, 0 to 2 inputs, in 2 to 4 groups."""
    n, p = int(rng.integers(2, 6)), int(rng.integers(0, 3))
    m = int(rng.integers(1, min(n, 3) + 1))
    A = rng.standard_normal((n, n))
    A *= rng.uniform(0.3, 0.95) / np.abs(np.linalg.eigvals(A)).max()
    kind = rng.choice(["identity", "rows", "dense"])
    if kind == "identity":
        n = m = min(n, 3)
        A, C = A[:n, :n] * 0.5 / max(1e-3, np.abs(np.linalg.eigvals(A[:n, :n])).max()), np.eye(n)
    elif kind == "rows":
        C = np.eye(n)[rng.permutation(n)[:m]]
    else:
        C = rng.standard_normal((m, n))
    outputs, inputs = [f"y{i}" for i in range(m)], [f"u{i}" for i in range(p)]
    plant: dict[str, Any] = {
        "A": A.tolist(),
        "C": C.tolist(),
        "discrete": True,
        "initial_range": rng.uniform(0.0, 1.0, n).tolist(),
        "disturbance": {"state": rng.uniform(0.0, 0.05, n).tolist(), "output": rng.uniform(0.005, 0.05, m).tolist()},
    }
    if p:
        plant["B"] = rng.standard_normal((n, p)).tolist()
        if rng.random() < 0.5:
            plant["D"] = rng.standard_normal((m, p)).tolist()
        gain = rng.standard_normal((p, n)) * rng.choice([0.0, 0.05])
        plant["feedback"] = {"gain": gain.tolist(), "reference_bound": rng.uniform(0.1, 1.5, p).tolist()}
    signals = [{"name": y, "role": "output", "range": [-300.0, 300.0], "resolution": 0.01, "slew": "reachable"} for y in outputs]
    signals += [{"name": u, "role": "input", "range": [-30.0, 30.0], "resolution": 0.001, "slew": "reachable"} for u in inputs]
    cut = int(rng.integers(1, m)) if m > 1 and rng.random() < 0.4 else m
    groups: list[dict[str, Any]] = []
    for i, members in enumerate([outputs[:cut], outputs[cut:]]):
        if members:
            groups.append({"name": f"sensor{i}", "signals": members, "frame": {"id": 0x100 + i}, "trigger": random_trigger(rng, len(members))})
    way = rng.choice(["tick", "event", "periodic"]) if p else "none"
    if way == "event":
        groups.append({"name": "control", "signals": inputs, "frame": {"id": 0x110}, "trigger": random_trigger(rng, p)})
    elif way == "periodic":
        groups.append({"name": "control", "signals": inputs, "frame": {"id": 0x110}, "transmission": "periodic"})
    closing: dict[str, Any] = {"name": "closing", "frame": {"id": 0x120}, "transmission": "tick"}
    if way == "tick":
        closing |= {"signals": inputs, "applied_as_sent": bool(rng.random() < 0.7)}
    groups.append(closing)
    faults = [{"name": f"{s}_fault", "signal": s, "type": t} for s, t in [(y, "sensor") for y in outputs] + [(u, "actuator") for u in inputs] if rng.random() < 0.6]
    return {
        "schema": 1,
        "name": "random",
        "kind": "linear",
        "sample_time_s": 0.1,
        "plant": plant,
        "signals": signals,
        "groups": groups,
        "verdict": {"frame": {"id": 0x130}},
        "detector": {
            "observers": [
                {
                    "order": int(rng.integers(1, n + 2)),
                    "residuals": int(rng.integers(1, 3)),
                    "trigger_aware": bool(rng.random() < 0.7),
                    "search": {"trials": 8, "seed": int(rng.integers(0, 1000)), "poles": [0.0, 0.8]},
                }
            ]
        },
        "faults": faults,
    }


def made_of(source: dict[str, Any]) -> Design:
    return design(parse_model(source, PATH), fresh=True)[0]


@pytest.fixture(scope="module")
def random_designs() -> tuple[list[tuple[int, Design]], list[str]]:
    """The first designs that can be made, each with the number that seeds it, and the words with which the others were refused."""
    made: list[tuple[int, Design]] = []
    refused: list[str] = []
    number = 0
    while len(made) < PLANTS:
        number += 1
        assert number < 10 * PLANTS, f"nearly everything is refused: {refused[-5:]}"
        try:
            made.append((number, made_of(random_source(np.random.default_rng([SEED, number])))))
        except InputError as error:
            refused.append(str(error))
    return made, refused


def test_most_random_models_can_be_designed_and_the_others_are_refused_in_one_line(random_designs: tuple[list[tuple[int, Design]], list[str]]) -> None:
    made, refused = random_designs
    assert len(made) == PLANTS
    for text in refused:
        assert "\n" not in text
        assert len(text) > 20
    assert len(refused) < 2 * PLANTS, refused


def test_random_models_cover_what_they_are_meant_to_cover(random_designs: tuple[list[tuple[int, Design]], list[str]]) -> None:
    plants = [d.model.plant for _, d in random_designs[0]]
    assert {p.p for p in plants} == {0, 1, 2}
    assert any(np.array_equal(p.C, np.eye(p.n)) for p in plants)
    assert any(p.D.any() for p in plants)
    orders = {np.sign(d.generators[0].spec.order - d.model.plant.n) for _, d in random_designs[0]}
    assert orders == {-1, 0, 1}


def test_no_random_observer_breaks_the_luenberger_equations(random_designs: tuple[list[tuple[int, Design]], list[str]]) -> None:
    for number, made in random_designs[0]:
        for g in made.generators:
            o, p = g.observer, g.plant
            scale = max(1.0, np.abs(o.T).max(), np.abs(o.L).max())
            assert np.abs(o.T @ p.A - o.G @ o.T - o.L @ p.C).max() <= 1e-9 * scale, number
            assert np.abs(o.V @ p.C - o.W @ o.T).max() <= 1e-9 * scale, number
            if p.B.shape[1]:
                assert np.abs(o.T @ p.B - o.L @ p.D - o.H).max() <= 1e-9 * scale, number
                assert np.abs(o.V @ p.D - o.Qu).max() <= 1e-9 * scale, number
            assert np.abs(np.linalg.eigvals(o.G)).max() < 1.0, number


def test_no_random_post_filter_is_less_than_all_pass(random_designs: tuple[list[tuple[int, Design]], list[str]]) -> None:
    for number, made in random_designs[0]:
        for g in made.generators:
            o, f, p = g.observer, g.filter, g.plant
            Eb, Fb = o.T @ p.Ed - o.L @ p.Fd, o.V @ p.Fd
            if g.spec.aware:
                Eb, Fb = np.hstack([Eb, -o.L * p.Sy, -o.H * p.Su]), np.hstack([Fb, o.V * p.Sy, -o.Qu * p.Su])
            if f.regularised:
                rows = o.W.shape[0]
                Eb, Fb = np.hstack([Eb, np.zeros((Eb.shape[0], rows))]), np.hstack([Fb, f.regularised * np.eye(rows)])
            limit = 1e-9 if np.linalg.cond(f.S) <= 1e3 else 1e-7
            eye = np.eye(o.G.shape[0])
            for z in np.exp(1j * np.random.default_rng([SEED, number]).uniform(0.0, np.pi, 50)):
                from_d = Fb + o.W @ np.linalg.solve(z * eye - o.G, Eb)
                R = f.Mo - f.Mo @ o.W @ np.linalg.solve(z * eye - o.G + f.Lo @ o.W, f.Lo)
                assert np.abs(np.linalg.svd(R @ from_d, compute_uv=False) - 1.0).max() <= limit, number


@pytest.mark.parametrize("real", REALS)
@pytest.mark.parametrize("how", ["random", "corners"])
def test_no_healthy_random_plant_raises_an_alarm(random_designs: tuple[list[tuple[int, Design]], list[str]], real: str, how: str) -> None:
    for number, made in random_designs[0]:
        rng = np.random.default_rng([SEED, number, 1])
        native = Native(library(real), made.tables)
        plant = made.model.plant
        for kind in ("rest", "mixed"):
            reference = Reference(kind, 1.0, int(rng.integers(5, 60)))
            if how == "random":
                rows = Batch(native, made, SAMPLES, reference, (), SEED + number).runs(0, 60)
            else:
                d = rng.choice([-1.0, 1.0], (SAMPLES, plant.Ed.shape[1]))
                rows = Batch(native, made, SAMPLES, reference, (), SEED + number, disturbance=d, initial=plant.initial_range * rng.choice([-1.0, 1.0], plant.n)).runs(0, 10)
            assert alarms(rows) == Alarms(0, 0), f"plant {number}: |r|/J up to {max(r['margin'] for r in rows)}"


@pytest.mark.parametrize("real", ["f32", "q31"])
@pytest.mark.parametrize("start", [REST, MOVING], ids=["rest", "moving"])
@pytest.mark.parametrize("loss", [0.1, 0.5])
def test_no_alarm_of_a_healthy_random_plant_is_confirmed_whatever_is_lost(
    random_designs: tuple[list[tuple[int, Design]], list[str]], start: int, loss: float, real: str
) -> None:
    lost = 0
    for number, made in random_designs[0]:
        native = Native(library(real), made.tables)
        rows = Batch(native, made, SAMPLES, Reference("mixed", 1.0, 30), (), SEED + number, loss=loss, start=start).runs(0, 30)
        lost += sum(r["lost"] for r in rows)
        assert alarms(rows).confirmed == 0, f"plant {number}"
    assert lost > 0


@settings(max_examples=60)
@given(st.data())
def test_no_damaged_random_model_does_anything_but_design_or_refuse(data: st.DataObject) -> None:
    """Any one number of the plant, or any one key, replaced by something else: InputError or a design, never another exception."""
    source = copy.deepcopy(random_source(np.random.default_rng([SEED, data.draw(st.integers(0, 50), "model")])))
    nasty = st.sampled_from([0.0, 1e-300, 1e300, -1e9, 1e9, float("nan"), float("inf"), 0, -1, 2**40, "x", "", True, [], {}, [[]], [[1.0], [1.0, 2.0]], None])
    place: Any = source
    for _ in range(8):
        keys = list(place.keys()) if isinstance(place, dict) else list(range(len(place)))
        key = data.draw(st.sampled_from(keys), "key")
        if isinstance(place[key], (dict, list)) and place[key] and data.draw(st.integers(0, 5), "deeper"):
            place = place[key]
            continue
        if data.draw(st.booleans(), "remove"):
            del place[key]
        else:
            place[key] = data.draw(nasty, "value")
        break
    try:
        made_of(source)
    except InputError as error:
        assert "\n" not in str(error)
