"""Run inside with-vcan by test_formats_bus.py: how long a verdict takes from its closing frame, by the kernel's stamps, beside a process that
echoes the same frames without a detector: what is left of the first over the second is the detector's, the rest the host's."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from hullguard.bus import formats
from hullguard.core.native import read_verdict
from inside_support import Drive, collect, link, node, process, recorded
from node_support import BUS_TIMER

SAMPLES, FAULT = 300, 150
ECHO_ID = 0x7A0


def us(values: list[float]) -> str:
    """Median, 90th and 99th percentile, largest."""
    return "  ".join(f"{x * 1e6:7.0f}" for x in (*np.percentile(values, [50, 90, 99]), max(values)))


def test_latency_from_frame_to_verdict(tmp_path: Path) -> None:
    drive = Drive(faults=(f"controller2:bias:3@{FAULT}",))
    log, found = tmp_path / "both.log", 0
    both = recorded(log, "candump", "-L", "-r", 4000000, "vcan0", "vcan1", filters=2)
    with link() as bus, link("vcan1") as other, process(BUS_TIMER, "echo", "vcan1"), node("--lockstep", "--rest"), both:
        for _ in range(SAMPLES):
            frames, tick = drive.sample()
            verdicts, expected = drive.take([*frames, tick])
            found = found or next((v.k for v in verdicts if v.plant == "confirmed"), 0)
            # One after the other, so that both answers meet the same host.
            for frame in [*frames, tick]:
                bus.send(frame)
            assert collect(bus, {drive.verdict_id, drive.status_id}, len(expected)) == expected
            other.send(tick)
            collect(other, {ECHO_ID}, 1)
    closing = drive.native.tables.groups[drive.native.tables.closing].message.id
    asked: dict[str, float] = {}
    latency: dict[str, list[float]] = {"vcan0": [], "vcan1": []}
    flagged: list[int] = []
    for e in formats.read(log):
        if e.frame.id == closing:
            asked[e.channel] = e.time_s
        elif e.frame.id in (drive.verdict_id, ECHO_ID):
            latency[e.channel].append(e.time_s - asked[e.channel])
            told = read_verdict(drive.native, e.frame)
            if told is not None and told.plant == "confirmed":
                flagged.append(told.k)
    flag_us = latency["vcan0"][flagged[0]] * 1e6
    table = [
        f"latency on {os.environ.get('WITH_VCAN', 'vcan')}, {SAMPLES} samples, us:   p50      p90      p99      max",
        f"  closing frame to verdict (detector_node)   {us(latency['vcan0'])}",
        f"  the same frame echoed (the host alone)     {us(latency['vcan1'])}",
        f"  fault to flag: sample {FAULT} to {flagged[0]}, {flagged[0] - FAULT} samples, as in process; verdict frame {flag_us:.0f} us after its closing frame",
    ]
    print("\n".join(f"TIMING {line}" for line in table))
    # Host and guest schedule as they please; what they cannot change: each frame is answered once, afterwards, and in its own sample.
    assert len(latency["vcan0"]) == len(latency["vcan1"]) == SAMPLES
    assert min(latency["vcan0"]) >= 0 and min(latency["vcan1"]) >= 0
    assert flagged[0] == found > FAULT
    # The detector's share of a median, which single stalls do not move, is small against a sample of 100 ms.
    assert np.median(latency["vcan0"]) - np.median(latency["vcan1"]) < 0.2 * drive.design.model.sample_time_s
