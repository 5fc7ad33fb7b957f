"""Options of `hullguard identify`."""

from __future__ import annotations

import argparse
from collections.abc import Callable

EPILOG = """The plant's matrices are taken as they are; what is found are bounds: of disturbances, of sensor noise, slews, lags, and settings of the triggers.
Which bounds are one and the same follows from how the model writes them: disturbance = { state = 0.01 } is one for all states, a list one for each.

exit status: 0 done; 1 done, but the held-out part does not keep within the bounds; 2 bad input; 130 Ctrl-C
"""


def _share(text: str) -> float:
    value = _number(text)
    if not 0.0 < value <= 1.0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a share above 0, 1 at most")
    return value


def _part(text: str) -> float:
    value = _number(text)
    if not 0.0 <= value <= 0.9:
        raise argparse.ArgumentTypeError(f"'{text}' is not a share within 0 .. 0.9")
    return value


def _margin(text: str) -> float:
    value = _number(text)
    if not 0.0 <= value <= 10.0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a share within 0 .. 10")
    return value


def _window(text: str) -> int:
    value = int(text) if text.isdigit() else 0
    if not 4 <= value <= 1000:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of samples within 4 .. 1000")
    return value


def _lag(text: str) -> int:
    value = int(text) if text.isdigit() else -1
    if not 0 <= value <= 20:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of samples within 0 .. 20")
    return value


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")


def add_arguments(p: argparse.ArgumentParser, seed: Callable[[str], int]) -> None:
    """All of them; `seed` reads a seed."""
    p.add_argument("model", metavar="MODEL", help="name of a shipped model, or path of a model file: the plant, its signals and groups")
    p.add_argument("--csv", action="append", required=True, metavar="FILE", help="a recording without faults; columns carry the signals' names; may be given more than once")
    p.add_argument("--hold-out", type=_part, default=0.5, metavar="SHARE", help="last part of every recording, on which the bounds are checked (default 0.5)")
    p.add_argument("--margin", type=_margin, default=0.1, metavar="SHARE", help="what is written is larger by that share than the smallest bound found (default 0.1)")
    p.add_argument("--slew-margin", type=_margin, default=0.5, metavar="SHARE", help="the same for slews, of which a recording shows few large ones (default 0.5)")
    p.add_argument("--lag-max", type=_lag, default=3, metavar="N", help="largest lag of a signal that is looked for, samples (default 3); none where the model gives lags")
    p.add_argument("--window", type=_window, default=40, metavar="N", help="samples of one linear programme (default 40; a second pass has four times as many)")
    p.add_argument(
        "--split",
        choices=["moments", "detection"],
        default="moments",
        help="what shows as disturbance or as noise: in the proportion of their second moments (default), or so that thresholds become least",
    )
    p.add_argument("--weight", action="append", default=[], metavar="BOUND=W", help="with --split detection: weight of a bound (default: its share of the thresholds)")
    wish = p.add_mutually_exclusive_group()
    wish.add_argument("--bus-load", type=_share, metavar="SHARE", help="widen or narrow the triggers until this share of the periodic measurement frames is sent")
    wish.add_argument("--smallest-fault", metavar="NAME:SIZE", help="as wide as possible while a lasting fault NAME of SIZE still leaves its threshold")
    p.add_argument("--noise", action="store_true", help="add the noise that the model gives for every signal, for recordings without any; seeded, as replay does")
    p.add_argument("--seed", type=seed, default=1, metavar="S", help="seed of --noise (default 1)")
    p.add_argument("--name", metavar="NAME", help="name of the new model (default: that of the given one)")
    p.add_argument("--out", metavar="DIR", help="folder of the new model, its design and identify.html (default build/identified)")
    p.add_argument("--force", action="store_true", help="overwrite a model that is there")
