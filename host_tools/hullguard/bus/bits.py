"""Length of frames on the wire in the worst case, and the load that a model can put on a bus. Exact lengths come from the C side (core)."""

from __future__ import annotations

from hullguard.design.tables import BRS, EXTENDED, FD, MessageTable, Tables


def bit_times(bits: float, data_bits: float, bitrate_bps: float, data_bitrate_bps: float) -> float:
    """Duration of frames in bits of the nominal rate, when `data_bits` of their `bits` are sent at the data rate."""
    return bits - data_bits * (1.0 - bitrate_bps / data_bitrate_bps)


def worst_phases(message: MessageTable) -> tuple[int, int]:
    """Most bits that a frame can take, stuff bits and interframe space included: at the nominal rate, and at the data rate.

    Stuff bits that could be of either phase are counted at the nominal rate, the slower one: no frame is longer, in bits or in time.
    """
    extended, n = bool(message.flags & EXTENDED), message.length
    if not message.flags & FD:
        return 80 + 10 * n if extended else 55 + 10 * n, 0
    header = 36 if extended else 17  # start of frame to BRS
    crc, fixed = (17, 6) if n <= 16 else (21, 7)
    stuffed = header + 5 + 8 * n  # start of frame to the end of the data; a stuff bit behind its last bit is the first fixed one
    slow, every = (header - 1) // 4, (stuffed - 2) // 4
    nominal, data = header + 12 + slow, 5 + 8 * n + 4 + crc + fixed + 1 + every - slow
    return (nominal, data) if message.flags & BRS else (nominal + data, 0)


def worst_bits(message: MessageTable) -> int:
    """Most bits that a frame can take, those of both phases."""
    return sum(worst_phases(message))


def worst_bit_times(message: MessageTable, bitrate_bps: int, data_bitrate_bps: int) -> float:
    """Longest duration of a frame, in bits of the nominal rate."""
    nominal, data = worst_phases(message)
    return bit_times(nominal + data, data, bitrate_bps, data_bitrate_bps)


def load_bound(tables: Tables, bitrate_bps: int, sample_time_s: float, data_bitrate_bps: int) -> float:
    """Largest share of the bus: every sender at its shortest interval, a verdict and a status frame with every sample, and a freeze frame that is being read."""

    def length(message: MessageTable) -> float:
        return worst_bit_times(message, bitrate_bps, data_bitrate_bps)

    bits = 0.0
    for g in tables.groups:
        bits += length(g.message) / (min(g.silence) + 1)
    bits += length(tables.verdict) + length(tables.status) / tables.heartbeat
    if tables.freeze is not None:
        bits += length(tables.freeze.request) + tables.freeze.burst * length(tables.freeze.response)
    return bits / (sample_time_s * bitrate_bps)
