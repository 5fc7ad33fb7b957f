#!/usr/bin/env python3
"""Prove the rounding bounds that the design adds to thresholds and radii: scripts from the design's own constants, one Gappa run each.

    gappa.py RESULT WORK

- dot: a row of hg_linalg_rows() in float32, products and sums in the order of the C code, loses at most gamma32(terms + 2) of the sum of magnitudes.
  With |a_i|, |x_i| <= 1 that sum is `terms`; every length that a shipped table has.
- codec: |what the receiver's value is - the plant's value| <= half of hold.h, from reading the value through hg_code_encode() to hg_code_value(), for every
  signal of the shipped models that is sent as an integer; and |value of a code - offset - resolution code| <= half where the plant takes what was sent.
- q31: hg_q31_shift() and with it hg_acc_real() lose half a step at most, by every number of places that a sum is shifted.
- sum: n numbers above 0, products and sums in the order of the C code, lose at most the share n u of their exact sum, u = 2^-24: by induction, a script for each step
  up to the longest sum of a shipped table. Underflow aside, which takes less than 2^-149 from a product.
- gamma: n factors 1 + d, |d| <= u, are 1 within gamma32(n): what that makes of a sum with signs follows by its linearity. For each length of a shipped certificate.
- widened: what hull, modes, bank, mismatch and zonotope widen their tables by is at least what the C code can lose of any number on its way into threshold or radius,
  for each size that a shipped table has, and for the largest sizes of a zonotope and of a mismatch with as many groups as there can be; likewise what a decay is made
  slower by, in one step of its theta.
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

from hullguard.design import hull, mismatch, uio_hull, zonotope
from hullguard.design.arith import gamma32, share32
from hullguard.design.tables import FLOAT32, SignalTable, signal_table
from hullguard.model import load_model
from hullguard.model.schema import Signal

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "promises"))
from result import write_to

ROOT = Path(__file__).resolve().parent.parent.parent
MODELS = ("platoon", "platoon_bank", "suspension", "suspension_published", "two_state", "quadratic_sensor", "battery_cell", "cubic_suspension")
SHAPE = re.compile(r"\.order = (\d+)U, \.residuals = \d+U, \.width = (\d+)U")
TAPS = re.compile(r"static const uint8_t (\w+_taps)\[\] = \{([^}]*)\}")
HULL = re.compile(r"\.residuals = \d+U, \.width = (\d+)U, \.exponent[^{}]*?\.taps = (\w+)[^{}]*")
MODES = re.compile(r"\.modes = (\d+)U")
BANK = re.compile(r"\.window = (\d+)U, \.width = (\d+)U[^{}]*?\.extras = (\d+)U[^{}]*\.widen = HG_REAL_T\((\S+),")
MISMATCH = re.compile(r"hg_mismatch_config \w+ = \{\.states = \d+U, \.width = (\d+)U")
GROUPS = re.compile(r"#define HG_\w+_GROUPS (\d+)U")
GROUPS_MAX = 8  # HG_GROUPS_MAX
LARGEST = 255  # order, width, columns, disturbances of a zonotope; signals of a mismatch
U = Fraction(1, 2**24)
DIGITS = Fraction(5, 10**7)  # what rounding to seven digits can take from a decay
DOUBLE = Fraction(1, 2**50)  # what the design's own products lose
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


def growing(n: int) -> str:
    """One number more: a sum of n that has lost a share n u at most loses (n + 1) u of all with it."""
    return f"""{FLOAT}
