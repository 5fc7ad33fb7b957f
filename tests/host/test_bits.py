"""Lengths of frames against an encoder of the test's own, worst cases against an exhaustive search over all frames, and loads against a run's log."""

from __future__ import annotations

import functools
import json
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from host_support import SEED, Cli, Models, binary, classic_bits
from hullguard.bus import candump
from hullguard.bus.bits import worst_bit_times, worst_bits, worst_phases
from hullguard.bus.candump import BRS, EXTENDED, FD
from hullguard.core.library import library
from hullguard.core.native import Frame, Native, data_bits, frame_bits, read_verdict
from hullguard.design.tables import MessageTable
from hullguard.report.run_data import read_run

FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)
FORMATS = (0, EXTENDED)


def message(length: int, flags: int) -> MessageTable:
    return MessageTable("x", 0, flags, length, (0,) * 16)


# ---- CAN FD, bit by bit (ISO 11898-1:2015) ----


def fd_phases(frame: Frame) -> tuple[int, int]:
    """Bits at the nominal and at the data rate, from a list of every bit with its rate."""
    brs, n = bool(frame.flags & BRS), len(frame.data)
    name = [*binary(frame.id >> 18, 11), 1, 1, *binary(frame.id & 0x3FFFF, 18)] if frame.flags & EXTENDED else binary(frame.id, 11)
    slow = [0, *name, 0, *([] if frame.flags & EXTENDED else [0]), 1, 0, int(brs)]
    fast = [0, *binary(FD_LENGTHS.index(n), 4), *(b for byte in frame.data for b in binary(byte, 8))]
    wire: list[tuple[int, bool]] = []
    for bit, at_data_rate in [*((b, False) for b in slow), *((b, True) for b in fast)]:
        if len(wire) >= 5 and len({b for b, _ in wire[-5:]}) == 1:
            wire.append((1 - wire[-1][0], at_data_rate))
        wire.append((bit, at_data_rate))
    # A stuff bit in front of the CRC field would stand where the first fixed one does: there is one of them in any case.
    field = 4 + (17 if n <= 16 else 21)
    fixed = 1 + (field - 1) // 4
    wire += [(0, True)] * (field + fixed + 1) + [(0, False)] * (1 + 1 + 7 + 3)
    quick = sum(at_data_rate for _, at_data_rate in wire) if brs else 0
    return len(wire) - quick, quick


@pytest.mark.parametrize("flags", [FD, FD | BRS, FD | EXTENDED, FD | BRS | EXTENDED])
@pytest.mark.parametrize("length", FD_LENGTHS)
def test_fd_frames_have_the_length_of_the_encoder(length: int, flags: int) -> None:
    rng = random.Random(f"{SEED}/{length}/{flags}")
    fills = [bytes([b]) * length for b in (0x00, 0xFF, 0x55, 0x0F, 0x1F, 0xF8, 0x78, 0x87, 0x83)]
    tails = [rng.randbytes(max(length - 1, 0)) + bytes([b]) * min(length, 1) for b in (0x00, 0xFF, 0x1F, 0xE0, 0x20, 0xDF)]
    for data in [*fills, *tails, *(rng.randbytes(length) for _ in range(20))]:
        frame = Frame(rng.randrange(0x20000000 if flags & EXTENDED else 0x800), flags, data)
        nominal, quick = fd_phases(frame)
        assert (frame_bits(library("f32"), frame), data_bits(library("f32"), frame)) == (nominal + quick, quick), frame
        limit = worst_phases(message(length, flags))
        assert nominal + quick <= sum(limit) and nominal <= limit[0]


def test_a_classic_frame_has_no_data_phase() -> None:
    assert data_bits(library("f32"), Frame(0x123, 0, bytes(8))) == 0
    assert worst_phases(message(8, 0)) == (135, 0)


# ---- the longest frame of all ----

STATES = 8  # of the stuffing: last bit, and how many of its kind in a row (1 .. 4; a fifth is followed by a stuff bit)
REGISTER = 1 << 15


@functools.cache
def step(bit: int) -> tuple[np.ndarray, np.ndarray]:
    """What a bit makes of each stuffing state (2 run + last): the next one, and whether a stuff bit follows."""
    after, gain = np.zeros(STATES, dtype=np.int64), np.zeros(STATES, dtype=np.int8)
    for state in range(STATES):
        last, run = state & 1, (state >> 1) + 1
        run = run + 1 if bit == last else 1
        gain[state] = run == 5
        after[state] = (1 - bit) if run == 5 else 2 * (run - 1) + bit
    return after, gain


