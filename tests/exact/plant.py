"""A healthy plant, exactly: x(k+1) = A x + B u + Ed d, y = C x + D u + Fd d in rational numbers, and what its sensors and controllers hand to the senders.

The matrices are those that the design was made for, taken as the exact numbers that their floats are. An input that is applied as it was sent is
what its code stands for; other numbers are as the plant has them, and every reading is then rounded to the double that a sensor hands over.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hullguard.design.design import Design
from hullguard.model.table import Array
from numbers import Exact, exact, joined, zeros
