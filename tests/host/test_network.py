"""Frames of a vehicle's own database: layouts against cantools, protection by name, periodic senders, frames without a stamp, and what is refused."""

from __future__ import annotations

import itertools
import random
import shutil
import tomllib
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest
from cantools.database.can import Database, Message, Signal
from cantools.database.conversion import BaseConversion
from host_support import FLOATS, ROOT, SEED, Cli, Ready, alarms, build_library
from hullguard.bus import candump
from hullguard.codegen import emit_c
from hullguard.codegen.dbc import emit_dbc, messages_of
from hullguard.core.library import library
from hullguard.core.native import MOVING, REST, Native, Node, Plant, Sender, frame_in, frame_out
from hullguard.core.protect import Protector
from hullguard.design.design import Design, design
from hullguard.design.ids import data_ids, undetected_patterns
from hullguard.design.protection import NO_STAMP, UNPROTECTED, ProtectionTable, own_protection
from hullguard.design.tables import FLOAT32, GroupTable, SignalTable, field_table
from hullguard.errors import InputError
from hullguard.model import load_model, parse_fault
from hullguard.model.network import FD_LENGTHS, Field, protection
from hullguard.model.schema import Model, parse_model
from hypothesis import given, settings
from hypothesis import strategies as st
from test_same import Generated, assert_same

FIXTURE = ROOT / "tests" / "fixtures" / "network"
VEHICLE = FIXTURE / "vehicle.dbc"
INVALID = -(2**31)


def vehicle() -> Database:
    found = cantools.database.load_file(VEHICLE)
    assert isinstance(found, Database)
    return found


def made(text: str) -> Database:
    found = cantools.database.load_string(text, "dbc")
    assert isinstance(found, Database)
    return found


@pytest.fixture(scope="module")
def network() -> Design:
    return design(load_model(str(FIXTURE / "network.toml")))[0]


@pytest.fixture(scope="module")
def native(network: Design) -> Native:
    return Native(library("f32"), network.tables)


def ready(d: Design, scenario: str, real: str = "f32") -> Ready:
    chosen = d.model.scenario(scenario)
    return Ready(d, Native(library(real), d.tables), chosen.reference, chosen.samples)


# ---- layouts ----


def fields_of(dice: random.Random, length: int, most: int) -> list[Field]:
    """Fields wherever there is room, of any kind that the codec knows."""
    free, found = set(range(8 * length)), []
    for i in range(most):
        is_float = length >= 4 and dice.random() < 0.15
        is_signed = is_float or dice.random() < 0.5
        bits = 32 if is_float else min(dice.choice((2, 3, 7, 8, 9, 13, 16, 17, 24, 31)), 8 * length)
        field = Field(
            f"s{i}", dice.randrange(8 * length), bits, dice.random() < 0.5, is_signed, is_float, dice.choice((1.0, 0.5, 0.001, 3.0)), dice.choice((0.0, -40.0, 7.25)), None, None
        )
        if is_float:
            field = replace(field, factor=1.0, offset=0.0)
        if set(field.bits) <= free:
            free -= set(field.bits)
            found.append(field)
    return found


def message_of(fields: list[Field], length: int) -> Message:
    """cantools' own idea of the layout; it refuses signals that overlap or leave the frame."""
    signals = [
        Signal(
            f.name,
            f.start,
            f.length,
            byte_order="big_endian" if f.motorola else "little_endian",
            is_signed=f.is_signed,
            conversion=BaseConversion.factory(scale=f.factor, offset=f.offset, is_float=f.is_float),
        )
        for f in fields
    ]
    return Message(0x123, "layout", length, signals, is_fd=length > 8, strict=True)


def group_of(template: GroupTable, fields: list[Field], length: int) -> GroupTable:
    """A group's table with these fields; every code that they can carry is valid."""
    signals = []
    for f in fields:
        low, high = f.codes if not f.is_float else (-1000000, 1000000)
        signals.append(
            SignalTable(
                f.name,
                f.factor if not f.is_float else 0.001,
                f.offset,
                1 / (f.factor if not f.is_float else 0.001),
                low,
                high,
                f.start,
                f.length,
                (1 if f.motorola else 0) | (4 if f.is_float else 2 if f.is_signed else 0),
                0.0,
                1.0,
                0.0,
                0,
            )  # fmt: skip
        )
    count = len(signals)
    message = replace(template.message, id=0x123, flags=0x0C if length > 8 else 0, length=length, protection=UNPROTECTED, idle=())
    return replace(template, signals=tuple(signals), message=message, levels=1, interval_max=1, margin=1, silence=(0,), delta=((0,) * count,),
                   sigma=((0,) * count,), activity=((0,) * count,), slew=((1.0,) * count,) * 2)  # fmt: skip


