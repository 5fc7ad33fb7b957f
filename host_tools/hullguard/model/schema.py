"""The model file, schema 1: what an engineer writes, checked and in the units it was written in."""

from __future__ import annotations

import hashlib
import itertools
import json
import re
import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from hullguard.design.protection import MODAL, MODES, NIBBLE_ID_MAX, NONE, PROFILES
from hullguard.errors import InputError
from hullguard.files import is_file
from hullguard.model import polynomial
from hullguard.model.builders_car import TYRE
from hullguard.model.choice import read_orders, read_parity, read_poles
from hullguard.model.detector import DetectorSpec, read_detector
from hullguard.model.faults import FaultSpec, parse_fault
from hullguard.model.freeze import FreezeSpec, read_freeze
from hullguard.model.network import Network, Wire, adopt, check_range
from hullguard.model.plant import Plant, read_plant
from hullguard.model.road import RoadSpec, read_road
from hullguard.model.table import Array, Table
from hullguard.model.templates import expand
from hullguard.model.uio import KIND, UioSpec, component_names, read_uios

SCHEMA = 1
NAME = re.compile(r"^[a-z][a-z0-9_]{0,30}$")
SHIPPED = Path(__file__).resolve().parent.parent.parent / "models"
GROUPS_MAX = 8
GENERATORS_MAX = 32
FAULTS_MAX = 32
GROUP_SIGNALS_MAX = 32
PERIOD_MAX = 190  # samples; with the widest margin, what a receiver's age can count
IGNORABLE = ("crc", "counter", "state")  # checks of a group's protection that a model may turn off


@dataclass(frozen=True)
class Signal:
    """One signal on the bus, output or input of the plant."""

    name: str
    role: str  # output | input
    low: float
    high: float
    resolution: float
    slew: tuple[float, ...] | None  # None: computed from reachable sets
    scale: float  # activity scale of the adaptive trigger
    noise: float  # bound of the sensor's noise
    csv_delay: int  # the reading at k is the recording's row k - csv_delay
    float32: bool


@dataclass(frozen=True)
class Frame:
    """Where a message sits on the bus."""

    id: int
    extended: bool
    fd: bool | None  # None: CAN FD where a classic frame is too short
    data_id: int
    profile: str | None = None  # of E2E; None: by the length of the frame
    mode: str = "both"  # of the data identifier, profiles 01 and 11
    wire: Wire | None = None  # the frame as a vehicle has it; its protection is the one that counts

    @property
    def stamped(self) -> bool:
        """Whether the frame says which sample it belongs to."""
        return self.wire.protection.stamped if self.wire is not None else self.profile != NONE

    @property
    def protected(self) -> bool:
        """Whether the frame has a checksum and a counter."""
        return (self.wire.protection.profile if self.wire is not None else self.profile) != NONE


@dataclass(frozen=True)
class Trigger:
    """The sender's promise, in physical units, a row a level; level 0 is the quietest."""

    delta: Array  # levels x width
    sigma: Array  # levels x width
    silence: tuple[int, ...]
    interval_max: int
    activity: Array  # levels x width: change between frames that reaches the level; row 0 is not used
    margin: int

    @property
    def periodic(self) -> bool:
        """Whether a sender speaks every interval_max samples, whatever its signals do."""
        return min(self.silence) + 1 >= self.interval_max


@dataclass(frozen=True)
class Group:
    """One sender: one trigger, one frame."""

    name: str
    signals: tuple[int, ...]  # places in the model's signal vector, consecutive
    frame: Frame
    trigger: Trigger
    closing: bool
    applied_as_sent: bool
    skew: int = 0  # samples: a value may be that much older, or by the sender's own clock newer, than the sample it is booked to
    ignore: tuple[str, ...] = ()  # checks of its protection that are off
    resync: int = 0  # good frames refused after a jump of its counter

    @property
    def horizon(self) -> int:
        """Samples for which the slews of its signals are needed."""
        return self.trigger.interval_max + self.trigger.margin + self.skew


@dataclass(frozen=True)
class Search:
    """How the free parameters of a generator are looked for."""

    objective: str  # "smallest fault" | "delay" | "between events"
    trials: int
    seed: int
    poles: tuple[float, float]
    event_weight: tuple[float, float]  # range of the weight of the event error in a trigger-aware post-filter
    size: float  # of the step whose delay is minimised, in the unit of the faulty signal


