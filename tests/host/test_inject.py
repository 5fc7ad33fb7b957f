"""What every action does to frames, to the byte where chance has no part in it; chance repeats by its seed; a label for everything."""

from __future__ import annotations

import math
from dataclasses import replace
from random import Random

import pytest
from host_support import SEED
from hullguard.bus.candump import ERROR, EXTENDED, FD, REMOTE
from hullguard.core.native import Frame
from hullguard.errors import InputError
from hullguard.inject import Codec, Injector, Sent, codec_of, parse_directive
from hullguard.inject.actions import ACTIONS
from hullguard.inject.command import described
from hypothesis import given
from hypothesis import strategies as st
from inject_support import (
    PERIOD_S,
    codec,
    control,
    in_order,
    injector,
    made,
    measurement,
    read,
    stream,
    through,
    value,
)

# Directives a tap can carry out as they are; of the others only those with copy=true.
TAP = {"duplicate", "replay", "spoof", "rtr", "exttwin", "fdtwin", "flood", "error"}


def one(spec: str, frame: Frame | None = None) -> list[Frame]:
    """What comes out at once for one frame."""
    return [s.frame for s in injector(spec).take(frame or measurement(3), 0.3)]


# ---- bytes ----

M3 = measurement(3)
BYTES = [
    ("corrupt:mask=0000000100000000", [replace(M3, data=M3.data[:3] + bytes([M3.data[3] ^ 1]) + M3.data[4:])]),
    ("corrupt:mask=000001,repair=true", [measurement(3, gap12_m=0.301)]),
    ("corrupt:mask=000001,copy=true,repair=true", [M3, measurement(3, gap12_m=0.301)]),
    ("length:to=6", [replace(M3, data=M3.data[:6])]),
    ("length:to=0", [replace(M3, data=b"")]),
    ("length:to=6,copy=true", [M3, replace(M3, data=M3.data[:6])]),
    ("counter:by=3", [made("measurement", 6, 3, gap12_m=0.3, gap23_m=2.0, speed1_mps=3.0)]),
    ("bias:signal=gap12_m,size=0.5", [measurement(3, gap12_m=0.8)]),
    ("bias:signal=measurement.gap12_m,size=-0.5", [measurement(3, gap12_m=-0.2)]),
    ("bias:signal=gap12_m,size=100", [measurement(3, gap12_m=20.0)]),
    ("gain:signal=speed1_mps,factor=-2", [measurement(3, speed1_mps=-6.0)]),
    ("spike:signal=speed1_mps,size=3,sign=minus", [measurement(3, speed1_mps=0.0)]),
    ("nan:signal=gap23_m", [measurement(3, gap23_m=math.nan)]),
    ("drop", []),
    ("silence", []),
    ("duplicate:times=2", [M3, M3, M3]),
    ("rtr", [M3, Frame(0x110, REMOTE, b"")]),
    ("rtr:id=0x1ABCDEF", [M3, Frame(0x1ABCDEF, REMOTE | EXTENDED, b"")]),
    ("exttwin", [M3, replace(M3, flags=EXTENDED)]),
    ("exttwin:copy=false", [replace(M3, flags=EXTENDED)]),
    ("fdtwin", [M3, replace(M3, flags=FD)]),
    ("error:kind=busoff", [M3, read("20000040#0000000000000000")]),
    ("error:kind=passive,tx=128,rx=3", [M3, read("20000204#0030000000008003")]),
    ("error:kind=warning", [M3, read("20000004#000C000000000000")]),
    ("error:kind=stuff", [M3, read("20000008#0000040000000000")]),
    ("spoof:frame=123#DEADBEEF", [M3, read("123#DEADBEEF")]),
    ("spoof", [M3, made("measurement", 4, 0, gap12_m=0.3, gap23_m=2.0, speed1_mps=3.0)]),
    ("spoof:message=measurement,set=gap12_m=1.5;speed1_mps=0,counter=9,stamp=2", [M3, made("measurement", 9, 2, gap12_m=1.5, gap23_m=2.0)]),
    ("flood:id=0x7,data=AB,lasts=0.001", [M3, read("007#AB")]),
    ("busoff", [read("20000040#0000000000000000")]),
]  # fmt: skip


