"""What a model of kind "uio" says beside a linear one: inputs that nobody knows, and the observers that do without them; suspension.

[plant.unknown]                       # G of a builder, or its own columns
road = { bound = 3.0, rate = 200.0 }  # |road| and |its change a second|, at every time

[[detector.uio]]
outputs = [..]  faults = [..]         # faults of actuators are estimated from columns of B, of sensors as states of their own
form = "discrete"                     # or "first-order hold", or, without poles, "direct": where sensors tell every state
poles = [-20, -40, -80, -160]         # a second; or { slow = -20, fast = -160 }
low_pass_s = 0.1
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hullguard.model.builders import BUILDERS, Builder
from hullguard.model.isolate import IsolateSpec, read_isolate
from hullguard.model.table import Array, Table

if TYPE_CHECKING:
    from hullguard.model.schema import Fault

KIND = "uio"
FORMS = ("discrete", "first-order hold", "direct")
DISCRETE, HOLD, DIRECT = FORMS
_STEM = re.compile(r"^[a-z_]*[a-z]")


@dataclass(frozen=True)
class UnknownInputs:
    """The plant in continuous time with the inputs that nobody knows."""

    names: tuple[str, ...]  # q
    A: Array  # n x n
    B: Array  # n x p
    G: Array  # n x q
    bound: Array  # q: magnitude at every time
    rate: Array  # q: change a second
    builder: str | None  # and what it was given, so that a plant with a weaker part can be made
    parameters: dict[str, Any]


@dataclass(frozen=True)
class Gains:
    """A chosen observer, a published one for example."""

    F: Array
    K: Array
    H: Array


@dataclass(frozen=True)
class UioSpec:
    """One unknown-input observer."""

    outputs: tuple[int, ...]  # indices into y
    actuators: tuple[int, ...]  # indices into the model's faults
    sensors: tuple[int, ...]  # the same; each is a state
    decay: tuple[float, ...]  # of the sensors' faults, a second
    poles: tuple[complex, ...] | tuple[float, float, None]  # chosen, or slowest, fastest and none: as many in between as are free
    low_pass_s: float
    form: str  # one of FORMS
    trust: tuple[float, ...] | None  # n: how much each state's equation counts in the reconstruction; None: as is best for the radii
    gains: Gains | None
    isolate: IsolateSpec | None


def read_unknown(plant: Table, builder: Builder | None, A: Array, B: Array) -> UnknownInputs | None:
    """[plant.unknown]; None where there is none."""
    if "unknown" not in plant:
        return None
    t = plant.table("unknown")
    if builder is not None and builder.unknown is None:
        raise plant.error("unknown", f"the builder {plant.text('builder')} has no inputs that nobody knows; remove it")
    if builder is not None and builder.unknown is not None:
        G = builder.unknown(plant)
        names = builder.unknown_names(B.shape[1])
    else:
        names = tuple(t.names("names"))
        G = t.matrix("G", A.shape[0], len(names))
    bound, rate = [], []
    for name in names:
        stem = _STEM.match(name)
        key = name if name in t or stem is None else stem[0].removesuffix("_")
        own = t.table(key)
        bound.append(own.number("bound", 0.0))
        rate.append(own.number("rate", 0.0))
        own.close()
    t.close()
    given = {k: v for k, v in plant.data.items() if isinstance(v, (int, float))}
    return UnknownInputs(names, A, B, G, np.array(bound), np.array(rate), plant.text("builder") if builder is not None else None, given)


def component_names(known: UnknownInputs | None) -> dict[str, tuple[str, int]]:
    """Parts of the plant that can lose a share of themselves, by name: the builder's parameter, and the place of the corner."""
    if known is None or known.builder is None:
        return {}
    found = ((stem.split("_")[0], stem) for stem in BUILDERS[known.builder].components)
    return {f"{name}{i + 1}": (stem, i) for name, stem in found for i in range(len(known.names))}


def weakened(known: UnknownInputs, left: dict[str, float]) -> Array:
    """A of the plant with components that have this share left, each by its name."""
    names, A = component_names(known), known.A
    for name, share in left.items():
        parameter, corner = names[name]
        more = Table(known.parameters | {parameter: 2.0 * float(known.parameters[parameter])}, "plant")
        # A is linear in each parameter: what one of them does, at its corner alone, is the difference that twice as much of it makes.
        whole = BUILDERS[str(known.builder)].make(more).A - known.A
        A = A - (1.0 - share) * np.where(component_columns(corner, whole), whole, 0.0)
    return A


