"""Event-triggered, set-based fault detection on ECUs over CAN: the host side."""

import logging
import os
import platform
from pathlib import Path

# Matrices are small here: a second thread of the linear algebra only waits for the first, several times as long as the work takes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

CPU = Path("/proc/cpuinfo")


def _same_digits() -> None:
    """Have the linear algebra compute alike on every x86-64 processor that can.

    Left to itself it adds in another order where there is AVX-512, and what rounding leaves of the last digits of eigenvectors ends up in a design's tables and hash.
    """
    if "OPENBLAS_CORETYPE" in os.environ or platform.machine() != "x86_64" or not CPU.exists():
        return
    with CPU.open(encoding="utf-8", errors="replace") as lines:  # not all of it: it is long where there are many processors
        flags = next((line.split() for line in lines if line.startswith("flags")), [])
    if {"avx2", "fma"} <= set(flags):
        os.environ["OPENBLAS_CORETYPE"] = "Haswell"


_same_digits()

# What it thinks of a database goes nowhere: errors come as exceptions and are told in one line.
logging.getLogger("cantools").addHandler(logging.NullHandler())

__version__ = "0.1.0"
