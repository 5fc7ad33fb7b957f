"""boards_inside.py BOARD OUT TICKS: a detector node on an emulated board, TICKS samples in one boot with every kind of faulty frame, run where vcan0
and vcan1 exist. Writes OUT/BOARD.json.

The board on vcan0, the Linux node on vcan1 and a node in this process get the same frames of the same emulated plant and injector. Every frame
the board and the Linux node send must be, byte for byte, the one this process sends, to every closing frame its answer; and in the end every
counter of every group must be the same. In lockstep, so that nothing depends on how fast this machine is; the board's own timer is for
tests/node/bus_inside.py.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

from board_support import Board, board, seen
from hullguard.bus.link import CanLink
from hullguard.campaign.frames_all import all_cases
from hullguard.campaign.frames_study import codec_for
from hullguard.core.native import Frame
from hullguard.inject.directive import Directive
from hullguard.inject.engine import Injector
from hullguard.inject.labels import Ledger
from inside_support import Drive, Process, collect, link, node, reachable, ready
from node_support import SEED

FIRST = 10
WIDTH_MIN = 3  # samples for each directive
COUNTERS = ("good", "lost", "crc", "format", "repeated", "early", "late", "sequence", "untrusted", "numeric", "invalid")


def directives(ticks: int) -> list[Directive]:
    """Every case of a campaign with faulty frames, one after the other: each in a window of its own, as many samples of quiet behind it."""
    made, _ = ready()
    codec = codec_for(made)
    count = len(all_cases(made.model, made.tables, codec, 0, 1))
    width = (ticks - FIRST - ticks // 20) // count
    if width < WIDTH_MIN:
        sys.exit(f"boards_inside.py: {ticks} ticks are too few for {count} directives; give at least {(WIDTH_MIN * count + FIRST) * 20 // 19 + 20}")
    starts = [FIRST + i * width for i in range(count)]
    return [all_cases(made.model, made.tables, codec, start, start + (width - 1) // 2)[i].directive for i, start in enumerate(starts)]


class Twins:
    """The board, the Linux node, and the node in this process."""

    def __init__(self, name: str, on_board: CanLink, on_linux: CanLink, drive: Drive) -> None:
        self.name, self.drive = name, drive
        self.links = {"board": on_board, "linux": on_linux}
        self.frames = self.received = self.steps = self.answers = 0
        self.differences: list[str] = []
        self.plants: dict[str, int] = {}

    def give(self, frame: Frame) -> None:
        """One frame on both buses; what both answer is compared."""
        self.frames += 1
        taken = seen(self.name, frame)
        verdicts, expected = self.drive.take([taken] if taken else [])
        self.received += taken is not None and reachable(self.drive.native, taken)
        self.steps += len(verdicts)
        self.answers += len(expected)
        for v in verdicts:
            self.plants[v.plant] = self.plants.get(v.plant, 0) + 1
        self.links["board"].send(frame)
        if taken:
            self.links["linux"].send(taken)
        for who, bus in self.links.items() if expected else ():
            got = collect(bus, {self.drive.verdict_id, self.drive.status_id}, len(expected))
            if got != expected and len(self.differences) < 5:
                self.differences.append(f"sample {self.drive.k}: {who} said {[f.data.hex() for f in got]}, expected {[f.data.hex() for f in expected]}")

    def compare(self, who: str, told: dict[str, int]) -> None:
        """Counters of every group."""
        for i, g in enumerate(self.drive.native.tables.groups):
            own = self.drive.native.library.lib.hg_node_health(self.drive.shadow.node, i)
            for name in COUNTERS:
                here, there = int(getattr(own, name)), told[f"{g.name}.{name}"]
                if here != there:
                    self.differences.append(f"{g.name}.{name}: {there} by {who}, {here} in this process")


def run(name: str, ticks: int, machine: Board, linux: Process, file: Path) -> dict[str, Any]:
    """The drive."""
    made, _ = ready()
    drive, ledger = Drive(faults=(f"controller1:bias:2@{ticks - ticks // 25}",)), Ledger()
    injector = Injector(directives(ticks), codec_for(made), SEED, True, ledger)
    with link("vcan0") as on_board, link("vcan1") as on_linux:
        twins = Twins(name, on_board, on_linux, drive)
        began = time.monotonic()
        for k in range(ticks):
            frames, closing = drive.sample()
            for i, frame in enumerate([*frames, closing]):
                for s in injector.take(frame, (k + 0.1 * (i + 1)) * made.model.sample_time_s):
                    twins.give(s.frame)
        for s in injector.finish():
            twins.give(s.frame)
        seconds = time.monotonic() - began
        told = machine.settled(twins.received)
    linux.stop()
    twins.compare("the board", told)
    twins.compare("the Linux node", {n: int(c) for n, c in (line.rsplit(" ", 1) for line in file.read_text().splitlines())})
    exact = {"steps": twins.steps, "unsent": 0, "can.received": twins.received, "can.sent": twins.answers, "can.lost": 0, "can.refused": 0, "can.malformed": 0, "can.bus": 1}
    twins.differences += [f"{n}: {told[n]} on the board, expected {v}" for n, v in exact.items() if told[n] != v]
    if not twins.plants.get("confirmed"):
        twins.differences.append("the plant fault was not found")
    return {
        "board": name, "seed": SEED, "ticks": ticks, "steps": twins.steps, "frames": twins.frames, "injected": sum(ledger.actions.values()), "verdicts": twins.answers,
        "plant": twins.plants, "seconds": round(seconds, 1), "round_trips_per_s": round(twins.answers / seconds), "differences": twins.differences,
    }  # fmt: skip


def main(name: str, out: Path, ticks: int) -> int:
    """One boot."""
    out.mkdir(parents=True, exist_ok=True)
    file = out / f"{name}-linux.txt"
    began = time.monotonic()
    with board(name) as machine, node("--interface", "vcan1", "--rest", "--lockstep", "--health", file) as linux:
        booted = time.monotonic() - began
        result = run(name, ticks, machine, linux, file) | {"boot_s": round(booted, 1), "exit_status": machine.leave()}
    (out / f"{name}.json").write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result))
    return int(bool(result["differences"]) or result["exit_status"] != 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])))
