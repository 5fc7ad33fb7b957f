"""The openacc model on a recorded drive: false alarms, bits, and every small step fault from every start.

    python tests/openacc/openacc.py FILE.csv        a recording with the model's columns (make openacc DATA=FILE.csv)
    python tests/openacc/openacc.py --generated     a drive of the model's own emulator, shorter; what `make test` runs

Recorded speeds, gaps and accelerations are derived from one another: the manoeuvres are real, the sensors' noise is not. So the noise that
the model states is added, uniform and seeded; the accelerometer knows a(k-1) at k; faults go into a reading before its trigger sees it;
every signal is sent by events and every frame is counted, the tick and the verdicts too. Exit status 1 when a figure misses its limit.
"""

from __future__ import annotations

import argparse
import csv
import sys
import tempfile
from pathlib import Path

import numpy as np
from hullguard.core.library import library
from hullguard.core.native import MOVING, Batch, Native
from hullguard.design.design import Design, design
from hullguard.errors import HullguardError
from hullguard.model import FaultSpec, load_model
from hullguard.model.schema import Reference
from hullguard.model.table import Array
from hullguard.plant.recording import read_recording
from hullguard.plant.run import periodic_bits

SEED = 1
WITHIN = 20  # samples in which a step has to be found
FOUND = 0.99
BITS = 0.45
FIRST, STEP = 50, 7
SLOW_WITHIN = 300
CARS = range(1, 6)
REST = Reference("rest", 0.0, 1)


def generated(made: Design, native: Native, samples: int) -> Array:
    """A drive of the emulator, without sensor noise: what a recording would hold."""
    quiet = np.random.default_rng(SEED).uniform(-1, 1, (samples, made.model.plant.Ed.shape[1]))
    quiet[:, made.model.plant.n :] = 0.0  # the columns behind the states' own are the sensors' noise
    trace = Batch(native, made, samples, made.model.scenario(None).reference, seed=SEED, disturbance=quiet).trace()
    return trace["reading"]