@pytest.mark.parametrize(("spec", "expected"), BYTES, ids=[b[0] for b in BYTES])
def test_the_bytes_of_an_action(spec: str, expected: list[Frame]) -> None:
    assert one(spec) == expected


def test_the_bytes_of_an_invalid_forgery() -> None:
    forged = one("spoof:valid=false")[1]
    assert not in_order(forged) and forged.data[1:] == one("spoof")[1].data[1:]


def test_every_action_is_listed_with_an_example_that_works() -> None:
    assert {r["action"] for r in described()} == set(ACTIONS)
    assert {r["action"] for r in described() if r["tap"] == "yes"} == TAP
    for kind in ACTIONS.values():
        frames = stream(300)
        inject = injector(kind.example)
        through(inject, frames)
        assert inject.ledger.events, f"{kind.example}: nothing happened"
        told = {e for r in inject.ledger.rows for e in r.expects.split("|")}
        assert told <= {*kind.expects, *kind.also}, kind.example


VALUES = ["bias:signal=gap12_m,size=0.7", "drift:signal=gap12_m,rate=0.3", "gain:signal=gap12_m,factor=1.7", "noise:signal=gap12_m,size=2", "freeze:signal=gap12_m", "nan:signal=gap12_m"]


@pytest.mark.parametrize("spec", [*VALUES, "spike:signal=gap12_m,size=3@p=0.4", "corrupt:bits=5,repair=true@id=measurement", "counter:by=2@id=measurement,p=0.3"])
def test_a_wrong_value_is_in_a_frame_that_is_in_order(spec: str) -> None:
    """Checksum right, identifier, kind, length and stamp as they were; only the one signal moved."""
    frames = stream(40)
    out = through(injector(spec), frames)
    assert [s.time_s for s in out] == [s.time_s for s in frames] and out != frames
    for before, after in zip(frames, out, strict=True):
        assert in_order(after.frame)
        assert (before.frame.id, before.frame.flags, len(before.frame.data)) == (after.frame.id, after.frame.flags, len(after.frame.data))
        assert before.frame.data[1] & 0xF0 == after.frame.data[1] & 0xF0, "the stamp"
        if "signal=gap12_m" in spec:
            assert before.frame.data[4:] == after.frame.data[4:] and before.frame.data[1] == after.frame.data[1]


def test_the_values_of_faults_over_time() -> None:
    window = "@from=1.0,to=1.55"
    for spec, wrong in {
        f"drift:signal=gap23_m,rate=2{window}": lambda k: 2.0 + 2.0 * 0.1 * (k - 10),
        f"freeze:signal=gap12_m{window}": lambda k: 0.9,
        f"bias:signal=gap12_m,size=0.25{window}": lambda k: 0.1 * k + 0.25,
    }.items():
        name = spec.split("signal=")[1].split(",")[0].split("@")[0]
        out = [s.frame for s in through(injector(spec), stream(30)) if s.frame.id == 0x110]
        for k, frame in enumerate(out):
            assert value(frame, name) == pytest.approx(wrong(k) if 10 <= k <= 15 else value(measurement(k), name), abs=0.0006), (spec, k)


def test_a_value_beyond_the_range_goes_out_only_where_that_is_asked_for() -> None:
    assert codec().reception(one("bias:signal=gap12_m,size=100")[0]) == "good"
    far = one("bias:signal=gap12_m,size=25,clip=false")[0]
    assert value(far, "gap12_m") == pytest.approx(25.3) and codec().reception(far) == "numeric"
    assert codec().reception(one("nan:signal=gap12_m,pattern=range")[0]) == "numeric"
    assert codec().reception(one("nan:signal=gap12_m")[0]) == "invalid"


def test_a_frame_that_was_damaged_is_not_repaired_by_what_comes_behind() -> None:
    for seed in range(60):  # a renewed checksum is right by chance once in 256
        inject = injector("corrupt:bits=2@id=measurement", f"bias:signal=gap12_m,size={1 + seed * 0.01}", seed=seed)
        out = [s.frame for s in inject.take(measurement(seed), 0.0)]
        assert not in_order(out[0])


