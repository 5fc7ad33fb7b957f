"""One directive and more of every action, for any model: what `--inject all` means, in three classes by what protection can know of it."""

from __future__ import annotations

from dataclasses import dataclass

from hullguard.design.protection import NO_STAMP
from hullguard.design.tables import GroupTable, Tables
from hullguard.inject.actions import ACTIONS
from hullguard.inject.codec import Codec
from hullguard.inject.directive import Directive, parse_directive
from hullguard.inject.shot import STAMP_MODULUS
from hullguard.model.schema import Model

SEEN, HEAVY, VALID = "seen", "heavy", "valid"
CLASSES = {
    SEEN: "protection sees it: up to 3 flipped bits, length, counter, stamp, twins, old, lost, late, doubled frames, floods, bus-off",
    HEAVY: "more than 3 flipped bits: passes at the residual rate of the checksum",
    VALID: "checksum and counter are in order: nothing but the plant's physics can tell, like a sensor fault",
}
TRUE = ("true", "yes", "1")
VALUES = ("bias", "drift", "gain", "noise", "spike", "freeze")  # change values and renew the checksum


@dataclass(frozen=True)
class FrameCase:
    """One directive of a campaign with faulty frames."""

    spec: str
    directive: Directive
    kind: str  # SEEN, HEAVY or VALID


def kind_of(d: Directive) -> str:
    """The class of a directive."""
    if d.action == "corrupt":
        if d.options.get("repair", "false").lower() in TRUE:
            return VALID
        return SEEN if "mask" not in d.options and int(d.options.get("bits", "1")) <= 3 else HEAVY
    if d.action in VALUES or (d.action == "spoof" and d.options.get("valid", "true").lower() in TRUE):
        return VALID  # a counter or stamp that the forger chose is now and then the right one
    return HEAVY if d.action == "flood" and "data" not in d.options else SEEN


def case_of(spec: str) -> FrameCase:
    """A user's directive."""
    directive = parse_directive(spec)
    return FrameCase(spec, directive, kind_of(directive))


def all_cases(model: Model, tables: Tables, codec: Codec, start: int, end: int) -> list[FrameCase]:
    """Every action, on the first group that sends by events and on the one that closes the sample, between two samples."""
    event = next((i for i, g in enumerate(tables.groups) if i != tables.closing and g.signals), tables.closing)
    group, closing = tables.groups[event], tables.groups[tables.closing]
    signal = group.signals[0]
    period = model.sample_time_s
    step = 20 * signal.resolution
    k = f"k={start}..{end}"
    both = [f"@id={n},{k}" for n in dict.fromkeys((group.name, closing.name))]
    window = f"from={start * period:g},to={end * period:g}"
    often = f"@period={7 * period:g},{window}"
    number, wide = group.message.id, bool(group.message.flags & 1)
    lengths = [n for n in (0, 1, 5, 7, 8) if n != group.message.length][:3]
    each = [f"corrupt:bits={n}{w},p=0.5" for n in (1, 2, 3, 4, 5, 6, 8, 16, 32) for w in both]
    each += [f"length:to={n}@id={group.name},{k},p=0.5" for n in lengths]
    each += [f"counter:by={n}{w},p=0.3" for n in (1, 3, 8, 15) for w in both]
    each += [f"spoof:message={group.name},valid=false{often}"]
    each += [f"{a}{w},p=0.5" for a in ("rtr", "fdtwin", "duplicate", "duplicate:times=3,gap=" + f"{1.5 * period:g}") for w in both]
    each += [] if wide else [f"exttwin{w},p=0.5" for w in both]
    each += [f"replay:frames={n},age={a * period:g}{w},p=0.3" for n, a in ((1, 1), (1, 5), (1, 11), (3, 5)) for w in both]
    each += [f"drop{w},p=0.3" for w in both] + [f"silence:lasts={4 * period:g}{w},every=8" for w in both] + [f"busoff:lasts={3 * period:g}{w},every=8" for w in both]
    each += [f"delay:by={0.5 * period:g}{w},p=0.3" for w in both] + [f"delay:by={0.2 * period:g},jitter={2 * period:g}{w},p=0.3" for w in both]
    each += [f"reorder{w},p=0.3" for w in both] + [f"reorder:behind=3,patience={5 * period:g}{w},p=0.3" for w in both]
    each += [f"flood:id=0x000,rate={40 / period:g},lasts={3 * period:g}{often}", f"flood:id=0x{number:X},rate={40 / period:g},lasts={3 * period:g}{often}"]
    each += [f"error:kind={n}{often}" for n in ("busoff", "passive")]
    each += [f"nan:signal={signal.name},pattern={n}@{k},p=0.5" for n in ("invalid", "range")[: 1 + (codec.signal(signal.name)[1].beyond is not None)]]
    each += [f"corrupt:bits=2,repair=true@id={group.name},{k},p=0.3", f"spoof:message={group.name}{often}"]
    sizes = {"bias": "size", "drift": "rate", "noise": "size", "spike": "size"}
    each += [f"{a}:signal={signal.name},{o}={step:g}@{k}" + (",p=0.3" if a == "spike" else "") for a, o in sizes.items()]
    each += [f"gain:signal={signal.name},factor=1.2@{k}", f"freeze:signal={signal.name}@{k}"]
    cases = [case_of(spec) for spec in each] + _misplaced(group, start, period, window)
    missing = set(ACTIONS) - {c.directive.action for c in cases} - ({"exttwin"} if wide else set())
    assert not missing, f"actions without a case: {missing}"
    return cases


def _misplaced(group: GroupTable, start: int, period: float, window: str) -> list[FrameCase]:
    """Forged frames of other samples than the open one, early and late: one in 16 samples, whose stamp is therefore never the right one."""
    if group.message.protection.stamp == NO_STAMP:
        return []
    stamps = [(start + ahead) % STAMP_MODULUS for ahead in (1, 7, 9, 15)]
    specs = [f"spoof:message={group.name},stamp={n}@period={STAMP_MODULUS * period:g},{window}" for n in stamps]
    return [FrameCase(spec, parse_directive(spec), SEEN) for spec in specs]
