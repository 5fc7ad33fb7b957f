"""All actions, by the names that directives call them."""

from __future__ import annotations

from hullguard.inject.actions.content import Corrupt, Counter, Length
from hullguard.inject.actions.extra import Error, ExtTwin, FdTwin, Flood, Replay, Rtr, Spoof
from hullguard.inject.actions.timing import BusOff, Delay, Drop, Duplicate, Reorder, Silence
from hullguard.inject.actions.values import Bias, Drift, Freeze, Gain, Nan, Noise, Spike
from hullguard.inject.shot import Action

ACTIONS: dict[str, type[Action]] = {
    "corrupt": Corrupt, "length": Length, "counter": Counter,
    "bias": Bias, "drift": Drift, "gain": Gain, "noise": Noise, "spike": Spike, "freeze": Freeze, "nan": Nan,
    "drop": Drop, "silence": Silence, "busoff": BusOff, "delay": Delay, "reorder": Reorder, "duplicate": Duplicate,
    "replay": Replay, "spoof": Spoof, "rtr": Rtr, "exttwin": ExtTwin, "fdtwin": FdTwin, "flood": Flood, "error": Error,
}  # fmt: skip
