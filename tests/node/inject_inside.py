"""Run inside with-vcan by test_node_inject.py: the injector as a tap (as a gateway: bus_inside.py), and what only SocketCAN
carries: error frames of any class, and CAN FD lengths that have no code."""

from __future__ import annotations

import contextlib
import json
import signal
import socket
import struct
import subprocess
from pathlib import Path

import pytest
from hullguard.bus import candump
from hullguard.bus.candump import FD
from hullguard.core.native import Frame
from hullguard.inject import codec_of
from inside_support import Process, link, process
from node_support import ROOT, hullguard

DBC = ROOT / "firmware" / "models" / "platoon.dbc"
TAP = ("-i", "socketcan", "-c", "vcan0", "--fd")


def inject(names: object, *options: object) -> contextlib.AbstractContextManager[Process]:
    return process(*hullguard("inject", names, "--ready", "--json", "-q", *options))


def told(process_: Process) -> dict:
    assert process_.status == 0, process_.err
    return json.loads(process_.lines[-1])


class Raw:
    """A socket of its own: python-can lengthens what it receives to the next length that CAN FD can say."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self._socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        self._socket.bind(("vcan0",))
        self._socket.settimeout(5.0)

    def lengths(self, identifier: int, count: int) -> list[int]:
        """Of the next frames with an identifier."""
        found: list[int] = []
        while len(found) < count:
            number, length = struct.unpack_from("=IB", self._socket.recv(72))
            found += [length] if number == identifier else []
        return found


def test_a_tap_with_all_that_only_socketcan_carries(tmp_path: Path) -> None:
    codec = codec_of(DBC.read_text(), "platoon.dbc")
    layout = codec.message("measurement")
    assert layout.protection is not None
    frames = [Frame(0x110, 0, layout.protection.protect(bytes(8), k, k)) for k in range(5)]
    long = Frame(0x321, FD, bytes(range(16)))
    specs = ("fdtwin@id=0x110,nth=5", "exttwin@id=0x110,nth=4", "rtr@id=0x110,nth=3", "error:kind=passive,tx=200@id=0x110,nth=2", "length:to=13,copy=true@id=0x321")
    raw = Raw()
    with link() as bus, inject(DBC, *TAP, *(x for s in specs for x in ("--do", s)), "--out", tmp_path) as tap:
        got = []
        for frame in (*frames, long):
            bus.send(frame)
            if frame is not frames[0]:
                got.append(bus.receive(5.0))
        tap.stop(signal.SIGINT)
    assert told(tap)["sent"] == 5
    texts = ["20000204#003000000000C800", "110#R", f"00000110#{frames[3].data.hex().upper()}", f"110##0{frames[4].data.hex().upper()}"]
    recorded = [e.frame for e in candump.read(tmp_path / "injected.log")]
    assert recorded[-1] == Frame(0x321, FD, bytes(range(13))) and [candump.line(0, "x", f).split()[2] for f in recorded[:-1]] == texts
    assert [g[0] for g in got[:-1] if g] == recorded[:-1] and raw.lengths(0x321, 2) == [16, 13]
    with link() as bus, process(*hullguard("inject", "--replay", tmp_path / "injected.log", *TAP, "--ready", "--json", "-q")) as again:
        assert [bus.receive(5.0)[0] for _ in recorded][:-1] == recorded[:-1], "to the byte"  # type: ignore[index]
        again.wait(10)
    assert told(again)["sent"] == 5 and raw.lengths(0x321, 1) == [13]


@pytest.mark.parametrize("spec", ["drop", "delay", "bias:signal=gap12_m,size=1"])
def test_a_tap_refuses_before_it_opens_the_bus(spec: str) -> None:
    done = subprocess.run(hullguard("inject", DBC, "--do", spec, *TAP), capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "") and done.stderr.count("\n") == 1 and "a tap cannot" in done.stderr
