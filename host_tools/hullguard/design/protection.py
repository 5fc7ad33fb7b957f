"""End-to-end protection of one message: which profile of AUTOSAR E2E, and where its fields lie. The layouts of the project's own frames.

    none, P22, P02                    byte 0 CRC   byte 1 counter (low nibble), stamp (high nibble)                              signals from bit 16
    P01, P11: both, alternate, low    the same
    P01, P11: nibble                  byte 0 CRC   byte 1 counter, data-id nibble (high)   byte 2 stamp (low nibble)             signals from bit 20
    P05                               bytes 0, 1 CRC, low byte first   byte 2 counter      byte 3 stamp (low nibble)             signals from bit 28

A frame without protection has no stamp either, and its signals begin at bit 0. The stamp is the sample index modulo 16.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

from hullguard.design.ids import data_ids
from hullguard.errors import InputError

NO_STAMP = 0xFFFF
NONE = "none"
PROFILES = (NONE, "P01", "P02", "P05", "P11", "P22")
LISTED = ("P02", "P22")  # profiles with a data identifier for each counter value
MODES = ("both", "alternate", "low", "nibble")
MODAL = ("P01", "P11")  # profiles with a data-id mode
MODULUS = {NONE: 0, "P01": 15, "P02": 16, "P05": 256, "P11": 15, "P22": 16}
DATA_ID_MAX = 0xFFFF
NIBBLE_ID_MAX = 0xFFF  # in mode nibble: a byte in the checksum and a nibble in the frame
IDS = 16
NIBBLE = 4


@dataclass(frozen=True)
class ProtectionTable:
    """hg_e2e_config."""

    profile: str  # "none" | "P01" | "P02" | "P05" | "P11" | "P22"
    crc: int  # byte of the checksum (P05: its low byte)
    counter: int  # first bit of the counter, Intel numbering (bit 8*byte + i)
    nibble: int  # first bit of the data-id nibble (P01/P11 mode nibble)
    stamp: int  # first bit of the sample index modulo 16; NO_STAMP where the frame has none
    mode: str  # "both" | "alternate" | "low" | "nibble" (P01, P11)
    data_id: int  # P01, P05, P11
    data_ids: tuple[int, ...]  # P02, P22: 16 bytes; else ()
    ignore: tuple[str, ...]  # of "crc", "counter", "stamp", "state": checks that are off
    resync: int = 0  # good frames in sequence that are refused after a jump of the counter

    @property
    def modulus(self) -> int:
        """Counter values; 0 without a counter."""
        return MODULUS[self.profile]

    @property
    def stamped(self) -> bool:
        """Whether a frame says which sample it belongs to."""
        return self.stamp != NO_STAMP

    @property
    def nibbled(self) -> bool:
        """Whether a nibble of the data identifier is in the frame."""
        return self.profile in MODAL and self.mode == "nibble"

    @property
    def places(self) -> dict[str, tuple[int, int]]:
        """First bit, Intel numbering, and bits of every field that the frame has."""
        if self.profile == NONE:
            return {}
        wide = self.profile == "P05"
        found = {"crc": (8 * self.crc, 16 if wide else 8), "counter": (self.counter, 8 if wide else NIBBLE)}
        if self.nibbled:
            found["nibble"] = (self.nibble, NIBBLE)
        if self.stamped:
            found["stamp"] = (self.stamp, NIBBLE)
        return found

    @property
    def bits(self) -> dict[int, str]:
        """Field that has each protected bit of the frame."""
        return {first + i: name for name, (first, count) in self.places.items() for i in range(count)}


UNPROTECTED = ProtectionTable(NONE, 0, 0, 0, NO_STAMP, "both", 0, (), ())


def own_protection(profile: str, mode: str, data_id: int) -> tuple[ProtectionTable, int]:
    """Protection of a frame of the project's own layout, and the bit where its signals begin. `mode` counts for P01 and P11 only."""
    if profile == NONE:
        return UNPROTECTED, 0
    if profile in LISTED:
        return ProtectionTable(profile, 0, 8, 0, 12, "both", 0, data_ids(data_id), ()), 16
    if profile == "P05":
        return ProtectionTable(profile, 0, 16, 0, 24, "both", data_id, (), ()), 28
    if mode == "nibble":
        return ProtectionTable(profile, 0, 8, 12, 16, mode, data_id, (), ()), 20
    return ProtectionTable(profile, 0, 8, 0, 12, mode, data_id, (), ()), 16


def check_protection(p: ProtectionTable, length: int, where: str) -> None:
    """Refuse places outside a frame of `length` bytes, on one another or off their boundary, and identifiers that the profile does not have."""
    boundary = {"crc": 8, "counter": 8 if p.profile == "P05" else NIBBLE, "nibble": NIBBLE, "stamp": NIBBLE}
    for name, (first, count) in p.places.items():
        if first < 0 or first + count > 8 * length:
            raise InputError(f"{where}: the {name} of its protection, bits {first} .. {first + count - 1}, is outside the frame of {length} bytes")
        if first % boundary[name]:
            raise InputError(f"{where}: the {name} of its protection begins at bit {first}, which is not a multiple of {boundary[name]}")
    for (a, (a_first, a_count)), (b, (b_first, b_count)) in combinations(p.places.items(), 2):
        if a_first < b_first + b_count and b_first < a_first + a_count:
            raise InputError(f"{where}: {a} and {b} of its protection lie on the same bits; give each its own")
    if p.profile in LISTED and (len(p.data_ids) != IDS or not all(0 <= i <= 0xFF for i in p.data_ids)):
        raise InputError(f"{where}: profile {p.profile} needs a data-id list of {IDS} bytes, found {len(p.data_ids)}; give data_ids")
    most = NIBBLE_ID_MAX if p.nibbled else DATA_ID_MAX
    if not 0 <= p.data_id <= most:
        raise InputError(f"{where}: data id 0x{p.data_id:X} is beyond 0x{most:X}" + ("; mode nibble has 12 bits for it" if p.nibbled else ""))
