"""`hullguard identify`."""

from __future__ import annotations

import argparse
import os
import tomllib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from hullguard.commands import emit, make_folder, progress, say
from hullguard.design import store
from hullguard.design.design import Design, finish, stored_for
from hullguard.errors import ExpectationError, InputError
from hullguard.identify import bounds, records, tradeoff
from hullguard.identify.moments import Shares, disagreement
from hullguard.identify.moments import shares as moment_shares
from hullguard.identify.records import Record
from hullguard.identify.structure import Structure, entries, structure
from hullguard.identify.write import Rewriter, rounded_up
from hullguard.model import Model
from hullguard.model.schema import NAME, find_model, load_model, parse_model
from hullguard.model.schema import source as read_source
from hullguard.model.table import Array

WIDER = 1.2  # times its half width: a range that a recording leaves
SHOWN = 5  # contradictions
DOUBTED = 0.25  # of all that a signal moves: noise that large is a model that explains little


@dataclass(frozen=True)
class Given:
    """What the command line names, read."""

    model: Model
    source: dict[str, Any]  # the model file's data
    text: str  # and its text
    paths: list[Path]
    lag: list[int]  # samples that each signal is late
    kept: bool  # the lags are the model's
    fitted: list[Record]
    held: list[Record]


@dataclass(frozen=True)
class Motion:
    """Slews and ranges, a [[signals]] entry each."""

    slew: dict[int, Array]  # horizon: what is written
    seen: dict[int, float]  # largest over one sample
    range: dict[int, tuple[float, float]]


@dataclass(frozen=True)
class Found:
    """All that was found."""

    structure: Structure
    shares: Shares
    fit: bounds.Fit
    written: Array  # parameters, margin and rounding included
    margin: bounds.Need | None  # of the held-out part, times `written`
    motion: Motion


@dataclass(frozen=True)
class Outcome:
    """The new model and how it does."""

    design: Design
    share: Array  # residuals x (parameters, OTHERS): of the thresholds
    curve: tradeoff.Curve
    chosen: tradeoff.Point | None
    fitted: tradeoff.Drive
    held: tradeoff.Drive | None
    moved: tuple[float, str]  # largest step of any record over its slew, and the signal


def run_identify(args: argparse.Namespace) -> int:
    """`hullguard identify`."""
    given = _given(args)
    out = Path(args.out) if args.out else Path("build") / "identified"
    target = out / f"{args.name or given.model.path.stem}.toml"
    if target.exists() and not args.force:
        raise InputError(f"{target} is there already; give --force to overwrite it, or another --out")
    wish = _smallest_fault(args.smallest_fault, given.model)
    with progress(args, f"identifying {given.model.name}") as tick:
        found = _find(args, given, tick)
        rewriter = _rewritten(args, given, found, out)
        model = parse_model(tomllib.loads(rewriter.text()), target)
        _check(found, model, tomllib.loads(rewriter.text()))
        stored, _ = stored_for(model, True, tick, os.cpu_count() or 1)
        curve = tradeoff.Curve(model, stored, given.fitted, tick)
        point = tradeoff.chosen(curve, model, args.bus_load, wish)
        if point is not None:
            why = f"for {args.bus_load:g} of the periodic frames" if args.bus_load is not None else f"for {args.smallest_fault}"
            rewriter.triggers(point.scale, f"{why}; {100 * point.drive.frames:.3g} % sent in {', '.join(p.name for p in given.paths)}")
            model = parse_model(tomllib.loads(rewriter.text()), target)
    make_folder(out)
    target.write_text(rewriter.text(), encoding="utf-8")
    store.write(store.path_of(target), model.path.stem, stored)
    stored, _ = stored_for(model, False, lambda *_: None)  # triggers that were chosen change the filters
    store.write(store.path_of(target), model.path.stem, stored)
    made = finish(model, stored)
    outcome = Outcome(
        design=made,
        share=tradeoff.shares(found.structure, made, found.written),
        curve=curve,
        chosen=point,
        fitted=tradeoff.drive(made, given.fitted),
        held=tradeoff.drive(made, given.held) if given.held else None,
        moved=_moved(given, made),
    )
    from hullguard.identify.report import write_report

    result = as_json(given, found, outcome, target)
    report = write_report(out / "identify.html", result)
    for line in describe(result):
        say(args, line)
    say(args, f"model: {target} (hullguard design {target}); report: {report}")
    emit(args, result)
    return _judge(found, outcome)


