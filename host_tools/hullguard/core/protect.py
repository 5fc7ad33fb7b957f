"""End-to-end protection of one message by the C library: for those who make, change or judge frames one by one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from hullguard.core.library import Library
from hullguard.design.protection import ProtectionTable

IGNORE = {"crc": 0x01, "counter": 0x02, "stamp": 0x04, "state": 0x08}  # HG_E2E_IGNORE_*


@dataclass(frozen=True)
class Header:
    """What a good frame's header says. `stamp` is the sample index modulo 16, None in a message that has none."""

    counter: int
    stamp: int | None


def protection(library: Library, table: ProtectionTable) -> tuple[Any, list[Any]]:
    """hg_e2e_config, and what must live as long."""
    ffi, lib = library.ffi, library.lib
    config = ffi.new("hg_e2e_config *")
    kept = [config]
    config.profile = getattr(lib, f"HG_E2E_{table.profile.upper()}")
    config.mode = getattr(lib, f"HG_E2E_{table.mode.upper()}")
    config.data_id, config.crc, config.counter = table.data_id, table.crc, table.counter
    config.nibble, config.stamp = table.nibble, table.stamp
    config.ignore = sum(IGNORE[name] for name in table.ignore)
    config.resync = table.resync
    config.limits = ffi.addressof(lib.hg_e2e_limits_default)
    if table.data_ids:
        kept.append(ffi.new("uint8_t[]", list(table.data_ids)))
        config.data_ids = kept[-1]
    return config, kept


class Protector:
    """One message's rules: writes and checks headers."""

    def __init__(self, library: Library, table: ProtectionTable) -> None:
        self._ffi, self._lib = library.ffi, library.lib
        self.table = table
        self._config, self._keep = protection(library, table)
        self._blind, self._kept = protection(library, replace(table, ignore=("crc",)))
        self.modulus = int(self._lib.hg_e2e_modulus(self._config))

    def protect(self, data: bytes, counter: int, stamp: int) -> bytes:
        """The frame with counter (taken by the modulus), stamp (modulo 16) and checksum in place; ValueError for one that is too short or too long."""
        made = self._ffi.new("uint8_t[]", data or b"\0")
        if self._lib.hg_e2e_protect(self._config, made, len(data), counter % self.modulus, stamp % 16) != self._lib.HG_OK:
            raise ValueError(f"{len(data)} bytes cannot hold this protection")
        return bytes(self._ffi.buffer(made, len(data)))

    def sum(self, data: bytes) -> bytes:
        """The data with their checksum renewed; counter and stamp are those in place."""
        header = self._ffi.new("hg_e2e_header *")
        self._lib.hg_e2e_check(self._blind, data, len(data), header)
        return self.protect(data, int(header.counter), int(header.stamp))

    def check(self, data: bytes) -> Header | None:
        """What the header says; None for a damaged frame or one of a wrong length."""
        header = self._ffi.new("hg_e2e_header *")
        if self._lib.hg_e2e_check(self._config, data or b"\0", len(data), header) != self._lib.HG_OK:
            return None
        return Header(int(header.counter), int(header.stamp) if self.table.stamped else None)
