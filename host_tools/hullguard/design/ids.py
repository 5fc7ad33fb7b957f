"""Lists of data identifiers for profile 22 that let no error of up to three bits pass."""

from __future__ import annotations

from functools import cache
from itertools import combinations

POLYNOMIAL = 0x2F
LIST = 16


def _step(crc: int) -> int:
    for _ in range(8):
        crc = ((crc << 1) ^ POLYNOMIAL) & 0xFF if crc & 0x80 else (crc << 1) & 0xFF
    return crc


@cache
def _syndromes(length: int) -> tuple[int, ...]:
    """Change of the checksum by each bit of bytes 1 .. length-1, byte by byte, bit 0 first. CRCs are linear: start value and XOR drop out."""
    found = []
    for byte in range(1, length):
        for bit in range(8):
            crc = 1 << bit
            for _ in range(length - byte + 1):  # the byte itself, the rest, and the identifier behind them
                crc = _step(crc)
            found.append(crc)
    return tuple(found)


def undetected(ids: tuple[int, ...], length: int, bits: int = 3) -> int:
    """Number of (counter, error pattern of 1 .. bits flipped bits in `length` bytes) that the checksum does not see."""
    crc_bits = [1 << b for b in range(8)]
    syndromes = _syndromes(length)
    counter_bits, other = syndromes[:4], list(syndromes[4:]) + crc_bits
    sums = {0: {0: 1}}
    for n in range(1, bits + 1):
        counts: dict[int, int] = {}
        for chosen in combinations(other, n):
            value = 0
            for c in chosen:
                value ^= c
            counts[value] = counts.get(value, 0) + 1
        sums[n] = counts
    misses = 0
    for counter in range(LIST):
        for flip in range(LIST):
            flipped = flip.bit_count()
            change = _step(ids[counter] ^ ids[counter ^ flip])
            for b in range(4):
                if flip >> b & 1:
                    change ^= counter_bits[b]
            for n in range(0 if flipped else 1, bits - flipped + 1):
                misses += sums[n].get(change, 0)
    return misses


def data_ids(data_id: int) -> tuple[int, ...]:
    """The list of a message: its folded data identifier for every counter value.

    A constant list keeps the frame with its counter a linear code, whose distance is that of CRC-8H2F itself: no error of up to three
    bits passes in frames of up to 12 bytes. The list 0, 1, .. 15, in use elsewhere, lets 48 patterns pass in 8 bytes.
    """
    return (fold(data_id),) * LIST


def fold(data_id: int) -> int:
    """The byte that stands for a 16-bit data identifier."""
    return (data_id ^ (data_id >> 8)) & 0xFF