# ---- time ----


def bare(sent: list[Sent]) -> list[tuple[float, Frame]]:
    """Without what a receiver is expected to count."""
    return [(s.time_s, s.frame) for s in sent]


def test_times_and_order() -> None:
    frames = stream(4)
    late = through(injector("delay:by=0.15@id=measurement,nth=2"), frames)
    assert [round(s.time_s, 3) for s in late] == [0.0, 0.01, 0.11, 0.2, 0.21, 0.25, 0.3, 0.31] and late[5].frame == measurement(1)
    swapped = through(injector("reorder@id=measurement|control,nth=3"), frames)
    assert [s.frame for s in swapped[:5]] == [measurement(0), control(0), control(1), measurement(1), measurement(2)]
    twofold = through(injector("reorder:behind=2@id=measurement|control,nth=3"), frames)
    assert [s.frame for s in twofold[:5]] == [measurement(0), control(0), control(1), measurement(2), measurement(1)]
    patient = through(injector("reorder:behind=9,patience=0.05@id=measurement,nth=1"), frames)
    assert bare(patient)[1] == (0.05, measurement(0)) and len(patient) == len(frames)
    twice = through(injector("duplicate:gap=0.005@id=control,nth=1"), frames)
    assert bare(twice)[2] == (0.015, control(0))


def test_a_silence_swallows_its_own_and_lasts() -> None:
    out = through(injector("silence:lasts=0.5@id=measurement,at=1.0"), stream(20))
    assert [round(s.time_s, 2) for s in out if s.frame.id == 0x110] == [round(k * PERIOD_S, 2) for k in range(20) if not 10 <= k < 15]
    assert sum(s.frame.id == 0x120 for s in out) == 20


def test_bus_off_says_so_and_comes_back() -> None:
    out = through(injector("busoff:lasts=0.5@at=1.0"), stream(20))
    assert [x for x in bare(out) if x[1].flags & ERROR] == [(1.0, read("20000040#0000000000000000")), (1.5, read("20000100#0000000000000000"))]
    assert not [s for s in out if 1.0 <= s.time_s < 1.5 and not s.frame.flags & ERROR] and len(out) == 40 - 10 + 2


def test_a_counter_that_jumped_goes_on_from_there() -> None:
    out = [s.frame for s in through(injector("counter:by=5@id=measurement,nth=4"), stream(20)) if s.frame.id == 0x110]
    assert [f.data[1] & 15 for f in out] == [k % 16 if k < 3 else (k + 5) % 16 for k in range(20)] and all(map(in_order, out))


def test_replay_sends_what_passed_with_its_spacing() -> None:
    out = through(injector("replay:frames=3,age=0.5@id=measurement,at=1.55"), stream(20))
    old = [s for s in out if round(20 * s.time_s, 6) % 2 == 1]  # in between the others
    assert [s.frame for s in old] == [measurement(k) for k in (8, 9, 10)]
    assert [round(s.time_s, 6) for s in old] == [1.55, 1.65, 1.75]
    burst = through(injector("replay:frames=3,spacing=burst@id=measurement,at=1.55"), stream(20))
    assert [s.frame for s in burst if s.time_s == 1.55] == [measurement(k) for k in (13, 14, 15)]


def test_a_flood_has_its_rate_and_an_end() -> None:
    out = [s for s in through(injector("flood:id=0x1,rate=500,lasts=0.1,length=3@at=0.5"), stream(20)) if s.frame.id == 1]
    assert [round(s.time_s, 6) for s in out] == [round(0.5 + i * 0.002, 6) for i in range(50)]
    assert {len(s.frame.data) for s in out} == {3} and len({s.frame.data for s in out}) > 40


def test_forgeries_count_on_and_carry_the_open_samples_stamp() -> None:
    out = through(injector("spoof:message=measurement@period=0.03,from=1.02,to=1.1"), stream(12))
    forged = [s.frame for s in out if 1.011 < s.time_s < 1.1]
    assert [(f.data[1] & 15, f.data[1] >> 4) for f in forged] == [(11, 11), (12, 11), (13, 11)] and all(map(in_order, forged))