@dataclass(frozen=True)
class Observer:
    """One residual generator that the design has to find."""

    order: int  # the smallest one to try; in a finished design the one that was found
    order_max: int
    residuals: int
    outputs: tuple[int, ...]  # indices into y
    inputs: tuple[int, ...]  # indices into u
    faults: tuple[int, ...]  # indices into the model's faults: what it is searched for
    aware: bool  # trigger-aware post-filter
    search: Search
    parity: tuple[tuple[float, ...], ...] | None  # order + 1 x outputs: chosen, not searched for
    poles: tuple[complex, ...] | None  # order: chosen, not searched for

    @property
    def chosen(self) -> bool:
        """Whether the model leaves nothing to a search."""
        return self.parity is not None and self.poles is not None

    @property
    def filtered(self) -> bool:
        """Whether the generator has a post-filter; a difference between events has none, it would forget the frame it starts from."""
        return self.search.objective not in ("between events", "unknown inputs")


@dataclass(frozen=True)
class Fault:
    """A fault that must be found, and can be injected by name."""

    name: str
    signal: int
    type: str  # actuator | sensor
    size_max: float | None = None  # signal units: the largest that isolation accounts for


@dataclass(frozen=True)
class Reference:
    """How an emulated plant is driven."""

    kind: str  # rest | steps | ramps | sines | mixed
    amplitude: float
    period: int  # samples


@dataclass(frozen=True)
class Scenario:
    """A named run."""

    name: str
    samples: int
    reference: Reference
    faults: tuple[FaultSpec, ...]
    set: dict[str, Any] = field(default_factory=dict)
    figures: str = ""  # "published": the report of a run begins with the publication's four figures
    road: RoadSpec | None = None  # what the wheels of a suspension meet


@dataclass(frozen=True)
class Model:
    """A whole model. The signal vector is the groups' signals, group after group."""

    name: str
    path: Path
    sample_time_s: float
    bitrate_bps: int
    data_bitrate_bps: int  # of CAN FD frames; bitrate_bps where the model does not say
    load_max: float
    plant: Plant
    signals: tuple[Signal, ...]
    groups: tuple[Group, ...]
    observers: tuple[Observer, ...]
    detector: DetectorSpec
    verdict: Frame
    status: Frame
    heartbeat: int
    debounce_up: int
    debounce_down: int
    latch: bool
    faults: tuple[Fault, ...]
    scenarios: tuple[Scenario, ...]
    sha256: str  # of everything that a design depends on
    uios: tuple[UioSpec, ...] = ()
    polynomials: tuple[polynomial.FilterSpec, ...] = ()
    freeze: FreezeSpec | None = None

    @property
    def outputs(self) -> list[int]:
        """Places of the plant's outputs y in the signal vector."""
        return [i for i, s in enumerate(self.signals) if s.role == "output"]

    @property
    def inputs(self) -> list[int]:
        """Places of the plant's inputs u in the signal vector."""
        return [i for i, s in enumerate(self.signals) if s.role == "input"]

    @property
    def components(self) -> dict[str, int]:
        """Parts of the plant that a fault can weaken, by name, with the place of the signal that such a fault is like, or shows in first."""
        names = component_names(self.plant.unknown)
        acting = {name: self.inputs[corner] for name, (parameter, corner) in names.items() if parameter != TYRE}
        return acting | {name: self.outputs[0] for name in names if name not in acting}

    @property
    def closing(self) -> int:
        """Index of the group whose frame closes the sample."""
        return next(i for i, g in enumerate(self.groups) if g.closing)

    def centre(self, place: int) -> float:
        """Value of a signal at the plant's equilibrium."""
        plant = self.plant
        if place in self.inputs:
            return float(plant.equilibrium_input[self.inputs.index(place)])
        row = self.outputs.index(place)
        return float(plant.C[row] @ plant.equilibrium + plant.D[row] @ plant.equilibrium_input)

    def signal(self, name: str) -> int:
        """Place of a signal in the vector, by its name or by the name of a fault."""
        for i, s in enumerate(self.signals):
            if s.name == name:
                return i
        for fault in self.faults:
            if fault.name == name:
                return fault.signal
        if name in self.components:
            return self.components[name]
        known = ", ".join([s.name for s in self.signals] + [f.name for f in self.faults] + list(self.components))
        raise InputError(f"'{name}' is neither a signal nor a fault of model {self.name}: {known}")

    def scenario(self, name: str | None) -> Scenario:
        """A scenario by name; the first one without a name."""
        if name is None:
            return self.scenarios[0]
        for s in self.scenarios:
            if s.name == name:
                return s
        raise InputError(f"model {self.name} has no scenario '{name}': {', '.join(s.name for s in self.scenarios)}")


def find_model(name: str) -> Path:
    """The file behind a shipped model's name, or behind a path."""
    path = Path(name)
    if is_file(path):
        return path
    if path.suffix == ".toml" or len(path.parts) > 1:
        raise InputError(f"model '{name}': no such file")
    shipped = SHIPPED / f"{name}.toml"
    if not is_file(shipped):
        known = sorted(p.stem for p in SHIPPED.glob("*.toml") if not p.stem.endswith(".design"))
        raise InputError(f"model '{name}': neither a file nor a shipped model ({', '.join(known)})")
    return shipped


