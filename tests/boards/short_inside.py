"""short_inside.py OUT: what `make check` runs of boards, where vcan0 and vcan1 exist: some hundred samples of each, a sensor node, and the quick part of the
node's tests. In one process, because a guest and the start of Python take longer than most of it."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import board_support
import boards_inside
import pytest
import sensor_inside

DETECTOR_TICKS, SENSOR_TICKS = 300, 100


def main(out: Path) -> int:
    """The first failure ends it."""
    names = list(board_support.COMMANDS)
    for name in names:
        if boards_inside.main(name, out, DETECTOR_TICKS):
            return 1
        print(f"  ok  detector node on board {name}")
    if sensor_inside.main(names[0], names[0], out, SENSOR_TICKS):
        return 1
    print(f"  ok  sensor node and detector node on board {names[0]}")
    os.environ["HULLGUARD_NODES"] = ",".join(names)
    tests = [str(board_support.ROOT / "tests" / "node" / "bus_inside.py"), "-m", "quick", "-q", "--tb=short", "-p", "no:cacheprovider", "-p", "no:hypothesispytest"]
    if pytest.main(tests):
        return 1
    print(f"  ok  tests of a node on a bus, the quick ones, on boards {', '.join(names)}")
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