def identified(made: Design, series: Array) -> list[tuple[str, float, float]]:
    """(what, largest value on the first half of the drive, bound of the model): disturbances and slews."""
    model, half = made.model, series[: len(series) // 2]
    place = {s.name: i for i, s in enumerate(model.signals)}
    period = model.sample_time_s
    col = {name: half[:, i] for name, i in place.items()}
    found = []
    for i in CARS:
        v, a = col[f"speed{i}_mps"], col[f"accel{i}_mps2"]
        row = model.plant.states.index(f"speed{i}_mps")
        own = float(model.plant.Ed[row, row])
        found.append((f"speed{i} disturbance, m/s", float(np.abs(np.diff(v) - period * a[:-1]).max()), own))
        if i > 1:
            ahead, before = col[f"speed{i - 1}_mps"], col[f"accel{i - 1}_mps2"]
            g = col[f"gap{i}_m"]
            error = np.diff(g) - period * (ahead - v)[:-1] - period**2 / 2 * (before - a)[:-1]
            row = model.plant.states.index(f"gap{i}_m")
            found.append((f"gap{i} disturbance, m", float(np.abs(error).max()), float(model.plant.Ed[row, row])))
    for s in model.signals:
        assert s.slew is not None
        found.append((f"{s.name} slew, a sample", float(np.abs(np.diff(col[s.name])).max()) + 2 * s.noise, s.slew[0]))
        found.append((f"{s.name} range", float(max(np.abs(col[s.name] - (s.low + s.high) / 2))) + s.noise, (s.high - s.low) / 2))
    return found


def steps() -> list[FaultSpec]:
    """0.5 m on each gap and 0.5 m/s on each speed, both signs."""
    names = [f"speed{i}_mps" for i in CARS] + [f"gap{i}_m" for i in CARS if i > 1]
    return [FaultSpec(n, "bias", size, 0, None) for n in names for size in (0.5, -0.5)]


def slow() -> list[FaultSpec]:
    """Faults that creep or hide: reported, not judged."""
    faults = [FaultSpec(s.format(i), "freeze", 0.0, 0, None) for i in CARS for s in ("speed{}_mps", "gap{}_m", "accel{}_mps2") if not (i == 1 and s.startswith("gap"))]
    faults += [FaultSpec(f"accel{i}_mps2", "bias", size, 0, None) for i in CARS for size in (0.5, -0.5)]
    return faults + [FaultSpec(f"gap{i}_m", "drift", size, 0, None) for i in CARS if i > 1 for size in (0.1, -0.1)]


def table(title: str, faults: list[FaultSpec], delay: Array, within: int) -> Array:
    """Print share found and delay of each fault; the matrix of hits."""
    hit = (delay >= 0) & (delay <= within)
    print(title)
    for j, f in enumerate(faults):
        size = "" if f.kind == "freeze" else f":{f.size:g}"
        mean = f"mean delay {delay[hit[:, j], j].mean():.2f}" if hit[:, j].any() else "never"
        print(f"  {f.name}:{f.kind}{size:6s} {100 * hit[:, j].mean():7.2f} %   {mean}")
    print(f"  all: {100 * hit.mean():.3f} % of {hit.size} runs")
    return hit


def main() -> int:
    """Run all; 0 when every limit is met."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("csv", nargs="?")
    parser.add_argument("--generated", action="store_true")
    parser.add_argument("--misses", default="build/openacc-misses.txt", help="file that lists every missed fault SPEC")
    args = parser.parse_args()
    made, _ = design(load_model("openacc"))
    native = Native(library("f32"), made.tables)
    if args.generated:
        series = generated(made, native, 3000)
        with tempfile.TemporaryDirectory() as folder:
            # Through a file, as a recording would come; the delay of the accelerations is put in before it.
            path = Path(folder) / "drive.csv"
            undelayed = series.copy()
            for i, signal in enumerate(made.model.signals):
                if signal.csv_delay:
                    undelayed[: -signal.csv_delay, i] = series[signal.csv_delay :, i]
            with path.open("w", newline="") as file:
                writer = csv.writer(file)
                writer.writerow([s.name for s in made.model.signals])
                writer.writerows([f"{x:.9g}" for x in row] for row in undelayed)
            series = read_recording(path, made.model)
    elif args.csv:
        series = read_recording(Path(args.csv), made.model)
    else:
        parser.error("give a recording, or --generated")
    failures: list[str] = []
    print(f"drive of {len(series)} samples, model hash {made.tables.hash:08x}, seed {SEED}")
    print("bounds, identified on the first half:")
    for what, value, bound in identified(made, series):
        if value > bound:
            failures.append(f"{what}: {value:.4g} on the first half exceeds the model's {bound:.4g}")
        if "disturbance" in what or value > bound:
            print(f"  {what}: {value:.5f} (model {bound:g})")

    batch = Batch(native, made, len(series), REST, seed=SEED, start=MOVING, series=series, noise=True)
    result = batch.runs(0, 1)[0]
    trace = batch.trace(0)
    _, every, measured, _ = periodic_bits(made, native, trace["reading"].tolist())
    groups = len(made.model.groups) - 1
    print(f"fault-free: {result['false_provisional']} provisional and {result['false_confirmed']} confirmed false alarms, largest |r|/J {result['margin']:.3f}")
    print(f"measurement frames: {100 * result['measurement'] / groups / len(series):.1f} % of periodic, intervals {result['interval_min']}..{result['interval_max']}")
    print(
        f"bits, all frames counted: {result['bits']} = {100 * result['bits'] / measured:.1f} % of the measurement groups sent periodically ({measured}), "
        f"{100 * result['bits'] / every:.1f} % with the tick counted on both sides"
    )
    if result["false_provisional"]:
        failures.append("a false alarm")
    if result["bits"] > BITS * measured:
        failures.append(f"more than {100 * BITS:.0f} % of the bits of periodic sending")

    last = min(9200, len(series) - WITHIN - 2)
    starts = (last - FIRST) // STEP + 1
    last = FIRST + STEP * (starts - 1)
    faults = steps()
    hit = table(f"steps, from every start {FIRST}..{last} in steps of {STEP}, found within {WITHIN} samples:", faults, batch.sweep(faults, FIRST, STEP, starts, WITHIN + 1), WITHIN)
    missed = [str(FaultSpec(f.name, f.kind, f.size, FIRST + STEP * int(s), None)) for s, j in np.argwhere(~hit) for f in [faults[j]]]
    out = Path(args.misses)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text("".join(m + "\n" for m in missed))
    print(f"  {len(missed)} missed, listed in {out}" + (": " + ", ".join(missed[:6]) + (" .." if len(missed) > 6 else "") if missed else ""))
    if hit.mean() < FOUND:
        failures.append(f"{100 * hit.mean():.2f} % of the steps found, fewer than {100 * FOUND:.0f} %")
    creeping = slow()
    few = (len(series) - SLOW_WITHIN - FIRST - 2) // (10 * STEP) + 1
    table(f"slow faults, from {few} starts, found within {SLOW_WITHIN} samples (reported only):", creeping, batch.sweep(creeping, FIRST, STEP * 10, few, SLOW_WITHIN + 1), SLOW_WITHIN)
    for f in failures:
        print(f"FAILED: {f}")
    return 1 if failures else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except HullguardError as error:
        print(f"openacc: {error}", file=sys.stderr)
        sys.exit(error.status)
