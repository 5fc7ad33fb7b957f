"""Directives as they are written: one line or YAML, read alike; what is wrong is said in one line with the place and the cure."""

from __future__ import annotations

from pathlib import Path

import pytest
from host_support import ROOT
from hullguard.errors import InputError
from hullguard.inject import parse_directive, read_codec, read_directives
from hullguard.inject.predicate import Predicate
from hypothesis import given
from hypothesis import strategies as st
from inject_support import DBC, codec, injector

GOOD = [
    "drop",
    "corrupt:bits=3@id=0x110,p=0.1,from=5,to=10",
    "bias:signal=gap12_m,size=0.5@time>=10",
    'spike:signal=speed1_mps,size=3@when="gap12_m>1.0"',
    "spike:signal=speed1_mps,size=3@when=gap12_m>1.0",
    "spoof:message=measurement,set='gap12_m=1.5;speed1_mps=0'@at=10",
    " drop@ id = 0x110 , nth = 5 ",
    "drop@id=0x100/0x7F0|measurement|0x110x|272",
    "duplicate@k=100..,p=1e-3",
    "drop@when='measurement.gap12_m > 1'",
]
BAD = {
    "": "expected ACTION",
    "drop it": "expected ACTION",
    "DROP": "expected ACTION",
    "explode": "there are bias",
    "drop@": "name a trigger",
    "drop:": "leave it out",
    "drop@id": "is not NAME=VALUE",
    "drop@id=": "is not NAME=VALUE",
    "drop@id=0x110,id=0x120": "given twice",
    "drop@where=here": "no trigger 'where'; there are id",
    "drop:size=1": "no option 'size'; it has none",
    "bias:signal=gap12_m": "needs size=",
    "bias:signal=gap12_m,size=big": "expected a number",
    "bias:signal=gap12_m,size=nan": "expected a number",
    "corrupt:bits=0": "at least 1",
    "corrupt:bits=1.5": "whole number",
    "corrupt:bits=513": "at most 512",
    "corrupt:repair=perhaps": "true or false",
    "corrupt:mask=XY": "hexadecimal",
    "nan:signal=gap12_m,pattern=odd": "one of invalid, range",
    "error:kind=fire": "one of busoff",
    "drop@p=1.5": "at most 1",
    "drop@nth=0": "at least 1",
    "drop@from=-1": "at least 0",
    "drop@from=2,to=1": "not after its start",
    "drop@to=0": "not after its start",
    "drop@k=5..5": "not after its start",
    "drop@k=-1": "START..END",
    f"drop@k={'9' * 5000}": "START..END",  # Python reads no whole number of more than 4300 digits
    "drop@id=0x20000000": "largest",
    "drop@seed=-1": "at least 0",
    "drop@id=a-b": "neither a message's name nor a number",
    "flood@at=1,period=1": "one of them",
    "flood@at=1,nth=2": "one or the other",
    "flood@period=0": "at least 1e-05",
    "flood@period=1e-300": "at least 1e-05",  # the moments until the first frame would never come to an end
    "drop@when=gap12_m": "comparison",
    "drop@when=gap12_m >": "not an expression",
    "drop@when=exec('x') > 1": "none of number, signal",
    "drop@when=gap12_m > __import__('os').system('x')": "none of number, signal",
    'drop@when="gap12_m > 1': "not closed",
}
UNKNOWN = {
    "drop@id=engine": "it has measurement, control, verdict, status",
    "bias:signal=gap99_m,size=1": "it has E2E_CRC",
    "bias:signal=E2E_counter,size=1": "measurement.E2E_counter",
    "drop@when=gap99_m > 1": "no signal 'gap99_m'",
    "spoof:message=engine": "no message 'engine'",
    "spoof:message=measurement,set=gap99_m=1": "no signal 'gap99_m'",
    "spoof:message=measurement,set=gap12_m=wide": "SIGNAL=NUMBER",
    "spoof:set=gap12_m=1": "needs message=",
    "spoof:frame=123,message=control": "leave message=",
    "spoof:frame=XYZ": "candump",
    "flood:rate=1e5,lasts=100": "period=",
    "drop@at=5": "from=, nth= or count=",
    "spoof@at=5": "from=, nth= or count=",
    "rtr@period=1": "from=, nth= or count=",
    "nan:signal=measurement.E2E_counter,pattern=range": "pattern=invalid",
}


@pytest.mark.parametrize("spec", GOOD)
def test_what_is_good_works(spec: str) -> None:
    injector(spec)


@pytest.mark.parametrize("spec", BAD)
def test_what_cannot_be_read_is_told(spec: str) -> None:
    with pytest.raises(InputError) as refused:
        parse_directive(spec)
    said = str(refused.value)
    assert "\n" not in said and BAD[spec] in said
    assert said.startswith(f"directive '{spec}': ")


@pytest.mark.parametrize("spec", UNKNOWN)
def test_what_does_not_fit_the_messages_is_told(spec: str) -> None:
    with pytest.raises(InputError) as refused:
        injector(spec)
    said = str(refused.value)
    assert "\n" not in said and said.startswith(f"directive '{spec}'") and UNKNOWN[spec] in said


def test_sample_indices_need_a_model() -> None:
    with pytest.raises(InputError, match="name the model"):
        injector("drop@k=5", known=read_codec(DBC))
    assert codec().closing is not None


def test_names_need_a_codec() -> None:
    from hullguard.inject import Codec

    with pytest.raises(InputError, match="without a model or DBC"):
        injector("drop@id=measurement", known=Codec())


