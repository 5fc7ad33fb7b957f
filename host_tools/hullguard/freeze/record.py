"""A freeze frame's words (hullguard/freeze.h) as the numbers that they are."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hullguard.core.library import library
from hullguard.core.native import PLANT_STATES, Native, bus_of
from hullguard.design.design import Design
from hullguard.errors import InputError

FORMAT = 1
TYPES = {1: "f32", 2: "f64", 3: "q31"}
HEAD, ROW_HEAD = 3, 3  # words before the samples, and of a sample before its numbers
BASES = ("unset", "set", "statistical")


@dataclass(frozen=True)
class Sample:
    """What the ECU knew when it judged a sample."""

    k: int
    plant: str
    basis: str
    bus: tuple[str, ...]
    candidates: int
    value: tuple[float, ...]
    radius: tuple[float, ...]
    r: tuple[float, ...]
    J: tuple[float, ...]


@dataclass(frozen=True)
class Record:
    """The samples around one alarm, oldest first."""

    number: int
    real: str
    model_hash: int
    alarm: int  # place of the alarm's sample
    samples: tuple[Sample, ...]


def checksum(words: Sequence[int]) -> int:
    """CRC-32C of words, as the library computes it."""
    lib, crc = library().lib, 0
    for word in words:
        crc = int(lib.hg_crc32c(crc, word, 4))
    return crc


def _numbers(words: Sequence[int], real: str) -> list[float]:
    if real == "q31":
        return [float(x) for x in struct.unpack(f"<{len(words)}i", struct.pack(f"<{len(words)}I", *words))]
    return list(struct.unpack(f"<{len(words)}f" if real == "f32" else f"<{len(words) // 2}d", struct.pack(f"<{len(words)}I", *words)))


def _units(design: Design, real: str) -> list[float]:
    """What each number of value (or radius) and of r (or J) is times of."""
    native = Native(library(real), design.tables)
    return [native.unit(i) for i in range(design.tables.width + design.tables.residuals)]


def decode(design: Design, words: Sequence[int]) -> Record:
    """A whole record; one that is damaged, or of another shape than the model's, is refused."""
    if len(words) < HEAD + 1 or checksum(words[:-1]) != words[-1]:
        raise InputError("the record is damaged: its checksum is wrong; read it again")
    form, real, number, held = (words[0] >> shift & 0xFF for shift in (0, 8, 16, 24))
    width, alarm, residuals = words[2] & 0xFF, words[2] >> 8 & 0xFF, words[2] >> 16
    t = design.tables
    if form != FORMAT or real not in TYPES or (width, residuals) != (t.width, t.residuals):
        raise InputError(
            f"the record has {width} signals and {residuals} residuals in format {form}, model {t.name} {t.width} and {t.residuals} in format {FORMAT}; name the ECU's model"
        )
    row = ROW_HEAD + 2 * (width + residuals) * (2 if TYPES[real] == "f64" else 1)
    if len(words) != HEAD + held * row + 1:
        raise InputError(f"the record has {len(words)} words, {held} samples need {HEAD + held * row + 1}; read it again")
    units = _units(design, TYPES[real])
    rows = (words[HEAD + i * row : HEAD + (i + 1) * row] for i in range(held))
    return Record(number, TYPES[real], words[1], alarm, tuple(_sample(design, r, TYPES[real], units) for r in rows))


def _sample(design: Design, row: Sequence[int], real: str, units: Sequence[float]) -> Sample:
    t, numbers = design.tables, _numbers(row[ROW_HEAD:], real)

    def part(first: int, count: int, unit: int) -> tuple[float, ...]:
        return tuple(x * u for x, u in zip(numbers[first : first + count], units[unit : unit + count], strict=True))

    plant, basis, bus = row[1] & 0xFF, row[1] >> 8 & 0xFF, row[1] >> 16
    w, n = t.width, t.residuals
    shown = (part(0, w, 0), part(w, w, 0), part(2 * w, n, w), part(2 * w + n, n, w))
    return Sample(row[0], PLANT_STATES[plant & 3], BASES[basis % len(BASES)], bus_of(bus, len(t.groups)), row[2], *shown)


def ratios(sample: Sample) -> Iterator[float]:
    """|r| / J of each residual."""
    return (abs(r) / J if J > 0.0 else 0.0 for r, J in zip(sample.r, sample.J, strict=True))