@settings(max_examples=200)
@given(seed=st.integers(0, 2**32), length=st.sampled_from(FD_LENGTHS[1:]))
def test_any_layout_reads_and_writes_as_cantools_does(network: Design, seed: int, length: int) -> None:
    dice = random.Random(seed)
    fields = fields_of(dice, length, 31)
    if not fields:
        return
    message, group = message_of(fields, length), group_of(network.tables.groups[0], fields, length)
    lib = library("f32")
    made = Native(lib, replace(network.tables, groups=(group, *network.tables.groups[1:])))
    assert lib.lib.hg_frame_valid(made.messages)
    frame, codes = lib.ffi.new("hg_can_frame *"), lib.ffi.new("int32_t[]", len(fields))
    for _ in range(5):
        raw: dict[str, float] = {}
        for i, (f, s) in enumerate(zip(fields, group.signals, strict=True)):
            codes[i] = dice.choice((s.minimum, s.maximum, dice.randint(s.minimum, s.maximum)))
            raw[f.name] = float(np.float32(s.resolution) * np.float32(codes[i])) if f.is_float else codes[i]
        sent = [codes[i] for i in range(len(fields))]
        data = message.encode(raw, scaling=False, padding=False, strict=False)
        lib.lib.hg_frame_pack(made.messages, codes, frame)
        assert frame_out(lib, frame).data == data
        noise = bytearray(data)  # bits of others are no business of the receiver's
        own = {b for f in fields for b in f.bits}
        for bit in set(range(8 * length)) - own:
            noise[bit // 8] |= dice.getrandbits(1) << (bit % 8)
        lib.ffi.memmove(frame.data, bytes(noise), length)
        assert lib.lib.hg_frame_unpack(made.messages, frame, codes) == lib.lib.HG_OK
        assert [codes[i] for i in range(len(fields))] == sent


def test_a_vehicles_signals_are_where_its_database_has_them(network: Design) -> None:
    by_name = {s.name: (m, s) for m in vehicle().messages for s in m.signals}
    names = {"gap12_m": "Gap12_m", "gap23_m": "RangeRear", "speed1_mps": "Speed1_mps", "control1_mps2": "Control1_mps2", "control2_mps2": "Control2_mps2"}
    for g in network.tables.groups:
        for s in g.signals:
            m, found = by_name[names.get(s.name, "Control3_mps2")]
            assert (g.message.id, g.message.length, bool(g.message.flags & 1), bool(g.message.flags & 4)) == (m.frame_id, m.length, m.is_extended_frame, m.is_fd)
            assert (s.start, s.length, bool(s.flags & 1)) == (found.start, found.length, found.byte_order == "big_endian")
            if s.flags & FLOAT32:
                assert found.is_float and s.resolution == np.float32(0.001)
                continue
            assert (np.float32(found.scale), np.float32(found.offset), found.is_signed) == (s.resolution, s.offset, bool(s.flags & 2))
            low, high = found.minimum or 0, found.maximum or 0
            assert (s.minimum, s.maximum) == (round((low - found.offset) / found.scale), round((high - found.offset) / found.scale))


def test_cantools_reads_the_readings_and_the_initial_values_from_the_frames(network: Design, native: Native) -> None:
    source = Plant(native, network, network.model.scenario("manoeuvres").reference, [], SEED)
    sender, database, seen = Sender(native), vehicle(), Counter[str]()
    others = {"RadarFront": {"RF_Quality": 9, "RF_Temperature": 25}, "Throttle": {"TH_State": 21}, "WheelSpeed": {"WS_Direction": 1}, "Actuators": {"AC_Torque": 51.3}}
    for k in range(100):
        reading = source.read()
        for i, g in enumerate(network.model.groups):
            frame = sender.step(i, k, reading)
            if frame is None:
                continue
            message = database.get_message_by_frame_id(frame.id, force_extended_id=bool(frame.flags & 1))
            seen[message.name] += 1
            read = message.decode(frame.data)
            assert isinstance(read, dict)
            assert g.frame.wire is not None
            for place, field in zip(g.signals, g.frame.wire.fields, strict=True):
                s = network.model.signals[place]
                assert abs(float(str(read[field.name])) - reading[place]) <= s.resolution / 2 * 1.01 + 1e-4 * abs(reading[place]) * 0.01 + 1e-5 * abs(field.offset)
            for name, value in others.get(message.name, {}).items():
                assert float(str(read[name])) == pytest.approx(value)
        source.move()
    assert (seen["RadarRear"], seen["WheelSpeed"], seen["Throttle"], seen["Actuators"]) == (100, 50, 100, 100)
    assert 20 <= seen["RadarFront"] < 100


def test_the_range_of_a_narrow_field_covers_its_rounding() -> None:
    """A code's value by the tables and by the database's own factor and offset, over the whole range of a field with a large offset."""
    model = load_model(str(FIXTURE / "network.toml"))
    for low, high, factor, offset in ((0.0, 1000.0, 0.01, -300.0), (-20.0, 20.0, 0.001, -100.0), (100.0, 16000.0, 0.001, 0.0)):
        field = Field("f", 0, 31, False, False, False, factor, offset, None, None)
        s = field_table(replace(model.signals[0], low=low, high=high, resolution=factor), field, False)
        for code in np.linspace(s.minimum, s.maximum, 2001).astype(int).tolist():
            exact = code * factor + offset
            read = np.float32(s.offset) + np.float32(np.float32(s.resolution) * np.float32(code))
            assert abs(float(read) - exact) + factor / 2 <= s.half


# ---- protection ----

OWN = [("P22", "both"), ("P02", "both"), ("P05", "both"), ("P01", "both"), ("P01", "alternate"), ("P11", "low"), ("P11", "nibble")]


@pytest.mark.parametrize(("profile", "mode"), OWN)
def test_undetected_errors_are_those_that_the_library_lets_pass(profile: str, mode: str) -> None:
    length, dice = 5, random.Random(SEED)
    p, _ = own_protection(profile, mode, 0x5A3)
    if p.data_ids:
        p = replace(p, data_ids=tuple(dice.randrange(256) for _ in range(16)))  # a bad list: some errors pass
    protector, worst = Protector(library("f32"), p), 0
    patterns = [sum(1 << b for b in c) for n in (1, 2, 3) for c in itertools.combinations(range(8 * length), n)]
    for counter in range(protector.modulus) if p.modulus < 256 else (0, 77, 255):
        good = int.from_bytes(protector.protect(dice.randbytes(length), counter, 3), "little")
        worst = max(worst, sum(protector.check((good ^ e).to_bytes(length, "little")) is not None for e in patterns))
    assert worst == undetected_patterns(p, length)


@pytest.mark.parametrize("length", [8, 12])
def test_chosen_data_ids_let_no_error_of_three_bits_pass(length: int) -> None:
    dice = random.Random(SEED)
    for _ in range(20):
        for profile in ("P02", "P22", "P05"):
            assert undetected_patterns(own_protection(profile, "both", dice.randrange(1 << 16))[0], length) == 0
    assert undetected_patterns(own_protection("P05", "both", 1)[0], 64) == 0
    assert {undetected_patterns(own_protection("P11", "nibble", dice.randrange(1 << 12))[0], 8) for _ in range(20)} == {169}
    listed = replace(own_protection("P02", "both", 0)[0], data_ids=tuple(range(16)))
    assert undetected_patterns(listed, 8) == 48 and data_ids(0x110) == (0x11,) * 16


def overridden(profile: str, mode: str) -> dict[str, Any]:
    frame = {"id": 0x110, "protection": profile} | ({"mode": mode} if profile in ("P01", "P11") else {})
    return {"groups.measurement.frame": frame, "groups.measurement.trigger.interval_max": 4}


@pytest.mark.parametrize(("profile", "mode"), OWN)
def test_own_frames_of_every_profile_run_and_read_back_from_their_database(profile: str, mode: str) -> None:
    """Layouts of the project's own: senders and node agree, no false alarm, cantools and canmatrix accept the database, attributes give the table back."""
    overrides = overridden(profile, mode)
    if own_protection(profile, mode, 1)[1] > 16:  # a third measurement has no room then
        overrides["groups.measurement.frame"]["fd"] = True
    d = design(load_model("platoon", overrides, "manoeuvres"))[0]
    p, first = own_protection(profile, mode, 0x110)
    assert d.tables.groups[0].message.protection == p and d.tables.groups[0].signals[0].start == first
    text = emit_dbc(d)
    database = made(text)
    for m in messages_of(d):
        assert protection(database.get_message_by_frame_id(m.table.id)) == m.table.protection
    for loss in (0.0, 0.1):
        found = alarms(rows := ready(d, "manoeuvres").batch(150, ("controller2:bias:2@100",), loss=loss).runs(0, 20))
        assert (found.confirmed if loss else found.provisional) == 0 and all(r["confirmed_at"] >= 100 for r in rows)
    sender = Sender(Native(library("f32"), d.tables))
    frame = sender.step(0, 5, [1.0, -2.0, 3.0, 0.0, 0.0, 0.0])
    assert frame is not None
    read = database.decode_message(frame.id, frame.data)
    assert isinstance(read, dict) and (read["gap12_m"], read["gap23_m"], read["speed1_mps"]) == pytest.approx((1, -2, 3))
    assert (read["E2E_counter"], read["E2E_stamp"]) == (0, 5)


def test_the_vehicles_protection_is_that_of_attributes_or_names(network: Design) -> None:
    found = {g.name: g.message.protection for g in network.tables.groups}
    ids = (0x1F, 0x2E, 0x3D, 0x4C, 0x5B, 0x6A, 0x79, 0x88, 0x97, 0xA6, 0xB5, 0xC4, 0xD3, 0xE2, 0xF1, 0x07)
    assert found["radar_front"] == ProtectionTable("P02", 0, 8, 0, 12, "both", 0, ids, ())
    assert found["radar_rear"] == ProtectionTable("P11", 0, 8, 12, NO_STAMP, "nibble", 0xB4D, (), ())
    assert found["wheels"] == UNPROTECTED
    assert found["throttle"] == ProtectionTable("P01", 7, 48, 0, 52, "both", 0x2C0, (), ())
    assert found["actuators"] == ProtectionTable("P05", 0, 16, 0, 24, "both", 0x6F0, (), ())


def test_the_emitted_database_of_a_network_reads_back_and_other_tools_accept_it(network: Design, tmp_path: Path) -> None:
    canmatrix = pytest.importorskip("canmatrix.formats")
    text = emit_dbc(network)
    database = made(text)
    for m in messages_of(network):
        found = database.get_message_by_frame_id(m.table.id, force_extended_id=bool(m.table.flags & 1))
        assert protection(found) == m.table.protection
    (tmp_path / "network.dbc").write_text(text, encoding="utf-8")
    matrix = canmatrix.loadp_flat(str(tmp_path / "network.dbc"))
    assert {f.name for f in matrix.frames} == {m.name for m in messages_of(network)}
    frame = matrix.frame_by_name("actuators")
    assert frame.attribute("E2EProfile") in ("P05", "3") and int(frame.attribute("E2EDataId")) == 0x6F0


def test_a_models_own_database_gives_its_own_frames_back(tmp_path: Path) -> None:
    """The database that one design emits is a vehicle's database for another model: the same tables but for the slack of float32 in them."""
    d = design(load_model("platoon"))[0]
    (tmp_path / "own.dbc").write_text(emit_dbc(d), encoding="utf-8")
    data = tomllib.loads((ROOT / "host_tools" / "models" / "platoon.toml").read_text(encoding="utf-8"))
    data["network"] = {"dbc": "own.dbc"}
    for g in data["groups"]:
        del g["frame"]
        g["dbc_message"] = g["name"]
    for s in data["signals"]:
        s.pop("range")
        s.pop("resolution")
    data["verdict"]["frame"] = {"id": 0x300}
    again = design(parse_model(data, tmp_path / "again.toml"))[0]
    for g, h in zip(d.tables.groups, again.tables.groups, strict=True):
        assert g.message == h.message
        for s, t in zip(g.signals, h.signals, strict=True):
            assert replace(t, half=s.half, span=s.span) == s
            assert s.half <= t.half <= s.half * 1.4 + 1e-6


# ---- runs ----


@pytest.mark.parametrize("real", FLOATS)
@pytest.mark.parametrize("scenario", ["rest", "manoeuvres"])
def test_no_false_alarm_on_a_vehicles_network_and_faults_are_found(network: Design, scenario: str, real: str) -> None:
    batch = ready(network, scenario, real).batch
    for start in (REST, MOVING):
        assert alarms(batch(150, start=start).runs(0, 60)).provisional == 0
        assert alarms(batch(150, loss=0.2, start=start).runs(0, 60)).confirmed == 0
    for fault in ("controller2:bias:4@80", "controller1:bias:4@80"):
        assert all(80 <= r["confirmed_at"] < 110 for r in batch(150, (fault,)).runs(0, 20))


def test_a_healthy_network_is_told_as_healthy(network: Design) -> None:
    trace = ready(network, "manoeuvres").batch(100).trace(0)
    assert set(trace["bus"][4:].tolist()) == {0b0101010101}
    error = np.abs(trace["value"][:, :6] - trace["reading"])
    assert np.all(error <= trace["radius"][:, :6] * (1 + 1e-6))


@pytest.fixture(scope="module", params=FLOATS)
def generated(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, network: Design) -> tuple[Ready, Generated]:
    header, source = emit_c(network)
    lib = build_library(tmp_path_factory.mktemp("network") / "lib", request.param, extra={"network.h": header, "network.c": source})
    return ready(network, "manoeuvres", request.param), Generated(lib, network)


@pytest.mark.parametrize(("loss", "start"), [(0.0, REST), (0.3, MOVING)])
def test_generated_tables_of_a_network_give_the_same_runs(generated: tuple[Ready, Generated], loss: float, start: int) -> None:
    one, compiled = generated
    faults = [parse_fault("controller2:bias:4@60")]
    other = Ready(one.design, compiled, one.reference, one.samples)
    assert_same(one.batch(120, ("controller2:bias:4@60",), loss=loss, start=start), other.batch(120, ("controller2:bias:4@60",), loss=loss, start=start), 3)
    source, senders = Plant(one.native, one.design, one.reference, faults, SEED), (Sender(one.native), Sender(compiled))
    for k in range(30):
        reading = source.read()
        for g in range(len(one.design.tables.groups)):
            assert senders[0].step(g, k, reading) == senders[1].step(g, k, reading)  # the idle bytes too
        source.move()


def test_the_commands_take_a_network(cli: Cli, tmp_path: Path) -> None:
    for name in ("network.toml", "vehicle.dbc"):
        shutil.copy(FIXTURE / name, tmp_path)
    path, out = tmp_path / "network.toml", tmp_path / "out"
    assert cli("design", path, "--out", out).status == 0
    assert (out / "network.dbc").is_file() and (out / "network.c").is_file()
    done = cli("run", path, "--bus", "inprocess", "--expect", "detect", "--out", tmp_path / "run", "--json")
    assert done.status == 0, done.err
    assert done.json["false_alarms"] == {"provisional": 0, "confirmed": 0}
    frames = [e.frame for e in candump.read(tmp_path / "run" / "run.log")]
    assert {f.id for f in frames} == {0xA5, 0x1B0, 0x2C0, 0x18FEF121, 0x6F0, 0x710, 0x711}
    assert len([f for f in frames if f.id == 0x18FEF121]) == 150
    quiet = cli("run", path, "--bus", "inprocess", "--scenario", "rest", "--expect", "quiet")
    assert quiet.status == 0, quiet.err
    many = cli("campaign", path, "--runs", 40, "--loss", 0.1, "--json")
    assert many.status == 0, many.err
    assert many.json["false_alarm_runs"] == 0


# ---- periodic senders and frames without a stamp ----


def changed(change: Callable[[dict[str, Any]], object], folder: Path = FIXTURE) -> Model:
    data = tomllib.loads((FIXTURE / "network.toml").read_text(encoding="utf-8"))
    change(data)
    return parse_model(data, folder / "network.toml")


@pytest.mark.parametrize("period", [1, 2, 3, 7])
def test_a_periodic_sender_speaks_every_period_and_its_radius_is_that_of_its_age(period: int) -> None:
    def longer(data: dict[str, Any]) -> None:
        own = {"frame": {"id": 0x300, "protection": "none"}, "period_samples": period}
        data["groups"][2] = {k: v for k, v in data["groups"][2].items() if k not in ("dbc_message", "frame")} | own

    d = design(changed(longer))[0]
    g = d.tables.groups[2]
    s, place = g.signals[0], g.first
    assert (g.levels, g.silence, g.interval_max, g.message.protection) == (1, (period - 1,), period, UNPROTECTED)
    trace = ready(d, "manoeuvres").batch(60).trace(0)
    spoke = [k for k in range(60) if trace["events"][k] >> 2 & 1]
    assert spoke == list(range(0, 60, period))
    slew = d.stored.slew[place]
    for k in range(60):
        age = k % period
        expected = s.half if age == 0 else s.half + slew[age - 1]
        assert trace["radius"][k, place] == pytest.approx(expected, rel=1e-5)
    lossy = ready(d, "manoeuvres").batch(60, loss=0.4).trace(0)
    heard, age = [bool(e >> 2 & 1) and not lost >> 2 & 1 for e, lost in zip(lossy["events"], lossy["lost"], strict=True)], -1
    for k in range(60):
        age = 0 if heard[k] else age + 1 if age >= 0 else -1
        if 0 < age <= g.interval_max + g.margin:
            assert lossy["radius"][k, place] == pytest.approx(s.half + slew[age - 1], rel=1e-5)
        elif age != 0:
            assert lossy["radius"][k, place] == pytest.approx(s.span, rel=1e-6)


@pytest.mark.parametrize("skew", [1, 2])
def test_a_frame_without_a_stamp_may_be_of_a_sample_before_or_after(skew: int) -> None:
    """The rear radar measures up to `skew` samples beside the tick, each frame anew: what is held stays within its radius, and nothing alarms."""
    d = design(changed(lambda data: data["groups"][1].update(skew_samples=skew)))[0]
    native, dice = Native(library("f32"), d.tables), random.Random(SEED)
    place, late = d.tables.groups[1].first, 0.0
    for run in range(8):
        source = Plant(native, d, d.model.scenario("manoeuvres").reference, [], SEED, run)
        readings = []
        for _ in range(80):
            readings.append(source.read())
            source.move()
        sender, node = Sender(native), Node(native, REST)
        for k in range(80 - skew):
            for g in range(len(d.tables.groups)):
                beside = dice.choice((-skew, 0, skew)) if g == 1 else 0
                frame = sender.step(g, k, readings[max(k + beside, 0)])
                if frame is not None and (g != 1 or dice.random() < 0.8):
                    assert node.receive(frame) == 1
            verdict = node.step()
            assert verdict is not None and verdict.plant in ("starting", "none")
            error = abs(node.value[place] - readings[k][place])
            assert error <= node.radius[place] * (1 + 1e-6)
            late = max(late, error)
    assert late > d.model.signals[place].resolution * 2, "the readings must differ for this to show anything"


def test_skew_widens_a_fresh_value_and_shifts_its_slew(network: Design) -> None:
    exact = design(changed(lambda data: data["groups"][1].update(skew_samples=0)))[0]
    place = network.tables.groups[1].first
    fresh, slew = exact.tables.groups[1].signals[0].half, network.stored.slew[place]
    g = network.tables.groups[1]
    assert g.signals[0].half == pytest.approx(fresh + slew[0], rel=1e-6)
    assert [r[0] for r in g.slew] == pytest.approx([min(fresh + x, g.signals[0].span) for x in slew[1 : 1 + len(g.slew)]], rel=1e-6)
    assert network.model.groups[1].skew == 1 and all(h.skew == 0 for i, h in enumerate(network.model.groups) if i != 1)


def test_a_closing_frame_may_count_samples_by_itself(tmp_path: Path) -> None:
    """Without any stamp on the bus the closing frame's counter tells the samples apart."""
    data = tomllib.loads((ROOT / "host_tools" / "models" / "platoon.toml").read_text(encoding="utf-8"))
    d = design(load_model("platoon"))[0]
    (tmp_path / "own.dbc").write_text("\n".join(line for line in emit_dbc(d).splitlines() if 'E2EStampBit" BO_' not in line), encoding="utf-8")
    data["network"] = {"dbc": "own.dbc"}
    for g in data["groups"]:
        del g["frame"]
        g["dbc_message"], g["skew_samples"] = g["name"], 0
    data["verdict"]["frame"] = {"id": 0x300}
    again = design(parse_model(data, tmp_path / "again.toml"))[0]
    assert not any(g.message.protection.stamped for g in again.tables.groups)
    for loss in (0.0, 0.1):
        found = alarms(rows := ready(again, "manoeuvres").batch(120, ("controller2:bias:2@60",), loss=loss).runs(0, 20))
        assert (found.confirmed if loss else found.provisional) == 0 and all(r["confirmed_at"] >= 60 for r in rows)


# ---- refusals ----


def at(data: dict[str, Any], key: str, value: Any) -> None:
    """Set (or with None remove) what a dotted key says."""
    *path, last = key.split(".")
    place: Any = data
    for part in path:
        place = place[int(part) if part.isdigit() else part]
    if value is None:
        place.pop(last)
    else:
        place[last] = value


REAR = "groups.1.frame.protection"
WRONG_MODEL: list[tuple[str, Any, str]] = [
    ("network.dbc", "missing.dbc", "no file 'missing.dbc' beside the model"),
    ("network.dbc", "network.toml", "not a database that can be read"),
    ("network", {}, r'give \[network\] dbc'),
    ("groups.0.dbc_message", "RadarFrond", "did you mean 'RadarFront'"),
    ("groups.0.dbc_message", "Diagnostics", "is multiplexed"),
    ("signals.1.dbc_signal", "RangeReer", "did you mean 'RangeRear'"),
    ("signals.1.dbc_signal", None, "has no signal 'gap23_m'"),
    ("signals.0.resolution", 0.002, "steps of 0.001, the model says 0.002; remove resolution"),
    ("signals.0.range", [-40.0, 20.0], "does not fit 'Gap12_m' of message 'RadarFront'"),
    ("signals.0.wire", "float32", "is an integer in the database"),
    ("signals.2.wire", "integer", "is a float32 in the database"),
    ("signals.2.resolution", None, "give the signal a resolution"),
    ("signals.2.range", None, "states no range"),
    ("groups.0.frame", {"id": 0x123}, "taken from the database; remove it"),
    ("groups.0.frame", {"protection": "P05"}, "the database says P02"),
    ("groups.0.frame", {"protection": "none"}, "the database says P02"),
    ("groups.1.frame", {"protection": "none"}, ""),
    (f"{REAR}.crc", "RR_Mode", "it must have 8 and begin at a multiple of 8"),
    (f"{REAR}.counter", "RR_Counter", "did you mean 'RR_MessageCounter'"),
    (f"{REAR}.counter", "RR_Mode", "it must have 4"),
    (f"{REAR}.counter", None, "'counter' is missing"),
    (f"{REAR}.crc", None, "'crc' is missing"),
    (f"{REAR}.data_id", 0x1234, "mode nibble has 12 bits"),
    (f"{REAR}.profile", "P07", "is not one of"),
    (f"{REAR}.profile", "P22", "unknown key|is missing"),
    (f"{REAR}.stamp", "RR_MessageCounter", "lie on the same bits"),
    (f"{REAR}.colour", "red", "unknown key"),
    ("groups.1.transmission", "event", "'trigger' is missing"),
    ("groups.1.period_samples", 2, "sent every 100 ms by the database, 2 x 100 ms by the model"),
    ("sample_time_s", 0.03, "by the database"),
    ("sample_time_s", 0.0005, "more than 190"),
    ("groups.1.skew_samples", 17, "outside"),
    ("groups.0.skew_samples", 1, "must sample with the tick"),
    ("groups.4.skew_samples", 1, "the one it closes"),
    ("groups.4.frame", {"protection": {"profile": "P05", "data_id": 0x6F0, "crc": "AC_Crc", "counter": "AC_Counter"}}, "has no stamp, so nothing says"),
    ("verdict.frame.id", 0x76C, "the vehicle's message 'Diagnostics'"),
    ("verdict.frame.protection", "P05", "layout of profile 22"),
    ("signals.3.dbc_signal", "TH_Crc", "does not fit|steps of|states no range|lies on the crc"),
]  # fmt: skip


def test_an_event_without_a_counter_is_refused() -> None:
    def eventful(data: dict[str, Any]) -> None:
        data["groups"][2].update(transmission="event", trigger={"delta": 0.0, "sigma": 0.1, "interval_max": 5})

    with pytest.raises(InputError, match="looks like silence"):
        changed(eventful)


@pytest.mark.parametrize(("key", "value", "message"), WRONG_MODEL)
def test_what_cannot_be_taken_is_refused_with_a_cure(key: str, value: Any, message: str) -> None:
    if message == "":
        assert not changed(lambda data: at(data, key, value)).groups[1].frame.protected  # the database says nothing: none is as good as that
        return
    with pytest.raises(InputError, match=message) as found:
        changed(lambda data: at(data, key, value))
    assert "\n" not in str(found.value)


WRONG_DBC = [
    ("BO_ 1900 Diagnostics", "BO_ 1900 RadarFront", "no message 'RadarFront' alone: RadarFront, RadarFront are called so"),
    ("BO_ 1900 Diagnostics", "BO_ 165 Diagnostics", "0xA5, in common with 'Diagnostics'"),
    ("SG_ RF_Quality", "SG_ GAP12_M", "no signal 'gap12_m' alone"),
    ("SG_ Gap12_m : 21|16@0- (0.001,0)", "SG_ Gap12_m : 21|33@0- (0.001,0)", "33 bits; a signed signal may have 32"),
    ("SG_ RangeRear : 19|18@1+ (0.001,-100)", "SG_ RangeRear : 20|32@1+ (0.001,-100)", "32 bits; an unsigned signal may have 31"),
    ("SG_ RangeRear : 19|18@1+ (0.001,-100)", "SG_ RangeRear : 19|18@1+ (-0.001,100)", "must be positive"),
    ("SG_ RangeRear : 19|18@1+ (0.001,-100)", "SG_ RangeRear : 19|1@1+ (0.001,-100)", "no room for two values"),
    ("SG_ RangeRear : 19|18@1+ (0.001,-100) [-20|20]", "SG_ RangeRear : 19|8@1+ (1,0) [0|255]", "'no value', 255; give a range within"),
    ("SG_ RangeRear : 19|18@1+ (0.001,-100)", "SG_ RangeRear : 11|18@1+ (0.001,-100)", "overlap"),
    ("SG_ RR_Mode : 40|3@1+", "SG_ RR_Mode : 30|3@1+", "'RangeRear' and 'RR_Mode' overlap"),
    ("SG_ RF_Counter : 8|4@1+ (1,0) [0|15]", "SG_ RF_Counter : 32|4@1+ (1,0) [0|15]", ""),
    ("SG_ RangeRear : 19|18@1+ (0.001,-100)", "SG_ RangeRear : 50|18@1+ (0.001,-100)", "not inside its 8 bytes"),
    ("Speed1_mps : 7|32@0-", "Speed1_mps : 7|64@0-", "float of 64 bits|not inside"),
    ("Speed1_mps : 7|32@0- (1,0)", "Speed1_mps : 7|32@0- (0.1,0)", "it must carry signal units"),
    ('"E2EProfile" BO_ 165 2;', '"E2EProfile" BO_ 165 3;', "AUTO"),
    ('F1 07";', 'F1";', "needs a data-id list of 16 bytes, found 15"),
    ('F1 07";', 'F1 ZZ";', "not a list of bytes"),
    ('"E2EStampBit" BO_ 165 12;', '"E2EStampBit" BO_ 165 13;', "not a multiple of 4"),
    ('"E2EStampBit" BO_ 165 12;', '"E2EStampBit" BO_ 165 64;', "outside the frame"),
    ('"E2EStampBit" BO_ 165 12;', '"E2EStampBit" BO_ 165 16;', "'Gap12_m' lies on the stamp"),
    ('"None","P01","P02","P05","P11","P22"', '"None","P01","P07","P05","P11","P22"', "attribute E2EProfile is 'P07'"),
    ("BO_ 165 RadarFront: 8", "BO_ 165 RadarFront: 11", "no length of a CAN frame"),
    ("Control2_mps2 : 45|20@0- (0.001,0) [-30|30]", "Control2_mps2 : 45|31@0- (0.000001,0) [-30|30]", "beyond 24 bits"),
]


@pytest.mark.parametrize(("old", "new", "message"), WRONG_DBC)
def test_a_database_that_cannot_be_used_is_refused_with_a_cure(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = VEHICLE.read_text(encoding="utf-8")
    assert text.count(old) == 1
    if message == "AUTO":
        message = "crc and stamp of its protection lie on the same bits"  # profile 05 in the frame of another profile
    (tmp_path / "vehicle.dbc").write_text(text.replace(old, new), encoding="utf-8")
    if message == "":  # the place of the counter is that of the attributes, whatever is called so
        assert changed(lambda data: None, tmp_path).groups[0].frame.protected
        return
    with pytest.raises(InputError, match=message) as found:
        design(changed(lambda data: None, tmp_path))
    assert "\n" not in str(found.value)


def test_an_unused_message_may_be_as_wrong_as_it_likes(tmp_path: Path) -> None:
    text = VEHICLE.read_text(encoding="utf-8").replace("SG_ DI_Speed m0 : 8|16", "SG_ DI_Speed m0 : 60|16")
    (tmp_path / "vehicle.dbc").write_text(text, encoding="utf-8")
    assert changed(lambda data: None, tmp_path).groups[0].frame.id == 0xA5


def test_a_design_depends_on_what_it_took(tmp_path: Path) -> None:
    text = VEHICLE.read_text(encoding="utf-8")
    hashes = set()
    for new in (text, text.replace("SG_ Gap12_m : 21|16@0-", "SG_ Gap12_m : 29|16@0-"), text.replace("DI_Mileage", "DI_Odometer")):
        (tmp_path / "vehicle.dbc").write_text(new, encoding="utf-8")
        hashes.add(changed(lambda data: None, tmp_path).sha256)
    assert len(hashes) == 2


def test_own_frames_are_refused_what_they_cannot_have() -> None:
    def error(**frame: Any) -> str:
        with pytest.raises(InputError) as found:
            load_model("platoon", {"groups.measurement.frame": {"id": 0x110, **frame}})
        return str(found.value)

    assert "looks like silence" in error(protection="none")
    assert "names signals of a database" in error(protection={"profile": "P11"})
    assert "unknown key 'mode'" in error(protection="P22", mode="nibble")
    assert "outside" in error(protection="P11", mode="nibble", data_id=0x1000)
    with pytest.raises(InputError, match="the closing frame without protection"):
        load_model("platoon", {"groups.control.frame": {"id": 0x120, "protection": "none"}})
    with pytest.raises(InputError, match="needs the database"):
        load_model("platoon", {"groups.control.dbc_message": "x"})
    with pytest.raises(InputError, match="takes no frame from a database"):
        load_model("platoon", {"signals.speed1_mps.dbc_signal": "x"})


def test_long_frames_are_protected_by_sixteen_bits() -> None:
    long, short = (design(load_model("platoon", {"plant.vehicles": n}))[0] for n in (8, 3))
    assert [g.message.protection.profile for g in long.tables.groups] == ["P05", "P05"]
    assert [g.message.protection.profile for g in short.tables.groups] == ["P22", "P22"]
    rows = ready(long, "manoeuvres").batch(120, ("controller2:bias:2@60",), loss=0.1).runs(0, 10)
    assert alarms(rows).confirmed == 0 and all(r["confirmed_at"] >= 60 for r in rows)


@pytest.mark.parametrize("profile", ["P01", "P02", "P05"])
def test_the_counter_of_a_profile_bounds_how_long_a_group_may_be_silent(profile: str) -> None:
    modulus = {"P01": 15, "P02": 16, "P05": 256}[profile]
    frame = {"id": 0x110, "protection": profile, "fd": True}
    fits = {"groups.measurement.frame": frame, "groups.measurement.trigger.interval_max": min(modulus - 5, 200)}
    design(load_model("platoon", fits))
    if modulus < 200:
        with pytest.raises(InputError, match=f"its counter of {modulus} hides the loss"):
            design(load_model("platoon", fits | {"groups.measurement.trigger.interval_max": modulus - 4}))


def test_a_receiver_counts_what_the_vehicles_profile_tells(network: Design, native: Native) -> None:
    source = Plant(native, network, network.model.scenario("rest").reference, [], SEED)
    sender, node = Sender(native), Node(native, REST)
    for k in range(20):
        reading = source.read()
        for g in range(5):
            frame = sender.step(g, k, reading)
            if frame is None:
                continue
            damaged = frame_in(native.library, replace(frame, data=bytes([frame.data[0] ^ 1, *frame.data[1:]])))
            if g in (1, 3) and k == 10:
                expected = native.library.lib.HG_E_CRC
                assert native.library.lib.hg_node_receive(node.node, damaged) == expected
                continue
            if g == 1 and k == 12:
                continue  # lost
            assert node.receive(frame) == 1
        assert node.step() is not None
        source.move()
    health = node.health()
    assert (health["crc"], health["lost"]) == (2, 3)


def test_checks_are_on_unless_the_model_turns_them_off() -> None:
    made = design(load_model("platoon"))[0]
    assert all(g.message.protection.ignore == () and g.message.protection.resync == 0 for g in made.tables.groups)
    loose = design(load_model("platoon", {"groups.measurement.rules": {"ignore": ["crc", "state"], "resync": 2}}))[0]
    rules = {g.name: g.message.protection for g in loose.tables.groups}
    assert (rules["measurement"].ignore, rules["measurement"].resync) == (("crc", "state"), 2) and rules["control"].ignore == ()
    text = emit_c(loose)[1]
    assert ".ignore = HG_E2E_IGNORE_CRC | HG_E2E_IGNORE_STATE" in text and ".resync = 2U" in text
    native = Native(library("f32"), loose.tables)
    assert (native.messages[0].e2e.ignore, native.messages[0].e2e.resync, native.messages[1].e2e.ignore) == (0x01 | 0x08, 2, 0)


@pytest.mark.parametrize(
    ("group", "rules", "said"),
    [
        ("measurement", {"ignore": ["counter"]}, "looks like silence"),
        ("control", {"ignore": ["counter"]}, "is the clock"),
        ("measurement", {"ignore": ["stamp"]}, "'stamp' is no check"),
        ("measurement", {"resync": 16}, "resync"),
        ("measurement", {"limits": 1}, "limits"),
    ],
)
def test_rules_that_cannot_be(group: str, rules: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        load_model("platoon", {f"groups.{group}.rules": rules})