@functools.cache
def shifted(bit: int) -> np.ndarray:
    """CRC register after a bit, for each register."""
    register = np.arange(REGISTER)
    return (register << 1 & 0x7FFF) ^ np.where((register >> 14) ^ bit, 0x4599, 0)


def earlier(value: np.ndarray, bit: int) -> np.ndarray:
    """Most stuff bits from before `bit` on, given those after it: [register, state]."""
    after, gain = step(bit)
    return value[shifted(bit)][:, after] + gain


@functools.cache
def after_data(data: int) -> np.ndarray:
    """Most stuff bits of the CRC sequence and `data` free bits before it, by register and state."""
    if data:
        later = after_data(data - 1)
        return np.maximum(earlier(later, 0), earlier(later, 1))
    value = np.zeros((REGISTER, STATES), dtype=np.int8)
    for i in range(15):  # its last bit first; the register holds the sequence, most significant bit first
        ones = ((np.arange(REGISTER) >> i) & 1).astype(bool)[:, None]
        (a0, g0), (a1, g1) = step(0), step(1)
        value = np.where(ones, value[:, a1] + g1, value[:, a0] + g0)
    return value


def longest_classic(length: int, flags: int) -> Frame:
    """A frame of this length with the most stuff bits, over all identifiers and data: dynamic programming over CRC register and stuffing state."""
    free: list[int | None] = [None]
    extension = [1, 1, *free * 18, 0] if flags & EXTENDED else [0]  # with RTR
    header = [0, *free * 11, *extension, 0, 0, *binary(length, 4)]
    plan = [*header, *free * (8 * length)]
    values = [after_data(8 * length)]
    for bit in reversed(header):
        values.insert(0, np.maximum(earlier(values[0], 0), earlier(values[0], 1)) if bit is None else earlier(values[0], bit))
    values += [after_data(d) for d in range(8 * length - 1, -1, -1)]
    register, state, bits = 0, 1, []  # before the frame the bus is recessive, but that run does not count: one 1 is too short to matter
    for i, fixed in enumerate(plan):
        best = {b: int(values[i + 1][shifted(b)[register], step(b)[0][state]]) + int(step(b)[1][state]) for b in ((0, 1) if fixed is None else (fixed,))}
        bit = max(best, key=lambda b: best[b])
        register, state = int(shifted(bit)[register]), int(step(bit)[0][state])
        bits.append(bit)
    name = bits[1:12] + (bits[14:32] if flags & EXTENDED else [])
    data = bits[len(header) :]
    whole = int("".join(map(str, data)) or "0", 2)
    return Frame(int("".join(map(str, name)), 2), flags, whole.to_bytes(length, "big"))


@pytest.mark.parametrize("flags", FORMATS)
def test_no_classic_frame_is_longer_than_the_worst_case(flags: int) -> None:
    short = []
    for length in range(9):
        frame = longest_classic(length, flags)
        longest = frame_bits(library("f32"), frame)
        assert longest == classic_bits(frame)
        short.append(worst_bits(message(length, flags)) - longest)
        # The search is one over all frames: no random frame may beat it.
        rng = random.Random(SEED + length)
        others = [Frame(rng.randrange(0x20000000 if flags else 0x800), flags, bytes(rng.choice((0x00, 0xFF, 0x0F, 0xF0, 0x3C, 0x78)) for _ in range(length))) for _ in range(200)]
        assert max(classic_bits(f) for f in others) <= longest
    print(f"{'extended' if flags else 'standard'}: bits between the longest frame there is and the bound, 0 .. 8 bytes: {short}")
    assert all(0 <= s <= 4 for s in short)


def longest_fd(length: int, flags: int, ratio: float) -> float:
    """Longest duration in nominal bit times over all identifiers and data of one length, `ratio` the nominal bit rate over the data rate."""
    free: list[int | None] = [None]
    name = [*free * 11, 1, 1, *free * 18, 0] if flags & EXTENDED else [*free * 11, 0, 0]
    slow = [0, *name, 1, 0, 1]
    fast = [0, *binary(FD_LENGTHS.index(length), 4), *free * (8 * length)]
    longest = {1: 0.0}  # duration so far by stuffing state
    for i, fixed in enumerate([*slow, *fast]):
        own = 1.0 if i < len(slow) else ratio
        behind = 1.0 if i < len(slow) - 1 else 0.0 if i == len(slow) + len(fast) - 1 else ratio
        found: dict[int, float] = {}
        for state, duration in longest.items():
            for bit in (0, 1) if fixed is None else (fixed,):
                after, gain = int(step(bit)[0][state]), int(step(bit)[1][state])
                found[after] = max(found.get(after, 0.0), duration + own + gain * behind)
        longest = found
    crc = 4 + 17 + 6 if length <= 16 else 4 + 21 + 7
    return max(longest.values()) + ratio * (crc + 1) + 12


