"""same.py SAMPLES: the five-sensor model with 15 % of the frames lost, the same at 100 Hz with half of its frames late and 5 % lost, and two cars; in process and
on a CAN bus with the Linux node. In each run the copies of the filter, one a node, the plain filter that is told values without frames, and the node on the bus must
have one digest of all states; and both runs the same. Exit status 1 otherwise.

HULLGUARD_SEED=n: another course.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from typing import Any

MODELS = (("fusion5", "lossy"), ("fusion5_fast", "delayed"), ("tracking", "default"))


def run(model: str, scenario: str, bus: str, samples: int, seed: str) -> dict[str, Any]:
    """One run of the command; what it printed."""
    began = time.monotonic()
    command = [sys.executable, "-m", "hullguard", "run", model, "--scenario", scenario, "--no-fault", "--samples", str(samples), "--seed", seed, "--bus", bus, "--json"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{model} on {bus}: exit status {done.returncode}: {done.stderr.strip()}")
    found: dict[str, Any] = json.loads(done.stdout)
    copies = found["copies"]
    print(
        f"{model:12s} {found['bus']}: {samples} samples, {sum(s['lost'] for s in found['per_sensor'].values())} frames lost, {copies['nodes']} copies, unequal in "
        f"{copies['samples_unequal']}; digest {copies['digest']}, of the node {copies['node_digest'] or '-'}; {time.monotonic() - began:.0f} s",
        flush=True,
    )
    return found


def main() -> int:
    """Print each run; 1 when digests differ."""
    samples, seed = int(sys.argv[1]), os.environ.get("HULLGUARD_SEED", "1")
    print(f"HULLGUARD_SEED={seed}", flush=True)
    good = True
    for model, scenario in MODELS:
        runs = [run(model, scenario, bus, samples, seed) for bus in ("inprocess", "auto")]
        digests = {r["copies"]["digest"] for r in runs} | {r["copies"]["node_digest"] for r in runs if r["copies"]["node_digest"]}
        same = len(digests) == 1 and not any(r["copies"]["samples_unequal"] for r in runs) and runs[1]["copies"]["node_digest"] is not None
        print(f"{model}: {'equal to the bit' if same else 'FAILED: not equal'}")
        good = good and same
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
