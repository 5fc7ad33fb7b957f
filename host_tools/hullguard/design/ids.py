"""Data identifiers, and how many errors the checksums of the E2E profiles do not see: exact, because CRCs are linear."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from hullguard.design.protection import ProtectionTable

LIST = 16
POLYNOMIAL = {"P01": 0x1D, "P11": 0x1D, "P02": 0x2F, "P22": 0x2F, "P05": 0x1021}
SURE = 12  # bytes: CRC-8H2F with a constant list sees every error of up to three bits in frames no longer than that
ERRORS = 3  # bits

Counts = NDArray[np.int64]


def _step(crc: int, polynomial: int, width: int) -> int:
    """The remainder after eight more bits."""
    for _ in range(8):
        crc = (crc << 1) ^ (polynomial if crc >> (width - 1) else 0)
        crc &= (1 << width) - 1
    return crc


def _moved(byte: int, behind: int, polynomial: int, width: int) -> int:
    """Change of the checksum by a change of one byte with `behind` bytes after it. Start value and XOR drop out."""
    crc = byte << (width - 8)
    for _ in range(behind + 1):
        crc = _step(crc, polynomial, width)
    return crc


def undetected(ids: tuple[int, ...], length: int, bits: int = ERRORS) -> int:
    """Number of (counter, error pattern of 1 .. bits flipped bits in `length` bytes) that profile 22 does not see with this list of identifiers."""
    return sum(_unseen("P22", ids, length, 0, 8, -1, bits))


def undetected_patterns(p: ProtectionTable, length: int, bits: int = ERRORS) -> int:
    """Error patterns of 1 .. bits flipped bits in a frame of `length` bytes that its protection does not see: most of all counter values."""
    if p.profile not in POLYNOMIAL:
        raise ValueError("a frame without protection sees nothing")
    ids = p.data_ids
    if p.mode == "alternate" and not ids:
        ids = (p.data_id & 0xFF, p.data_id >> 8)
    return max(_unseen(p.profile, ids, length, p.crc, p.counter, p.nibble if p.nibbled else -1, bits))


@cache
def _unseen(profile: str, ids: tuple[int, ...], length: int, crc: int, counter: int, nibble: int, bits: int) -> tuple[int, ...]:
    """Patterns that pass, a number for every counter value.

    `ids`: what of the data identifier enters the checksum by the counter's value, modulo the length of the list; () where that does not
    depend on the counter. `nibble`: first bit of the part that the receiver compares with its own, so that no error there passes; or -1.
    """
    syndrome = _syndromes(profile, length, crc)
    for i in range(4 if nibble >= 0 else 0):
        del syndrome[nibble + i]
    special = 0 if profile == "P05" else 4  # counter bits whose error also changes the identifier, or is seen as no counter value
    values = 15 if profile in ("P01", "P11") else 1 << special
    own = [syndrome.pop(counter + i) for i in range(special)]
    counts = _sums(list(syndrome.values()), bits, 16 if profile == "P05" else 8)
    behind = length - 1 if profile in ("P01", "P11") else 0  # the identifier comes before the data there, behind them in the others
    misses = [0] * values
    for value in range(values):
        for flip in range(1 << special):
            other, flipped = value ^ flip, flip.bit_count()
            if other >= values or flipped > bits:
                continue
            change = _moved(ids[value % len(ids)] ^ ids[other % len(ids)], behind, POLYNOMIAL[profile], 8) if ids else 0
            for i in range(special):
                change ^= own[i] if flip >> i & 1 else 0
            misses[value] += sum(int(counts[n][change]) for n in range(0 if flipped else 1, bits - flipped + 1))
    return tuple(misses)


def _syndromes(profile: str, length: int, crc: int) -> dict[int, int]:
    """What each bit of the frame, Intel numbering, changes of the checksum received beside the one computed."""
    wide = profile == "P05"
    width, size = (16, 2) if wide else (8, 1)
    after = {"P05": 2, "P02": 1, "P22": 1}.get(profile, 0)  # bytes of the data identifier behind the data
    data = [b for b in range(length) if not crc <= b < crc + size]
    found = {}
    for place, byte in enumerate(data):
        for bit in range(8):
            found[8 * byte + bit] = _moved(1 << bit, len(data) - 1 - place + after, POLYNOMIAL[profile], width)
    for bit in range(width):
        found[8 * crc + bit] = 1 << bit  # low byte first
    return found


def _sums(syndromes: list[int], bits: int, width: int) -> list[Counts]:
    """How many sets of n = 0 .. bits of them have each sum."""
    counts = [np.zeros(1 << width, dtype=np.int64) for _ in range(bits + 1)]
    counts[0][0] = 1
    every = np.arange(1 << width)
    for s in syndromes:
        for n in range(bits, 0, -1):
            counts[n] += counts[n - 1][every ^ s]
    return counts


def data_ids(data_id: int) -> tuple[int, ...]:
    """The list of a message: its folded data identifier for every counter value.

    A constant list keeps the frame with its counter a linear code, whose distance is that of CRC-8H2F itself: no error of up to three
    bits passes in frames of up to 12 bytes. The list 0, 1, .. 15, in use elsewhere, lets 48 patterns pass in 8 bytes.
    """
    return (fold(data_id),) * LIST


def fold(data_id: int) -> int:
    """The byte that stands for a 16-bit data identifier."""
    return (data_id ^ (data_id >> 8)) & 0xFF