@pytest.mark.parametrize("flags", FORMATS)
@pytest.mark.parametrize("ratio", [1.0, 0.25, 0.0625])
def test_no_fd_frame_is_longer_than_the_worst_case(flags: int, ratio: float) -> None:
    short = []
    for length in FD_LENGTHS:
        bound = worst_bit_times(message(length, flags | FD | BRS), 500_000, round(500_000 / ratio))
        short.append(bound - longest_fd(length, flags, ratio))
    print(f"{'extended' if flags else 'standard'}, data rate {1 / ratio:g} times: nominal bit times between the longest frame and the bound: {[round(s, 3) for s in short]}")
    assert all(-1e-9 <= s <= 5.0 for s in short)


# ---- the load of a run ----


FD_GROUPS = {"groups.measurement.frame.fd": True, "groups.control.frame.fd": True, "verdict.frame.fd": True}
SWITCHED = {"bus.data_bitrate_bps": 2_000_000}
SAMPLES = 200


def test_data_phases_count_at_their_own_rate(cli: Cli, models: Models, tmp_path: Path) -> None:
    """Mean, 99th percentile and bound of an FD bus, from its log and the test's encoder."""

    def run(overrides: dict[str, object], out: Path) -> dict[str, Any]:
        options = [x for key, value in overrides.items() for x in ("--set", f"{key}={json.dumps(value)}")]
        done = cli("run", "platoon", "--scenario", "manoeuvres", *options, "--samples", SAMPLES, "--no-fault", "--bus", "inprocess", "--json", "--seed", SEED, "--out", out)
        assert done.status == 0, done.err
        return done.json

    plain, found = run(FD_GROUPS, tmp_path / "plain"), run(FD_GROUPS | SWITCHED, tmp_path / "switched")
    native = Native(library("f32"), models.design(FD_GROUPS | SWITCHED, "manoeuvres").tables)
    nominal, quick = np.zeros(SAMPLES), np.zeros(SAMPLES)
    for entry in candump.read(tmp_path / "switched" / "run.log"):
        told = read_verdict(native, entry.frame)
        if told is None or not told.reply:
            k = round(entry.time_s / found["sample_time_s"])
            nominal[k], quick[k] = np.add((nominal[k], quick[k]), fd_phases(entry.frame))
    frames, T = found["frames"], found["sample_time_s"]
    window, seconds = round(1 / T), nominal / 500_000 + quick / 2_000_000
    sliding = np.convolve(seconds, np.ones(window), "valid") / (window * T)
    assert (frames["bits"], frames["data_bits"]) == (nominal.sum() + quick.sum(), quick.sum())
    assert frames["load_mean"] == pytest.approx(seconds.sum() / (SAMPLES * T), rel=1e-12)
    assert frames["load_p99"] == pytest.approx(np.percentile(sliding, 99), rel=1e-12)
    assert sliding.max() <= frames["load_bound"]
    assert plain["frames"]["bits"] == frames["bits"] and plain["frames"]["load_mean"] == pytest.approx(frames["bits"] / (SAMPLES * T * 500_000), rel=1e-12)
    assert frames["load_mean"] < 0.7 * plain["frames"]["load_mean"] and frames["load_bound"] < 0.7 * plain["frames"]["load_bound"]
    shown = read_run(tmp_path / "switched")
    assert np.allclose(shown.bits / 500_000, seconds, rtol=1e-12)
    assert found["data_bitrate"] == 2_000_000 and "data_bitrate" not in plain
    assert 'BA_ "BaudrateCANFD" 2000000;' in (tmp_path / "switched" / "platoon.dbc").read_text()


def test_a_classic_bus_has_one_rate(cli: Cli) -> None:
    refused = cli("run", "platoon", "--set", "bus.data_bitrate_bps=250000", "--bus", "inprocess")
    assert refused.status == 2 and "data_bitrate_bps" in refused.err
