"""sensor_inside.py SENSOR DETECTOR OUT TICKS: a sensor node and a detector node, each on an emulated board, on one bus, run where vcan0 exists. Writes
OUT/SENSOR-sensor.json.

This process plays the plant: its readings go to the sensor's console, its control frames to the bus. Every frame of the sensor must be, byte for
byte, the one that the host's sender makes of the same readings, and its silence the same; the detector's hold in this process, fed with the
sensor's frames, must have the sensor's own codes in every sample; and the detector board must answer what the detector in this process answers.
"""

from __future__ import annotations

import json
import math
import struct
import sys
import time
from pathlib import Path

from board_support import Board, board
from hullguard.bus.link import CanLink
from inside_support import Drive, collect, link

MEASUREMENT, CONTROL = 0, 1


def spoiled(reading: list[float], k: int) -> list[float]:
    """Now and then a reading that is no number, or out of range."""
    bad = {13: math.nan, 29: 1e9, 43: -math.inf}.get(k % 97)
    return reading if bad is None else [bad, *reading[1:]]


class Loop:
    """Both boards, and what this process knows of both."""

    def __init__(self, bus: CanLink, sensor: Board, ticks: int) -> None:
        self.bus, self.sensor = bus, sensor
        self.drive = Drive(faults=(f"gap12_sensor:bias:3@{ticks - ticks // 10}",))
        self.width = len(self.drive.native.tables.groups[MEASUREMENT].signals)
        self.sent = 0
        self.plants: dict[str, int] = {}
        self.differences: list[str] = []

    def expect(self, what: str, got: object, wanted: object) -> None:
        """Note a difference; the first few tell enough."""
        if got != wanted and len(self.differences) < 5:
            self.differences.append(f"sample {self.drive.k}: {what}: {got}, expected {wanted}")

    def ask(self, reading: list[float]) -> tuple[str, list[int]]:
        """Give the sensor its readings; what it did, and its last sent codes."""
        self.sensor.key(" ".join(struct.pack(">f", r).hex() for r in reading) + "\n")
        word, *codes = self.sensor.line().split()
        return word, [int.from_bytes(bytes.fromhex(c), "big", signed=True) for c in codes]

    def sample(self) -> None:
        """One sample."""
        drive = self.drive
        reading = spoiled(drive.source.read(), drive.k)
        drive.source.move()
        frame, closing = drive.sender.step(MEASUREMENT, drive.k, reading), drive.sender.step(CONTROL, drive.k, reading)
        word, codes = self.ask(reading[: self.width])
        self.expect("the sensor", word, "sent" if frame else "silent")
        heard = collect(self.bus, {drive.native.tables.groups[MEASUREMENT].message.id}, 1) if word == "sent" else []
        self.expect("its frame", heard, [frame] if frame else [])
        self.sent += len(heard)
        assert closing is not None, "the control group speaks in every sample"
        verdicts, expected = drive.take([*heard, closing])
        self.expect("the hold", list(drive.shadow.node.detector.memory.hold[MEASUREMENT].sent[0 : self.width]), codes)
        self.bus.send(closing)
        self.expect("the detector", collect(self.bus, {drive.verdict_id, drive.status_id}, len(expected)), expected)
        for v in verdicts:
            self.plants[v.plant] = self.plants.get(v.plant, 0) + 1
        drive.k += 1


def main(sensor_name: str, detector_name: str, out: Path, ticks: int) -> int:
    """One boot of both."""
    out.mkdir(parents=True, exist_ok=True)
    with link() as bus, board(detector_name) as detector, board(sensor_name, "sensor") as sensor:
        sensor.key("40000000 zz\n")
        loop = Loop(bus, sensor, ticks)
        loop.expect("a line that is no reading", sensor.line(), "what")
        began = time.monotonic()
        for _ in range(ticks):
            loop.sample()
        seconds = time.monotonic() - began
        loop.expect("steps", detector.health()["steps"], ticks)
        loop.expect("exit status", (sensor.leave(), detector.leave()), (0, 0))
    if not loop.plants.get("confirmed"):
        loop.differences.append("the sensor fault was not found")
    told = {"ticks": ticks, "frames": loop.sent, "plant": loop.plants, "seconds": round(seconds, 1), "differences": loop.differences}
    result = {"sensor": sensor_name, "detector": detector_name} | told
    (out / f"{sensor_name}-sensor.json").write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result))
    return int(bool(loop.differences))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], Path(sys.argv[3]), int(sys.argv[4])))
