"""Time counted in samples, exactly: intervals between events, latency from frame to verdict and from fault to flag, heartbeats, a sender's silence
in the bus health, and the deadline of `hullguard detect` on a clock of the test's own."""

from __future__ import annotations

import random
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from host_support import REALS, SEED, SILENT_2, Cli, Models
from hullguard.bus import candump
from hullguard.core.library import library
from hullguard.core.native import REST, Frame, Native, Node, Plant, Sender, Verdict, read_verdict
from hullguard.plant import detect
from hullguard.plant.detect import Detector, from_bus

RUNS = [("platoon", "manoeuvres"), ("platoon", "adaptive"), ("platoon", "rest"), ("openacc", "default")]


def made(models: Models, model: str, scenario: str, overrides: dict[str, Any] | None = None, real: str = "f32") -> tuple[Any, Native]:
    design = models.design(overrides, scenario, model)
    return design, Native(library(real), design.tables)


def sent(native: Native, readings: list[list[float]]) -> list[list[int]]:
    """Samples in which each group speaks."""
    sender = Sender(native)
    return [[k for k, reading in enumerate(readings) if sender.step(g, k, reading) is not None] for g in range(len(native.tables.groups))]


# ---- event intervals ----


@pytest.mark.parametrize(("model", "scenario"), RUNS)
def test_events_keep_their_intervals(model: str, scenario: str, models: Models) -> None:
    """Never closer than the silence, never further apart than the longest interval."""
    design, native = made(models, model, scenario)
    source, readings = Plant(native, design, design.model.scenario(scenario).reference, [], SEED), []
    for _ in range(1500):
        readings.append(source.read())
        source.move()
    for g, at in zip(native.tables.groups, sent(native, readings), strict=True):
        gaps = np.diff(at)
        print(f"{model} {scenario} {g.name}: {gaps.min()} .. {gaps.max()} samples, within {min(g.silence) + 1} .. {g.interval_max}; mean {gaps.mean():.2f}")
        assert at[0] == 0 and gaps.min() > min(g.silence) and gaps.max() <= g.interval_max
        assert 1500 - at[-1] <= g.interval_max


@pytest.mark.parametrize(("model", "scenario"), RUNS)
def test_a_quiet_signal_is_sent_at_the_longest_interval_exactly(model: str, scenario: str, models: Models) -> None:
    _, native = made(models, model, scenario)
    for g, at in zip(native.tables.groups, sent(native, [[0.0] * native.tables.signals] * 200), strict=True):
        assert set(np.diff(at)) == {g.interval_max}


