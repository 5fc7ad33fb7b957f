"""The same seed in process and on vcan, where the detector node is a process of its own: the same frames, the same verdicts.
And the whole chain, sender to verdict, against a second implementation in double precision (tests/oracle)."""

from __future__ import annotations

import csv
import json
import sys
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hullguard.bus import candump
from hullguard.design.design import Design, design
from hullguard.model import load_model
from node_support import HERE, ORACLE_RUN, ROOT, SEED, command, in_guest

sys.path.insert(0, str(ROOT / "tests" / "oracle"))
from export import export  # noqa: E402


@dataclass(frozen=True)
class Case:
    """One run, made twice."""

    model: str
    scenario: str
    real: str

    @property
    def name(self) -> str:
        return f"{self.model}-{self.scenario}-{self.real}"

    @property
    def compiled_in(self) -> bool:
        """A scenario that overrides the model's tables is not what the C node has."""
        return self.scenario != "adaptive"

    def arguments(self, out: Path, bus: str) -> list[str]:
        return ["run", self.model, "--scenario", self.scenario, "--real", self.real, "--seed", str(SEED), "--bus", bus, "--out", str(out / self.name), "--json"]


EVERY = [("platoon", "default"), ("platoon", "rest"), ("platoon", "manoeuvres"), ("platoon", "adaptive"), ("openacc", "default")]
SINGLE = [Case(m, s, "f32") for m, s in EVERY]
DOUBLE = [Case(m, s, "f64") for m, s in EVERY]
ON_VCAN = [*SINGLE, Case("platoon", "default", "f64"), Case("openacc", "default", "f64")]
HERE_AND_NOW = [*SINGLE, *DOUBLE]
BUS_STATES = ("absent", "good", "lossy", "stale")
PLANTS = {"starting": 0, "none": 1, "provisional": 2, "confirmed": 3}

# How far float64 and the oracle may differ. r: rounding of two orders of summation. J: the library adds proven rounding allowances and cuts
# the sum off with a bound of its tail, so it is never below the oracle's and at most 2 % above.
R_TOLERANCE = 1e-7
J_BELOW = 1e-8
J_ABOVE = 1.02


@dataclass(frozen=True)
class Ended:
    """A finished run."""

    status: int
    result: dict[str, Any]
    err: str
    files: Path

    def log(self) -> dict[int, list[tuple[int, bytes]]]:
        """Frames by identifier, without time stamp and channel."""
        frames = defaultdict(list)
        for entry in candump.read(self.files / "run.log"):
            frames[entry.frame.id].append((entry.frame.flags, entry.frame.data))
        return frames

    def columns(self) -> dict[str, np.ndarray]:
        with (self.files / "signals.csv").open(newline="") as file:
            rows = list(csv.reader(file))
        return dict(zip(rows[0], np.array(rows[1:], dtype=float).T, strict=True))


def made(folder: Path, cases: list[Case], bus: str, launch: list[str]) -> dict[Case, Ended]:
    folder.mkdir()
    (folder / "commands").write_text(json.dumps({c.name: c.arguments(folder, bus) for c in cases}))
    done = command([*launch, sys.executable, str(HERE / "commands_inside.py"), str(folder / "commands")], HULLGUARD_INSIDE="1")
    assert done.returncode == 0, f"{' '.join(launch)}: exit status {done.returncode}: {done.stdout} {done.stderr}"
    found = {}
    for c in cases:
        told = json.loads((folder / f"{c.name}.json").read_text())
        found[c] = Ended(told["status"], json.loads(told["out"] or "{}"), told["err"], folder / c.name)
    return found


@pytest.fixture(scope="module")
def in_process(tmp_path_factory: pytest.TempPathFactory) -> dict[Case, Ended]:
    return made(tmp_path_factory.mktemp("same") / "process", HERE_AND_NOW, "inprocess", [])


@pytest.fixture(scope="module")
def on_vcan(tmp_path_factory: pytest.TempPathFactory) -> dict[Case, Ended]:
    return made(tmp_path_factory.mktemp("same") / "vcan", ON_VCAN, "auto", in_guest())


@pytest.mark.parametrize("case", ON_VCAN, ids=lambda c: c.name)
def test_same_seed_same_verdicts(case: Case, in_process: dict[Case, Ended], on_vcan: dict[Case, Ended]) -> None:
    inside, outside = on_vcan[case], in_process[case]
    assert (inside.status, outside.status) == (0, 0), f"{inside.err}\n{outside.err}"
    node = ("detector_node" if case.real == "f32" else "detector_node_f64") if case.compiled_in else "hullguard detect"
    assert f"node: {node}, a process of its own" in inside.err.splitlines()
    assert "node:" not in outside.err
    assert inside.result["bus"].startswith("vcan0") and outside.result["bus"] == "in process (no CAN bus)"
    for key in ("verdicts", "faults", "frames", "communication"):
        assert inside.result[key] == outside.result[key], key
    assert {k: v for k, v in inside.result.items() if k != "bus"} == {k: v for k, v in outside.result.items() if k != "bus"}


