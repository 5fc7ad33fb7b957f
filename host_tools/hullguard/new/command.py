"""`hullguard new`."""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hullguard.commands import say
from hullguard.design.design import check_observable, sub_plant, usual_radius
from hullguard.design.observer import check_parity
from hullguard.design.reach import reach
from hullguard.errors import InputError
from hullguard.model.builders import BUILDERS
from hullguard.model.schema import NAME, parse_model
from hullguard.model.table import Array, Table
from hullguard.model.uncertain import zero_order_hold
from hullguard.new.draft import DRIVEN, Draft, Part, half, matrix, quoted, text
from hullguard.new.sources import KEYS, StateSpace, read_file, read_inline

USUAL = (-10.0, 10.0)
DECAYS = 1 - 1e-9
HALFWAY = 0.5  # of a range
STEPS = 10_000  # samples in which a damped plant has shown what an input does
SAMPLED = 0.1  # seconds, where a question is left empty


def run_new(args: argparse.Namespace) -> int:
    """`hullguard new`."""
    if not _sources(args):
        if not sys.stdin.isatty():
            raise InputError("new needs a plant: --from FILE, --A .. --B .. --C .., or --builder NAME KEY=VALUE ..; on a terminal it asks")
        ask(args, input)
    if len(_sources(args)) > 1:
        raise InputError(f"{' and '.join(_sources(args))}: give one source of the plant")
    if not args.name or not NAME.match(args.name):
        raise InputError(f"name '{args.name or ''}': expected a lower-case identifier of at most 31 characters, for example: hullguard new pendulum --from plant.mat")
    target = Path(args.out) if args.out else Path(f"{args.name}.toml")
    if target.exists() and not args.force:
        raise InputError(f"{target} is there already; give --force to overwrite it, or another --out")
    made = text(_built(args) if args.builder else _given(args))
    check(made, target)
    try:
        target.write_text(made, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{target}: cannot be written ({error.strerror}); name another with --out") from error
    say(args, f"{target}: {made.count('CHECK') - 1} defaults marked CHECK; next: hullguard identify {target} --csv FILE, hullguard design {target}, hullguard run {target}")
    return 0


def _sources(args: argparse.Namespace) -> list[str]:
    inline = ["--A"] if any(getattr(args, k) is not None for k in KEYS) else []
    return (["--from"] if args.source else []) + inline + (["--builder"] if args.builder else [])


def check(made: str, target: Path) -> None:
    """What design would refuse is refused before there is a file: the reader, observability, bounds of all states, parity vectors."""
    model = parse_model(tomllib.loads(made), target)
    check_observable(model)
    try:
        reach(model, max(g.horizon for g in model.groups))
    except InputError as error:
        raise InputError(f"{str(error).split(':')[0]}: measure it (a row of C), or say how far it goes with --state-range NAME=X") from error
    for i, spec in enumerate(model.observers):
        check_parity(sub_plant(model, spec, usual_radius(model)), spec.order_max, f"{target.name}: detector.observers[{i}]")


def ask(args: argparse.Namespace, question: Callable[[str], str]) -> None:
    """A few questions instead of options; an empty answer takes the default."""

    def answer(what: str, default: str = "") -> str:
        return question(f"{what}{f' [{default}]' if default else ''}: ").strip() or default

    args.name = args.name or answer("Name of the model (lower case)", "plant")
    source = answer(f"Plant: a file (.mat, .npz, .json, .csv), a builder ({', '.join(_builders())}), or the matrix A", "string_of_vehicles")
    if source in BUILDERS:
        args.builder = [source, *answer("Its parameters", "vehicles=3 drag_per_s=1.0" if source == "string_of_vehicles" else "cars=3").split()]
    elif Path(source).suffix in (".mat", ".npz", ".json", ".csv"):
        args.source = source
    else:
        args.A, args.B, args.C = source, answer("Matrix B (none: no inputs)") or None, answer("Matrix C")
    if args.sample_time is None:
        said = answer("Sample time, s", "" if args.source else f"{SAMPLED}")
        args.sample_time = _seconds(said) if said else None
    if not args.builder and not args.source and not args.continuous and not args.discrete:
        args.discrete = answer("Are the matrices discrete already (yes, no)", "no").lower().startswith("y")
    args.outputs = args.outputs or answer("Names of the outputs, by commas (empty: y1, y2 .., or all states of a builder)") or None
    if not args.builder:
        args.inputs = args.inputs or answer("Names of the inputs, by commas (empty: u1, u2 ..)") or None
    args.range = args.range or answer("Ranges of signals, NAME=LOW..HIGH, by blanks (empty: -10..10)").split()


def _seconds(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _builders() -> list[str]:
    return [name for name, b in sorted(BUILDERS.items()) if b.unknown is None]


def _built(args: argparse.Namespace) -> Draft:
    """A plant of a builder."""
    name, *pairs = args.builder
    if name not in _builders():
        why = "has inputs that nobody knows: begin with a copy of host_tools/models/suspension.toml" if name in BUILDERS else f"is no builder: {', '.join(_builders())}"
        raise InputError(f"--builder {name}: {why}")
    if args.discrete or args.states or args.inputs:
        raise InputError(f"--builder {name}: its matrices are continuous, its states and inputs have names; leave --discrete, --states and --inputs out")
    parameters: dict[str, Any] = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        try:
            parameters[key] = tomllib.loads(f"v = {value}")["v"]
        except tomllib.TOMLDecodeError as error:
            raise InputError(f"--builder {name}: '{pair}' is not KEY=VALUE with a number, for example vehicles=3") from error
        if not equals:
            raise InputError(f"--builder {name}: '{pair}' is not KEY=VALUE")
    builder, table = BUILDERS[name], Table(parameters, f"--builder {name}")
    made = builder.make(table)
    table.close()
    size = made.B.shape[1]
    states = builder.states(size)
    outputs = _names(args.outputs, list(states))
    for signal in outputs:
        if signal not in states:
            raise InputError(f"--outputs: '{signal}' is no state of the builder; it has {', '.join(states)}")
    lines = (f'builder = "{name}"', *(f"{pair.partition('=')[0]} = {pair.partition('=')[2]}" for pair in pairs))
    draft = _draft(args, f"a plant of the builder {name}, {' '.join(pairs)}", lines, states, outputs, list(builder.inputs(size)), _sample_time(args, None))
    return replace(draft, measured=args.measured_inputs or name == "car_following", damped=_damped(made.A, False))


def _given(args: argparse.Namespace) -> Draft:
    """A plant of matrices."""
    plant = read_file(Path(args.source)) if args.source else read_inline({k: getattr(args, k) for k in KEYS})
    discrete = args.discrete or (plant.discrete and not args.continuous)
    if args.continuous and plant.discrete:
        raise InputError(f"--continuous: {args.source} says that its matrices are discrete; leave it out")
    (n, p), m = plant.B.shape, plant.C.shape[0]
    states = tuple(_names(args.states, [f"x{i + 1}" for i in range(n)], n, "--states"))
    outputs = _names(args.outputs, [f"y{i + 1}" for i in range(m)], m, "--outputs")
    inputs = _names(args.inputs, [f"u{i + 1}" for i in range(p)], p, "--inputs")
    draft = _draft(args, f"matrices from {Path(args.source).name if args.source else 'the command line'}", (), states, outputs, inputs, _sample_time(args, plant))
    damped = _damped(plant.A, discrete)
    driven = _driven(plant, draft, discrete) if damped and draft.inputs else DRIVEN
    return replace(draft, plant=tuple(_matrices(plant, states, discrete)), damped=damped, driven=driven)


def _matrices(plant: StateSpace, states: tuple[str, ...], discrete: bool) -> list[str]:
    """Lines of [plant]. Signals are in the order of groups: outputs first, so rows and columns stay as they are."""
    lines = [f"states = {quoted(list(states))}", f"discrete = {'true' if discrete else 'false'}" + ("" if discrete else "   # made discrete by a zero-order hold")]
    lines += [matrix("A", plant.A), *([matrix("B", plant.B)] if plant.B.shape[1] else []), matrix("C", plant.C)]
    return lines + ([matrix("D", plant.D)] if plant.D.any() else [])


def _draft(args: argparse.Namespace, origin: str, lines: tuple[str, ...], states: tuple[str, ...], outputs: list[str], inputs: list[str], sample_time_s: float) -> Draft:
    """All that both kinds of plant have in common."""
    for what, value in (("--disturbance", args.disturbance), ("--noise", args.noise)):
        if not 0.0 <= value < np.inf:
            raise InputError(f"{what} {value}: expected a bound of 0 or more")
    ranges = dict(_range(t) for t in args.range)
    for known, found, what in (([*outputs, *inputs], ranges, "--range"), (list(states), bounds := dict(_bound(t) for t in args.state_range), "--state-range")):
        for name in found:
            if name not in known:
                raise InputError(f"{what} {name}: there is no such name, only {', '.join(known)}")
    parts = [tuple(Part(n, *ranges.get(n, USUAL)) for n in names) for names in (outputs, inputs)]
    return Draft(args.name, origin, lines, sample_time_s, states, parts[0], parts[1], args.measured_inputs, False, DRIVEN, bounds, args.disturbance, args.noise)


def _damped(A: Array, discrete: bool) -> bool:
    values = np.linalg.eigvals(A)
    return bool(np.abs(values).max() < DECAYS if discrete else values.real.max() < -(1 - DECAYS))


def _driven(plant: StateSpace, draft: Draft, discrete: bool) -> float:
    """The share of the inputs' ranges, half at most, that moves no output further than HALFWAY, however the inputs step: |y| <= sum_k |C A^k B| |u| + |D| |u|."""
    A, B = (plant.A, plant.B) if discrete else zero_order_hold(plant.A, plant.B, draft.sample_time_s)
    reach = np.abs(plant.D)
    for _ in range(STEPS):
        reach, B = reach + np.abs(plant.C @ B), A @ B
    furthest = reach @ np.full(len(draft.inputs), min(half(s) for s in draft.inputs))
    shares = [HALFWAY * half(s) / float(y) for s, y in zip(draft.outputs, furthest, strict=True) if y > 0.0]
    return min([HALFWAY, *shares])


def _sample_time(args: argparse.Namespace, plant: StateSpace | None) -> float:
    own = plant.sample_time_s if plant is not None else None
    if args.sample_time is None and own is None:
        raise InputError("--sample-time is needed: nothing else says how often the plant is sampled")
    if args.sample_time is None:
        assert own is not None
        return own
    if own is not None and not np.isclose(own, args.sample_time):
        raise InputError(f"--sample-time {args.sample_time:g}: {args.source} says {own:g} s; leave it out, or make the matrices anew")
    if not 1e-6 <= args.sample_time <= 3600.0:
        raise InputError(f"--sample-time {args.sample_time:g}: expected seconds, 1e-6 .. 3600")
    return float(args.sample_time)


def _names(given: str | None, usual: list[str], count: int | None = None, what: str = "--outputs") -> list[str]:
    if given is None:
        return usual
    names = [n.strip() for n in given.split(",")]
    if count is not None and len(names) != count:
        raise InputError(f"{what}: {len(names)} names, the matrices have {count}")
    for n in names:
        if not NAME.match(n):
            raise InputError(f"{what}: '{n}' is not a lower-case identifier of at most 31 characters")
    return names


def _range(text: str) -> tuple[str, tuple[float, float]]:
    name, _, both = text.partition("=")
    low, dots, high = both.partition("..")
    try:
        pair = float(low), float(high)
    except ValueError:
        pair = (0.0, 0.0)
    if not dots or not (-np.inf < pair[0] < pair[1] < np.inf):
        raise InputError(f"--range '{text}': expected NAME=LOW..HIGH, for example y1=-20..20")
    return name, pair


def _bound(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    found = _seconds(value)
    if not 0.0 < found < np.inf:
        raise InputError(f"--state-range '{text}': expected NAME=X, X above 0")
    return name, found