def _given(args: argparse.Namespace) -> Given:
    """Model and recordings; lags taken out."""
    path = find_model(args.model)
    model, data = load_model(args.model), read_source(path)
    if args.name is not None and not NAME.match(args.name):
        raise InputError(f"--name '{args.name}': expected a lower-case identifier of at most 31 characters")
    # A model over another one is written out whole: lists of both are one list then.
    own = path.read_text(encoding="utf-8")
    text = tomli_w.dumps(data) if "base" in tomllib.loads(own) else own
    paths = [Path(p) for p in args.csv]
    raw = records.read(paths, model)
    if args.noise:
        rng = np.random.default_rng(args.seed)
        raw = [r + rng.uniform(-1.0, 1.0, r.shape) * np.array([s.noise for s in model.signals]) for r in raw]
    kept = any(s.csv_delay for s in model.signals) or args.lag_max == 0
    if kept:
        latest = max(s.csv_delay for s in model.signals)
        lag = [latest - s.csv_delay for s in model.signals]
    else:
        lag = records.lags(model, [r[: round(len(r) * (1 - args.hold_out))] for r in raw], args.lag_max, lambda parts: disagreement(model.plant, parts))
    fitted, held = records.parted(model, paths, raw, [max(lag) - x for x in lag], args.hold_out)
    return Given(model, data, text, paths, lag, kept, fitted, held)


def _smallest_fault(text: str | None, model: Model) -> tuple[str, float] | None:
    """--smallest-fault NAME:SIZE."""
    if text is None:
        return None
    name, _, size = text.partition(":")
    searched = [model.faults[f].name for o in model.observers for f in o.faults]
    try:
        value = float(size)
    except ValueError:
        value = float("nan")
    if name not in searched or not 0.0 < value < np.inf:
        known = ", ".join(dict.fromkeys(searched)) or "none"
        raise InputError(f"--smallest-fault '{text}': expected NAME:SIZE, SIZE above 0, NAME a fault that an observer is made for: {known}")
    return name, value


def _find(args: argparse.Namespace, given: Given, tick: bounds.Tick) -> Found:
    """Bounds from the fitted part, and how the rest keeps within them."""
    found = structure(given.model, given.source)
    shares = moment_shares(found, given.fitted)
    weight = _weights(args, found, tick)
    fit = bounds.fit(found, given.fitted, shares.sigma, weight, args.window, tick)
    written = np.array([rounded_up(b * (1 + args.margin)) for b in fit.bound])
    margin = bounds.margin(found, given.held, written, args.window, tick) if given.held else None
    return Found(found, shares, fit, written, margin, _motion(args, given))


def _weights(args: argparse.Namespace, found: Structure, tick: bounds.Tick) -> Array | None:
    """--split detection: what a unit of every bound is of the thresholds of the given model; none otherwise."""
    if args.split == bounds.MODE_MOMENTS:
        if args.weight:
            raise InputError("--weight needs --split detection: the bounds are in the proportion of their moments otherwise")
        return None
    named = {}
    for text in args.weight:
        name, _, value = text.rpartition("=")
        try:
            named[name] = float(value)
        except ValueError:
            named[name] = float("nan")
        if name not in [p.name for p in found.parameters] or not 0.0 < named[name] < np.inf:
            raise InputError(f"--weight '{text}': expected BOUND=W, W above 0, BOUND of: {', '.join(p.name for p in found.parameters)}")
    if len(named) == len(found.parameters):
        return np.array([named[p.name] for p in found.parameters])
    made = finish(found.model, stored_for(found.model, False, tick)[0])
    unit = tradeoff.shares(found, made, np.ones(len(found.parameters)))[:, : len(found.parameters)].mean(0)
    own = np.array([named.get(p.name, float(w)) for p, w in zip(found.parameters, unit, strict=True)])
    return np.asarray(np.maximum(own, 1e-6 * own.max()))


