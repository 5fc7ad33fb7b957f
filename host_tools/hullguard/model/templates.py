"""Entries of a model file that stand for many: one a vehicle, or one a gap, of a builder's plant. Expanded before anything is checked.

    each = "gap"  name = "gap{i}{j}_m"         an entry for every gap: i is the vehicle ahead, j = i + 1 the one behind
    when = { vehicles = [2, 16] }              an entry for platoons of that length only
    id = { first = 0x220, step = 0x10 }        a number of an entry with `each` that grows from one to the next
    { speed = 0.5, gap = 1.0 }                 a vector over states, inputs or a group's signals by what the names begin with

Neighbouring entries with the same `each` take turns: all of them for the first vehicle or gap, then all for the next. A list of names may hold
entries too: signals = [{ each = "gap", name = "gap{i}{j}_m" }, "speed1_mps"]. What comes out is the model that one would have written by hand.
"""

from __future__ import annotations

import copy
import itertools
import re
from collections.abc import Sequence
from typing import Any

from hullguard.errors import InputError
from hullguard.model.builders import BUILDERS, SIZE_MAX
from hullguard.model.table import Table

_PLACE = re.compile(r"\{(\w*)\}")
STEM = re.compile(r"^[a-z_]*[a-z]")  # what a name is before its number

Instance = dict[str, int]
Families = dict[str, list[Instance]]


def expand(source: dict[str, Any], where: str) -> dict[str, Any]:
    """A model without templates. Data that is malformed in another way passes through: its reader says what is wrong."""
    data = copy.deepcopy(source)
    plant = data.get("plant")
    plant = plant if isinstance(plant, dict) else {}
    size, families = _families(data, where)
    for key in ("signals", "faults", "groups"):
        data[key] = _entries(data.get(key), size, families, f"{where}.{key}")
        if data[key] is None:
            del data[key]
    detector = data.get("detector")
    if isinstance(detector, dict) and "observers" in detector:
        detector["observers"] = _entries(detector["observers"], size, families, f"{where}.detector.observers")
    if isinstance(detector, dict) and "uio" in detector:
        detector["uio"] = _entries(detector["uio"], size, families, f"{where}.detector.uio")
    inner = detector if isinstance(detector, dict) else {}
    named = (("groups", data.get("groups"), ("signals",)), *((f"detector.{k}", inner.get(k), ("outputs", "inputs", "faults")) for k in ("observers", "uio")))
    for place, owner, keys in named:
        for i, entry in enumerate(owner if isinstance(owner, list) else []):
            for key in keys:
                if isinstance(entry, dict) and isinstance(entry.get(key), list):
                    entry[key] = _names(entry[key], size, families, f"{where}.{place}[{i}].{key}")
    _vectors(data, plant, where)
    return data


def _plural(value: Any) -> bool:
    """Whether there is a template anywhere in it."""
    if isinstance(value, dict):
        return "each" in value or "when" in value or any(_plural(v) for v in value.values())
    return isinstance(value, list) and any(_plural(v) for v in value)


def _families(data: dict[str, Any], where: str) -> tuple[tuple[str, int] | None, Families]:
    """The key that says how large a builder's plant is, with its value, and what an `each` can name; nothing where no template asks."""
    if not any(_plural(data.get(key)) for key in ("signals", "groups", "faults", "detector")):
        return None, {}
    plant = Table(data, where).table("plant")
    if "builder" not in plant:
        return None, {}
    builder = BUILDERS[plant.text("builder", choices=sorted(BUILDERS))]
    count = plant.whole(builder.size, builder.least, SIZE_MAX)
    return (builder.size, count), builder.families(count)


def _entries(entries: Any, size: tuple[str, int] | None, families: Families, where: str) -> Any:
    """An array of tables with every template in it expanded."""
    if not isinstance(entries, list):
        return entries
    kept = [(i, e) for i, e in enumerate(entries) if not isinstance(e, dict) or _wanted(e, size, f"{where}[{i}]")]
    made: list[Any] = []
    for each, block in itertools.groupby(kept, key=lambda ie: ie[1].get("each") if isinstance(ie[1], dict) else None):
        members = list(block)
        if each is None:
            made += [e for _, e in members]
            continue
        for place, instance in enumerate(_instances(each, families, f"{where}[{members[0][0]}]")):
            made += [_fill({k: v for k, v in e.items() if k != "each"}, instance, place, f"{where}[{i}]") for i, e in members]
    return made


def _wanted(entry: dict[str, Any], size: tuple[str, int] | None, where: str) -> bool:
    """Whether an entry's `when` holds; takes it out."""
    if "when" not in entry:
        return True
    when = entry.pop("when")
    if size is None:
        raise InputError(f"{where}.when: needs a [plant] builder; remove it")
    key, count = size
    bounds = when.get(key) if isinstance(when, dict) and len(when) == 1 else None
    if not isinstance(bounds, list) or len(bounds) != 2 or not all(isinstance(b, int) and not isinstance(b, bool) for b in bounds) or bounds[0] > bounds[1]:
        raise InputError(f"{where}.when: expected {{ {key} = [smallest, largest] }}")
    return bool(bounds[0] <= count <= bounds[1])