# ---- triggers ----

TRIGGERS = {
    "@id=measurement": lambda k, m: m,
    "@id=0x110": lambda k, m: m,
    "@id=0x100/0x7E0": lambda k, m: m,
    "@id=measurement|control": lambda k, m: True,
    "@id=0x110x": lambda k, m: False,
    "@id=measurement,nth=5": lambda k, m: m and k == 4,
    "@id=control,every=4": lambda k, m: not m and k % 4 == 3,
    "@id=measurement,from=0.5,to=0.8": lambda k, m: m and 5 <= k < 8,
    "@id=measurement,time>=0.5,time<0.8": lambda k, m: m and 5 <= k < 8,
    "@id=control,k=3..6": lambda k, m: not m and 3 <= k < 6,
    "@k=17": lambda k, m: k >= 17,
    "@id=measurement,count=3": lambda k, m: m and k < 3,
    '@id=measurement,when="gap12_m > 1.0"': lambda k, m: m and k > 10,
    "@id=control,when='gap12_m >= 0.45 and not gap12_m > 0.95 or measurement.gap12_m == 0'": lambda k, m: not m and (5 <= k <= 9 or k == 0),
    "@id=measurement,when=abs(gap12_m - 0.5) < 0.15": lambda k, m: m and 4 <= k <= 6,
    "@id=measurement,when=1 / gap12_m > 4": lambda k, m: m and k in (1, 2),
    "@id=measurement,p=0": lambda k, m: False,
    "@id=measurement,from=0.95,every=2,count=2": lambda k, m: m and k in (11, 13),
}