def _read_file(path: Path, above: tuple[Path, ...] = ()) -> dict[str, Any]:
    """A model file's data, over that of the model it is based on; `above`: the files that are based on this one."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{path.name}: not valid TOML: {error}") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    if "base" not in data:
        return data
    base = data.pop("base")
    if not isinstance(base, str) or not is_file(path.parent / base):
        raise InputError(f"{path.name}.base: expected the name of a model file beside this one, found {base!r}")
    beneath = (path.parent / base).resolve()
    if beneath in (*above, path.resolve()):
        raise InputError(f"{path.name}.base: '{base}' is in the end based on this file; remove one of the two")
    return _over(data, _read_file(beneath, (*above, path.resolve())))


def source(path: Path) -> dict[str, Any]:
    """A model file's data as written, over that of the model it is based on: nothing expanded, nothing checked."""
    return _read_file(path)


def _over(data: dict[str, Any], beneath: dict[str, Any]) -> dict[str, Any]:
    """Tables are merged, everything else replaces what is beneath."""
    merged = dict(beneath)
    for key, value in data.items():
        below = beneath.get(key)
        merged[key] = _over(value, below) if isinstance(value, dict) and isinstance(below, dict) else value
    return merged


def load_model(name: str, overrides: dict[str, Any] | None = None, scenario: str | None = None) -> Model:
    """Read a model by shipped name or path; then what the scenario sets, then `overrides` (dotted keys, as --set gives them)."""
    path = find_model(name)
    data = _read_file(path)
    model = parse_model(data, path)
    changes = dict(model.scenario(scenario).set) | (overrides or {})
    if not changes:
        return model
    # The plant's keys say what the templates stand for; all others name entries as they are after that.
    for key, value in changes.items():
        if key.startswith("plant."):
            _override(data, key, value)
    data = expand(data, path.name)
    for key, value in changes.items():
        if not key.startswith("plant."):
            _override(data, key, value)
    return parse_model(data, path)


