"""detector_node itself in virtual time, exact to the microsecond: when it answers, when a closing frame is overdue, and when a sender that fell
silent becomes a bit of bus health. Expected times are worked out from node.h and hold.h, not from another run of the node."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from hullguard.core.native import Frame, Verdict
from inside_support import Drive, ready
from node_support import SEED, VIRTUAL_NODE, command

T = 100_000  # of the platoon, microseconds
SLACK = T // 2
FIRST = 1_000_000  # arrival of sample 0's closing frame


@dataclass(frozen=True)
class Ran:
    """What the node did."""

    verdicts: list[tuple[int, Verdict]]  # time sent
    statuses: list[int]  # times sent
    misses: list[tuple[int, int, int]]  # sample, due, noticed
    samples: int

    def first(self, said: Callable[[Verdict], bool]) -> tuple[int, int]:
        """Sample and time of the first verdict that says so."""
        return next((v.k, at) for at, v in self.verdicts if said(v))


@dataclass
class Script:
    """Frames with their arrival times: a sample every T, measurement frames ahead of the closing one."""

    drive: Drive
    frames: list[tuple[int, Frame]]

    @staticmethod
    def of(samples: int, late: Callable[[int], int] = lambda k: 0, lost: Callable[[int, bool], bool] = lambda k, closing: False, **options: object) -> Script:
        """`late` moves a sample's frames, `lost` drops measurement or closing frames."""
        drive = Drive(**options)  # type: ignore[arg-type]
        frames: list[tuple[int, Frame]] = []
        for k in range(samples):
            measured, tick = drive.sample()
            at = FIRST + k * T + late(k)
            frames += [(at - 1000, f) for f in measured if not lost(k, False)]
            frames += [] if lost(k, True) else [(at, tick)]
        return Script(drive, frames)

    def run(self, folder: Path, *options: object, rest: bool = True, held_us: int = 0) -> Ran:
        file, timing = folder / "frames", folder / "timing"
        file.write_text("".join(f"{at} {f.id} {f.flags} {f.data.hex() or '-'}\n" for at, f in self.frames))
        done = command([str(VIRTUAL_NODE), str(file), str(held_us), *["--rest"] * rest, "--timing", str(timing), *map(str, options)])
        assert (done.returncode, done.stderr) == (0, ""), done.stderr
        sent = [line.split() for line in done.stdout.splitlines() if line.startswith("sent ")]
        rows = [(int(at), Frame(int(number), 0, bytes.fromhex(data))) for _, at, number, data in sent]
        lines = timing.read_text().splitlines()
        verdicts = [(at, self.drive.told(f)) for at, f in rows if f.id == self.drive.verdict_id]
        misses = [(int(k), int(due), int(noticed)) for k, due, noticed in (line.split() for line in lines[2:])]
        return Ran(verdicts, [at for at, f in rows if f.id == self.drive.status_id], misses, int(lines[0].split()[2]))


def bus(drive: Drive, verdict: Verdict, group: str) -> str:
    return verdict.bus[[g.name for g in drive.native.tables.groups].index(group)]


