"""python-can reads and writes MF4 by asammdf, and imports it at once, with pandas and more: most of the time that a command takes to start."""

from __future__ import annotations

import importlib
import sys
from typing import Any, cast


def import_can() -> None:
    """Import python-can without asammdf, for a process of our own; what has been imported already is left alone."""
    if "can" in sys.modules or "asammdf" in sys.modules:
        return
    modules = cast(dict[str, Any], sys.modules)
    modules["asammdf"] = None  # "not to be had", as the import system has it
    try:
        importlib.import_module("can")
    finally:
        del modules["asammdf"]


def mf4() -> Any:
    """python-can's module for MF4, with asammdf if it is installed."""
    module = importlib.import_module("can.io.mf4")
    return importlib.reload(module) if module.asammdf is None else module
