"""Directives: which frames or moments (trigger), and what then happens (action). One line, or an entry of a YAML file.

How both are written stands in arguments.SPEC, which --help prints. An entry has action, options, trigger and name, or is a one-line directive.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import yaml

from hullguard.errors import InputError
from hullguard.inject.options import number
from hullguard.inject.predicate import Predicate

_TIME = re.compile(r"^time\s*(>=|>|<=|<)\s*(.+)$")
_SAMPLES = re.compile(r"^(\d{1,18})(\.\.(\d{1,18})?)?$")
_ID = re.compile(r"^(0[xX][0-9A-Fa-f]+|\d+)(?:/(0[xX][0-9A-Fa-f]+|\d+))?(x)?$")
_SIGN = {">=": "from", ">": "from", "<": "to", "<=": "to"}
TRIGGERS = ("id", "when", "from", "to", "k", "nth", "every", "at", "period", "p", "count", "name", "seed")
SEED_MAX = 2**64 - 1
PERIOD_MIN_S = 1e-5  # more often than any bus has frames; a shorter one would never come to an end
STANDARD_MAX, EXTENDED_MAX = 0x7FF, 0x1FFFFFFF
DEPTH_MAX = 6  # levels of a YAML file; directives, entry, options, signals are 4


@dataclass(frozen=True)
class IdMatch:
    """One entry of id=: a message's name, or a number under a mask."""

    text: str
    id: int | None = None
    mask: int = EXTENDED_MAX
    extended: bool = False


@dataclass(frozen=True)
class Trigger:
    """When a directive acts. Times in seconds since the start, `to` and `k_end` not part of it."""

    ids: tuple[IdMatch, ...] = ()
    when: Predicate | None = None
    start_s: float = 0.0
    end_s: float = math.inf
    k_start: int | None = None
    k_end: int | None = None
    nth: int = 0
    every: int = 1
    at_s: float | None = None
    period_s: float | None = None
    p: float = 1.0
    count: int = 0  # 0: no limit

    @property
    def timed(self) -> bool:
        """Whether it acts at moments instead of on frames."""
        return self.at_s is not None or self.period_s is not None

    @property
    def selective(self) -> bool:
        """Whether it chooses single frames or moments, not a time or a state of the traffic."""
        return bool(self.nth or self.every > 1 or self.timed or self.p < 1.0 or self.count)


@dataclass(frozen=True)
class Directive:
    """One fault. `where` says in errors where it stands, `spec` is what the user wrote."""

    name: str
    action: str
    options: Mapping[str, str] = field(default_factory=dict)
    trigger: Trigger = field(default_factory=Trigger)
    seed: int | None = None  # instead of the injector's
    spec: str = ""
    where: str = ""


def _split(text: str, separator: str, where: str) -> list[str]:
    """Parts between separators that stand outside quotation marks, which go."""
    parts, quote = [""], ""
    for c in text:
        if quote:
            quote = "" if c == quote else quote
            parts[-1] += "" if not quote else c
        elif c in "\"'":
            quote = c
        elif c == separator:
            parts.append("")
        else:
            parts[-1] += c
    if quote:
        raise InputError(f"{where}: a quotation mark {quote} is not closed")
    return parts


def _halves(spec: str) -> tuple[str, str | None]:
    """Before and behind the first @ outside quotation marks, these kept."""
    quote = ""
    for i, c in enumerate(spec):
        if quote:
            quote = "" if c == quote else quote
        elif c in "\"'":
            quote = c
        elif c == "@":
            return spec[:i], spec[i + 1 :]
    return spec, None


def _pairs(text: str, where: str) -> dict[str, str]:
    made: dict[str, str] = {}
    for part in _split(text, ",", where):
        limit = _TIME.match(part.strip())
        name, equals, value = (_SIGN[limit[1]], "=", limit[2]) if limit else part.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise InputError(f"{where}: '{part.strip()}' is not NAME=VALUE")
        if name.strip() in made:
            raise InputError(f"{where}: {name.strip()} is given twice")
        made[name.strip()] = value.strip()
    return made


