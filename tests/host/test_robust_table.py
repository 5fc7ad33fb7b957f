"""firmware/README.md: every row of the table of misbehaviour names a test, and every test it names is there."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_every_row_names_tests_that_exist() -> None:
    lines = (ROOT / "firmware" / "README.md").read_text().splitlines()
    head = next(i for i, line in enumerate(lines) if line.startswith("| what comes |"))
    rows = [line.strip().strip("|").split("|") for line in lines[head + 2 : lines.index("### Replays") - 1]]
    code = "\n".join(f.read_text() for f in [*(ROOT / "tests" / "unit").glob("*.c"), *(ROOT / "tests" / "node").glob("*.py")])
    assert len(rows) > 40 and all(len(row) == 6 for row in rows), [row[0] for row in rows if len(row) != 6]
    for row in rows:
        names = re.findall(r"`([a-z]\w+)`", row[-1])
        assert names or "the same" in row[-1], row[0]
        assert all(re.search(rf"\b{name}\(", code) for name in names), (row[0], names)