@pytest.mark.parametrize("trigger", TRIGGERS)
def test_a_trigger_chooses(trigger: str) -> None:
    inject = injector(f"drop{trigger}")
    kept = through(inject, stream(20))
    expected = [s for i, s in enumerate(stream(20)) if not TRIGGERS[trigger](i // 2, i % 2 == 0)]
    assert kept == expected
    assert sum(inject.ledger.events.values()) == 40 - len(kept)


def test_a_probability_is_one() -> None:
    inject = injector("drop@id=measurement,p=0.3")
    left = len(through(inject, stream(2000)))
    assert 0.25 < (4000 - left) / 2000 < 0.35


def test_error_frames_and_unknown_frames_are_nobodys() -> None:
    error, other = read("20000040#0000000000000000"), read("7FF#00")
    assert [s.frame for f in (error, other) for s in injector("drop@id=measurement").take(f, 0.0)] == [error, other]
    assert [s.frame for f in (error, other) for s in injector("drop").take(f, 0.0)] == [error]


def test_without_a_codec_numbers_do() -> None:
    inject = injector("corrupt:bits=2@id=0x123", known=Codec())
    out = [s.frame for s in inject.take(read("123#0000"), 0.0) + inject.take(read("124#0000"), 0.1)]
    assert sum(b.bit_count() for b in out[0].data) == 2 and out[1] == read("124#0000") and inject.ledger.rows[0].expects == ""


# ---- composition, seeds ----


def test_a_directive_works_on_what_those_before_it_made() -> None:
    assert one2("duplicate", "counter:by=1") == [made("measurement", 4 + i, 3, gap12_m=0.3, gap23_m=2.0, speed1_mps=3.0) for i in range(2)]
    assert one2("bias:signal=gap12_m,size=1", "gain:signal=gap12_m,factor=2") == [measurement(3, gap12_m=2.6)]
    assert one2("gain:signal=gap12_m,factor=2", "bias:signal=gap12_m,size=1") == [measurement(3, gap12_m=1.6)]
    assert one2("spoof", "drop@id=measurement") == []
    late = injector("delay:by=0.05", "bias:signal=gap12_m,size=1@from=0.32")
    assert [s.frame for s in late.take(M3, 0.3) + late.finish()] == [measurement(3, gap12_m=1.3)], "when it comes out, the second one has begun"


def one2(*specs: str) -> list[Frame]:
    return [s.frame for s in injector(*specs).take(M3, 0.3)]


RANDOM = ["corrupt:bits=3@id=measurement,p=0.5", "noise:signal=gap23_m,size=1@p=0.7", "delay:by=0.02,jitter=0.2@id=control,p=0.3", "flood:id=0x5,lasts=0.01@at=0.4", "drop@id=control,p=0.2"]


@given(st.integers(0, 2**64 - 1), st.lists(st.sampled_from([*RANDOM, *(k.example for k in ACTIONS.values())]), min_size=1, max_size=4))
def test_the_same_seed_gives_the_same_bytes(seed: int, specs: list[str]) -> None:
    runs = []
    for _ in range(2):
        inject = injector(*specs, seed=seed)
        runs.append((through(inject, stream(30)), inject.ledger.rows))
    assert runs[0] == runs[1]


@given(st.integers(0, 2**32), st.lists(st.sampled_from(RANDOM), max_size=3))
def test_one_more_directive_moves_no_others_chances(seed: int, more: list[str]) -> None:
    """Those of another directive on other frames, before or behind."""
    spec = "corrupt:bits=3@id=measurement,p=0.5,name=mine"
    alone = injector(spec, seed=seed)
    through(alone, stream(30))
    others = [f"drop@id=control,p=0.{i + 2}" for i in range(len(more))]
    for specs in ([*others, spec], [spec, *others]):
        together = injector(*specs, seed=seed)
        through(together, stream(30))
        assert [r.sent for r in together.ledger.rows if r.directive == "mine"] == [r.sent for r in alone.ledger.rows]


def test_directives_have_chances_of_their_own() -> None:
    inject = injector("noise:signal=gap12_m,size=1", "noise:signal=gap23_m,size=1")
    through(inject, stream(5))
    details = [[r.detail.split("-> ")[1] for r in inject.ledger.rows if r.directive == f"noise{i}"] for i in (1, 2)]
    moved = [[round(float(d) - was, 3) for d, was in zip(details[0], (0.1 * k for k in range(5)), strict=True)], [round(float(d) - 2.0, 3) for d in details[1]]]
    assert moved[0] != moved[1]


def test_a_directive_may_have_a_seed_of_its_own() -> None:
    runs = []
    for seed in (3, 4):
        inject = injector("corrupt:bits=2@p=0.5,seed=18446744073709551615", "noise:signal=gap12_m,size=1", seed=seed)
        through(inject, stream(20))
        runs.append([r for r in inject.ledger.rows if r.action == "corrupt"])
        assert {r.seed for r in inject.ledger.rows} == {seed, 2**64 - 1}
    assert runs[0] == runs[1]


def test_another_seed_gives_others() -> None:
    runs = {tuple(s.frame.data for s in through(injector(*RANDOM[:2], seed=seed), stream(20))) for seed in range(20)}
    assert len(runs) == 20


# ---- tap ----


@pytest.mark.parametrize("name", ACTIONS)
def test_what_a_tap_cannot_do_is_refused_at_once(name: str) -> None:
    spec = ACTIONS[name].example
    if name in TAP:
        frames = stream(300)
        sent = through(injector(spec, gateway=False), frames)
        both = through(injector(spec), frames)
        assert sent and len(both) == len(sent) + len(frames)
        return
    with pytest.raises(InputError) as refused:
        injector(spec, gateway=False)
    said = str(refused.value)
    assert "\n" not in said and spec in said and "a tap cannot" in said and "--from-channel" in said


def test_a_tap_sends_changed_copies_only() -> None:
    inject = injector("bias:signal=gap12_m,size=1,copy=true", "corrupt:bits=1,copy=true@id=0x777", gateway=False)
    assert [s.frame for s in inject.take(M3, 0.3)] == [measurement(3, gap12_m=1.3)]
    with pytest.raises(InputError, match="a tap cannot"):
        injector("exttwin:copy=false", gateway=False)


# ---- labels ----


def test_a_label_says_what_was_done() -> None:
    inject = injector("bias:signal=gap12_m,size=0.5@id=measurement,nth=3", "drop@id=control,nth=1", seed=7)
    through(inject, stream(5))
    first, second = inject.ledger.rows
    assert (first.time_s, first.k, first.directive, first.action, first.frame, first.expects, first.detail, first.seed) == (0.01, 0, "drop1", "drop", 1, "lost", "dropped", 7)
    assert read(first.original) == control(0) and first.sent == ""
    assert (second.directive, second.frame, second.k, second.expects, second.detail) == ("bias1", 4, 2, "good", "gap12_m 0.2 -> 0.7")
    assert (read(second.original), read(second.sent)) == (measurement(2), measurement(2, gap12_m=0.7))


def test_what_changes_nothing_is_no_event() -> None:
    for spec in ("bias:signal=gap12_m,size=0.0001", "gain:signal=gap12_m,factor=1", "length:to=8", "delay:by=0", "counter:by=16", "replay@at=0"):
        inject = injector(spec)
        assert [s.frame for s in inject.take(M3, 0.3)] == [M3] and not inject.ledger.rows, spec


# ---- codec ----

OTHER = """VERSION ""
BU_: a
BO_ 2147483939 wide: 16 a
 SG_ big : 7|12@0- (0.5,10) [0|0] "" a
 SG_ mode M : 16|4@1+ (1,0) [0|3] "" a
 SG_ first m0 : 24|8@1+ (1,0) [0|100] "" a
 SG_ second m1 : 24|8@1+ (1,0) [0|100] "" a
 SG_ real : 32|32@1- (2,1) [-100|100] "" a
 SG_ fine : 64|64@1- (1,0) [0|0] "" a
BO_ 5 twin: 1 a
 SG_ big : 0|8@1+ (1,0) [0|250] "" a
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","r2","r3","r4","r5","r6","r7","r8","r9","r10","r11","r12","r13","StandardCAN_FD","ExtendedCAN_FD";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "VFrameFormat" BO_ 2147483939 15;
SIG_VALTYPE_ 2147483939 real : 1;
SIG_VALTYPE_ 2147483939 fine : 2;
"""


def test_a_foreign_dbc_with_everything_in_it() -> None:
    known = codec_of(OTHER, "other.dbc")
    wide = known.message("wide")
    data = bytes(Random(SEED).randbytes(8)) + bytes(8)
    import cantools

    database = cantools.database.load_string(OTHER, "dbc")
    for signal, wanted in (("wide.big", -523.5), ("first", 7.0), ("real", 12.5), ("fine", 1e300)):
        layout, field = known.signal(signal)
        base = layout.fields["mode"].with_raw(data, 0)
        told = database.get_message_by_name("wide").decode(field.with_raw(base, field.pattern(wanted, clip=False)))  # type: ignore[union-attr]
        assert told[field.name] == field.value(field.with_raw(base, field.pattern(wanted, clip=False))) == wanted  # type: ignore[call-overload,index]
    frame = Frame(wide.id, EXTENDED | FD, wide.fields["mode"].with_raw(data, 1))
    inject = injector("bias:signal=first,size=1", known=known)
    assert [s.frame for s in inject.take(frame, 0.0)] == [frame], "the frame does not carry that one"
    with pytest.raises(InputError, match=r"big.*wide, twin.*wide\.big"):
        injector("bias:signal=big,size=1", known=known)
    infinite = injector("nan:signal=real,pattern=range", known=known).take(replace(frame, data=bytes(16)), 0.0)[0].frame
    assert infinite.data[4:8] == bytes.fromhex("0000807f") and known.reception(infinite) == "numeric"
    quiet = injector("nan:signal=real", known=known).take(replace(frame, data=bytes(16)), 0.0)[0].frame
    assert quiet.data[4:8] == bytes.fromhex("0000c07f") and known.reception(quiet) == "invalid"


def test_directives_have_names_of_their_own() -> None:
    inject = Injector([parse_directive(s) for s in ("drop@p=0.1", "delay", "drop@name=x")], codec())
    assert [d.name for d in inject.directives] == ["drop1", "delay1", "x"]
    with pytest.raises(InputError, match="'x' is taken"):
        injector("drop@name=x", "delay@name=x")