def parse_directive(spec: str, where: str = "") -> Directive:
    """Read a one-line SPEC; raises InputError with `where` it stands, if that is known, and what would do."""
    where = f"{where}: directive '{spec}'" if where else f"directive '{spec}'"
    head, tail = _halves(spec.strip())
    action, colon, options = head.partition(":")
    if not re.fullmatch(r"[a-z]+", action):
        raise InputError(f"{where}: expected ACTION[:OPTION=VALUE,..][@TRIGGER=VALUE,..], for example drop@id=0x110,p=0.1")
    if tail is not None and not tail.strip():
        raise InputError(f"{where}: nothing behind @; name a trigger, for example @id=0x110")
    if colon and not options.strip():
        raise InputError(f"{where}: nothing behind ':'; leave it out or give OPTION=VALUE")
    return _made(action, _pairs(options, where) if options.strip() else {}, _pairs(tail, where) if tail else {}, spec.strip(), where)


def _made(action: str, options: Mapping[str, str], trigger: Mapping[str, str], spec: str, where: str) -> Directive:
    from hullguard.inject.actions import ACTIONS
    from hullguard.inject.options import fill

    if action not in ACTIONS:
        raise InputError(f"{where}: no action '{action}'; there are {', '.join(sorted(ACTIONS))}")
    fill(ACTIONS[action], options, where)
    seed = int(number(trigger["seed"], int, 0, SEED_MAX, f"{where}: seed={trigger['seed']}")) if "seed" in trigger else None
    return Directive(trigger.get("name", ""), action, dict(options), _trigger(trigger, where), seed, spec, where)


def _id(text: str, where: str) -> IdMatch:
    found = _ID.match(text)
    if not found:
        if not re.fullmatch(r"[A-Za-z_]\w*", text):
            raise InputError(f"{where}: id '{text}' is neither a message's name nor a number such as 0x110, 0x100/0x7F0 or 0x110x")
        return IdMatch(text)
    value, mask = (int(x, 16 if x[:2].lower() == "0x" else 10) for x in (found[1], found[2] or hex(EXTENDED_MAX)))
    if value > EXTENDED_MAX:
        raise InputError(f"{where}: id {text} is above 0x1FFFFFFF, the largest there is")
    return IdMatch(text, value & mask, mask, bool(found[3]) or value > STANDARD_MAX)


def _trigger(given: Mapping[str, str], where: str) -> Trigger:
    for name in given:
        if name not in TRIGGERS:
            raise InputError(f"{where}: no trigger '{name}'; there are {', '.join(TRIGGERS)}")

    def of(name: str, kind: type[int] | type[float], low: float | None, high: float | None = None, above: float | None = None) -> Any:
        return number(given[name], kind, low, high, f"{where}: {name}={given[name]}", above) if name in given else None

    made = Trigger(
        ids=tuple(_id(x.strip(), where) for x in given["id"].split("|")) if "id" in given else (),
        when=_condition(given["when"], where) if "when" in given else None,
        start_s=of("from", float, 0.0) or 0.0,
        end_s=math.inf if "to" not in given else of("to", float, 0.0),
        nth=of("nth", int, 1) or 0,
        every=of("every", int, 1) or 1,
        at_s=of("at", float, 0.0),
        period_s=of("period", float, PERIOD_MIN_S),
        p=1.0 if "p" not in given else of("p", float, 0.0, 1.0),
        count=of("count", int, 1) or 0,
    )
    if made.end_s <= made.start_s:
        raise InputError(f"{where}: it ends at {made.end_s:g} s, not after its start at {made.start_s:g} s")
    if made.at_s is not None and made.period_s is not None:
        raise InputError(f"{where}: at= is one moment, period= many; give one of them")
    if made.timed and (made.nth or made.every > 1):
        raise InputError(f"{where}: nth= and every= count frames, at= and period= are moments; give one or the other")
    if "k" not in given:
        return made
    first, last = _samples(given["k"], where)
    return replace(made, k_start=first, k_end=last)


def _condition(text: str, where: str) -> Predicate:
    try:
        return Predicate(text)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def _samples(text: str, where: str) -> tuple[int, int | None]:
    found = _SAMPLES.match(text)
    if not found:
        raise InputError(f"{where}: k={text}: expected START or START..END, for example 100..120")
    start, end = int(found[1]), int(found[3]) if found[3] else None
    if end is not None and end <= start:
        raise InputError(f"{where}: k={text}: it ends at {end}, not after its start at {start}")
    return start, end