@pytest.mark.parametrize("overrides", [{}, SILENT_2], ids=["silence 0", "silence 2"])
def test_a_wild_signal_is_sent_at_the_shortest_interval_exactly(overrides: dict[str, Any], models: Models) -> None:
    _, native = made(models, "platoon", "rest", overrides)
    readings = [[(-1.0) ** (k // 3 if overrides else k) * (5.0 + k % 7)] * native.tables.signals for k in range(200)]
    for g, at in zip(native.tables.groups, sent(native, readings), strict=True):
        assert set(np.diff(at)) == {min(g.silence) + 1}
    assert native.tables.groups[0].silence == ((2,) if overrides else (0,))


# ---- latencies of a run ----


@pytest.mark.parametrize(("model", "scenario"), [("platoon", "default"), ("openacc", "default")])
def test_frame_to_verdict_and_fault_to_flag(model: str, scenario: str, cli: Cli, models: Models, tmp_path: Path) -> None:
    """By the stamps of run.log: a verdict has the time of its closing frame, the flag that of the sample in which run.json says the fault was found."""
    done = cli("run", model, "--scenario", scenario, "--bus", "inprocess", "--seed", SEED, "--json", "--out", tmp_path)
    assert done.status == 0, done.err
    result, (_, native) = done.json, made(models, model, scenario)
    period, closing = result["sample_time_s"], native.tables.groups[native.tables.closing].message.id
    closed: dict[int, float] = {}
    told: dict[int, tuple[float, Verdict]] = {}
    status: list[int] = []
    for e in candump.read(tmp_path / "run.log"):
        if e.frame.id == closing:
            closed[len(closed)] = e.time_s
        elif e.frame.id == native.tables.status.id:
            status.append(round(e.time_s / period))
        elif (verdict := read_verdict(native, e.frame)) is not None:
            told[verdict.k + 4096 * ((len(closed) - 1) // 4096)] = (e.time_s, verdict)
    assert set(closed) == set(told) == set(range(result["samples"]))
    assert all(told[k][0] == at == pytest.approx(k * period, abs=1e-6) for k, at in closed.items())
    assert status == list(range(0, result["samples"], native.tables.heartbeat))
    alarms = [k for k in sorted(told) if told[k][1].plant in ("provisional", "confirmed")]
    for fault in result["faults"]:
        flag = min(k for k in alarms if k >= fault["start"])
        assert flag == fault["detected_at"] and flag - fault["start"] == fault["delay"]
        late = told[flag][0] - fault["start"] * period
        print(f"{model}: fault at {fault['start'] * period:g} s, flag {late:.3f} s later ({fault['delay']} samples); verdict 0 us after its closing frame")


# ---- a sender's silence ----


@pytest.mark.parametrize("real", REALS)
@pytest.mark.parametrize(("model", "scenario"), [("platoon", "manoeuvres"), ("openacc", "default")])
def test_silence_becomes_bus_health_to_the_sample(model: str, scenario: str, real: str, models: Models) -> None:
    """Each group in turn falls silent: lossy where the longest interval has passed, stale where the margin has too, all others good."""
    design, native = made(models, model, scenario, real=real)
    groups, closing = native.tables.groups, native.tables.closing
    for silent in (g for g in range(len(groups)) if g != closing):
        rng = random.Random(f"{SEED}/{model}/{silent}")
        stop = rng.randrange(30, 60)
        source = Plant(native, design, design.model.scenario(scenario).reference, [], SEED)
        sender, node, last = Sender(native), Node(native, REST), 0
        seen: dict[str, int] = {}
        heard = defaultdict(list)
        for k in range(stop + groups[silent].interval_max + groups[silent].margin + 5):
            reading = source.read()
            source.move()
            for g in [*(i for i in range(len(groups)) if i != closing), closing]:
                frame = sender.step(g, k, reading)
                if frame is None or (g == silent and k >= stop):
                    continue
                last = k if g == silent else last
                node.receive(frame)
            verdict = node.step()
            assert verdict is not None and all(b == "good" for g, b in enumerate(verdict.bus) if g != silent)
            seen.setdefault(verdict.bus[silent], k)
            for f in node.report(False):
                heard[f.id].append(k)
        table = groups[silent]
        assert seen == {"good": 0, "lossy": last + table.interval_max, "stale": last + table.interval_max + table.margin + 1}, table.name
        assert set(heard[native.tables.verdict.id]) >= {seen["lossy"], seen["stale"]}, "a change is said at once"
        print(f"{model} {real} {table.name}: last frame {last}, lossy after {seen['lossy'] - last}, stale after {seen['stale'] - last} samples")


# ---- the deadline of hullguard detect ----


class Clock:
    """A bus whose frames come at stated times, and the only clock there is."""

    channel = "virtual"

    def __init__(self, frames: list[tuple[float, Frame]]) -> None:
        self.now, self._frames = 0.0, list(frames)

    def monotonic(self) -> float:
        return self.now

    def time(self) -> float:
        return self.now

    def receive(self, timeout_s: float) -> tuple[Frame, float] | None:
        if self._frames and self._frames[0][0] <= self.now + timeout_s:
            self.now, frame = self._frames.pop(0)
            return frame, self.now
        self.now += timeout_s
        return None


@pytest.mark.parametrize("foreign", [0, 8], ids=["quiet", "flooded"])
@pytest.mark.parametrize("count", [1, 3, 7])
def test_detect_closes_overdue_samples_at_their_deadline(count: int, foreign: int, models: Models, monkeypatch: pytest.MonkeyPatch) -> None:
    """Half a period after a closing frame was due, and every period from then on; with the next one everything is as before."""
    design, native = made(models, "platoon", "rest")
    T, first, samples, start = 0.125, 20, 40, 1.0  # sums of powers of two: no rounding
    sender, source = Sender(native), Plant(native, design, design.model.scenario("rest").reference, [], SEED)
    frames: list[tuple[float, Frame]] = []
    for k in range(samples):
        reading = source.read()
        source.move()
        for g in (0, 1):
            frame = sender.step(g, k, reading)
            if frame is not None and not (g == 1 and first <= k < first + count):
                frames.append((start + k * T, frame))
    frames += [(start + i * T / foreign, Frame(0x7FF, 0, b"")) for i in range(samples * foreign)]  # without them, deadlines have the bus to themselves
    clock = Clock(sorted(frames, key=lambda f: f[0]))
    monkeypatch.setattr(detect, "time", clock)
    closed: list[tuple[int, float]] = []
    detector = Detector(native, REST, False, None, lambda v: closed.append((v.k, clock.now)), T)
    from_bus(detector, clock, T, True, samples, lambda: False)  # type: ignore[arg-type]
    expected = [(k, start + k * T + (T / 2 if first <= k < first + count else 0.0)) for k in range(samples)]
    assert closed == expected
    assert detector.node.health()["overdue"] == count and detector.outages == 0