s = rnd(s_); a = rnd(a_); x = rnd(x_); t = rnd(s + rnd(a * x));
{{ S in [1b-100, 1b100] /\\ a * x in [1b-100, 1b100] /\\ s -/ S in [-{n}b-24, {2 * n}b-24] -> t -/ (S + a * x) in [-{n + 1}b-24, {2 * n + 2}b-24] }}"""


def factors(n: int) -> str:
    """A product of n factors that are nearly 1."""
    known = " /\\ ".join(f"d{i} in [-1b-24, 1b-24]" for i in range(n))
    product = "\n".join(f"p{i} = {f'p{i - 1} * ' if i else ''}(1 + d{i});" for i in range(n))
    return f"{product}\n{{ {known} -> |p{n - 1} - 1| <= {below(Fraction(gamma32(n)))} }}"


def covers(factor: Fraction, roundings: int) -> str:
    """A factor that is at least what so many roundings take."""
    return f"{{ w in [{below(factor)}, {below(factor)}] -> w * (1 - {roundings}b-24) >= 1 }}"


def hulls() -> set[tuple[int, int, int]]:
    """Lags of all signals together, signals, modes of the shipped hulls."""
    found = set()
    for source in shipped():
        text = source.read_text()
        taps = {name: sum(int(x) for x in re.findall(r"\d+", table)) for name, table in TAPS.findall(text)}
        for match in HULL.finditer(text):
            modes = MODES.search(match[0])
            found.add((taps[match[2]], int(match[1]), int(modes[1]) if modes else 0))
    return found


def widened() -> Iterator[tuple[str, str]]:
    """What tables are widened by, against the roundings of the C code: a product, as many sums as there are numbers before and after it, bias, theta."""
    for lags, width, modes in sorted(hulls()):
        made = 1 + Fraction(share32(uio_hull.roundings(lags, modes) if modes else hull.roundings(lags, width)))
        yield f"hull of {lags} lags, {modes} modes", covers(made * (1 - DOUBLE), lags + modes + 2)
        tail = made + Fraction(1, 10**6) - DIGITS if not modes else (made * (1 - DIGITS) ** 2) * Fraction(uio_hull.WIDER) ** 2
        yield f"what leaves the lags of a hull of {width} signals, {modes} modes", covers(tail * (1 - DOUBLE), (width + 1) + modes + 3)
    yield "a tail's decay", covers(1 / Fraction(hull.SLOWER), 2)
    yield "a mode's decay", covers(Fraction(uio_hull.WIDER) * (1 - DIGITS), 2)
    for window, width, extras, made in sorted(banks()):
        read = 1 + Fraction(gamma32(window * width))
        yield f"bank of {window} x {width}, {extras} extras", covers(made / read, window * (width + extras) + 2)
        yield f"radii of nothing else in a bank of {window} x {width}, {extras} extras", covers(made * (1 - DOUBLE), window * (width + extras) + 1)
    for width, groups in sorted({*mismatches(), *((width, GROUPS_MAX) for width in (1, GROUPS_MAX, LARGEST))}):
        yield f"mismatch of {width} signals, {groups} groups", covers((1 + Fraction(share32(mismatch.roundings(width, groups)))) * (1 - DOUBLE), width + 2 + groups)
    for columns, width, disturbances, order in ((16, 6, 3, 4), (LARGEST, LARGEST, LARGEST, LARGEST), (1, 1, 0, 1)):
        made = 1 + Fraction(share32(zonotope.roundings(columns + width + disturbances + order, width, order)))
        yield f"zonotope of {columns} columns, {width} signals, {disturbances} disturbances, order {order}", covers(made * (1 - DOUBLE), columns + width + order + 3)


def lengths() -> list[int]:
    """Terms of a row of each generator and observer that ships."""
    found = {int(order) + int(width) for source in shipped() for order, width in SHAPE.findall(source.read_text())}
    if not found:
        sys.exit("no shipped table says its order and width: has their layout changed?")
    return sorted(found)


def banks() -> set[tuple[int, int, int, Fraction]]:
    """Window, signals, extras, and factor on radii of the shipped banks."""
    found = {(int(m[0]), int(m[1]), int(m[2]), Fraction(float.fromhex(m[3]))) for source in shipped() for m in BANK.findall(source.read_text())}
    if not found:
        sys.exit("no shipped bank says its window: has its layout changed?")
    return found


def mismatches() -> set[tuple[int, int]]:
    """Signals that a mismatch reads, and groups of its model."""
    found = set()
    for source in shipped():
        text = source.read_text()
        groups = GROUPS.search(source.with_suffix(".h").read_text())
        found |= {(int(width), int(groups[1])) for width in MISMATCH.findall(text) if groups}
    if not found:
        sys.exit("no shipped mismatch says its width: has its layout changed?")
    return found


def shipped() -> list[Path]:
    """Sources of the shipped tables."""
    return sorted((ROOT / "firmware/models").glob("*.c"))


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
    longest = max([lags + modes for lags, _, modes in hulls()] + [window * (width + extras) for window, width, extras, _ in banks()])
    for n in range(1, longest + 3):
        yield f"sum of {n}", growing(n)
    for n in sorted({window * width for window, width, _, _ in banks()}):
        yield f"gamma of {n}", factors(n)
    yield from widened()


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
    sums, wide = [n for n in names if n.startswith("sum of")], len(list(widened()))
    ranges = len([n for n in names if n.endswith(("as sent", "its offset"))])
    text = (
        f"{len(items)} scripts: sums of products of {len(dots)} shipped lengths, up to {lengths()[-1]} terms; {ranges} ranges of signals; {len(moved)} shifts; "
        f"sums of numbers above 0 up to {len(sums)}; {wide} factors that tables are widened by"
    )
    write_to(result, [("The bounds of rounding that the design adds to thresholds and radii are not below what the arithmetic of the C code can lose", text)])
    print(f"  ok  gappa: {text}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