def named(directives: Iterable[Directive]) -> list[Directive]:
    """Every directive with a name of its own: given, or its action's with a number. A further one moves no other's random numbers."""
    made: list[Directive] = []
    counts: dict[str, int] = {}
    for d in directives:
        counts[d.action] = counts.get(d.action, 0) + 1
        name = d.name or f"{d.action}{counts[d.action]}"
        if any(o.name == name for o in made):
            raise InputError(f"{d.where}: the name '{name}' is taken; give another with name=")
        made.append(replace(d, name=name))
    return made


# ---- YAML ----


def read_directives(path: Path) -> list[Directive]:
    """The directives of a YAML file: a list, or a mapping with `directives`; an entry is a one-line SPEC or has action, options, trigger, name."""
    try:
        source = path.read_text(encoding="utf-8")
        root = yaml.compose(source, Loader=yaml.SafeLoader)
        _sane(root, path.name, 0)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a readable YAML file ({error})") from error
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        told = " ".join(str(getattr(error, "problem", None) or error).split())
        raise InputError(f"{path.name}:{mark.line + 1 if mark else 1}: not YAML ({told})") from error
    except RecursionError as error:
        raise InputError(f"{path.name}:1: nested too deep; an entry has {DEPTH_MAX} levels at most") from error
    if isinstance(root, yaml.MappingNode):
        entries = {k.value: v for k, v in root.value}
        for extra in entries.keys() - {"directives"}:
            raise InputError(f"{path.name}:1: no key '{extra}' at the top; there is directives")
        root = entries.get("directives")
    if not isinstance(root, yaml.SequenceNode) or not root.value:
        raise InputError(f"{path.name}:1: expected a list of directives, for example: directives: [drop@id=0x110]")
    return [_entry(node, f"{path.name}:{node.start_mark.line + 1}") for node in root.value]


def _sane(node: yaml.Node | None, name: str, depth: int) -> None:
    """Refuse keys that are no text, and trees deeper than any directive, also those that hold themselves."""
    where = f"{name}:{node.start_mark.line + 1 if node else 1}"
    if depth > DEPTH_MAX:
        raise InputError(f"{where}: nested too deep; an entry has {DEPTH_MAX} levels at most")
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise InputError(f"{where}: a key must be a word, not a list or a mapping")
            _sane(value, name, depth + 1)
    elif isinstance(node, yaml.SequenceNode):
        for value in node.value:
            _sane(value, name, depth + 1)


def _entry(node: yaml.Node, where: str) -> Directive:
    value = _plain(node, where)
    if isinstance(value, str):
        return parse_directive(value, where)
    if not isinstance(value, dict) or not isinstance(value.get("action"), str):
        raise InputError(f"{where}: expected a one-line directive, or a mapping with action, and if need be options, trigger, name")
    for key in value.keys() - {"action", "options", "trigger", "name"}:
        raise InputError(f"{where}: no key '{key}'; an entry has action, options, trigger, name")
    options, trigger = (value.get(key, {}) for key in ("options", "trigger"))
    if not isinstance(options, dict) or not isinstance(trigger, dict):
        raise InputError(f"{where}: options and trigger are mappings, for example {{id: measurement, p: 0.1}}")
    trigger = trigger | ({"name": value["name"]} if "name" in value else {})
    made = [{k: _text(v, f"{where}: {k}") for k, v in part.items()} for part in (options, trigger)]
    spec = value["action"] + "".join(mark + ",".join(f"{k}={v}" for k, v in part.items()) for mark, part in zip(":@", made, strict=True) if part)
    return _made(value["action"], made[0], made[1], spec, where)


def _plain(node: yaml.Node, where: str) -> Any:
    """Strings, lists and mappings of a YAML tree; numbers stay as they are written, so that both forms are read alike."""
    if isinstance(node, yaml.MappingNode):
        made: dict[str, Any] = {}
        for key, value in node.value:
            if key.value in made:
                raise InputError(f"{where}: {key.value} is given twice")
            made[key.value] = _plain(value, where)
        return made
    if isinstance(node, yaml.SequenceNode):
        return [_plain(x, where) for x in node.value]
    return node.value


def _text(value: Any, where: str) -> str:
    """A value as the one-line form has it: ids of a list with |, signals of a mapping with ;."""
    if isinstance(value, list) and all(isinstance(x, str) for x in value):
        return "|".join(value)
    if isinstance(value, dict) and all(isinstance(x, str) for x in value.values()):
        return ";".join(f"{k}={v}" for k, v in value.items())
    if not isinstance(value, str) or not value:
        raise InputError(f"{where}: expected a value")
    return value
