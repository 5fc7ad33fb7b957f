"""exact.py [--deep]: soundness, exactly. HULLGUARD_SEED=n repeats a run.

    oracle      the library in every number type against rational numbers (oracle.py): shipped linear models, a variant with prediction, random small models
    adversary   the search for a fault-free run that alarms (adversary.py): every shipped set-based model, an uncertain one, random ones; also where frames are lost
    statistics  what models of kind "polynomial" promise is a probability: false alarms over many runs against it

Fails on the first promise that does not hold, on an alarm without a fault, on |r| / J above 1, and where the adversary comes less near to 1 than it has to: one
that finds nothing shows nothing.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tomllib
import traceback
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from adversary import Found, Search
from hullguard.campaign import polynomial_study
from hullguard.core.native import MOVING, REST
from hullguard.design.design import Design, design
from hullguard.errors import InputError
from hullguard.model import load_model
from oracle import BrokenError, Run, Worst
from result import write
from test_soundness import made_of, random_source

ROOT = Path(__file__).resolve().parents[2]
MODELS = ROOT / "host_tools" / "models"
SEED = int(os.environ.get("HULLGUARD_SEED") or int.from_bytes(os.urandom(4), "little"))
REALS = ("f32", "f64", "q31")
STARTS = {"rest": REST, "moving": MOVING}
LOSS = 0.15
UNCERTAIN = {"plant.drag_per_s": {"value": 1.0, "pm": 0.1}}
PREDICTED = {"detector.prediction": True}
ZONOTOPE = {"detector.threshold": "zonotope"}
SILENT = {"groups.measurement.trigger.silence": 1}
# How near to 1 the adversary must come, for each kind of judge; of a model that is not here NEAR_OTHER.
NEAR = {
    "platoon": {"residuals": 0.97},
    "platoon-silent": {"residuals": 0.95},
    "platoon-uncertain": {"residuals": 0.95},
    "platoon-predicted": {"residuals": 0.95},
    "platoon-zonotope": {"residuals": 0.9},
    "platoon_bank": {"residuals": 0.95, "banks": 0.95},
    "platoon_bank-together": {"residuals": 0.8, "banks": 0.9},
    "openacc": {"residuals": 0.98},
    "dc_motor": {"residuals": 0.95, "banks": 0.95},
    "battery_pack": {"residuals": 0.95},
    "suspension": {"residuals": 0.93, "estimates": 0.99},
    "suspension_published": {"residuals": 0.5, "estimates": 0.9},
}
NEAR_OTHER = 0.3


@dataclass(frozen=True)
class Subject:
    """A model, or a random one."""

    name: str
    model: str = ""
    overrides: tuple[tuple[str, Any], ...] = ()
    random: int = 0

    def design(self) -> Design:
        """Made once, before the processes are."""
        return _random(self.random) if self.random else _designed(self.model or self.name, json.dumps(dict(self.overrides)))


@cache
def _designed(model: str, overrides: str) -> Design:
    return design(load_model(model, json.loads(overrides)))[0]


@cache
def _random(number: int) -> Design:
    """The first random model from this number on that can be designed."""
    for more in range(50):
        try:
            return made_of(random_source(np.random.default_rng([SEED, 100 * number + more])))
        except InputError:
            continue
    raise BrokenError(f"random model {number}: nearly everything is refused")


@dataclass(frozen=True)
class Job:
    """Something to do in a process of its own, and its line in the table."""

    part: str
    subject: Subject
    real: str
    start: str
    loss: float
    samples: int
    count: int
    kind: str = "residuals"  # adversary: what to aim at

    def __str__(self) -> str:
        return f"{self.part} {self.subject.name} {self.real} start {self.start}{f' loss {self.loss:g}' if self.loss else ''}{f' {self.kind}' if self.part == 'adversary' else ''}"


@dataclass
class Done:
    """What came of it."""

    job: Job
    worst: Worst | None = None
    found: Found | None = None
    kinds: dict[str, float] = field(default_factory=dict)
    shares: list[float] = field(default_factory=list)  # of a promised probability
    wrong: str = ""


def oracle(job: Job) -> Done:
    """`count` runs of so many samples each."""
    worst = Worst()
    made = job.subject.design()
    for i in range(job.count):
        worst = worst.join(Run(made, job.real, SEED + i, job.loss, STARTS[job.start]).samples(job.samples))
    return Done(job, worst)


def kinds_of(made: Design) -> dict[str, slice]:
    """Places of residuals, banks and estimates in what a search measures."""
    t = made.tables
    own = t.residuals - len(t.banks)
    return {"residuals": slice(0, own), "banks": slice(own, t.residuals), "estimates": slice(t.residuals, None)}


def adversary(job: Job) -> Done:
    """`count` attacks, one aim after another, at samples and with signs that are drawn."""
    made = job.subject.design()
    search = Search(made, job.real, STARTS[job.start], job.samples, SEED, job.loss)
    rng = np.random.default_rng([SEED, job.samples])
    places = range(len(search.found.ratio))[kinds_of(made)[job.kind]]
    aims = [a for a in search.aims if a.place in places]
    for i in rng.permutation(max(job.count, len(aims)))[: job.count]:
        search.attack(aims[int(i) % len(aims)], int(rng.integers(job.samples // 4, job.samples)), float(rng.choice([-1.0, 1.0])))
    found = search.found
    kinds = {name: float(found.ratio[part].max()) for name, part in kinds_of(made).items() if found.ratio[part].size}
    done = Done(job, found=found, kinds=kinds)
    if found.confirmed or (not job.loss and found.provisional):
        done.wrong = f"a false alarm: {found.provisional} provisional, {found.confirmed} confirmed"
    elif not job.loss and found.largest > 1.0:
        done.wrong = f"|r| / J reaches {found.largest:.6f} without a fault"
    elif found.outside > found.runs:
        done.wrong = f"{found.outside} of {found.outside + found.runs} runs left what the model declares: the search is wrong"
    return done


def statistics(job: Job) -> Done:
    """False alarms of the polynomial filter against the probability that is promised whatever the noise, and a control that must break it."""
    checks = [c for c in polynomial_study.promises(polynomial_study.Study(job.count, SEED, job.real)) if "false alarms" in c.what]
    failed = [str(c) for c in checks if not c.passed]
    return Done(job, shares=[c.value / c.high for c in checks if "control" not in c.what], wrong="; ".join(failed))


PARTS: dict[str, Callable[[Job], Done]] = {"oracle": oracle, "adversary": adversary, "statistics": statistics}


def do(job: Job) -> Done:
    """Never raises: what was wrong comes back."""
    try:
        return PARTS[job.part](job)
    except BrokenError as broken:
        return Done(job, wrong=str(broken))
    except Exception:
        return Done(job, wrong=traceback.format_exc())


def shipped() -> list[Subject]:
    """Set-based models, by name, and variants."""
    return [Subject(file.stem) for file in sorted(MODELS.glob("*.toml")) if ".design" not in file.name and kind_of(file) in ("linear", "uio")]


def kind_of(file: Path) -> str:
    """What a model file says, or the one it is based on."""
    source = tomllib.loads(file.read_text(encoding="utf-8"))
    return str(source["kind"]) if "kind" in source else kind_of(file.parent / source["base"])


VARIANTS = (
    Subject("platoon-silent", "platoon", tuple(SILENT.items())),
    Subject("platoon-uncertain", "platoon", tuple(UNCERTAIN.items())),
    Subject("platoon-predicted", "platoon", tuple(PREDICTED.items())),
    Subject("platoon-zonotope", "platoon", tuple(ZONOTOPE.items())),
    Subject("platoon_bank-together", "platoon_bank", tuple((UNCERTAIN | PREDICTED | ZONOTOPE).items())),
)


def jobs(deep: bool, only: list[str]) -> list[Job]:
    """What there is to do, of these models alone if there are any."""
    more = 10 if deep else 1
    made = [Job("statistics", Subject("polynomial"), "f32", "rest", 0.0, 300, 20 * more)] if not only or "polynomial" in only else []
    randoms = [Subject(f"random {i}", random=i) for i in range(1, 41 if deep else 5)]
    for subject in [s for s in (*shipped(), *VARIANTS, *randoms) if not only or s.name in only]:
        d = subject.design()
        uio = bool(d.uios)
        fewer = 1 if subject.random or d.model.plant.n > 6 else 2
        losses = (0.0, LOSS)
        if not uio:
            reals = [r for r in REALS if r != "q31" or d.tables.fixed is not None]
            made += [Job("oracle", subject, real, start, loss, 40, fewer * more) for real in reals for start in STARTS for loss in losses]
        samples = 25 if d.model.plant.n > 6 else 45
        for start in STARTS:
            for kind, part in kinds_of(d).items():
                size = d.tables.residuals + sum(len(u.names) for u in d.uios)
                if range(size)[part]:
                    count = 6 if subject.random else 30
                    made.append(Job("adversary", subject, "f32", start, 0.0, samples, count * more, kind))
                    made.append(Job("adversary", subject, "f32", start, LOSS, samples, max(2, count // 4) * more, kind))
                    if d.tables.fixed is not None:
                        made.append(Job("adversary", subject, "q31", start, 0.0, samples, max(2, count // 4) * more, kind))
            if uio:
                made.append(Job("adversary", subject, "f32", start, 0.0, 300 if deep else 120, 2 * more, "residuals"))
    return made


def table(done: list[Done]) -> list[str]:
    """A line a model and part; what was found wrong beside it."""
    lines = ["", f"{'model':<30} {'|true-value|/radius':>20} {'rounding/bound':>15} {'(J-J_exact)/allowed':>20} {'J/J_exact':>11}"]
    names = list(dict.fromkeys(d.job.subject.name for d in done))
    for name in names:
        worst = [d.worst for d in done if d.worst is not None and d.job.subject.name == name]
        if worst:
            w = worst[0]
            for other in worst[1:]:
                w = w.join(other)
            hulls = f"{w.slack:>20.3f} {w.low:>11.8f}" if w.low < float("inf") else f"{'no hull':>20}"
            lines.append(f"{name:<30} {w.hold:>20.4f} {w.rounding:>15.3f} {hulls}")
    lines += ["", f"{'model, largest |r|/J reached':<30} {'residuals':>10} {'banks':>10} {'estimates':>10} {'runs':>7} {'alarms':>7}   with losses: {'runs':>6} confirmed"]
    for name in names:
        own = [d for d in done if d.found is not None and d.job.subject.name == name]
        if own:
            best = nearest(own)
            shown = [f"{best[kind]:>10.4f}" if kind in best else f"{'':>10}" for kind in ("residuals", "banks", "estimates")]
            sure, lossy = [d.found for d in own if not d.job.loss], [d.found for d in own if d.job.loss]
            runs, alarms = sum(f.runs for f in sure if f), sum(f.provisional for f in sure if f)
            lines.append(f"{name:<30} {' '.join(shown)} {runs:>7} {alarms:>7}   {'':>13}{sum(f.runs for f in lossy if f):>6} {sum(f.confirmed for f in lossy if f):>9}")
    shares = [x for d in done for x in d.shares]
    return lines + (
        ["", f"polynomial filters: at most {max(shares):.3f} of the false alarms that are promised, over {len(shares)} statistics and kinds of noise"] if shares else []
    )


def nearest(done: list[Done]) -> dict[str, float]:
    """Without losses, the largest ratio of each kind."""
    best: dict[str, float] = {}
    for d in done:
        if not d.job.loss:
            for kind, ratio in d.kinds.items():
                best[kind] = max(best.get(kind, 0.0), ratio)
    return best


def blunt(done: list[Done]) -> list[str]:
    """Models to whose thresholds the adversary did not come near enough to show anything."""
    found = []
    for name in dict.fromkeys(d.job.subject.name for d in done if d.found is not None):
        best = nearest([d for d in done if d.job.subject.name == name])
        for kind, limit in NEAR.get(name, {"residuals": NEAR_OTHER if not name.startswith("random") else 0.0}).items():
            if best.get(kind, 0.0) < limit:
                found.append(f"{name}: the adversary brings {kind} to {best.get(kind, 0.0):.3f} of the threshold, less than {limit:g}: it shows nothing")
    return found


def main() -> int:
    """All jobs; exit status 1 when something is wrong."""
    parser = argparse.ArgumentParser(description="soundness against exact numbers and an adversary")
    parser.add_argument("--deep", action="store_true", help="ten times as many runs, and more random models")
    parser.add_argument("--only", nargs="+", default=[], metavar="MODEL", help="these models alone, and no result is left")
    asked = parser.parse_args()
    print(f"HULLGUARD_SEED={SEED}", flush=True)
    todo = jobs(asked.deep, asked.only)
    if not todo:
        parser.error(f"no set-based model among {', '.join(asked.only)}")
    with ProcessPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        done = list(pool.map(do, todo))
    print("\n".join(table(done)))
    wrong = [f"{d.job}: {d.wrong}" for d in done if d.wrong] + blunt(done)
    for line in wrong:
        print(f"FAILED {line}")
    if not wrong and not asked.only:
        say(done)
    print(f"  ok  {len(done)} parts" if not wrong else f"{len(wrong)} of {len(done)} parts failed")
    return 1 if wrong else 0


def say(done: list[Done]) -> None:
    """Leave what is promised."""
    exactly = [d.worst for d in done if d.worst is not None]
    best = nearest([d for d in done if d.found is not None])
    runs = sum(d.found.runs for d in done if d.found is not None)
    samples = sum(w.samples for w in exactly)
    write(
        "exact",
        [
            (
                "in exact rational numbers no held value is further from the truth than its radius, also in the samples that a gap has rewritten",
                f"{samples} samples in {len(exactly)} settings, at most {max(w.hold for w in exactly):.4f} of a radius",
            ),
            ("no residual is further from that of rational numbers than rounding is proven to move it", f"at most {max(w.rounding for w in exactly):.3f} of the bound"),
            (
                "no threshold is below the exact hull of its radii, and none further above than the design says",
                f"J / J_exact at least {min(w.low for w in exactly):.8f}, at most {max(w.slack for w in exactly):.2f} of what is allowed above",
            ),
            (
                "no disturbance, initial state, reference, road or plant within its bounds that linear programmes find raises an alarm; none is confirmed where frames are lost",
                f"{runs} runs; residuals reach {best['residuals']:.4f}, banks {best['banks']:.4f}, estimates {best['estimates']:.4f} of their thresholds",
            ),
            (
                "false alarms of polynomial filters are as rare as promised whatever the noise, with a confidence of 99.9 %",
                f"at most {max(x for d in done for x in d.shares):.3f} of the promised probability",
            ),
        ],
    )


if __name__ == "__main__":
    sys.exit(main())
