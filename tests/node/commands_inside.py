"""commands_inside.py FILE: the hullguard commands of a JSON file {name: [argument, ..]}, one after another in one process (starting Python
costs seconds in a guest); what each printed and how it ended go to NAME.json beside the file."""

from __future__ import annotations

import contextlib
import io
import json
import sys
from pathlib import Path

from hullguard.cli import main


def one(arguments: list[str]) -> dict[str, object]:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = main(arguments)
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else 1
    return {"status": status, "out": out.getvalue(), "err": err.getvalue()}


file = Path(sys.argv[1])
for name, arguments in json.loads(file.read_text()).items():
    (file.parent / f"{name}.json").write_text(json.dumps(one(arguments)))