def _motion(args: argparse.Namespace, given: Given) -> Motion:
    """Slews and ranges that the recordings ask for."""
    model, entry = given.model, entries(given.model, given.source)
    horizon = {i: g.horizon for g in model.groups for i in g.signals}
    slew: dict[int, Array] = {}
    seen: dict[int, float] = {}
    leaves: dict[int, tuple[float, float]] = {}
    for i, s in enumerate(model.signals):
        low, high = (float(f([f(r.series[:, i]) for r in given.fitted])) for f in (np.min, np.max))
        if low < s.low or high > s.high:
            middle, half = (low + high) / 2, (high - low) / 2 * WIDER
            leaves[entry[s.name]] = (min(s.low, middle - half), max(s.high, middle + half))
        declared = s.slew is not None or (s.role == "output" and model.plant.feedback is None)
        if not declared:
            continue
        found = _moves(given.fitted, i, horizon[i]) * (1 + args.slew_margin) + s.resolution
        key = entry[s.name]
        slew[key] = np.maximum(slew[key][: len(found)], found[: len(slew[key])]) if key in slew else found
        seen[key] = max(seen.get(key, 0.0), float(_moves(given.fitted, i, 1)[0]))
    return Motion(slew, seen, leaves)


def _moved(given: Given, made: Design) -> tuple[float, str]:
    """The largest part of its slew that a signal uses, computed slews too."""
    parts, slew = [*given.fitted, *given.held], made.stored.slew
    used = [float((_moves(parts, i, slew.shape[1]) / slew[i]).max()) for i in range(len(made.model.signals))]
    worst = int(np.argmax(used))
    return used[worst], made.model.signals[worst].name


def _moves(parts: Sequence[Record], signal: int, horizon: int) -> Array:
    """Largest |s(k+j) - s(k)| for j = 1 .. horizon."""
    return np.maximum.accumulate([max(float(np.abs(r.series[j:, signal] - r.series[:-j, signal]).max()) for r in parts) for j in range(1, horizon + 1)])


def _rewritten(args: argparse.Namespace, given: Given, found: Found, out: Path) -> Rewriter:
    """The new model file, triggers as given."""
    origin = f"{', '.join(p.name for p in given.paths)}, first {100 * (1 - args.hold_out):.3g} %"
    rewriter = Rewriter(given.text, given.model, "identified")
    rewriter.head(
        [
            f"{given.model.path.name} with bounds found by `hullguard identify` in {origin}. What each was before, and the least that explains the recording,",
            f"stand beside it; what is written is {100 * args.margin:.3g} % more, slews {100 * args.slew_margin:.3g} %, rounded up. Next: hullguard design, then hullguard replay.",
        ],
        args.name,
    )
    rewriter.moved(out)
    rewriter.bounds(found.structure, found.written, found.fit.bound)
    rewriter.slews(found.motion.slew, found.motion.seen)
    rewriter.ranges(found.motion.range)
    if not given.kept and max(given.lag):
        entry = entries(given.model, given.source)
        delay = {entry[s.name]: max(given.lag) - x for s, x in zip(given.model.signals, given.lag, strict=True)}
        if any(delay[entry[s.name]] != max(given.lag) - x for s, x in zip(given.model.signals, given.lag, strict=True)):
            raise InputError("signals of one [[signals]] entry lag by different numbers of samples; write an entry for each, or align the recording and give --lag-max 0")
        rewriter.delays({i: d for i, d in delay.items() if d})
    return rewriter


