"""A drive of a motor on a bench, recorded: what the tutorial (host_tools/docs/tutorial.md) identifies bounds from.

python host_tools/examples/motor_drive.py drive.csv [SEED [FRICTION]]

The motor here is what its data sheet says and a little more: dry friction, cogging, dead time of the bridge, noise of both sensors. Forty seconds, a hundred
rows each; a row holds the readings of a sample and the voltage commanded in it. FRICTION is the dry friction in N m: 0.002 when the bearings are warm.
"""

import csv
import math
import random
import sys
from pathlib import Path

SAMPLE_S = 0.01
SAMPLES = 4000
STEPS = 100  # of integration, a sample

RESISTANCE_OHM, INDUCTANCE_H, CONSTANT, INERTIA_KGM2, VISCOUS_NMS = 1.0, 0.002, 0.05, 0.0002, 0.00005  # the data sheet; CONSTANT in V s/rad and N m/A
WARM_NM, COGGING_NM, POLES, DEAD_V = 0.002, 0.001, 14, 0.04  # what it does not say
COUNT_RADPS, SHUNT_A = 0.15, 0.04  # noise of the readings, at most
WIRE_V = 0.002  # resolution of the commanded voltage on the bus

State = tuple[float, float, float]  # speed, current, angle


def slope(state: State, voltage_v: float, dry_nm: float) -> State:
    """The derivative of a state."""
    speed, current, angle = state
    load = VISCOUS_NMS * speed + dry_nm * math.tanh(speed) + COGGING_NM * math.sin(POLES * angle)
    applied = voltage_v - DEAD_V * math.tanh(10.0 * current)
    return (CONSTANT * current - load) / INERTIA_KGM2, (applied - RESISTANCE_OHM * current - CONSTANT * speed) / INDUCTANCE_H, speed


def moved(state: State, voltage_v: float, dry_nm: float) -> State:
    """The next sample's state, the voltage held; midpoint rule."""
    dt = SAMPLE_S / STEPS
    for _ in range(STEPS):
        first = slope(state, voltage_v, dry_nm)
        second = slope((state[0] + dt / 2 * first[0], state[1] + dt / 2 * first[1], state[2] + dt / 2 * first[2]), voltage_v, dry_nm)
        state = (state[0] + dt * second[0], state[1] + dt * second[1], state[2] + dt * second[2])
    return state


def main() -> None:
    """Speeds to be reached, new ones every half to one and a half seconds, and what was read on the way."""
    target = Path(sys.argv[1])
    seed, dry_nm = (int(sys.argv[2]) if len(sys.argv) > 2 else 1), (float(sys.argv[3]) if len(sys.argv) > 3 else WARM_NM)
    rng = random.Random(seed)
    state: State = (0.0, 0.0, 0.0)
    wanted, until = 0.0, 0
    with target.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file)
        out.writerow(["time_s", "speed_radps", "current_a", "voltage_v"])
        for k in range(SAMPLES):
            if k == until:
                wanted, until = rng.uniform(-300.0, 300.0), k + rng.randint(50, 150)
            speed = state[0] + COUNT_RADPS * rng.uniform(-1.0, 1.0)
            current = state[1] + SHUNT_A * rng.uniform(-1.0, 1.0)
            command = max(-24.0, min(24.0, CONSTANT * wanted + 0.02 * (wanted - speed)))
            voltage = WIRE_V * round(command / WIRE_V)
            out.writerow([f"{k * SAMPLE_S:.2f}", f"{speed:.3f}", f"{current:.3f}", f"{voltage:.3f}"])
            state = moved(state, voltage, dry_nm)
    print(f"{target}: {SAMPLES} rows, {SAMPLES * SAMPLE_S:g} s")


main()