@pytest.mark.parametrize("case", ON_VCAN, ids=lambda c: c.name)
def test_same_seed_same_frames(case: Case, in_process: dict[Case, Ended], on_vcan: dict[Case, Ended]) -> None:
    inside, outside = on_vcan[case], in_process[case]
    assert inside.log() == outside.log()
    for name in ("signals.csv", "labels.csv"):
        assert (inside.files / name).read_bytes() == (outside.files / name).read_bytes(), name
    times = [e.time_s for e in candump.read(inside.files / "run.log")]
    assert times == sorted(times), "a log has one clock"


@pytest.mark.parametrize("case", ON_VCAN, ids=lambda c: c.name)
def test_another_seed_is_another_run(case: Case, in_process: dict[Case, Ended]) -> None:
    """The comparison above can fail: the seed reaches the frames."""
    other = Case(case.model, "manoeuvres" if case.scenario == "rest" else "rest", case.real) if case.model == "platoon" else None
    if other in in_process:
        assert in_process[case].log() != in_process[other].log()
    log = in_process[case].log()
    assert len(set(log[min(log)])) > 1, "readings move"


@pytest.mark.parametrize("case", ON_VCAN, ids=lambda c: c.name)
def test_no_false_alarm(case: Case, on_vcan: dict[Case, Ended]) -> None:
    result = on_vcan[case].result
    assert result["false_alarms"] == {"provisional": 0, "confirmed": 0}
    assert result["margin_max"] <= 1.0


# ---- the oracle ----


def prepared(case: Case) -> Design:
    return design(load_model(case.model, {}, case.scenario))[0]


def oracle(case: Case, run: Ended, folder: Path) -> tuple[np.ndarray, list[str], Design]:
    """Rows k, plant, bus, r.., J.. of the second implementation, fed with the readings that the run recorded."""
    ready = prepared(case)
    export(ready, folder / "model.txt")
    columns = run.columns()
    names = [s.name for s in ready.model.signals]
    with (folder / "signals.csv").open("w") as file:
        file.write(",".join(names) + "\n")
        file.writelines(",".join(f"{columns[n][k]:.17g}" for n in names) + "\n" for k in range(len(columns["k"])))
    done = command([str(ORACLE_RUN), str(folder / "model.txt"), str(folder / "signals.csv")])
    assert done.returncode == 0, done.stderr
    return np.array([[float(x) for x in line.split(",")] for line in done.stdout.splitlines()]), names, ready


def bus_bits(run: Ended, groups: list[str]) -> list[int]:
    """Bus health of every sample, as the verdict frame carries it, from the changes in the JSON object."""
    changes = {v["k"]: sum(BUS_STATES.index(v["bus"][g]) << 2 * i for i, g in enumerate(groups)) for v in run.result["verdicts"]}
    bits, now = [], -1
    for k in range(run.result["samples"]):
        now = changes.get(k, now)
        bits.append(now)
    return bits


@pytest.mark.parametrize("case", DOUBLE, ids=lambda c: c.name)
def test_float64_against_the_oracle(case: Case, in_process: dict[Case, Ended], tmp_path: Path) -> None:
    run = in_process[case]
    rows, _, ready = oracle(case, run, tmp_path)
    columns = run.columns()
    labels = [c[1:] for c in columns if c.startswith("r") and f"J{c[1:]}" in columns]
    width = len(labels)
    assert rows.shape == (run.result["samples"], 3 + 2 * width)
    r, J = (np.column_stack([columns[letter + name] for name in labels]) for letter in "rJ")
    r_oracle, J_oracle = rows[:, 3 : 3 + width], rows[:, 3 + width :]
    difference, ratio = np.abs(r - r_oracle) / J_oracle, J / J_oracle
    print(f"|r - oracle| / J at most {difference.max():.3g}, J / oracle {ratio.min():.9f} .. {ratio.max():.9f}")
    assert difference.max() <= R_TOLERANCE, f"sample {difference.max(axis=1).argmax()}"
    assert ratio.min() >= 1.0 - J_BELOW, f"a threshold below the exact one, sample {ratio.min(axis=1).argmin()}"
    assert ratio.max() <= J_ABOVE, f"sample {ratio.max(axis=1).argmax()}"
    assert rows[:, 1].astype(int).tolist() == columns["plant"].astype(int).tolist()
    assert rows[:, 2].astype(int).tolist() == bus_bits(run, [g.name for g in ready.tables.groups])
    if run.result["faults"]:
        assert PLANTS["confirmed"] in rows[:, 1], "the oracle finds the fault as well"


@pytest.mark.parametrize("case", SINGLE, ids=lambda c: c.name)
def test_float32_verdicts_are_the_oracles(case: Case, in_process: dict[Case, Ended], tmp_path: Path) -> None:
    """Single precision widens its thresholds by what it may round: an alarm of its own is the oracle's too."""
    run = in_process[case]
    rows, *_ = oracle(case, run, tmp_path)
    alarms, exact = run.columns()["plant"] >= PLANTS["provisional"], np.abs(rows[:, 3 : 3 + (rows.shape[1] - 3) // 2]) > rows[:, 3 + (rows.shape[1] - 3) // 2 :]
    first, first_exact = np.flatnonzero(alarms), np.flatnonzero(exact.any(axis=1))
    if len(first):
        assert len(first_exact) and first_exact[0] <= first[0]