def _instances(each: Any, families: Families, where: str) -> list[Instance]:
    if not families:
        raise InputError(f"{where}.each: needs a [plant] builder; write the entries one by one")
    if not isinstance(each, str) or each not in families:
        raise InputError(f"{where}.each: '{each}' is not one of {', '.join(families)}")
    return families[each]


def _fill(value: Any, instance: Instance, place: int, where: str) -> Any:
    """A copy of a template with its placeholders and growing numbers filled in."""
    if isinstance(value, str):
        return _text(value, instance, where)
    if isinstance(value, list):
        return [_fill(v, instance, place, where) for v in value]
    if isinstance(value, dict):
        if set(value) == {"first", "step"} and all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in value.values()):
            return value["first"] + place * value["step"]
        return {k: _fill(v, instance, place, where) for k, v in value.items()}
    return value


def _text(text: str, instance: Instance, where: str) -> str:
    for found in _PLACE.finditer(text):
        if found[1] not in instance:
            raise InputError(f"{where}: '{text}': {{{found[1]}}} is not one of {', '.join('{' + n + '}' for n in instance)}")
    return _PLACE.sub(lambda found: str(instance[found[1]]), text)


def _names(names: Sequence[Any], size: tuple[str, int] | None, families: Families, where: str) -> list[Any]:
    """A list of names in which an entry { each, name } stands for many."""
    tables = [{"name": n} if isinstance(n, str) else n for n in names]
    made = []
    for n in _entries(tables, size, families, where):
        if isinstance(n, dict) and set(n) != {"name"}:
            raise InputError(f'{where}: expected names, or {{ each = "..", name = ".." }}')
        made.append(n["name"] if isinstance(n, dict) else n)
    return made


def _vectors(data: dict[str, Any], plant: dict[str, Any], where: str) -> None:
    """Vectors that are given by what the names begin with, as lists."""
    builder = BUILDERS.get(plant["builder"]) if isinstance(plant.get("builder"), str) else None
    count = plant.get(builder.size) if builder is not None else None
    known = builder is not None and isinstance(count, int) and not isinstance(count, bool) and builder.least <= count <= SIZE_MAX
    states = list(builder.states(count)) if known and builder is not None and count is not None else plant.get("states")
    groups = _tables(data.get("groups"))
    order = [n for g in groups for n in _texts(g.get("signals"))]
    roles = {s.get("name"): s.get("role") for s in _tables(data.get("signals")) if isinstance(s.get("name"), str)}
    inputs, outputs = ([n for n in order if roles.get(n) == role] for role in ("input", "output"))
    disturbance, feedback = plant.get("disturbance"), plant.get("feedback")
    wanted: list[tuple[Any, str, Any, str]] = [(plant, key, states, "plant") for key in ("initial_range", "equilibrium", "state_range")]
    wanted += [(disturbance, "state", states, "plant.disturbance"), (disturbance, "output", outputs, "plant.disturbance")]
    wanted += [(feedback, "state_weights", states, "plant.feedback")]
    wanted += [(feedback, key, inputs, "plant.feedback") for key in ("input_weights", "reference_bound")]
    for i, g in enumerate(groups):
        wanted.append((g.get("trigger"), "sigma", _texts(g.get("signals")), f"groups[{i}].trigger"))
    detector = data.get("detector")
    for i, u in enumerate(_tables(detector.get("uio")) if isinstance(detector, dict) else []):
        wanted.append((u, "trust", states, f"detector.uio[{i}]"))
    for table, key, names, place in wanted:
        if names != [] and isinstance(table, dict) and isinstance(table.get(key), dict):
            table[key] = _vector(table[key], names, f"{where}.{place}.{key}")


def _tables(entries: Any) -> list[dict[str, Any]]:
    return [e for e in entries if isinstance(e, dict)] if isinstance(entries, list) else []


def _texts(names: Any) -> list[str]:
    return [n for n in names if isinstance(n, str)] if isinstance(names, list) else []


def _vector(given: dict[str, Any], names: Any, where: str) -> list[Any]:
    """One value a name: that of the name itself, or of what the name is before its number."""
    if not isinstance(names, list) or not all(isinstance(n, str) for n in names):
        raise InputError(f"{where}: by name, it needs a [plant] builder or states = [..]; give a list of numbers")
    made, used = [], set()
    for name in names:
        stem = STEM.match(name)
        key = name if name in given else stem[0] if stem else name
        if key not in given:
            raise InputError(f"{where}: nothing for '{name}'; give '{key}' or '{name}'")
        used.add(key)
        made.append(given[key])
    for key in given:
        if key not in used:
            raise InputError(f"{where}: '{key}' is the beginning of none of {', '.join(names)}")
    return made
