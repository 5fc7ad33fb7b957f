"""Emulated boards: how each is started on a CAN interface, its console, and what its emulator does otherwise than a wire."""

from __future__ import annotations

import contextlib
import os
import queue
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from hullguard.bus.candump import BRS, FD
from hullguard.core.native import Frame

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "node"))  # for those who import this first: what runs inside with-vcan shares inside_support
IMAGES = ROOT / "build" / "boards"
FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)
START_S = 60.0
ANSWER_S = 10.0
QUIET_S = 0.02


def _ctucan(image: Path, channel: str | None) -> list[str]:
    bus = ["-object", "can-bus,id=canbus0", "-object", "can-bus,id=canbus1"]
    host = ["-object", f"can-host-socketcan,id=host0,if={channel},canbus=canbus0"] if channel else []
    card = f"ctucan_pci,canbus0=/objects/canbus0,canbus1=/objects/{'canbus1' if channel else 'canbus0'}"
    return ["qemu-system-riscv32", "-M", "virt", "-bios", "none", "-m", "16M", "-kernel", str(image), *bus, *host, "-device", card]


def _zynqmp_r5(image: Path, channel: str | None) -> list[str]:
    bus = ["-object", "can-bus,id=canbus0"]
    host = ["-object", f"can-host-socketcan,id=host0,if={channel},canbus=canbus0"] if channel else []
    machine = "xlnx-zcu102,canbus0=/objects/canbus0" + ("" if channel else ",canbus1=/objects/canbus0")
    first = f"loader,file={image.parent / 'cpu_on.bin'},addr=0x800000,force-raw=on"
    loaded = ["-device", f"loader,file={image}", "-device", first, "-device", "loader,addr=0x800000,cpu-num=0"]
    return ["qemu-system-aarch64", "-M", machine, *bus, *host, "-smp", "5", "-m", "128M", "-nic", "none", "-semihosting", *loaded]


COMMANDS = {"ctucan": _ctucan, "zynqmp_r5": _zynqmp_r5}


def qemu(board: str, image: str, channel: str | None) -> list[str]:
    """Command line of an image; without a channel both controllers of the board share a bus of their own."""
    return [*COMMANDS[board](IMAGES / board / f"{image}.elf", channel), "-display", "none", "-monitor", "none", "-serial", "stdio", "-name", "ecu,debug-threads=on"]


def malformed(board: str, frame: Frame) -> bool:
    """Does the board's driver count a frame of the bus as one that contradicts itself? See the board's port.h."""
    dlc = next(length for length in FD_LENGTHS if length >= len(frame.data))
    return board == "ctucan" and bool(frame.flags & FD) and -(-dlc // 4) != -(-len(frame.data) // 4)


def seen(board: str, frame: Frame) -> Frame | None:
    """A frame of the bus as the board's emulated controller and its driver hand it on; None: not at all. See the board's port.h."""
    if malformed(board, frame):
        return None
    if board != "zynqmp_r5" or not frame.flags & FD:
        return frame
    return Frame(frame.id, frame.flags & ~(FD | BRS), frame.data) if len(frame.data) <= 8 else None


@dataclass
class Board:
    """A running image."""

    popen: subprocess.Popen[str]
    lines: queue.Queue[str]

    def read(self) -> None:
        """Gather what the console says until its end; for a thread of its own."""
        assert self.popen.stdout is not None
        for line in self.popen.stdout:
            self.lines.put(line.strip())

    def line(self, timeout_s: float = ANSWER_S) -> str:
        """The next line of the console."""
        return self.lines.get(timeout=timeout_s)

    def key(self, key: str) -> None:
        assert self.popen.stdin is not None
        self.popen.stdin.write(key)
        self.popen.stdin.flush()

    def restart(self, key: str = "r") -> None:
        """A node that begins anew, as the key says."""
        self.key(key)
        assert self.line() == "ready"

    def health(self) -> dict[str, int]:
        """Every counter."""
        self.key("h")
        told: dict[str, int] = {}
        while (line := self.line()) != "end":
            name, _, number = line.rpartition(" ")
            told[name] = int(number)
        return told

    def settled(self, received: int) -> dict[str, int]:
        """Every counter, once so many frames have been received."""
        end = time.monotonic() + ANSWER_S
        while (told := self.health())["can.received"] < received and time.monotonic() < end:
            time.sleep(0.01)
        return told

    def quiet(self) -> dict[str, int]:
        """Every counter, once no more frames come."""
        before, told = -1, self.health()
        while told["can.received"] != before:
            time.sleep(QUIET_S)
            before, told = told["can.received"], self.health()
        return told

    def leave(self) -> int:
        """Ask it to end; its exit status."""
        self.key("q")
        return self.popen.wait(ANSWER_S)

    def yield_processor(self) -> None:
        """An image that polls must not take the processor from those it waits for."""
        tasks = Path("/proc") / str(self.popen.pid) / "task"
        for task in tasks.iterdir():
            if "TCG" in (task / "comm").read_text():
                os.sched_setscheduler(int(task.name), os.SCHED_IDLE, os.sched_param(0))


@contextlib.contextmanager
def board(name: str, image: str = "detector", channel: str | None = "vcan0") -> Iterator[Board]:
    """An image from its 'ready' to its end, at the latest that of this context."""
    command = qemu(name, image, channel)
    with tempfile.TemporaryFile("w+") as errors:
        popen = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True, env=os.environ | {"QEMU_AUDIO_DRV": "none"})
        made = Board(popen, queue.Queue())
        threading.Thread(target=made.read, daemon=True).start()
        try:
            assert made.line(START_S) == "ready", "the image did not start"
            made.yield_processor()
            yield made
        except BaseException:
            errors.seek(0)
            print(f"{' '.join(command)}\n{errors.read()}", file=sys.stderr)
            raise
        finally:
            popen.kill()
            popen.wait()
