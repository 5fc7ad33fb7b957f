"""Options of `hullguard new`."""

from __future__ import annotations

import argparse

EPILOG = """MATRIX is rows of numbers, "0.9 0.1; 0 0.8" or [[0.9, 0.1], [0, 0.8]]. --from reads A, B, C, D and the sample time (Ts or dt; 0 is continuous) by name from
  FILE.mat   Matlab, save('plant.mat', 'A', 'B', 'C', 'D', 'Ts') or a struct of them; up to version 7
  FILE.npz   python-control, numpy.savez('plant.npz', A=sys.A, B=sys.B, C=sys.C, D=sys.D, dt=sys.dt)
  FILE.json  { "A": [[..]], "B": .., "C": .., "D": .., "dt": 0.1 }
  FILE.csv   a row a line, the matrix's name first: A,0.9,0.1 (and dt,0.1)
Without a source it asks, where it runs on a terminal.

exit status: 0 done; 2 bad input, or a file that is there already; 130 Ctrl-C
"""


def add_arguments(p: argparse.ArgumentParser) -> None:
    """All of them."""
    p.add_argument("name", metavar="NAME", nargs="?", help="name of the model, lower case; the file is NAME.toml")
    p.add_argument("--from", dest="source", metavar="FILE", help="a state-space file: .mat, .npz, .json or .csv")
    for key, what in (("A", "states"), ("B", "inputs"), ("C", "outputs"), ("D", "feed-through (default 0)")):
        p.add_argument(f"--{key}", metavar="MATRIX", help=what)
    p.add_argument("--builder", nargs="+", metavar=("BUILDER", "KEY=VALUE"), help="a plant from parameters, for example: string_of_vehicles vehicles=3 drag_per_s=1.0")
    p.add_argument("--sample-time", type=float, metavar="S", help="seconds")
    kind = p.add_mutually_exclusive_group()
    kind.add_argument("--discrete", action="store_true", help="the matrices are discrete already")
    kind.add_argument("--continuous", action="store_true", help="the matrices are continuous (default where the file does not say)")
    p.add_argument("--states", metavar="N[,N..]", help="names (default x1, x2 ..)")
    p.add_argument("--outputs", metavar="N[,N..]", help="names of the rows of C (default y1, y2 ..); of a builder: the states that are measured (default all)")
    p.add_argument("--inputs", metavar="N[,N..]", help="names of the columns of B (default u1, u2 ..)")
    p.add_argument("--measured-inputs", action="store_true", help="inputs are measured and sent like outputs; default: commands, which the plant applies as they are sent")
    p.add_argument("--range", action="append", default=[], metavar="NAME=LOW..HIGH", help="of a signal (default -10..10); may be given more than once")
    p.add_argument("--state-range", action="append", default=[], metavar="NAME=X", help="|state| in operation, for states that nothing else bounds")
    p.add_argument("--disturbance", type=float, default=0.01, metavar="X", help="bound of what moves each state besides the inputs, a sample (default 0.01; identify finds it)")
    p.add_argument("--noise", type=float, default=0.01, metavar="X", help="bound of every reading's noise (default 0.01; identify finds it)")
    p.add_argument("--out", metavar="FILE", help="default NAME.toml")
    p.add_argument("--force", action="store_true", help="overwrite a file that is there")