def _override(data: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key; a list of named tables is entered by name or number, as in groups.measurement.trigger.silence."""
    *parents, last = key.split(".")
    place: Any = data
    for part in parents:
        if isinstance(place, list):
            hits = [e for i, e in enumerate(place) if isinstance(e, dict) and (e.get("name") == part or str(i) == part)]
            if not hits:
                raise InputError(f"--set {key}: no entry '{part}'")
            place = hits[0]
        elif isinstance(place, dict):
            place = place.setdefault(part, {})
        else:
            raise InputError(f"--set {key}: '{part}' is not a table")
    if not isinstance(place, dict):
        raise InputError(f"--set {key}: '{last}' has no table around it")
    place[last] = value


def parse_override(text: str) -> tuple[str, Any]:
    """KEY=VALUE with VALUE in TOML; a bare word is text."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise InputError(f"--set '{text}': expected KEY=VALUE, for example groups.measurement.trigger.silence=1")
    try:
        parsed = tomllib.loads(f"v = {value}")["v"]
    except (tomllib.TOMLDecodeError, RecursionError):
        parsed = value.strip()
    return key.strip(), parsed


def parse_model(source: dict[str, Any], path: Path) -> Model:
    """Check a model's data and make a Model of it."""
    try:
        data = expand(source, path.name)
    except RecursionError as error:
        raise InputError(f"{path.name}: arrays and tables are nested too deeply; take some of the brackets away") from error
    network = adopt(data, path.name, path.parent)
    top = Table(data, path.name)
    if top.whole("schema", 1, 10_000) != SCHEMA:
        raise top.error("schema", f"this version reads schema {SCHEMA}")
    name = _name(top)
    kind = top.text("kind", choices=["linear", KIND, polynomial.KIND])
    sample_time_s = top.number("sample_time_s", 1e-6, 3600.0)
    bus = top.table("bus", optional=True)
    bitrate = bus.whole("bitrate_bps", 10_000, 8_000_000, 500_000)
    data_bitrate = bus.whole("data_bitrate_bps", bitrate, 20_000_000, bitrate)
    load_max = bus.number("load_max", 0.01, 1.0, 0.7)
    bus.close()

    declared = [_read_signal(t) for t in top.tables("signals")]
    _unique([s.name for s in declared], f"{path.name}: signals")
    groups, order = _read_groups(top, declared, path, network, sample_time_s)
    signals = tuple(declared[i] for i in order)
    outputs = [s.name for s in signals if s.role == "output"]
    inputs = [s.name for s in signals if s.role == "input"]
    if not outputs:
        raise InputError(f'{path.name}: no signal has role = "output": there is nothing to check')
    noise = {s.name: s.noise for s in signals}
    if kind == polynomial.KIND:
        plant = polynomial.read_nonlinear(top.table("plant"), outputs, inputs, sample_time_s, path)
    else:
        plant = read_plant(top.table("plant"), outputs, inputs, noise, sample_time_s)
    faults = tuple(_read_fault(t, signals) for t in top.tables("faults", optional=True))
    _unique([f.name for f in faults] + [s.name for s in signals], f"{path.name}: faults and signals")
    if len(faults) > FAULTS_MAX:
        raise InputError(f"{path.name}: {len(faults)} faults, the verdict frame has room for {FAULTS_MAX}")
    inner = top.table("detector")
    detector = read_detector(inner)
    if detector.feedback_known and plant.feedback is None:
        raise inner.error("feedback_known", "there is no [plant] feedback to know; give one, or remove this")
    for key, bank in (("bank", detector.bank), ("isolation", detector.isolation)):
        for n in bank.faults if bank is not None else ():
            if n not in [f.name for f in faults]:
                raise inner.error(f"{key}.faults", f"'{n}' is not one of {', '.join(f.name for f in faults) or 'none'}")
    uios = _read_uios(inner, plant, signals, faults) if kind == KIND else ()
    filters = _read_filters(inner, detector, outputs, faults) if kind == polynomial.KIND else ()
    observers = _read_observers(inner, outputs, inputs, faults) if kind not in (KIND, polynomial.KIND) else ()
    verdict, status, heartbeat, up, down, latch = _read_verdict(top.table("verdict"), groups)
    own = [("verdict", verdict), ("status", status), *((g.name, g.frame) for g in groups)]
    freeze = None
    if "freeze" in top:
        freeze = read_freeze(top.table("freeze"), _detector_frame, {(f.id, f.extended): n for n, f in own})
        own += [("freeze.request", freeze.request), ("freeze.response", freeze.response)] if freeze else []
    _free(path, network, own)
    scenarios = _read_scenarios(top, path)
    top.table("network", optional=True)  # read by adopt
    top.close()
    if sum(g.closing for g in groups) != 1:
        raise InputError(f'{path.name}: exactly one group closes the sample with transmission = "tick"; found {sum(g.closing for g in groups)}')
    return Model(
        name=name,
        path=path,
        sample_time_s=sample_time_s,
        bitrate_bps=bitrate,
        data_bitrate_bps=data_bitrate,
        load_max=load_max,
        plant=plant,
        signals=signals,
        groups=groups,
        observers=observers,
        detector=detector,
        verdict=verdict,
        status=status,
        heartbeat=heartbeat,
        debounce_up=up,
        debounce_down=down,
        latch=latch,
        faults=faults,
        scenarios=scenarios,
        sha256=_fingerprint(data | {"network": network.plain()} if network.taken else data),
        uios=uios,
        polynomials=filters,
        freeze=freeze,
    )


def _read_uios(inner: Table, plant: Plant, signals: tuple[Signal, ...], faults: tuple[Fault, ...]) -> tuple[UioSpec, ...]:
    """The observers of a model of kind "uio"."""
    if plant.unknown is None:
        raise inner.error("uio", "there is no input that nobody knows; give [plant.unknown], or make the model linear")
    named = [(i, s) for i, s in enumerate(signals) if s.role == "output"]
    made = read_uios(inner, plant.states, [s.name for _, s in named], faults, [i for i, _ in named])
    if not 1 <= len(made) <= GENERATORS_MAX:
        raise inner.error("uio", f"{len(made)} observers; 1 .. {GENERATORS_MAX} are possible")
    inner.close()
    return made


def _read_filters(inner: Table, detector: DetectorSpec, outputs: list[str], faults: tuple[Fault, ...]) -> tuple[polynomial.FilterSpec, ...]:
    """The filters of a model of kind "polynomial"."""
    for key, asked in (("bank", detector.bank), ("isolation", detector.isolation), ("prediction", detector.prediction), ("threshold", detector.threshold != "exact")):
        if asked:
            raise inner.error(key, "it needs the bounds of a linear plant; remove it, or make the model linear")
    made = polynomial.read_filters(inner, outputs, faults)
    if len(made) > GENERATORS_MAX:
        raise inner.error("polynomial", f"{len(made)} filters; 1 .. {GENERATORS_MAX} are possible")
    inner.close()
    return made


def _fingerprint(data: dict[str, Any]) -> str:
    """SHA-256 of all that the stored numbers of a design depend on: not scenarios, the freeze frame, nor what only chooses among them."""
    relevant = {k: v for k, v in data.items() if k not in ("scenarios", "freeze")}
    relevant["detector"] = {k: v for k, v in data.get("detector", {}).items() if k not in ("threshold", "zonotope", "prediction", "feedback_known")}
    for bank in ("bank", "isolation"):
        if bank in relevant["detector"]:
            relevant["detector"][bank] = {k: v for k, v in relevant["detector"][bank].items() if k != "size"}
    return hashlib.sha256(json.dumps(relevant, sort_keys=True).encode()).hexdigest()


def _unique(names: list[str], where: str) -> None:
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise InputError(f"{where}: '{twice[0]}' is there twice")


def _name(t: Table, *taken: str) -> str:
    name = t.text("name")
    if not NAME.match(name):
        raise t.error("name", f"'{name}' is not a lower-case identifier of at most 31 characters")
    if name in taken:
        raise t.error("name", f"'{name}' is the name of a message of the detector; choose another")
    return name


def _free(path: Path, network: Network, frames: list[tuple[str, Frame]]) -> None:
    """Refuse a frame of the project's own with an identifier that the vehicle uses."""
    for name, frame in frames:
        other = network.taken.get((frame.id, frame.extended))
        if frame.wire is None and other is not None:
            raise InputError(f"{path.name}: '{name}' would send with identifier 0x{frame.id:X}, which is that of the vehicle's message '{other}'; choose another")


def _read_signal(t: Table) -> Signal:
    name = _name(t)
    low, high = (float(v) for v in t.vector("range", 2))
    if not low < high:
        raise t.error("range", f"{low:g} is not below {high:g}")
    resolution = t.number("resolution", 1e-12, high - low)
    slew: tuple[float, ...] | None = None
    if "slew" in t and t.raw("slew") != "reachable":
        if isinstance(t.raw("slew"), str):
            raise t.error("slew", 'expected a list of numbers or "reachable"')
        slew = tuple(float(v) for v in t.vector("slew", low=0.0))
        if not slew or any(b < a for a, b in itertools.pairwise(slew)):
            raise t.error("slew", "expected at least one number, none smaller than the one before")
    recording = t.table("recording", optional=True)
    delay = recording.whole("delay", 0, 100, 0)
    recording.close()
    signal = Signal(
        name=name,
        role=t.text("role", choices=["output", "input"]),
        low=low,
        high=high,
        resolution=resolution,
        slew=slew,
        scale=t.number("scale", 1e-12, default=1.0),
        noise=t.number("noise", 0.0, default=0.0),
        csv_delay=delay,
        float32=t.text("wire", "integer", ["integer", "float32"]) == "float32",
    )
    t.close()
    return signal


def _read_groups(top: Table, declared: list[Signal], path: Path, network: Network, sample_time_s: float) -> tuple[tuple[Group, ...], list[int]]:
    """The groups, and the declared signals in the order in which the groups send them."""
    names = [s.name for s in declared]
    groups: list[Group] = []
    order: list[int] = []
    for t, wire in zip(top.tables("groups"), network.wires, strict=True):
        members = t.names("signals", [])
        for member in members:
            if member not in names:
                raise t.error("signals", f"'{member}' is not a declared signal")
        if len(members) > GROUP_SIGNALS_MAX:
            raise t.error("signals", f"{len(members)} signals, a frame has room for {GROUP_SIGNALS_MAX}; split the group")
        places = [names.index(m) for m in members]
        first = len(order)
        order += places
        groups.append(_read_group(t, tuple(range(first, len(order))), [declared[i] for i in places], wire, sample_time_s))
    if not 1 <= len(groups) <= GROUPS_MAX:
        raise InputError(f"{path.name}: {len(groups)} groups; 1 .. {GROUPS_MAX} are possible")
    _unique([g.name for g in groups], f"{path.name}: groups")
    for i, n in enumerate(names):
        if order.count(i) != 1:
            raise InputError(f"{path.name}: signal '{n}' is in {order.count(i)} groups, it must be in exactly one")
    ids = [(g.frame.id, g.frame.extended) for g in groups]
    for g, key in zip(groups, ids, strict=True):
        if ids.count(key) > 1:
            raise InputError(f"{path.name}: two groups send with identifier 0x{g.frame.id:X}; give each its own")
    closing = [g for g in groups if g.closing]
    _check_stamps(path, groups)
    for g in groups:
        # Behind the closing frame a frame without a stamp is booked to the next sample, which its skew covers.
        if closing and not g.closing and (g.frame.stamped or g.skew == 0) and _priority(g.frame) > _priority(closing[0].frame):
            raise InputError(
                f"{path.name}: group '{g.name}' (0x{g.frame.id:X}) would arrive after the closing frame (0x{closing[0].frame.id:X}): give the closing frame the larger identifier"
            )
    return tuple(groups), order


def _check_stamps(path: Path, groups: list[Group]) -> None:
    """Refuse stamps that nothing tells the detector how to read: a closing frame without one counts samples by itself."""
    blind = [g.name for g in groups if g.closing and not g.frame.stamped]
    stamped = [g.name for g in groups if g.frame.stamped]
    if blind and stamped:
        raise InputError(
            f"{path.name}: the closing frame of group '{blind[0]}' has no stamp, so nothing says what the stamps of '{stamped[0]}' count from; "
            'name a free signal of 4 bits, protection = { .., stamp = ".." }, or close the sample with a tick of its own'
        )


def _priority(frame: Frame) -> tuple[int, bool, int]:
    """Order of arbitration, first is sent first: the 11 base bits, a standard frame before an extended one, the other 18 bits."""
    return (frame.id >> 18, True, frame.id & 0x3FFFF) if frame.extended else (frame.id, False, 0)


def read_frame(t: Table, data_id: int) -> Frame:
    """A message of the project's own layout: its place on the bus and its protection."""
    extended = t.flag("extended", False)
    if "protection" in t and isinstance(t.raw("protection"), dict):
        raise t.error("protection", f"names signals of a database, and the frame is not from one; give the group dbc_message, or one of {', '.join(PROFILES)}")
    profile = t.text("protection", "", PROFILES) or None
    mode = t.text("mode", "both", MODES) if profile in MODAL else "both"
    most = NIBBLE_ID_MAX if mode == "nibble" else 0xFFFF
    number = t.whole("id", 0, 0x1FFFFFFF if extended else 0x7FF)
    frame = Frame(number, extended, t.flag("fd", False) if "fd" in t else None, t.whole("data_id", 0, most, data_id & most), profile, mode)
    t.close()
    return frame


def _read_group(t: Table, places: tuple[int, ...], members: list[Signal], wire: Wire | None, sample_time_s: float) -> Group:
    transmission = t.text("transmission", "event", ["event", "tick", "periodic"])
    if wire is not None:
        for field, member in zip(wire.fields, members, strict=True):
            check_range(wire, field, member)
        frame = Frame(wire.id, wire.extended, wire.fd, wire.protection.data_id, wire.protection.profile, wire.protection.mode, wire)
    else:
        inner = t.table("frame")
        frame = read_frame(inner, int(inner.whole("id", 0, 0x1FFFFFFF)) & 0xFFFF)
    applied = t.flag("applied_as_sent", False)
    if applied and any(s.role != "input" for s in members):
        raise t.error("applied_as_sent", "only inputs can be applied as sent")
    width = len(places)
    if transmission == "event":
        trigger = _read_trigger(t.table("trigger"), members)
    else:
        period = _read_period(t, wire, transmission == "tick", sample_time_s)
        margin = t.whole("margin", 0, 64, 4)
        empty = np.zeros((1, width))
        trigger = Trigger(empty, empty, (period - 1,), period, empty, margin)
    skew = t.whole("skew_samples", 0, 16, 0 if frame.stamped or transmission == "tick" else 1)
    group = Group(_name(t, "verdict", "status"), places, frame, trigger, transmission == "tick", applied, skew, *_read_rules(t, frame, transmission))
    _check_stamp(t, group)
    t.close()
    return group


def _read_rules(t: Table, frame: Frame, transmission: str) -> tuple[tuple[str, ...], int]:
    """Checks of the protection that are off, none unless the model says so, and the frames refused after a jump of the counter."""
    rules = t.table("rules", optional=True)
    ignore = tuple(rules.names("ignore", ()))
    for name in ignore:
        if name not in IGNORABLE:
            raise rules.error("ignore", f"'{name}' is no check; choose of {', '.join(IGNORABLE)}")
        if not frame.protected:
            raise rules.error("ignore", "the frame has no protection to be ignored; remove it")
    if "counter" in ignore and transmission != "periodic":
        raise rules.error("ignore", "without the counter a lost frame looks like silence, which is a promise, and the closing frame is the clock: periodic groups only")
    resync = rules.whole("resync", 0, 15, 0)
    rules.close()
    return ignore, resync


def _read_period(t: Table, wire: Wire | None, closing: bool, sample_time_s: float) -> int:
    """Samples from one frame of a periodic sender to its next; what the model and the database say must agree."""
    sample_ms = 1000 * sample_time_s
    stated = wire.cycle_ms if wire is not None else 0
    usual = max(1, round(stated / sample_ms))
    period = 1 if closing else t.whole("period_samples", 1, PERIOD_MAX, usual)
    if period > PERIOD_MAX:
        raise InputError(f"{t.where}: its period of {period} samples is more than {PERIOD_MAX}; choose a longer sample time")
    if wire is not None and stated and abs(stated - period * sample_ms) > max(0.5, 1e-6 * stated):
        cure = "give the model that sample time" if closing else "choose period_samples, or a sample time that divides the cycle"
        raise InputError(f"{t.where}: message '{wire.message}' is sent every {stated} ms by the database, {period} x {sample_ms:g} ms by the model; {cure}")
    return period


def _check_stamp(t: Table, group: Group) -> None:
    """Refuse what a frame without a counter, or without a stamp, cannot promise."""
    periodic = group.trigger.periodic
    if group.closing and not group.frame.protected:
        raise InputError(f"{t.where}: the closing frame without protection: the sample index would rest on a frame that may be damaged or repeated; protect it")
    if not periodic and not group.frame.protected:
        cure = 'protect it, or make it transmission = "periodic"'
        raise InputError(f"{t.where}: an event-triggered frame without protection: without a counter a lost frame looks like silence, which is a promise; {cure}")
    if group.closing and group.skew:
        raise t.error("skew_samples", "the closing frame says which sample is which: its values are of the one it closes; remove it")
    if not periodic and group.skew:
        # A promise begins with the sender's sample, which the receiver would have to know.
        raise t.error("skew_samples", "an event-triggered sender must sample with the tick: give skew_samples = 0 if it does, or send periodically")


def _read_trigger(t: Table, members: list[Signal]) -> Trigger:
    """From quiet (level 0: widest threshold, longest silence) to active (last level: narrowest, shortest), in even steps."""
    levels = t.whole("levels", 1, 8, 1)
    width = len(members)
    interval_max = t.whole("interval_max", 1, 200)
    narrow, wide = _pair(t, "delta", 0.0, 0.999)
    short, long = _pair(t, "silence", 0, interval_max - 1, default=0.0)
    if short != int(short) or long != int(long):
        raise t.error("silence", "expected whole samples")
    step = np.linspace(0.0, 1.0, levels) if levels > 1 else np.zeros(1)
    sigma = t.vector("sigma", width, 0.0)
    for s, value in zip(members, sigma, strict=True):
        if value > s.high - s.low:
            raise t.error("sigma", f"{value:g} for '{s.name}' is wider than its range: the trigger would never act")
        if value < s.resolution / 2:
            raise t.error("sigma", f"{value:g} for '{s.name}' is below half its resolution of {s.resolution:g}: the trigger could not see it")
    scales = np.array([s.scale for s in members])
    trigger = Trigger(
        delta=np.outer(wide + (narrow - wide) * step, np.ones(width)),
        sigma=np.outer(np.ones(levels), sigma),
        silence=tuple(round(v) for v in long + (short - long) * step),
        interval_max=interval_max,
        activity=np.outer(step, scales),
        margin=t.whole("margin", 0, 64, 4),
    )
    t.close()
    return trigger


def _pair(t: Table, key: str, low: float, high: float, default: float | None = None) -> tuple[float, float]:
    """A number, or [smallest, largest]."""
    if default is not None and key not in t:
        return default, default
    value = t.raw(key)
    if not isinstance(value, list):
        one = t.number(key, low, high)
        return one, one
    pair = t.vector(key, 2, low)
    if pair[0] > pair[1] or pair[1] > high:
        raise t.error(key, f"expected [smallest, largest] within {low:g} .. {high:g}")
    return float(pair[0]), float(pair[1])


def _read_fault(t: Table, signals: tuple[Signal, ...]) -> Fault:
    name, signal = _name(t), t.text("signal")
    places = [i for i, s in enumerate(signals) if s.name == signal]
    if not places:
        raise t.error("signal", f"'{signal}' is not a declared signal")
    kind = t.text("type", choices=["actuator", "sensor"])
    if kind == "actuator" and signals[places[0]].role != "input":
        raise t.error("type", f"'{signal}' is an output: an actuator fault needs an input")
    size_max = t.number("size_max", 1e-12) if "size_max" in t else None
    t.close()
    return Fault(name, places[0], kind, size_max)


def _read_observers(t: Table, outputs: list[str], inputs: list[str], faults: tuple[Fault, ...]) -> tuple[Observer, ...]:
    observers = []
    for o in t.tables("observers"):
        chosen = {key: o.names(key, everything) for key, everything in (("outputs", outputs), ("inputs", inputs), ("faults", [f.name for f in faults]))}
        for key, known in (("outputs", outputs), ("inputs", inputs), ("faults", [f.name for f in faults])):
            for n in chosen[key]:
                if n not in known:
                    raise o.error(key, f"'{n}' is not one of {', '.join(known) or 'none'}")
        search = _read_search(o.table("search", optional=True))
        least, most = read_orders(o, search)
        names = [f.name for f in faults]
        observers.append(
            Observer(
                order=least,
                order_max=most,
                residuals=o.whole("residuals", 1, 16),
                outputs=tuple(outputs.index(n) for n in chosen["outputs"]),
                inputs=tuple(inputs.index(n) for n in chosen["inputs"]),
                faults=tuple(names.index(n) for n in chosen["faults"]),
                aware=o.flag("trigger_aware", True),
                search=search,
                parity=read_parity(o, least, most, len(chosen["outputs"]), search),
                poles=read_poles(o, least, most, search),
            )
        )
        o.close()
    if not 1 <= len(observers) <= GENERATORS_MAX:
        raise t.error("observers", f"{len(observers)} residual generators; 1 .. {GENERATORS_MAX} are possible")
    t.close()
    return tuple(observers)


def _read_search(s: Table) -> Search:
    poles = s.vector("poles", 2) if "poles" in s else np.array([0.0, 0.9])
    if not -1.0 < poles[0] <= poles[1] < 1.0:
        raise s.error("poles", "expected [smallest, largest] inside the unit circle: -1 .. 1")
    objective = s.text("objective", "smallest fault", ["smallest fault", "delay", "between events"])
    if objective != "delay" and "size" in s:
        raise s.error("size", 'only objective = "delay" looks for a fault of a size; remove it')
    search = Search(
        objective=objective,
        trials=s.whole("trials", 1, 1_000_000, 1000),
        seed=s.whole("seed", 0, 2**32 - 1, 1),
        poles=(float(poles[0]), float(poles[1])),
        event_weight=_pair(s, "event_weight", 0.01, 100.0, default=1.0),
        size=s.number("size", 1e-9, default=1.0),
    )
    s.close()
    return search


def _detector_frame(t: Table) -> Frame:
    """A frame of the detector's own."""
    frame = read_frame(t, int(t.whole("id", 0, 0x1FFFFFFF)) & 0xFFFF)
    if frame.profile not in (None, "P22"):
        raise t.error("protection", f"the detector's own frames have a layout of profile 22, not {frame.profile}; remove it")
    return frame


def _read_verdict(t: Table, groups: tuple[Group, ...]) -> tuple[Frame, Frame, int, int, int, bool]:
    verdict = _detector_frame(t.table("frame"))
    if "status_frame" in t:
        status = _detector_frame(t.table("status_frame"))
    else:
        if verdict.id == (0x1FFFFFFF if verdict.extended else 0x7FF):
            raise t.error("frame", "there is no identifier behind it for the status frame; give status_frame, or a smaller id")
        status = replace(verdict, id=verdict.id + 1, data_id=(verdict.data_id + 1) & 0xFFFF)
    taken = [g.frame.id for g in groups] + [verdict.id, status.id]
    for i in (verdict.id, status.id):
        if taken.count(i) > 1:
            raise t.error("frame", f"identifier 0x{i:X} is used twice")
    debounce = t.table("debounce", optional=True)
    up, down = debounce.whole("up", 1, 255, 1), debounce.whole("down", 1, 255, 5)
    debounce.close()
    heartbeat, latch = t.whole("heartbeat_samples", 1, 65535, 10), t.flag("latch", False)
    t.close()
    return verdict, status, heartbeat, up, down, latch


def _read_scenarios(top: Table, path: Path) -> tuple[Scenario, ...]:
    scenarios = []
    for t in top.tables("scenarios", optional=True):
        r = t.table("reference", optional=True)
        seconds = r.number("period_s", 1e-6, default=6.0)
        reference = Reference(
            r.text("kind", "rest", ["rest", "steps", "ramps", "sines", "mixed"]),
            r.number("amplitude", 0.0, default=1.0),
            max(1, round(seconds / float(top.number("sample_time_s")))),
        )
        r.close()
        overrides = t.raw("set") if "set" in t else {}
        if not isinstance(overrides, dict):
            raise t.error("set", "expected a table of KEY = VALUE")
        figures = t.text("figures", "", ["published"])
        road = read_road(t.table("road")) if "road" in t else None
        scenarios.append(Scenario(t.text("name"), t.whole("samples", 1, 10_000_000), reference, tuple(parse_fault(f) for f in t.names("faults", [])), overrides, figures, road))
        t.close()
    if not scenarios:
        scenarios.append(Scenario("default", 200, Reference("rest", 0.0, 1), ()))
    _unique([s.name for s in scenarios], f"{path.name}: scenarios")
    return tuple(scenarios)
