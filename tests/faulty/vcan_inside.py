"""vcan_inside.py NODE OUT FRAMES EACH: at least FRAMES faulty frames in all and EACH of every directive, over all actions, on a real SocketCAN stack, run where vcan0 exists. Writes OUT/vcan.json.

The node on the bus, a process of its own, and one in this process get the same frames; every frame it sends must be the one this process sends,
and in the end every counter of every group must be the same. What the acceptance filter keeps away (foreign identifiers, error frames)
is on the bus all the same. In lockstep, so that nothing depends on how fast this machine is.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "node"))

from hullguard.campaign.frames_all import FrameCase, all_cases
from hullguard.campaign.frames_study import codec_for
from hullguard.inject.engine import Injector, Sent
from hullguard.inject.labels import Ledger
from inside_support import Drive, collect, link, process, ready
from node_support import SEED

SAMPLES, FIRST, LAST = 600, 10, 500
FAULT = "controller1:bias:2@300"
COUNTERS = ("good", "lost", "crc", "format", "repeated", "early", "late", "sequence", "untrusted", "numeric", "invalid")


class Case:
    """One directive, as many runs as it needs for its share of frames."""

    def __init__(self, node: str, out: Path, case: FrameCase) -> None:
        self.node, self.out, self.case = node, out, case
        self.frames = self.runs = self.injected = 0
        self.differences: list[str] = []

    def run(self, run: int) -> None:
        """One run."""
        made, native = ready()
        drive, ledger = Drive(faults=(FAULT,), seed=SEED + run), Ledger()
        injector = Injector([self.case.directive], codec_for(made), SEED + run, True, ledger)
        file = self.out / "health.txt"
        said: list[str] = []
        with link() as bus, process(self.node, "--rest", "--lockstep", "--health", file) as node:
            for k in range(SAMPLES):
                frames, closing = drive.sample()
                for i, frame in enumerate([*frames, closing]):
                    self._exchange(bus, drive, injector.take(frame, (k + 0.1 * (i + 1)) * made.model.sample_time_s), said)
            self._exchange(bus, drive, injector.finish(), said)
            node.stop()
        if node.status != 0 or node.err:
            self.differences.append(f"the node ended with status {node.status}: {node.err[-300:]}")
        if not any("confirmed" in s for s in said):
            self.differences.append(f"run {run}: the plant fault was not found")
        self._compare(drive, file)
        self.injected += sum(ledger.actions.values())
        self.runs += 1

    def _exchange(self, bus: Any, drive: Drive, sent: list[Sent], said: list[str]) -> None:
        for s in sent:
            verdicts, expected = drive.take([s.frame])
            said += [v.plant for v in verdicts]
            bus.send(s.frame)
            self.frames += 1
            if expected:
                got = collect(bus, {drive.verdict_id, drive.status_id}, len(expected))
                if got != expected and len(self.differences) < 5:
                    self.differences.append(f"{s.time_s:.3f} s: the node said {[f.data.hex() for f in got]}, expected {[f.data.hex() for f in expected]}")

    def _compare(self, drive: Drive, file: Path) -> None:
        told = dict(line.rsplit(" ", 1) for line in file.read_text().splitlines())
        for i, g in enumerate(drive.native.tables.groups):
            own = drive.native.library.lib.hg_node_health(drive.shadow.node, i)
            for name in COUNTERS:
                here, there = int(getattr(own, name)), int(told[f"{g.name}.{name}"])
                if here != there:
                    self.differences.append(f"{g.name}.{name}: {there} on the bus, {here} in this process")


def main(node: str, out: Path, wanted: int, each: int) -> int:
    """Every directive; then floods, the quickest, until there are as many frames as asked for."""
    made, _ = ready()
    cases = [Case(node, out, c) for c in all_cases(made.model, made.tables, codec_for(made), FIRST, LAST)]
    began = time.monotonic()
    for i, case in enumerate(cases):
        while case.injected < each and not case.differences:
            case.run(case.runs)
        print(f"{i + 1}/{len(cases)} {case.case.spec}: {case.injected} in {case.runs} runs, {time.monotonic() - began:.0f} s {case.differences[:1] or ''}", flush=True)
    floods = [c for c in cases if c.case.directive.action == "flood"]
    while sum(c.injected for c in cases) < wanted and not any(c.differences for c in floods):
        for case in floods:
            case.run(case.runs)
    rows = [{"spec": c.case.spec, "class": c.case.kind, "runs": c.runs, "frames": c.frames, "injected": c.injected, "differences": c.differences} for c in cases]
    result = {"seed": SEED, "injected": sum(c.injected for c in cases), "frames": sum(c.frames for c in cases), "seconds": round(time.monotonic() - began), "rows": rows}
    (out / "vcan.json").write_text(json.dumps(result, indent=1) + "\n")
    print(f"{result['injected']} faulty frames of {result['frames']} on the bus, {sum(bool(c.differences) for c in cases)} directives with a difference")
    return int(any(c.differences for c in cases))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])))