def _check(found: Found, model: Model, data: dict[str, Any]) -> None:
    """The bounds that the new file gives are those that were to be written."""
    again = structure(model, data)
    # A matrix carries its bounds within itself.
    wanted = [(p.given, b) for p, b, old in zip(again.parameters, found.written, found.structure.parameters, strict=True) if not old.direction]
    if not all(np.isclose(x, b) for x, b in wanted):
        raise InputError(f"{model.path.name}: its layout has no place for a bound; write [[signals]] and [plant] as tables")


def as_json(given: Given, found: Found, outcome: Outcome, target: Path) -> dict[str, Any]:
    """The object that --json prints."""
    fit, m, names = found.fit, found.margin, [*(p.name for p in found.structure.parameters), *tradeoff.OTHERS]
    mean = outcome.share.mean(0)
    return {
        "model": given.model.name, "file": str(target), "recordings": [str(p) for p in given.paths], "sample_time_s": given.model.sample_time_s,
        "samples": sum(len(r.y) for r in given.fitted), "held_out": sum(len(r.y) for r in given.held),
        "bounds": _bounds(found, mean),
        "threshold_shares": dict(zip(names, mean.tolist(), strict=True)),
        "threshold_shares_by_residual": outcome.share.tolist(),
        "doubted": _doubted(given, found),
        "heavy_tails": fit.heavy, "cuts": fit.cuts,
        "window_factors": {"largest": fit.needs[0].factor, "usual": fit.usual},
        "tightest": asdict(fit.needs[0]),
        "contradictions": [asdict(n) for n in fit.contradictions[:SHOWN]],
        "lags": dict(zip((s.name for s in given.model.signals), given.lag, strict=True)), "lags_given": given.kept,
        "slews": {given.source["signals"][i]["name"]: {"seen": found.motion.seen[i], "written": float(s[0])} for i, s in found.motion.slew.items()},
        "ranges": {given.source["signals"][i]["name"]: list(r) for i, r in found.motion.range.items()},
        "hold_out": None if m is None or outcome.held is None else {
            "factor": m.factor, "record": m.record, "line": m.line, "equation": m.equation, **_drive(outcome.held),
        },
        "slew_used": {"factor": outcome.moved[0], "signal": outcome.moved[1]},
        "fitted": _drive(outcome.fitted),
        "smallest_fault": {k: v if np.isfinite(v) else None for k, v in tradeoff.least_faults(outcome.design).items()},
        "trade_off": [
            {"scale": p.scale, "frames": p.drive.frames, "margin_max": p.drive.margin, "smallest_fault": {k: v if np.isfinite(v) else None for k, v in p.smallest.items()}}
            for p in outcome.curve.points
        ],
        "chosen": outcome.chosen.scale if outcome.chosen else None,
    }  # fmt: skip


def _bounds(found: Found, share: Array) -> list[dict[str, Any]]:
    """A row a parameter."""
    rows = zip(found.structure.parameters, found.fit.bound, found.written, found.shares.sigma, found.shares.error, share[:-2], strict=True)
    return [
        {
            "name": p.name, "given": p.given, "smallest": float(least), "written": float(written), "sigma": float(sigma),
            "relative_error": float(error) if np.isfinite(error) else None, "share": float(part),
        }
        for p, least, written, sigma, error, part in rows
    ]  # fmt: skip


def _doubted(given: Given, found: Found) -> dict[str, float]:
    """Signals whose noise would have to be a large part of all that they move in the recordings, with that part."""
    least = {p.name: float(b) for p, b in zip(found.structure.parameters, found.fit.bound, strict=True)}
    moved = {s.name: max(float(np.ptp(r.series[:, i])) for r in given.fitted) for i, s in enumerate(given.model.signals)}
    share = {name: 2 * least[f"noise of {name}"] / span for name, span in moved.items() if span > 0.0 and f"noise of {name}" in least}
    return {name: part for name, part in share.items() if part >= DOUBTED}


