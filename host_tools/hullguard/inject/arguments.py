"""Options of `hullguard inject`."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

SPEC = """a directive SPEC is ACTION[:OPTION=VALUE,..][@TRIGGER=VALUE,..], for example bias:signal=gap12_m,size=0.5@from=10,to=20
  ACTION, OPTION as --list tells; TRIGGER of
    id=ID[|ID..]    messages by name or number; number/MASK, or with x behind it an extended one
    when="CONDITION" on signals as they were last seen, for example gap12_m > 1.0 and abs(speed1_mps) < 3
    from=T, to=T    seconds since the start (or time>=T, time<T); k=START[..END] sample indices, where a MODEL is given
    nth=N, every=N  the N-th frame of those, or each N-th; p=P with that probability; count=N at most so often
    at=T, period=T  not on a frame but at a moment, or every T seconds
    name=NAME       in labels.csv, and of the directive's own random numbers; seed=S of these, instead of --seed
directives work one behind another, each on what those before it let through or send
"""


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of seconds above 0")
    return value


def add_arguments(p: argparse.ArgumentParser, seed: Callable[[str], int]) -> None:
    """All of them; `seed` reads a seed."""
    from can.cli import add_bus_arguments

    p.add_argument("model", metavar="MODEL", nargs="?", help="a model, or a DBC file (NAME.dbc): what is known by name, and how frames are protected")
    p.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="override a key of the model")
    p.add_argument("--do", action="append", default=[], metavar="SPEC", help="a directive; may be given more than once")
    p.add_argument("--file", action="append", default=[], metavar="FILE", help="directives in YAML; they come before those of --do")
    p.add_argument("--seed", type=seed, default=1, metavar="S", help="seed of every random number (default 1)")
    p.add_argument("--log", metavar="FILE", help="work on a recording (.log, .pcap, .pcapng, .blf, .mf4, .asc) as a gateway would, without any bus; needs --out")
    p.add_argument("--out", metavar="DIR", help="write injected.log (what was sent), labels.csv (the truth) and inject.json there")
    p.add_argument("--replay", metavar="FILE", help="send an injected.log again, byte for byte at its times, instead of directives")
    p.add_argument("--speed", type=_seconds, default=1.0, metavar="X", help="of --replay, a multiple of real time (default 1)")
    p.add_argument("--duration", type=_seconds, metavar="T", help="stop after T seconds (default: at Ctrl-C)")
    p.add_argument("--ready", action="store_true", help="print 'ready' once the bus is open")
    p.add_argument("--dry-run", action="store_true", help="check everything and say what would be done, but open no bus")
    p.add_argument("--list", action="store_true", help="all actions: options, examples, whether a tap can do it, what a receiver must count")
    add_bus_arguments(p, group_title="a tap: bus options of python-can")
    add_bus_arguments(p, prefix="from", group_title="a gateway: the side whose frames are falsified, for example the plant's")
    add_bus_arguments(p, prefix="to", group_title="a gateway: the side that gets them, for example the ECU's")
