"""Run inside with-vcan by test_node_process.py: what candump records is the log of the run, and canplayer gives it back."""

from __future__ import annotations

import contextlib
import io
import json
import re
import signal
import subprocess
import time
from pathlib import Path

import pytest
from hullguard.bus import candump
from hullguard.cli import main
from inside_support import WAIT_S, detect
from node_support import SEED

STAMP = re.compile(r"^\(\d{10}\.\d{6}\) ")


def run(arguments: list[object]) -> tuple[int, str]:
    """A command in this process."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        status = main([str(a) for a in arguments])
    return status, out.getvalue()


def bare(path: Path) -> list[str]:
    """Lines without their time stamp, which must be there."""
    lines = path.read_text().splitlines()
    assert all(STAMP.match(line) for line in lines)
    return [STAMP.sub("", line) for line in lines]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """model -> folder with a run's files and candump's log of it."""
    out = {}
    for model in ("platoon", "openacc"):
        folder = tmp_path_factory.mktemp(model)
        with (folder / "candump.log").open("w") as file:
            dump = subprocess.Popen(["candump", "-L", "-r", "4000000", "vcan0"], stdout=file)
            time.sleep(0.3)
            status, said = run(["run", model, "--seed", SEED, "--bus", "vcan0", "--out", folder, "--json"])
            time.sleep(0.3)
            dump.send_signal(signal.SIGINT)
            dump.wait(10)
        assert status == 0, said
        out[model] = folder
    return out


@pytest.mark.parametrize("model", ["platoon", "openacc"])
def test_candump_records_what_run_log_says(model: str, recorded: dict[str, Path]) -> None:
    own, seen = bare(recorded[model] / "run.log"), bare(recorded[model] / "candump.log")
    assert len(own) > 600 and own == seen


@pytest.mark.parametrize("model", ["platoon", "openacc"])
def test_canplayer_into_detect(model: str, recorded: dict[str, Path], tmp_path: Path) -> None:
    """The log played onto the bus, twenty times as fast as it was: the same verdict changes as in the run."""
    fast = tmp_path / "fast.log"
    fast.write_text("".join(candump.line(e.time_s / 20, e.channel, e.frame) + "\n" for e in candump.read(recorded[model] / "run.log")))
    result = json.loads((recorded[model] / "run.json").read_text())
    options = ("-i", "socketcan", "-c", "vcan0", "--rest", "--lockstep", "--listen", "--ready", "--json", "--samples", result["samples"])
    with detect(model, *options) as n:
        subprocess.run(["canplayer", "-I", str(fast)], check=True, timeout=WAIT_S)
        n.wait(30)
    assert n.status == 0, n.err
    told = json.loads(n.lines[-1])
    assert told["verdicts"] == result["verdicts"] and told["samples"] == result["samples"]
    assert any(v["plant"] == "confirmed" for v in told["verdicts"])


def test_canplayer_keeps_the_runs_pace(recorded: dict[str, Path], tmp_path: Path) -> None:
    """The stamps of run.log are a clock that canplayer can follow: 20 samples take two seconds."""
    first = [line for line, e in zip((recorded["platoon"] / "run.log").read_text().splitlines(), candump.read(recorded["platoon"] / "run.log"), strict=True) if e.time_s < 2.05]
    (tmp_path / "short.log").write_text("\n".join(first) + "\n")
    began = time.monotonic()
    subprocess.run(["canplayer", "-I", str(tmp_path / "short.log")], check=True, timeout=WAIT_S)
    assert 1.5 < time.monotonic() - began < 10


@pytest.mark.parametrize("log", ["run.log", "candump.log"])
@pytest.mark.parametrize("model", ["platoon", "openacc"])
def test_detect_reads_both_logs(model: str, log: str, recorded: dict[str, Path]) -> None:
    status, said = run(["detect", model, "--rest", "--log", recorded[model] / log, "--json"])
    told, result = json.loads(said), json.loads((recorded[model] / "run.json").read_text())
    assert status == 0 and told["verdicts"] == result["verdicts"]


def test_the_messages_carry_what_the_dbc_says(recorded: dict[str, Path]) -> None:
    """Every frame that candump saw is one of the DBC's, with its length."""
    import cantools

    for model, folder in recorded.items():
        database = cantools.database.load_file(folder / f"{model}.dbc")
        for entry in candump.read(folder / "candump.log"):
            message = database.get_message_by_frame_id(entry.frame.id)
            assert message.length == len(entry.frame.data)
            message.decode(entry.frame.data)