def _drive(d: tradeoff.Drive) -> dict[str, Any]:
    return {"false_alarms": {"provisional": d.provisional, "confirmed": d.confirmed}, "margin_max": d.margin, "frames": d.frames}


def describe(result: dict[str, Any]) -> list[str]:
    """The result for people."""
    lines = []
    late = [f"{n} {x}" for n, x in result["lags"].items() if x]
    if late and not result["lags_given"]:
        lines.append("lags, samples: " + ", ".join(late))
    for b in result["bounds"]:
        error = b["relative_error"]
        sure = "the data do not show it apart from the others" if error is None or error > 0.5 else f"told apart to {100 * error:.2g} %"
        lines.append(f"{b['name']}: at least {b['smallest']:.3g}, written {b['written']:g} (given {b['given']:g}); {sure}; {100 * b['share']:.3g} % of the thresholds")
    for name, part in result["doubted"].items():
        lines.append(f"noise of {name} is {100 * part:.3g} % of all that it moves: a wrong sign, unit or matrix? or a recording in which it hardly moves")
    worst, share = max(result["threshold_shares"].items(), key=lambda s: s[1])
    lines.append(f"what hurts detection most: {worst}, {100 * share:.3g} % of the thresholds; half of it would make them {50 * share:.3g} % smaller")
    t = result["tightest"]
    lines.append(f"tightest: {t['record']}:{t['line']}, {t['equation']}")
    usual = result["window_factors"]["usual"]
    for n in result["contradictions"]:
        much = f"{n['factor'] / usual:.3g} times what nine tenths of the recording need"
        lines.append(f"{n['record']}:{n['line']}: the {n['equation']} contradicts the model: {much}; a fault, a lost row, a wrong number?")
    hold = result["hold_out"]
    if hold is not None:
        alarms = hold["false_alarms"]
        lines.append(
            f"hold-out, {result['held_out']} samples: {100 * hold['factor']:.3g} % of the bounds used ({hold['record']}:{hold['line']}, {hold['equation']}); "
            f"false alarms {alarms['provisional']} provisional, {alarms['confirmed']} confirmed, largest |r|/J {hold['margin_max']:.3f}"
        )
    faults = ", ".join(f"{n} {v:.3g}" for n, v in result["smallest_fault"].items() if v is not None)
    drive = hold or result["fitted"]
    chosen = "as given" if result["chosen"] is None else f"{result['chosen']:g} times the given sigma"
    lines.append(f"triggers {chosen}: {100 * drive['frames']:.3g} % of the periodic measurement frames; smallest lasting faults: {faults or 'none asked for'}")
    return lines


def _judge(found: Found, outcome: Outcome) -> int:
    """Status 1 where the recordings do not keep within what was found."""
    if found.margin is not None and found.margin.factor > 1.0:
        place = f"{found.margin.record}:{found.margin.line}"
        raise ExpectationError(f"the held-out part needs {found.margin.factor:.3g} times the bounds ({place}); give a larger --margin, or a longer recording")
    factor, signal = outcome.moved
    if factor > 1.0:
        declared = next(s.slew for s in outcome.design.model.signals if s.name == signal) is not None
        cure = "give a larger --slew-margin" if declared else "declare its slew as a list: it does not move as [plant] feedback says"
        raise ExpectationError(f"'{signal}' moves {factor:.3g} times as fast as its slew; {cure}")
    if outcome.held is not None and outcome.held.provisional:
        kept = "what the model gives and identify does not look for (state_range, noise of inputs, matrices) is too narrow"
        raise ExpectationError(f"{outcome.held.provisional} false alarms in the held-out part: {kept}")
    return 0
