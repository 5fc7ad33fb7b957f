"""Event-triggered, set-based fault detection on ECUs over CAN: the host side."""

import logging
import os

# Matrices are small here: a second thread of the linear algebra only waits for the first, several times as long as the work takes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# What it thinks of a database goes nowhere: errors come as exceptions and are told in one line.
logging.getLogger("cantools").addHandler(logging.NullHandler())

__version__ = "0.1.0"
