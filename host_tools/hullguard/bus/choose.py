"""Which bus a run uses: an existing vcan, else one in a network namespace or under User-Mode Linux (with-vcan), else none at all."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from hullguard.errors import BusError

CAN_HARDWARE_TYPE = "280"
ROOT = Path(__file__).resolve().parents[3]
WITH_VCAN = ROOT / "build" / "with-vcan" / "with-vcan"
NODE = ROOT / "build" / "bin" / "detector_node"


def existing_vcan() -> str | None:
    """Name of a virtual CAN interface that is up."""
    base = Path("/sys/class/net")
    if not base.is_dir():
        return None
    for folder in sorted(base.iterdir()):
        try:
            is_can = (folder / "type").read_text().strip() == CAN_HARDWARE_TYPE
            up = int((folder / "flags").read_text().strip(), 16) & 1
        except (OSError, ValueError):
            continue
        if is_can and up and folder.name.startswith("vcan"):
            return folder.name
    return None


def launcher() -> list[str] | None:
    """The command that makes a vcan for what follows it, if there is one."""
    found = str(WITH_VCAN) if WITH_VCAN.is_file() else shutil.which("with-vcan")
    return [found, "-t", "0"] if found else None


def inside(arguments: list[str]) -> int:
    """Run this command again where vcan0 exists; its exit status. `arguments` replace the command line."""
    command = launcher()
    if command is None:
        raise BusError("no vcan here, and the launcher that makes one is not built; run: make with-vcan, or use --bus inprocess")
    python = str(Path(sys.executable))
    try:
        done = subprocess.run([*command, python, "-m", "hullguard", *arguments], check=False, env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"})
    except OSError as error:
        raise BusError(f"cannot start {command[0]}: {error.strerror}; use --bus inprocess") from error
    return done.returncode


def describe(channel: str) -> str:
    """How this process came to its bus, in words."""
    how = {"native": "a network namespace of its own", "uml": "User-Mode Linux, because this kernel has no CAN"}.get(os.environ.get("WITH_VCAN", ""))
    return f"{channel} in {how}" if how else channel
