"""The text of a first model file: what was given, and defaults that are safe rather than tight, each with a word on how to make it better."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hullguard.model.table import Array

WIRE_STEPS = 40_000  # of a range: resolution
QUIET = 0.01  # of a range: a trigger's sigma
INTERVAL = 10  # samples
TRIALS = 1000
DRIVEN = 0.05  # of an input's range: reference of the emulator, where nothing says how far the outputs would go
BESIDE = 50  # column of the words beside a line
ORDER_MAX = 12
FIRST_ID = 0x110
STEP_ID = 0x10
GROUP_SIGNALS = 16  # in one frame
FAULTS_MAX = 32


@dataclass(frozen=True)
class Part:
    """A signal."""

    name: str
    low: float
    high: float

    @property
    def resolution(self) -> float:
        """A round number that a 16-bit field has room for."""
        rough = (self.high - self.low) / WIRE_STEPS
        unit = 10.0 ** np.floor(np.log10(rough))
        return float(f"{unit * next(x for x in (1, 2, 5, 10) if x * unit >= rough * 0.999):.3g}")


@dataclass(frozen=True)
class Draft:
    """What is known of a model."""

    name: str
    origin: str  # where the plant comes from
    plant: tuple[str, ...]  # lines of [plant] that say what it is
    sample_time_s: float
    states: tuple[str, ...]
    outputs: tuple[Part, ...]
    inputs: tuple[Part, ...]
    measured: bool  # inputs are readings
    damped: bool  # all modes of the plant decay
    driven: float  # of the inputs' ranges: reference of the emulator
    state_range: dict[str, float]
    disturbance: float
    noise: float


def number(x: float) -> str:
    """As TOML, with the digits that it needs."""
    return repr(float(x))


def matrix(name: str, value: Array) -> str:
    """A row a line."""
    if value.shape[0] == 1:
        return f"{name} = [[{', '.join(number(x) for x in value[0])}]]"
    return f"{name} = [\n" + "".join(f"  [{', '.join(number(x) for x in row)}],\n" for row in value) + "]"


def quoted(names: list[str]) -> str:
    """A list of names."""
    return "[" + ", ".join(f'"{n}"' for n in names) + "]"


def beside(line: str, words: str) -> str:
    """A line with words beside it."""
    return f"{line:<{BESIDE}}# {words}" if len(line) < BESIDE else f"{line}  # {words}"


def text(d: Draft) -> str:
    """The whole file."""
    return "\n".join([*_head(d), *_plant(d), *_signals(d), *_groups(d), *_detector(d), *_faults(d), *_scenarios(d)]) + "\n"


def amplitude(d: Draft) -> float:
    """How far the emulator moves every input, in the unit of the one with the narrowest range."""
    return float(f"{min(half(s) for s in d.inputs) * d.driven:.2g}")


def half(part: Part) -> float:
    """How far a signal may go from zero, or from its end where that is zero."""
    return min(abs(part.low), abs(part.high)) or part.high - part.low


def _head(d: Draft) -> list[str]:
    file = f"{d.name}.toml"
    return [
        f"# {d.name}: {d.origin}. Begun by `hullguard new`; lines marked CHECK hold a default that only you can replace.",
        "#",
        "# Next: 1. ranges and resolutions of the signals, and CAN identifiers, as they are on your bus",
        f"#       2. hullguard identify {file} --csv drive.csv      disturbance, noise, slews and triggers from recordings without faults",
        f"#       3. hullguard design {file}                        C tables, DBC and a report of what will be found",
        f"#       4. hullguard run {file}                           an emulated drive with a fault",
        "",
        "schema = 1",
        f'name = "{d.name}"',
        'kind = "linear"',
        f"sample_time_s = {number(d.sample_time_s)}",
        "",
        "[bus]",
        "bitrate_bps = 500000",
        "",
    ]


def _plant(d: Draft) -> list[str]:
    lines = ["[plant]", *d.plant, beside("initial_range = 1.0", "CHECK: |state| at a start at rest")]
    if d.state_range:
        lines.append("state_range = [" + ", ".join(number(d.state_range.get(s, 1e6)) for s in d.states) + "]  # |state| in operation; 1e6: nothing is known of it")
    bounds = ", ".join([number(d.disturbance)] * len(d.states))
    lines.append(beside(f"disturbance = {{ state = [{bounds}] }}", "CHECK: what moves each besides the inputs, a sample; identify finds it"))
    if d.inputs:
        bound = amplitude(d)
        regulator = "gain = [" + ", ".join("[" + ", ".join("0.0" for _ in d.states) + "]" for _ in d.inputs) + "]" if d.damped else "state_weights = 1.0, input_weights = 1.0"
        lines.append(f"feedback = {{ {regulator}, reference_bound = {number(bound)} }}  # drives the emulator only: every slew below is declared")
    return [*lines, ""]


def _signals(d: Draft) -> list[str]:
    lines = ["# Slews as wide as the ranges are safe: they count in silent samples and after lost frames only, and identify finds better ones."]
    for part, role in [*((p, "output") for p in d.outputs), *((p, "input") for p in d.inputs)]:
        lines += ["[[signals]]", f'name = "{part.name}"', f'role = "{role}"']
        lines += [beside(f"range = [{number(part.low)}, {number(part.high)}]", "CHECK")]
        lines += [f"resolution = {number(part.resolution)}", f"slew = [{number(part.high - part.low)}]"]
        if role == "output" or d.measured:
            lines.append(beside(f"noise = {number(d.noise)}", "CHECK; identify finds it" if role == "output" else "CHECK"))
        lines.append("")
    return lines


def _groups(d: Draft) -> list[str]:
    sent = [*d.outputs, *(d.inputs if d.measured else ())]
    parts = [sent[i : i + GROUP_SIGNALS] for i in range(0, len(sent), GROUP_SIGNALS)]
    lines = ["# One sender each: a frame when a signal has moved by more than delta |value sent| + sigma, or after interval_max samples. CHECK identifiers."]
    for i, part in enumerate(parts):
        sigma = ", ".join(number(float(f"{max(QUIET * (s.high - s.low), s.resolution):.3g}")) for s in part)
        lines += ["[[groups]]", f'name = "measurement{i + 1 if len(parts) > 1 else ""}"', f"signals = {quoted([s.name for s in part])}"]
        lines += [f"frame = {{ id = 0x{FIRST_ID + STEP_ID * i:X} }}", f"trigger = {{ delta = 0.0, sigma = [{sigma}], silence = 0, interval_max = {INTERVAL} }}", ""]
    closing = FIRST_ID + STEP_ID * len(parts)
    if d.inputs and not d.measured:
        lines += ["# The control frame closes the sample; the plant applies what the frame says.", "[[groups]]", 'name = "control"']
        lines += [f"signals = {quoted([s.name for s in d.inputs])}", f"frame = {{ id = 0x{closing:X} }}", 'transmission = "tick"', "applied_as_sent = true", ""]
    else:
        lines += ["# A bare tick closes the sample.", "[[groups]]", 'name = "tick"', "signals = []", f"frame = {{ id = 0x{closing:X} }}", 'transmission = "tick"', ""]
    return [*lines, "[verdict]", f"frame = {{ id = 0x{closing + STEP_ID:X} }}", "heartbeat_samples = 10", "debounce = { up = 1, down = 5 }", ""]


def _detector(d: Draft) -> list[str]:
    n, m = len(d.states), len(d.outputs)
    order = min(ORDER_MAX, n, max(2, -(-n // m)))  # of n / m and more there always is a parity vector
    residuals = min(m, 2)
    return ["[detector]", f"observers = [{{ order = {order}, residuals = {residuals}, search = {{ trials = {TRIALS}, seed = 1 }} }}]", ""]


def _faults(d: Draft) -> list[str]:
    lines = ["# What must be found; it steers the search, and can be injected by name."]
    kind = "sensor" if d.measured else "actuator"
    faults = [*((s.name, kind) for s in d.inputs), *((s.name, "sensor") for s in d.outputs)]
    for name, what in faults[:FAULTS_MAX]:
        lines += ["[[faults]]", f'name = "{name[: 30 - len(what)]}_{what}"', f'signal = "{name}"', f'type = "{what}"', ""]
    return lines


def _scenarios(d: Draft) -> list[str]:
    first = d.inputs[0] if d.inputs and not d.measured else d.outputs[0]
    size = float(f"{0.25 * (first.high - first.low):.3g}")
    what = "actuator" if d.inputs and not d.measured else "sensor"
    period = float(f"{60 * d.sample_time_s:.3g}")
    reference = f'reference = {{ kind = "steps", amplitude = {number(amplitude(d))}, period_s = {number(period)} }}' if d.inputs else 'reference = { kind = "rest" }'
    return ["[[scenarios]]", 'name = "default"', "samples = 300", reference, f'faults = ["{first.name[: 30 - len(what)]}_{what}:bias:{size:g}@150"]']