def component_columns(corner: int, whole: Array) -> Array:
    """Mask of the entries that belong to a corner: it acts through the states of its own, whomever it moves."""
    mask = np.zeros(whole.shape, dtype=bool)
    mask[:, 4 * corner : 4 * corner + 4] = True
    return mask


def read_uios(detector: Table, states: Sequence[str], outputs: Sequence[str], faults: Sequence[Fault], places: Sequence[int]) -> tuple[UioSpec, ...]:
    """[[detector.uio]]. `places` are those of the outputs in the signal vector."""
    return tuple(_read_uio(t, states, outputs, faults, places) for t in detector.tables("uio"))


def _chosen(t: Table, key: str, known: Sequence[str], default: Sequence[str]) -> list[str]:
    names = t.names(key, default)
    for n in names:
        if n not in known:
            raise t.error(key, f"'{n}' is not one of {', '.join(known) or 'none'}")
    return names


def _read_uio(t: Table, states: Sequence[str], outputs: Sequence[str], faults: Sequence[Fault], places: Sequence[int]) -> UioSpec:
    chosen = _chosen(t, "outputs", outputs, outputs)
    by_name = {f.name: (i, f) for i, f in enumerate(faults)}
    named = [by_name[n] for n in _chosen(t, "faults", list(by_name), [n for n, (_, f) in by_name.items() if f.type == "actuator"])]
    read = [places[outputs.index(n)] for n in chosen]
    for _, f in named:
        if f.type == "sensor" and f.signal not in read:
            raise t.error("faults", f"'{f.name}' is the fault of a sensor that this observer does not read; add it to outputs")
    sensors = tuple(i for i, f in named if f.type == "sensor")
    if not named:
        raise t.error("faults", "none: an observer that looks for no fault raises no alarm; name one")
    form, trust, gains = t.text("form", DISCRETE, FORMS), _trust(t, states), _gains(t, len(states) + len(sensors), len(chosen))
    if form == DIRECT and "poles" in t:
        raise t.error("poles", "states that sensors tell directly need no observer, which alone has poles; remove them, or choose another form")
    if gains is not None and "poles" in t:
        raise t.error("poles", "chosen gains have poles of their own; remove one of them")
    spec = UioSpec(
        outputs=tuple(outputs.index(n) for n in chosen),
        actuators=tuple(i for i, f in named if f.type == "actuator"),
        sensors=sensors,
        decay=(t.number("fault_decay_per_s", 0.0, default=0.0),) * len(sensors),
        poles=_poles(t) if gains is None and form != DIRECT else (),
        low_pass_s=t.number("low_pass_s", 0.0, 1e3, 0.1),
        form=form,
        trust=trust,
        gains=gains,
        isolate=read_isolate(t),
    )
    if spec.gains is not None and spec.form != HOLD:
        raise t.error("gains", f'chosen gains are those of continuous time; give form = "{HOLD}"')
    t.close()
    return spec


def _gains(t: Table, n: int, m: int) -> Gains | None:
    if "gains" not in t or t.raw("gains") == {}:
        return None
    inner = t.table("gains")
    gains = Gains(inner.matrix("F", n, n), inner.matrix("K", n, m), inner.matrix("H", n, m))
    inner.close()
    return gains


def _trust(t: Table, states: Sequence[str]) -> tuple[float, ...] | None:
    if "trust" not in t:
        return None
    return tuple(float(x) for x in t.vector("trust", len(states), 1e-12))


def _poles(t: Table) -> tuple[complex, ...] | tuple[float, float, None]:
    value = t.raw("poles")
    if isinstance(value, dict):
        inner = t.table("poles")
        slow, fast = inner.number("slow", high=-1e-6), inner.number("fast", high=-1e-6)
        inner.close()
        if not fast < slow:
            raise t.error("poles", f"fast = {fast:g} is not left of slow = {slow:g}")
        return slow, fast, None
    if not isinstance(value, list) or not value:
        raise t.error("poles", "expected a list of poles a second, numbers or [re, im] pairs, or { slow = .., fast = .. }")
    parts = Table({str(i): [p, 0.0] if isinstance(p, (int, float)) and not isinstance(p, bool) else p for i, p in enumerate(value)}, f"{t.where}.poles")
    poles = [complex(*parts.vector(str(i), 2)) for i in range(len(value))]
    for p in poles:
        if p.real >= 0.0:
            raise t.error("poles", f"{p.real:g} does not die out; choose it left of the imaginary axis")
        if p.imag and not any(abs(q - p.conjugate()) < 1e-9 for q in poles):
            raise t.error("poles", f"[{p.real:g}, {p.imag:g}] comes without its conjugate; add [{p.real:g}, {-p.imag:g}]")
    return tuple(poles)