def test_a_verdict_leaves_in_the_moment_of_its_closing_frame(tmp_path: Path) -> None:
    """And a quiet node says something with every heartbeat only, exactly."""
    rng, samples = random.Random(SEED), 120
    late = [rng.randrange(-SLACK // 2, SLACK // 2) for _ in range(samples)]
    script = Script.of(samples, late.__getitem__)
    ran = script.run(tmp_path, "--samples", samples)
    assert ran.samples == samples and not ran.misses
    assert all(at == FIRST + v.k * T + late[v.k] for at, v in ran.verdicts)
    heartbeat = script.drive.native.tables.heartbeat
    assert ran.statuses == [FIRST + k * T + late[k] for k in range(0, samples, heartbeat)]
    changes = [v.k for (_, v), (_, before) in zip(ran.verdicts[1:], ran.verdicts, strict=False) if (v.plant, v.bus, v.candidates) != (before.plant, before.bus, before.candidates)]
    assert {v.k for _, v in ran.verdicts} >= set(range(0, samples, heartbeat))
    assert {v.k for _, v in ran.verdicts} - set(range(0, samples, heartbeat)) - set(changes) <= {1}, "the basis changes once, when the plant has left its rest"


def test_in_lockstep_every_closing_frame_is_answered_at_once(tmp_path: Path) -> None:
    script = Script.of(50)
    ran = script.run(tmp_path, "--samples", 50, "--lockstep")
    assert [(v.k, at) for at, v in ran.verdicts] == [(k, FIRST + k * T) for k in range(50)]


@pytest.mark.parametrize("slack_ms", [0, 0.001, 20, 50, 99])
@pytest.mark.parametrize("after", [-1, 0, 1])
def test_the_deadline_is_exact(slack_ms: float, after: int, tmp_path: Path) -> None:
    """A closing frame one microsecond before the deadline, or with it, is in time; one microsecond later the sample has been closed without it."""
    slack, k = round(slack_ms * 1000), 20
    script = Script.of(40, lambda i: slack + after if i == k else 0)
    ran = script.run(tmp_path, "--samples", 40, "--deadline", slack_ms)
    due = FIRST + k * T + slack
    if after <= 0:
        assert not [m for m in ran.misses if m[0] == k]
    else:
        assert (k, due, due) in ran.misses
    assert all(due_ == noticed for _, due_, noticed in ran.misses), "in virtual time nothing is noticed late"


def test_a_closing_frame_that_came_while_the_node_was_held_up_is_not_late(tmp_path: Path) -> None:
    """The node finds no frame more, is held up beyond the deadline, and the closing frame comes meanwhile, in time. One that does not come is still missed."""
    held, samples = SLACK + 10_000, 40
    script = Script.of(samples)
    late = next(k for k in range(10, samples) if any(at == FIRST + k * T - 1000 for at, _ in script.frames))
    script.frames = [(at + SLACK - 5000 if at == FIRST + late * T else at, f) for at, f in script.frames]
    assert not script.run(tmp_path, "--samples", samples, held_us=held).misses
    script.frames = [(at, f) for at, f in script.frames if at != FIRST + late * T + SLACK - 5000]
    ((k, due, noticed),) = script.run(tmp_path, "--samples", samples, held_us=held).misses
    assert (k, due) == (late, FIRST + late * T + SLACK) and due <= noticed <= due + held


@pytest.mark.parametrize("count", [1, 2, 7])
def test_lost_closing_frames_are_overdue_one_by_one(count: int, tmp_path: Path) -> None:
    first, samples = 30, 80
    script = Script.of(samples, lost=lambda k, closing: closing and first <= k < first + count)
    ran = script.run(tmp_path, "--samples", samples, "--health", tmp_path / "health")
    assert re.findall(r"^control.*\blost[ =](\d+)", (tmp_path / "health").read_text(), re.M) == [str(count)]
    assert ran.misses == [(k, FIRST + k * T + SLACK, FIRST + k * T + SLACK) for k in range(first, first + count)]
    # The closing group is periodic: its first absence is a loss, known at the deadline and said at once.
    table = script.drive.native.tables.groups[script.drive.native.tables.closing]
    assert table.interval_max == 1
    assert ran.first(lambda v: bus(script.drive, v, "control") == "lossy") == (first, FIRST + first * T + SLACK)
    stale = first + table.margin + 1
    if first + count > stale:
        assert ran.first(lambda v: bus(script.drive, v, "control") == "stale") == (stale, FIRST + stale * T + SLACK)
    # Two good frames in a row make it good again.
    healed = first + count + 1
    assert ran.first(lambda v: v.k >= first + count and bus(script.drive, v, "control") == "good") == (healed, FIRST + healed * T)


def test_a_sender_that_falls_silent_becomes_a_bit_of_bus_health(tmp_path: Path) -> None:
    """Lossy in the sample in which its longest interval has passed without a frame, stale when it is older than that and the margin, good with the
    second frame after it is back: to the sample and the microsecond."""
    group = ready()[1].tables.groups[0]
    stop, back, samples = 60, 90, 130
    script = Script.of(samples, lost=lambda k, closing: not closing and stop <= k < back)
    sent = [round((at + 1000 - FIRST) / T) for at, f in script.frames if f.id == group.message.id]
    last, again = max(k for k in sent if k < stop), [k for k in sent if k >= back]
    ran = script.run(tmp_path, "--samples", samples)
    expected = {"lossy": last + group.interval_max, "stale": last + group.interval_max + group.margin + 1}
    found = {state: ran.first(lambda v, s=state: bus(script.drive, v, group.name) == s) for state in expected}  # type: ignore[misc]
    print(f"last frame at sample {last}; interval_max {group.interval_max}, margin {group.margin}: {({s: k for s, (k, _) in found.items()})}; frames again at {again[:2]}")
    assert found == {s: (k, FIRST + k * T) for s, k in expected.items()}
    assert ran.first(lambda v: v.k >= back and bus(script.drive, v, group.name) == "good") == (again[1], FIRST + again[1] * T)
    assert not ran.misses


def test_from_fault_to_flag_in_virtual_time(tmp_path: Path) -> None:
    """The flag leaves with the closing frame of the very sample in which the detector finds the fault."""
    start, samples = 60, 110
    script = Script.of(samples, faults=(f"controller2:bias:3@{start}",))
    verdicts, _ = script.drive.take([f for _, f in script.frames], lockstep=False)
    k = next(v.k for v in verdicts if v.plant == "confirmed")
    ran = script.run(tmp_path, "--samples", samples)
    assert ran.first(lambda v: v.plant == "confirmed") == (k, FIRST + k * T)
    print(f"fault at sample {start}, flag at {k}: {k - start} samples, {(k - start) * T / 1e6:g} s")


def test_a_start_without_any_frame_is_reported(tmp_path: Path) -> None:
    """In a moving plant the first deadline counts from the start; the verdict then says that nothing is known."""
    ran = Script(Drive(), []).run(tmp_path, "--samples", 3, rest=False)
    at, first = ran.verdicts[0]
    assert (at, first.plant, set(first.bus)) == (T + SLACK, "starting", {"absent"})
