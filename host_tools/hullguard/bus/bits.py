"""Length of frames on the wire in the worst case, and the load that a model can put on a bus. Exact lengths come from the C side (core)."""

from __future__ import annotations

from hullguard.design.tables import EXTENDED, FD, MessageTable, Tables


def worst_bits(message: MessageTable) -> int:
    """Most bits that a frame can take, stuff bits and interframe space included; data-phase bits of an FD frame count as bits too."""
    extended, n = bool(message.flags & EXTENDED), message.length
    if not message.flags & FD:
        return 80 + 10 * n if extended else 55 + 10 * n
    nominal = 49 if extended else 30
    crc, fixed = (17, 6) if n <= 16 else (21, 7)
    data = 5 + 8 * n + 4 + crc + fixed
    stuffed = ((36 if extended else 17) + 5 + 8 * n - 1) // 4
    return nominal + data + stuffed


def load_bound(tables: Tables, bitrate_bps: int, sample_time_s: float) -> float:
    """Largest share of the bus: every sender at its shortest interval, a verdict and a status frame with every sample."""
    bits = 0.0
    for g in tables.groups:
        bits += worst_bits(g.message) / (min(g.silence) + 1)
    bits += worst_bits(tables.verdict) + worst_bits(tables.status) / tables.heartbeat
    return bits / (sample_time_s * bitrate_bps)
