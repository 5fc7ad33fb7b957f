"""The given model file with the bounds that were found: comments and order stay, and beside every number that changed stands where it comes from."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from tomlkit.items import AoT, InlineTable, Item, Table

from hullguard.identify.structure import NOISE, OUTPUT, STATE, Parameter, Structure
from hullguard.model.schema import Model
from hullguard.model.table import Array

LISTED = 10  # slews; longer ones follow from these
DIGITS = 3


def rounded_up(value: float) -> float:
    """To three digits, never below."""
    if value <= 0.0:
        return 0.0
    unit = 10.0 ** (np.floor(np.log10(value)) - DIGITS + 1)
    return float(f"{np.ceil(value / unit - 1e-9) * unit:.{DIGITS}g}")


class Rewriter:
    """A model file that is being changed."""

    def __init__(self, text: str, model: Model, origin: str) -> None:
        """`origin` goes into the comments: the recordings."""
        self._doc, self._model, self._origin = tomlkit.parse(text), model, origin

    def head(self, lines: list[str], name: str | None) -> None:
        """Comments above all, and the name."""
        fresh = tomlkit.document()
        for line in lines:
            fresh.add(tomlkit.comment(line))
        fresh.add(tomlkit.nl())
        self._head = tomlkit.dumps(fresh)
        if name is not None:
            self._doc["name"] = name

    def moved(self, folder: Path) -> None:
        """Paths that are relative to the given file, relative to the new one."""
        network: Any = self._doc.get("network")
        if network is not None and "dbc" in network and not Path(str(network["dbc"])).is_absolute():
            network["dbc"] = os.path.relpath(self._model.path.parent / str(network["dbc"]), folder)

    def bounds(self, found: Structure, bound: Array, smallest: Array) -> None:
        """Disturbances and noise."""
        plant: Any = self._doc["plant"]
        told: dict[str, list[str]] = {STATE: [], OUTPUT: []}
        for p, value, least in zip(found.parameters, bound, smallest, strict=True):
            note = f"{p.name.removeprefix('disturbance of ')}: {least:.3g} at least, given {p.given:g}"
            if p.where == NOISE:
                assert isinstance(p.key, int)
                self._set(self._signal(p.key), "noise", rounded_up(value), f"{self._origin}: {least:.3g} at least; given {p.given:g}")
                continue
            told[p.where].append(note)
            self._disturb(plant, p, float(value), found)
        disturbance = plant.get("disturbance")
        if disturbance is None:
            return
        if isinstance(disturbance, InlineTable):
            self._comment(disturbance, f"{self._origin}: " + "; ".join(told[STATE] + told[OUTPUT]))
            return
        for key, notes in told.items():
            if notes:
                self._comment(disturbance[key], f"{self._origin}: " + "; ".join(notes))

    def _disturb(self, plant: Any, p: Parameter, value: float, found: Structure) -> None:
        """One bound of plant.disturbance."""
        if "disturbance" not in plant:
            self._add(plant, "disturbance", tomlkit.inline_table())
        table = plant["disturbance"]
        given = table.get(p.where)
        if p.key is None:
            table[p.where] = rounded_up(value)
        elif isinstance(p.key, str):
            given[p.key] = rounded_up(value)
        elif isinstance(given, list) and given and isinstance(given[0], list):
            for row in given:
                row[p.key] = float(f"{float(row[p.key]) * rounded_up(value):.6g}")
        else:
            if not isinstance(given, list):
                table[p.where] = [0.0] * (found.model.plant.n if p.where == STATE else found.model.plant.m)
            table[p.where][p.key] = rounded_up(value)

    def slews(self, entries: dict[int, Array], largest: dict[int, float]) -> None:
        """Slews of the [[signals]] entries that need a list; `largest` is what was seen in one sample."""
        for i, slew in entries.items():
            made = np.maximum.accumulate([rounded_up(float(x)) for x in slew[:LISTED]])
            self._set(self._signal(i), "slew", [float(x) for x in made], f"{self._origin}: {largest[i]:.3g} seen in one sample")

    def ranges(self, entries: dict[int, tuple[float, float]]) -> None:
        """Ranges that a recording leaves."""
        for i, (low, high) in entries.items():
            given = list(self._signal(i)["range"])
            self._set(self._signal(i), "range", [low, high], f"{self._origin} leaves the given {given[0]:g} .. {given[1]:g}")

    def delays(self, entries: dict[int, int]) -> None:
        """Lags that a replay of such a recording has to take out."""
        for i, delay in entries.items():
            table = tomlkit.inline_table()
            table["delay"] = delay
            self._set(self._signal(i), "recording", table, f"{self._origin}: others lag by {delay} more; a sender's own lag belongs into the plant")

    def triggers(self, scale: float, why: str) -> None:
        """Every sigma times a number."""
        groups: Any = self._doc["groups"]
        for g in groups:
            if "trigger" not in g or "sigma" not in g["trigger"]:
                continue
            t = g["trigger"]
            sigma = t["sigma"].unwrap() if hasattr(t["sigma"], "unwrap") else t["sigma"]
            t["sigma"] = _times(sigma, scale)
            shown = ", ".join(f"{k} {v}" for k, v in sigma.items()) if isinstance(sigma, dict) else f"{sigma}"
            self._comment(t if isinstance(t, InlineTable) else t["sigma"], f"sigma {scale:g} times the given {shown}: {why}")

    def text(self) -> str:
        """The new file."""
        return self._head + tomlkit.dumps(self._doc)

    def _signal(self, entry: int) -> Any:
        signals: Any = self._doc["signals"]
        return signals[entry]

    def _set(self, table: Any, key: str, value: Any, note: str) -> None:
        if key in table:
            old = table[key].trivia.comment if isinstance(table[key], Item) else ""
            table[key] = value
            self._comment(table[key], note, old)
        else:
            self._add(table, key, value)
            self._comment(table[key], note)

    def _add(self, table: Any, key: str, value: Any) -> None:
        """A new key behind the last one, above the blank lines and comments that belong to what follows."""
        if isinstance(table, InlineTable) or not isinstance(table, Table):
            table[key] = value
            return
        body, behind = table.value.body, list[Any]()
        while body and body[-1][0] is None:
            behind.append(body.pop()[1])
        table.append(key, value)
        for item in reversed(behind):
            table.add(item)

    def _comment(self, item: Any, note: str, old: str = "") -> None:
        """A remark behind a value, after what stood there, but for the word of `new` that it is to be checked; where the file's layout has no place for one there is none."""
        if isinstance(self._doc["signals"], AoT) and isinstance(item, Item):
            before = (old or item.trivia.comment).removeprefix("#").partition("CHECK")[0].strip()
            item.comment(f"{before}; {note}" if before else note)


def _times(sigma: Any, scale: float) -> Any:
    """A number, list or table of numbers, times a number."""
    if isinstance(sigma, dict):
        made = tomlkit.inline_table()
        made.update({k: _times(v, scale) for k, v in sigma.items()})
        return made
    if isinstance(sigma, list):
        return [_times(v, scale) for v in sigma]
    return rounded_up(float(sigma) * scale)