def test_conditions() -> None:
    values = {"a": 2.0, "b": -3.0, "m.c": 0.5}
    for text, expected in {
        "a > 1": True, "1 < a < 2": False, "1 < a <= 2": True, "abs(b) == 3 and not a > 2": True, "a + b * 2 == -4 or a != 2": True,
        "-b - 1 >= a": True, "m.c < 1": True, "d > 0": False, "not d > 0": False, "a / (b + 3) > 1": False,
    }.items():  # fmt: skip
        assert Predicate(text).holds(values) is expected, text
    assert not Predicate("a > 1").holds({"a": float("nan")})


PIECES = ["drop", "bias", "spoof", ":", "@", "=", ",", "signal", "gap12_m", "size", "id", "when", "'", '"', "(", ">", "1", "-", "0x110", "/", "|", ";", "..", "k", "p", " ", "nan", "1e999", "9" * 400]


@given(st.one_of(st.text(max_size=40), st.lists(st.sampled_from(PIECES), max_size=14).map("".join)))
def test_whatever_is_written_is_read_or_refused(text: str) -> None:
    try:
        injector(text)
    except InputError as error:
        assert "\n" not in str(error).replace(text, "")


def test_a_deep_condition_is_refused_or_works() -> None:
    for text in ("(" * 5000 + "a > 1" + ")" * 5000, "not " * 5000 + "a > 1", "a > " + "-" * 5000 + "1"):
        with pytest.raises(InputError, match="more than 400"):
            Predicate(text)
    assert Predicate("not " * 98 + "a > 1").holds({"a": 2.0}) and Predicate("a > " + "-" * 390 + "1").holds({"a": 2.0})
    assert not Predicate("(" * 150 + "a > 1" + ")" * 150).holds({"a": 0.0})


# ---- YAML ----

FILE = """# what may be written above
directives:
  - drop@id=measurement,nth=5
  - action: bias
    name: wrong gap
    options: {signal: gap12_m, size: 0.50}
    trigger: {from: 1, to: 2.5}
  - action: spoof
    options:
      message: measurement
      set: {gap12_m: 1.5, speed1_mps: 0}
    trigger: {period: 0.5}
  - action: duplicate
    trigger: {id: [0x110, control], p: 0.1, when: gap12_m > 1.0}
  - action: corrupt
    options: {repair: true}
"""
SAME = [
    "drop@id=measurement,nth=5",
    "bias:signal=gap12_m,size=0.50@from=1,to=2.5,name=wrong gap",
    "spoof:message=measurement,set=gap12_m=1.5;speed1_mps=0@period=0.5",
    "duplicate@id=0x110|control,p=0.1,when=gap12_m > 1.0",
    "corrupt:repair=true",
]


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "faults.yaml"
    path.write_text(text)
    return path


def test_yaml_says_the_same_as_lines(tmp_path: Path) -> None:
    for read, line in zip(read_directives(written(tmp_path, FILE)), SAME, strict=True):
        wanted = parse_directive(line)
        assert (read.name, read.action, read.options, read.spec) == (wanted.name, wanted.action, wanted.options, line)
        assert read.trigger == wanted.trigger or (read.trigger.when and wanted.trigger.when and read.trigger.when.text == wanted.trigger.when.text)


def test_a_bare_list_will_do(tmp_path: Path) -> None:
    assert [d.action for d in read_directives(written(tmp_path, "[drop, delay]"))] == ["drop", "delay"]


YAML_BAD = {
    "": ":1: expected a list",
    "directives:": ":1: expected a list",
    "drop": ":1: expected a list",
    "directives: [drop]\nseed: 5": ":1: no key 'seed'",
    "- drop\n- explode": ":2: directive 'explode': no action",
    "- drop@p=2": "at most 1",
    "- drop\n-\n  action: bias\n  options: {signal: a}": ":3: needs size=",
    "- action: drop\n  when: x": ":1: no key 'when'",
    "- {options: {}}": ":1: expected a one-line directive",
    "- [drop]": ":1: expected a one-line directive",
    "- action: drop\n  trigger: now": ":1: options and trigger are mappings",
    "- action: drop\n  trigger: {p: }": ":1: p: expected a value",
    "- action: drop\n  action: delay": ":1: action is given twice",
    "- {": "not YAML",
    "- &a [*a]": ":1: nested too deep",
    "directives: &a\n- *a": "nested too deep",
    "[" * 3000 + "]" * 3000: ":1: nested too deep",
    "- {[a]: b}": ":1: a key must be a word",
    "{[a]: b}": ":1: a key must be a word",
    "- 'drop\0'": "not YAML",
    "- drop: [\n": "not YAML",
}


@pytest.mark.parametrize("text", YAML_BAD)
def test_bad_yaml_is_told_with_its_line(text: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        read_directives(written(tmp_path, text))
    said = str(refused.value)
    assert "\n" not in said and YAML_BAD[text] in said and said.startswith("faults.yaml:")


def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    for path in (tmp_path / "no.yaml", tmp_path):
        with pytest.raises(InputError, match="not a readable YAML file"):
            read_directives(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_codec(tmp_path / "no.dbc")
    bad = tmp_path / "bad.dbc"
    bad.write_text("BO_ what")
    with pytest.raises(InputError, match=r"bad\.dbc: not a DBC"):
        read_codec(bad)
    bad.write_bytes(b"VERSION \x9d")
    with pytest.raises(InputError, match=r"bad\.dbc: not text in the encoding of a DBC"):
        read_codec(bad)


@pytest.mark.parametrize("path", sorted((ROOT / "host_tools" / "examples").glob("*.yaml")), ids=lambda p: p.name)
def test_the_examples_are_good(path: Path) -> None:
    from hullguard.inject import Injector

    assert Injector(read_directives(path), codec()).directives
