"""Run inside with-vcan by test_freeze_bus.py: a freeze frame read from a node on a bus is, to the bit, what a node in this process has recorded; and a node of another model is told."""

from __future__ import annotations

import json
import threading
import time

import pytest
from hullguard.bus.link import CanLink
from hullguard.cli import main
from hullguard.core.library import library
from hullguard.core.native import REST, Frame, Plant
from hullguard.freeze.reader import Reader
from hullguard.freeze.record import decode
from hullguard.model import parse_fault
from hullguard.plant.run import OnCan, Pace, Run
from inside_support import WAIT_S, link, node, ready
from node_support import SEED

MODEL = "platoon_bank"
BUS = ("-i", "socketcan", "-c", "vcan0")
OTHER = ("--set", "freeze.samples=4", "--set", "freeze.request={id=0x150}")  # another hash, the same detector


def run_of(channel: CanLink, fault: str) -> tuple[Run, Plant]:
    made, native = ready(MODEL)
    source = Plant(native, made, made.model.scenario("default").reference, [parse_fault(fault)], SEED)
    return Run(made, native, OnCan(channel, native, Pace(True)), Pace(True), start=REST), source


def words_here(run: Run) -> list[int]:
    """The record of the node in this process."""
    lib, freeze = run.native.library.lib, run.node.node.freeze
    return [int(lib.hg_freeze_word(freeze, i)) for i in range(lib.hg_freeze_words(freeze))]


class Lossy:
    """A link on which every so many responses are lost, and one is damaged."""

    def __init__(self, own: CanLink) -> None:
        self._link, self._count = own, 0

    def send(self, frame: Frame) -> None:
        self._link.send(frame)

    def receive(self, timeout_s: float) -> tuple[Frame, float] | None:
        got = self._link.receive(timeout_s)
        self._count += 1
        if got is None or self._count % 7 == 3:
            return None
        return (Frame(got[0].id, got[0].flags, bytes([got[0].data[0] ^ 1]) + got[0].data[1:]), got[1]) if self._count % 50 == 11 else got


def test_what_is_read_is_what_was_recorded_to_the_bit(capsys: pytest.CaptureFixture[str]) -> None:
    made, _ = ready(MODEL)
    assert made.tables.freeze is not None
    with node("--model", MODEL, "--lockstep", "--rest"), link() as channel:
        run, source = run_of(channel, "controller2:bias:2@60")
        trace = run.samples(source, 120)
        assert run.mismatch is None and run.told.model == "match"
        with link() as second:
            reader = Reader(library(), Lossy(second), made.tables.freeze)  # type: ignore[arg-type]
            state = reader.state()
            assert state.state == "frozen" and state.record == 1
            words = reader.read(state, lambda done, whole: None)
        assert words == words_here(run)
        record = decode(made, words)
        assert [s.k for s in record.samples] == list(range(record.samples[0].k, record.samples[0].k + 16))
        for i, s in enumerate(record.samples):
            assert (list(s.value), list(s.radius), list(s.r), list(s.J)) == (trace.value[s.k], trace.radius[s.k], trace.r[s.k], trace.J[s.k])
            assert (s.plant, s.candidates, s.bus) == (trace.verdict[s.k].plant, trace.verdict[s.k].candidates, trace.verdict[s.k].bus)
            assert (s.plant == "confirmed") >= (i == record.alarm)
        assert record.samples[record.alarm - 1].plant != "confirmed"
        assert main(["freeze", MODEL, *BUS, "--json", "--clear"]) == 0
        told = json.loads(capsys.readouterr().out)
        assert told["cleared"] and told["alarm_k"] == record.samples[record.alarm].k and len(told["samples"]) == 16
        assert list(told["samples"][3]["J"].values()) == list(record.samples[3].J)
        assert main(["freeze", MODEL, *BUS]) == 0
        assert "nothing to read: the ECU is recording" in capsys.readouterr().out
        with link() as second, pytest.raises(Exception, match="is gone"):  # a reader whose record somebody else has cleared
            Reader(library(), second, made.tables.freeze).read(state, lambda done, whole: None)


def test_reading_does_not_disturb_detection() -> None:
    made, _ = ready(MODEL)
    assert made.tables.freeze is not None
    table, read = made.tables.freeze, list[list[int]]()
    with node("--model", MODEL, "--lockstep", "--rest"), link() as channel:
        run, source = run_of(channel, "controller1:bias:2@40")

        def reads() -> None:
            with link() as second:
                reader = Reader(library(), second, table)
                state, end = reader.state(), time.monotonic() + WAIT_S
                while state.state != "frozen" and time.monotonic() < end:
                    time.sleep(0.05)
                    state = reader.state()
                read.append(reader.read(state, lambda done, whole: None))

        thread = threading.Thread(target=reads)
        thread.start()
        run.samples(source, 160)  # in lockstep: every verdict is compared with this process's
        thread.join(WAIT_S)
        assert run.mismatch is None
        assert read == [words_here(run)]


def test_requests_that_nobody_answers_are_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["freeze", MODEL, *BUS]) == 3
    said = capsys.readouterr().err
    assert "no ECU answered" in said and said.count("\n") == 1
    assert main(["freeze", "platoon", *BUS]) == 2
    assert "[freeze]" in capsys.readouterr().err


@pytest.mark.parametrize("lockstep", [True, False])
def test_a_node_of_another_model_is_told_by_both_hashes(capsys: pytest.CaptureFixture[str], lockstep: bool) -> None:
    made, _ = ready("platoon")
    options = ["--lockstep"] if lockstep else []
    with node("--model", "platoon", "--rest", *options):
        assert main(["plant", "platoon", *BUS, "--samples", "25", "--no-fault", "--speed", "max" if lockstep else "4", *OTHER, *options, "--json"]) == 1
    told, said = capsys.readouterr()
    result = json.loads(told)
    assert result["ecu_model"] == "other" and result["ecu_hash"] == f"{made.tables.hash:08x}"
    assert said.splitlines()[-1].startswith("hullguard: the ECU runs another model") and result["model_hash"] in said and result["ecu_hash"] in said
