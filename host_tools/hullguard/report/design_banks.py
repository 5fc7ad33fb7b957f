"""The parts of a design's report that are not about observers: banks, which faults can be told apart, derived signals, what everything costs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from hullguard.design.bank_facts import BankFacts, bank_facts
from hullguard.design.cost import costs
from hullguard.design.design import Design
from hullguard.design.isolation import WITHIN, Pair
from hullguard.design.mismatch import mismatch_table
from hullguard.design.zonotope_table import TRUNCATE
from hullguard.model.schema import Model
from hullguard.report.page import Cell, esc, num, plural, table

AGES_MAX = 8  # columns of the table of predicted radii
BANK_INTRO = (
    "A certificate is a parity vector over a window of what was received: the proof, found by a linear programme on a simulated faulty run, that no healthy "
    "course explains that window. A bank holds those that together come closest to the earliest sound detection, each with its exact threshold."
)
ISOLATING_INTRO = "A bank “not X” holds certificates that no course of fault X moves. When one alarms, X alone is no explanation any more."
SMALLEST = (
    "Smallest constant fault, in its signal's unit, whose response alone reaches a certificate's threshold at the usual radii within so many samples of its "
    "start. A dash: none of the bank's certificates sees the fault until then."
)


def banks_section(design: Design) -> Iterator[str]:
    """Every bank: what it is made of, and what it sees."""
    facts = bank_facts(design)
    if not facts:
        return
    yield "<h2>Banks of certificates</h2>"
    yield f"<p>{esc(BANK_INTRO)}{' ' + esc(ISOLATING_INTRO) if any(f.stored.hypothesis is not None for f in facts) else ''}</p>"
    yield _sizes(facts)
    for learnt in _learnt(design, facts):
        yield f'<p class="note">{esc(learnt)}</p>'
    yield from _sees(design.model, facts)


def _sizes(facts: Sequence[BankFacts]) -> str:
    rows = [[f.name, f.table.certificates, f.table.window, len(f.table.signal), len(f.table.extra), f.cost.coefficients, f.cost.flash_bytes, f.cost.multiplications] for f in facts]
    header = ["bank", "#certificates", "#window (samples)", "#signals", "#derived radii", "#coefficients", "#flash (bytes)", "#multiplications a sample"]
    return table(header, rows, "Flash in single precision.")


def _learnt(design: Design, facts: Sequence[BankFacts]) -> Iterator[str]:
    """One line for the bank for detection, one for all hypotheses."""
    for isolating in (False, True):
        mine = [f for f in facts if (f.stored.hypothesis is not None) == isolating]
        if not mine:
            continue
        s = mine[0].learnt
        sizes, ways = ", ".join(f"±{num(x)}" for x in s.sizes), " and ".join("at rest" if r.kind == "rest" else f"under {r.kind} manoeuvres" for r in s.references)
        whom = "The bank for detection learnt" if not isolating else "Each bank for isolation learnt"
        faults = "every other fault that can be told from its own" if isolating else ", ".join(design.model.faults[i].name for i in s.faults)
        yield f"{whom} from {plural(s.runs, 'run')} of each fault, size, sign and way of driving: {faults}; sizes {sizes}; {ways}; seed {s.seed}; {sum(f.runs for f in mine)} runs."


def _sees(model: Model, facts: Sequence[BankFacts]) -> Iterator[str]:
    """Of the bank for detection at several horizons, of those for isolation at the shortest."""
    for f in facts:
        if f.stored.hypothesis is None:
            rows = [[model.faults[fault].name, *[_size(x) for x in f.smallest[place]]] for place, fault in enumerate(f.faults)]
            yield table([f"fault seen by the {f.name}", *[f"#within {w} samples" for w in f.within]], rows, SMALLEST)
    isolating = [f for f in facts if f.stored.hypothesis is not None]
    if isolating:
        faults = sorted({i for f in isolating for i in f.faults})
        seen = [{fault: f.smallest[place, 0] for place, fault in enumerate(f.faults)} for f in isolating]
        rows = [[model.faults[i].name, *[_size(s[i]) if i in s else None for s in seen]] for i in faults]
        yield table(["fault present", *[f"#{f.name}" for f in isolating]], rows, f"The same of the banks for isolation, within {isolating[0].within[0]} samples.")


def _size(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None


# --- isolability ---------------------------------------------------------------------------------------------------------


def isolability_section(design: Design, pairs: Sequence[Pair]) -> Iterator[str]:
    """Which fault can be told from which, as a square, and why not where not."""
    if not pairs:
        return
    faults = sorted({p.truth for p in pairs})
    names, by = [f.name for f in design.model.faults], {(p.truth, p.hypothesis): p for p in pairs}
    yield "<h2>Which faults can be told apart</h2>"
    rows = [[names[i], *[_cell(by.get((i, j))) for j in faults]] for i in faults]
    caption = (
        "A row a fault that is there, a column a hypothesis: the smallest constant fault, in its signal's unit, that no course of the hypothesis explains "
        f"within {WITHIN} samples, at the usual radii. It is the limit of any sound detector that looks at so long a window."
        + (" The plant is taken to be in the middle of its intervals." if design.tables.mismatch is not None else "")
    )
    yield table(["fault present", *[f"#not {names[j]}" for j in faults]], rows, caption)
    reasons = [p for p in pairs if p.reason]
    if reasons:
        yield "<p>Why some cannot:</p><ul>" + "".join(f"<li>{esc(names[p.truth])} from {esc(names[p.hypothesis])}: {esc(p.reason)}.</li>" for p in reasons) + "</ul>"


def _cell(pair: Pair | None) -> object:
    if pair is None:
        return "·"
    return Cell("never", "bad") if not pair.separable else Cell("not soon", "bad") if pair.smallest is None else pair.smallest


# --- derived signals, thresholds -----------------------------------------------------------------------------------------


def derived_section(design: Design) -> Iterator[str]:
    """Zonotopes, prediction between frames, uncertain parameters: what each changes, where the model has it."""
    parts = [*_zonotopes(design), *_prediction(design), *_mismatch(design)]
    if parts:
        yield "<h2>What the radii and thresholds rest on</h2>"
        yield from parts


def _zonotopes(design: Design) -> Iterator[str]:
    used = [(i, g.zonotope) for i, g in enumerate(design.generators) if g.zonotope is not None]
    if not used:
        return
    yield "<h3>Zonotope thresholds</h3>"
    if any(z.reduction == TRUNCATE for _, z in used):
        warning = "The threshold is the publication's: what does not fit is dropped, not covered. It is no outer bound, so false alarms are possible; it is there for comparison."
        yield f"<aside><p>{esc(warning)}</p></aside>"
    rows = [[design.judges[i], z.order, z.columns, "dropped" if z.reduction == TRUNCATE else "covered", z.recover, z.ready_rest, z.ready_moving] for i, z in used]
    header = ["", "#order", "#columns", "what does not fit is", "#samples until an overflow is forgotten", "#ready from rest", "#in motion"]
    caption = "The set of what the observer's state can be, moved on in every sample. Weights, composition and start of the generators above are those of the exact hull."
    yield table(header, rows, caption)


def _prediction(design: Design) -> Iterator[str]:
    if not design.tables.predictors:
        return
    yield "<h3>Prediction between frames</h3>"
    model, rows = design.model, []
    longest = max(len(p.radius) for p in design.tables.predictors)
    ages = sorted({int(a) for a in np.unique(np.round(np.linspace(1, longest, min(AGES_MAX, longest))))})
    for p in design.tables.predictors:
        group, trigger = design.tables.groups[p.group], model.groups[p.group].trigger
        for place, signal in enumerate(group.signals):
            i = p.first + place
            slew = [float(group.slew[a - 1][place]) + signal.half if a <= len(group.slew) else None for a in ages]
            rows.append([signal.name, "predicted", *[float(p.radius[a - 1][place]) if a <= len(p.radius) else None for a in ages]])
            rows.append(["", "slew", *slew])
            delta, sigma = float(trigger.delta[:, place].max()), float(trigger.sigma[:, place].max())
            promise = sigma + delta * model.signals[i].scale / 2
            rows.append(["", "promise", *[promise if min(group.silence) < a < group.interval_max else None for a in ages]])
    yield table(
        ["signal", "radius from", *[f"#{a}" for a in ages]],
        rows,
        "Radius of each signal by the samples since its last frame: of the prediction, of the largest slew, and of the sender's promise (at half its activity "
        "scale, the largest of its levels). The detector takes the smallest that holds.",
    )


def _moved(design: Design) -> tuple[int, ...]:
    """The states that uncertain parameters move, in the order of their radii."""
    return mismatch_table(design.model, design.stored.state_range)[1] if design.tables.mismatch is not None else ()


def uncertain_names(design: Design) -> list[str]:
    """What the radii are called that stand for uncertain parameters."""
    return [f"uncertain {design.model.plant.states[i]}" for i in _moved(design)]


def _mismatch(design: Design) -> Iterator[str]:
    found = design.tables.mismatch
    if found is None:
        return
    model = design.model
    yield "<h3>Uncertain parameters</h3>"
    states = _moved(design)
    usual = design.usual[len(design.usual) - len(states) :]
    rows = []
    for i, state in enumerate(states):
        terms = [f"{num(g)} |{model.signals[s].name}|" for s, g in zip(found.signal, found.gain[i], strict=True) if g > 0]
        rows.append([model.plant.states[state], " + ".join([num(found.constant[i]), *terms]), float(usual[i])])
    caption = "How far the uncertain parameters can move a state beyond the middle of their intervals in one sample; |signal| is its value's magnitude plus its radius."
    yield table(["state", "at most", "#usually"], rows, caption)


# --- cost ----------------------------------------------------------------------------------------------------------------


def cost_section(design: Design) -> Iterator[str]:
    """Multiplications, flash and RAM of every part."""
    every = costs(design)
    yield "<h2>Cost on the ECU</h2>"
    rows: list[list[object]] = [[c.name, c.multiplications, c.coefficients, c.flash_bytes, c.ram_bytes] for c in every]
    if len(every) > 1:
        rows.append(["all", sum(c.multiplications for c in every), sum(c.coefficients for c in every), sum(c.flash_bytes for c in every), sum(c.ram_bytes for c in every)])
    yield table(
        ["part", "#multiplications a sample", "#coefficients", "#flash (bytes)", "#RAM (bytes)"],
        rows,
        "Numbers in single precision; index tables, triggers, messages and the code itself come on top.",
    )


# --- for --json ----------------------------------------------------------------------------------------------------------


def as_json(design: Design, pairs: Sequence[Pair]) -> dict[str, object]:
    """The same for programs; isolability is null where it was not asked for."""
    names = [f.name for f in design.model.faults]
    banks = [
        {
            "name": f.name,
            "certificates": f.table.certificates,
            "window": f.table.window,
            "hypothesis": None if f.stored.hypothesis is None else names[f.stored.hypothesis],
            "faults": [names[i] for i in f.faults],
            "learnt": {
                "faults": [names[i] for i in f.learnt.faults],
                "sizes": list(f.learnt.sizes),
                "references": [r.kind for r in f.learnt.references],
                "runs": f.runs,
                "seed": f.learnt.seed,
            },
            "smallest_fault_within": {
                str(w): {names[i]: float(x) if np.isfinite(x) else None for i, x in zip(f.faults, f.smallest[:, n], strict=True)} for n, w in enumerate(f.within)
            },
        }
        for f in bank_facts(design)
    ]
    cost = [{"part": c.name, "multiplications": c.multiplications, "coefficients": c.coefficients, "flash_bytes": c.flash_bytes, "ram_bytes": c.ram_bytes} for c in costs(design)]
    found = [
        {"fault": names[p.truth], "hypothesis": names[p.hypothesis], "separable": p.separable, "smallest_fault": p.smallest, "within": WITHIN, "reason": p.reason} for p in pairs
    ]
    predicted = [
        {"group": design.tables.groups[p.group].name, "signals": [s.name for s in design.tables.groups[p.group].signals], "radius": [list(row) for row in p.radius]}
        for p in design.tables.predictors
    ]
    return {"banks": banks, "isolability": found or None, "prediction": predicted, "cost": cost}
