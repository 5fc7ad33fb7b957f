"""contract_run.py BOARD: the contract suite's image, its two controllers on a bus of their own; what it prints, and its exit status."""

from __future__ import annotations

import os
import subprocess
import sys

from board_support import qemu

LIMIT_S = 120

if __name__ == "__main__":
    sys.exit(subprocess.run(qemu(sys.argv[1], "contract", None), check=False, stdin=subprocess.DEVNULL, timeout=LIMIT_S, env=os.environ | {"QEMU_AUDIO_DRV": "none"}).returncode)
