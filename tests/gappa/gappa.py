#!/usr/bin/env python3
"""Prove the rounding bounds that the design adds to thresholds and radii: scripts from the design's own constants, one Gappa run each.

    gappa.py RESULT WORK

- dot: a row of hg_linalg_rows() in float32, products and sums in the order of the C code, loses at most gamma32(terms + 2) of the sum of magnitudes.
  With |a_i|, |x_i| <= 1 that sum is `terms`; every length that a shipped table has.
- codec: |what the receiver's value is - the plant's value| <= half of hold.h, from reading the value through hg_code_encode() to hg_code_value(), for every
  signal of the shipped models that is sent as an integer; and |value of a code - offset - resolution code| <= half where the plant takes what was sent.
- q31: hg_q31_shift() and with it hg_acc_real() lose half a step at most, by every number of places that a sum is shifted.
"""

import math
import re
import resource
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from pathlib import Path

from hullguard.design.arith import gamma32
from hullguard.design.tables import FLOAT32, SignalTable, signal_table
from hullguard.model import load_model
from hullguard.model.schema import Signal

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "promises"))
from result import write_to

ROOT = Path(__file__).resolve().parent.parent.parent
MODELS = ("platoon", "platoon_bank", "suspension", "suspension_published", "two_state", "quadratic_sensor", "battery_cell", "cubic_suspension")
SHAPE = re.compile(r"\.order = (\d+)U, \.residuals = \d+U, \.width = (\d+)U")
GRID = 200  # bits behind the point of the bounds in a script, rounded to the safe side
CPU_S = 10  # of one script; what holds is proved in 0.5, what does not is searched for ever
FLOAT = "@rnd = float<ieee_32, ne>;"


def exact(x: float) -> str:
    """A double as Gappa writes it."""
    mantissa, exponent = math.frexp(x)
    return f"{int(mantissa * 2**53)}b{exponent - 53}"


def below(x: Fraction) -> str:
    """Not above x."""
    return f"{math.floor(x * 2**GRID)}b-{GRID}"


def dot(terms: int) -> str:
    """A sum of products in index order."""
    text = [FLOAT]
    text += [f"a{i} = rnd(A{i}); x{i} = rnd(X{i}); p{i} = rnd(a{i} * x{i});" for i in range(terms)]
    text += ["s0 = rnd(p0); e0 = a0 * x0;"]
    text += [f"s{i} = rnd(s{i - 1} + p{i}); e{i} = e{i - 1} + a{i} * x{i};" for i in range(1, terms)]
    known = " /\\ ".join(f"|a{i}| <= 1 /\\ |x{i}| <= 1" for i in range(terms))
    text += [f"{{ {known} -> |s{terms - 1} - e{terms - 1}| <= {below(Fraction(gamma32(terms + 2)) * terms)} }}"]
    text += ["s0 - e0 -> (s0 - p0) + (p0 - a0 * x0);"]
    text += [f"s{i} - e{i} -> (s{i} - (s{i - 1} + p{i})) + (s{i - 1} - e{i - 1}) + (p{i} - a{i} * x{i});" for i in range(1, terms)]
    return "\n".join(text)


def codec(s: Signal, t: SignalTable, upper: bool) -> str:
    """The half of a signal's range above the offset, or below it: `code + 1/2, towards zero` is rounding down or up."""
    low, high = (t.offset, max(s.high, t.offset)) if upper else (min(s.low, t.offset), t.offset)
    half, cut = ("0.5", "dn") if upper else ("-0.5", "up")
    return f"""{FLOAT}
o = {exact(t.offset)}; r = {exact(t.resolution)}; u = {exact(t.per_unit)};
y = rnd(Y); d = rnd(y - o); x = rnd(d * u); m = rnd(x + {half}); c = int<{cut}>(m); q = rnd(c); w = rnd(r * q); v = rnd(o + w);
{{ Y in [{exact(low)}, {exact(high)}] -> |v - Y| <= {exact(t.half)} }}
v - Y -> (v - (o + w)) + (w - r * q) + r * (q - c) + r * ((c - m) + {half}) + r * (m - (x + {half})) + r * (x - d * u) + (r * u - 1) * d + (d - (y - o)) + (y - Y);"""


def taken(t: SignalTable) -> str:
    """Where the plant takes the decoded value: the decoder's rounding alone."""
    return f"""{FLOAT}
o = {exact(t.offset)}; r = {exact(t.resolution)}; c = int<ne>(C); q = rnd(c); w = rnd(r * q); v = rnd(o + w);
{{ C in [{t.minimum}, {t.maximum}] -> |v - (o + r * c)| <= {exact(t.half)} }}
v - (o + r * c) -> (v - (o + w)) + (w - r * q) + r * (q - c);"""


def shifts() -> Iterator[tuple[str, str]]:
    """hg_q31_shift() of a sum below 2^63 by 1 .. 62 places."""
    for places in range(1, 63):
        text = f"@near = fixed<{places}, na>;\nx = fixed<0, dn>(X);\n{{ |x| <= {2**63 - 2**places}b0 -> |near(x) - x| <= 1b{places - 1} }}"
        yield f"q31 shift by {places}", text


def lengths() -> list[int]:
    """Terms of a row of each generator and observer that ships."""
    found = {int(order) + int(width) for source in sorted((ROOT / "firmware/models").glob("*.c")) for order, width in SHAPE.findall(source.read_text())}
    if not found:
        sys.exit("no shipped table says its order and width: has their layout changed?")
    return sorted(found)


def scripts() -> Iterator[tuple[str, str]]:
    """Name and text of each."""
    for terms in lengths():
        yield f"dot of {terms}", dot(terms)
    for name in MODELS:
        model = load_model(name)
        for group in model.groups:
            for i in group.signals:
                s = model.signals[i]
                t = signal_table(s, 0, group.applied_as_sent)
                if t.flags & FLOAT32:
                    continue
                if group.applied_as_sent:
                    yield f"{name}: {s.name} as sent", taken(t)
                else:
                    yield f"{name}: {s.name} above its offset", codec(s, t, True)
                    yield f"{name}: {s.name} below its offset", codec(s, t, False)
    yield from shifts()


def proved(item: tuple[int, tuple[str, str]], work: Path) -> str:
    """Empty, or what Gappa said."""
    number, (name, text) = item
    path = work / f"{number:03d}.g"
    path.write_text(f"# {name}\n{text}\n")
    done = subprocess.run(["gappa", str(path)], capture_output=True, check=False, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S)))
    return "" if done.returncode == 0 else f"{name}: not proved, see {path}"


def main() -> int:
    """Command line."""
    result, work = Path(sys.argv[1]), Path(sys.argv[2])
    if shutil.which("gappa") is None:
        sys.exit("gappa is missing: host_tools/setup.sh check")
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    items = list(enumerate(scripts()))
    with ThreadPoolExecutor(2) as pool:
        for line in pool.map(lambda item: proved(item, work), items):
            if line:
                pool.shutdown(wait=False, cancel_futures=True)
                print(line)
                return 1
    names = [name for _, (name, _) in items]
    dots, moved = [n for n in names if n.startswith("dot")], [n for n in names if n.startswith("q31")]
    ranges = len(names) - len(dots) - len(moved)
    text = f"{len(items)} scripts: sums of products of {len(dots)} shipped lengths, up to {lengths()[-1]} terms; {ranges} ranges of signals; {len(moved)} shifts"
    write_to(result, [("The bounds of rounding that the design adds to thresholds and radii are not below what the arithmetic of the C code can lose", text)])
    print(f"  ok  gappa: {text}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
