"""results.py SAID FILE: what `make flips` promises, from what its parts have said."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "promises"))
from result import write_to

# Of each part, one for every line it says ok with.
PROMISES = {
    "garbage": ["a node, filter or observer started in memory that holds anything behaves to the bit like one started in zeros"],
    "calls": ["whatever system call of the SocketCAN backend fails once, with whatever errno, is answered by a status of the header, leaves nothing open, and does no harm later"],
    "platoon-plain": [
        "a bit of the platoon node's memory flipped between any two calls breaks nothing; lasting harm that nothing shows comes of members in known.json only",
        "under guard.h every single bit flipped between any two calls is detected, whatever byte it is in, and a new start alarms of nothing and comes back",
    ],
    "platoon_bank-plain": ["the same of the platoon with banks, between every seventh two calls", "the same under guard.h"],
    "platoon-asan": ["such flips lead to no access outside an object and to no undefined arithmetic", "the guard itself, too"],
}


def main() -> None:
    """What each part promises, and what it said."""
    said, out = Path(sys.argv[1]), Path(sys.argv[2])
    results = []
    for part, promises in PROMISES.items():
        lines = [line.removeprefix("  ok  ") for line in (said / part).read_text(encoding="utf-8").splitlines() if line.startswith("  ok  ")]
        results += zip(promises, lines, strict=True)
    write_to(out, results)


if __name__ == "__main__":
    main()
