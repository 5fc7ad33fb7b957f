"""The reports: self-contained, well-formed, complete, small enough, and clear about broken input."""

from __future__ import annotations

import io
import json
import math
import re
import shutil
import time
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hullguard.design.design import Design, design
from hullguard.errors import InputError
from hullguard.model.schema import load_model
from hullguard.report.design_report import write_design_report
from hullguard.report.live import LiveTable
from hullguard.report.run_data import read_run
from hullguard.report.run_report import headline, write_picture, write_run_report
from rich.console import Console

VOID = {"meta", "br", "hr", "img", "link", "input", "col"}


class Checker(HTMLParser):
    """Every tag is closed in order, no identifier is there twice, every reference inside the file has its target, none leads out of it."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: set[str] = set()
        self.wanted: set[str] = set()
        self.words: list[str] = []
        self.counts: dict[str, int] = {}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.counts[tag] = self.counts.get(tag, 0) + 1
        if tag not in VOID:
            self.open.append(tag)
        self._attributes(tag, attrs)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.counts[tag] = self.counts.get(tag, 0) + 1
        self._attributes(tag, attrs)

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open[-1] == tag, f"</{tag}> closes <{self.open[-1]}>"
        self.open.pop()

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    def _attributes(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert tag not in ("script", "iframe", "object", "embed", "link", "base"), tag
        names = [n for n, _ in attrs]
        assert len(names) == len(set(names)), f"<{tag}> has an attribute twice"
        for name, given in attrs:
            value = given or ""
            if name == "id":
                assert value not in self.ids, f"id {value} is there twice"
                self.ids.add(value)
            if name in ("href", "src", "action"):
                assert value.startswith(("#", "data:image/png;base64,")), value[:60]
                if value.startswith("#"):
                    self.wanted.add(value[1:])
            for target in re.findall(r"url\(([^)]*)\)", value):
                assert target.startswith("#"), target
                self.wanted.add(target[1:])


def check_html(path: Path) -> tuple[str, Checker]:
    """Text that a reader sees, and what was counted."""
    text = path.read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>")
    assert not re.search(r"https?:|//[a-z]+\.|@import", text)
    assert "NaN" not in text and ">nan<" not in text
    checker = Checker()
    checker.feed(text)
    checker.close()
    assert checker.open == []
    assert checker.wanted <= checker.ids, sorted(checker.wanted - checker.ids)[:5]
    return " ".join("".join(checker.words).split()), checker


def make_run(
    directory: Path,
    samples: int = 300,
    generators: int = 1,
    residuals: int = 2,
    groups: tuple[tuple[str, tuple[str, ...]], ...] = (("measurement", ("gap12_m", "gap23_m", "speed1_mps")), ("control", ("control1_mps2",))),
    faults: tuple[tuple[int, int | None, float], ...] = ((150, None, 1.0),),
    stale: tuple[int, int] | None = None,
    alarms: tuple[int, int] = (0, 0),
) -> dict[str, Any]:
    """A run's directory as the command leaves it. Faults are (start, end, size) on the first signal; the last group sends every sample."""
    rng = np.random.default_rng(7)
    directory.mkdir(parents=True, exist_ok=True)
    Ts, t = 0.1, np.arange(samples) * 0.1
    column: dict[str, np.ndarray] = {"time_s": t, "k": np.arange(samples)}
    fault = np.zeros(samples)
    for start, end, size in faults:
        fault[start : end if end else samples] += size
    events: dict[str, np.ndarray] = {}
    radius_sum, place = np.zeros(samples), 0
    for g, (name, members) in enumerate(groups):
        readings = []
        for _ in members:
            wave = sum(rng.uniform(0.2, 1.0) * np.sin(t / rng.uniform(0.8, 6.0) + rng.uniform(0, 6)) for _ in range(3))
            readings.append(wave + 0.01 * rng.uniform(-1, 1, samples) + (0.3 * fault if place == 0 else 0.0))
            place += 1
        y = np.array(readings).T
        event, held, value, radius, last = np.zeros(samples), y[0].copy(), np.zeros_like(y), np.zeros_like(y), -99
        for k in range(samples):
            lost = stale is not None and stale[0] <= k < stale[1] and g == 0
            if g == len(groups) - 1 or (not lost and (k - last >= 5 or np.any(np.abs(y[k] - held) > 0.05 * np.abs(held) + 0.05))):
                held, last, event[k] = y[k].copy(), k, 1.0
                radius[k] = 0.0005
            else:
                radius[k] = 0.05 * np.abs(held) + 0.05 if not lost else 20.0
            value[k] = held
        events[name] = event
        radius_sum += np.minimum(radius.mean(1), 1.0)
        for i, s in enumerate(members):
            column |= {s: y[:, i], f"{s}.value": value[:, i], f"{s}.radius": radius[:, i]}
    worst = np.zeros(samples)
    before = samples if not faults else faults[0][0]
    taps = 0.75 ** np.arange(30)
    for g in range(1, generators + 1):
        for i in range(1, residuals + 1):
            noise = np.convolve(rng.uniform(-1, 1, samples), taps)[:samples] * 0.5
            response = np.convolve(fault, taps)[:samples] * (2.2 if (g, i) == (1, min(2, residuals)) else 0.15)
            J = 3.0 + np.convolve(radius_sum, taps)[:samples] * 3.0 + 60 * 0.7 ** np.arange(samples)
            r = np.clip(noise, -0.8 * J, 0.8 * J) + response
            column |= {f"r{g}.{i}": r, f"J{g}.{i}": J}
            worst = np.maximum(worst, np.abs(r) / J)
    over = worst > 1
    plant = np.where(over, 3, 1)
    plant[:10] = 0
    found = []
    for start, end, _ in faults:
        hit = np.flatnonzero(over[start:end] if end else over[start:])
        at = int(start + hit[0]) if len(hit) else None
        if at is not None:
            plant[at : at + 2] = 2
        found.append((start, end, at))
    column["plant"] = plant
    bits = sum((e * 120 for e in events.values()), np.zeros(samples)) + 111 * (np.arange(samples) % 10 == 0)
    for name, e in events.items():
        column[f"event.{name}"] = e
    column["bits"] = bits
    names = list(column)
    rows = [",".join(f"{column[n][k]:.9g}" for n in names) for k in range(samples)]
    (directory / "signals.csv").write_text(",".join(names) + "\n" + "\n".join(rows) + "\n")

    words = ("starting", "none", "provisional", "confirmed")
    verdicts: list[dict[str, Any]] = []
    for k in range(samples):
        health = {name: "absent" if k < 1 else "stale" if stale and stale[0] + 9 <= k < stale[1] and i == 0 else "good" for i, name in enumerate(events)}
        suspects = [groups[0][1][0]] if plant[k] > 1 else []
        entry = {"k": k, "plant": words[plant[k]], "candidates": suspects, "bus": health}
        if not verdicts or {**entry, "k": verdicts[-1]["k"]} != verdicts[-1]:
            verdicts.append(entry)
    per_group = {}
    for name, e in events.items():
        steps = np.diff(np.flatnonzero(e))
        per_group[name] = {
            "frames": int(e.sum()),
            "interval_min": int(steps.min()),
            "interval_max": int(steps.max()),
            "interval_mean": float(steps.mean()),
            "histogram": {str(i): int((steps == i).sum()) for i in np.unique(steps)},
        }
    first = groups[0][1][0]
    info = {
        "model": "platoon",
        "model_hash": "1f3a99c0",
        "real": "f32",
        "threshold": "exact",
        "known_faults": [first],
        "judges": [{"name": f"observer {g + 1}", "kind": "observer", "residuals": residuals} for g in range(generators)],
        "bus": "in process",
        "bitrate": 500000,
        "samples": samples,
        "seed": 1,
        "sample_time_s": Ts,
        "scenario": "default",
        "frames": {
            "measurement": int(sum(e.sum() for e in list(events.values())[:-1])),
            "periodic": samples * len(groups),
            "total": int(sum(e.sum() for e in events.values())) + samples // 10,
            "bits": int(bits.sum()),
            "bits_periodic": 120 * samples * len(groups),
            "load_mean": float(bits.mean() / 5e4),
            "load_p99": float(np.quantile(bits, 0.99) / 5e4),
            "load_bound": 135 * (len(groups) + 1.1) / 5e4,
        },
        "per_group": per_group,
        "events": {"interval_min": 1, "interval_max": 5},
        "faults": [
            {
                "name": first,
                "kind": "bias",
                "spec": f"{first}:bias:1@{start}" + (f"..{end}" if end else ""),
                "start": start,
                "detected_at": at,
                "confirmed_at": None if at is None else at + 2,
                "delay": None if at is None else at - start,
                "fault": first,
                "candidates": [] if at is None else [first],
                "narrowed_at": None if at is None else at + 2,
                "narrowed_to": [] if at is None else [first],
            }
            for start, end, at in found
        ],
        "false_alarms": {"provisional": alarms[0], "confirmed": alarms[1]},
        "communication": {"crc_errors": 0, "lost_frames": 4 if stale else 0, "late_frames": 0},
        "margin_max": float(worst[10:before].max()),
        "verdicts": verdicts,
    }
    (directory / "run.json").write_text(json.dumps(info))
    labels = ["start,end,name,kind,size,signal"] + [f"{s},{e if e else ''},{first},bias,{size},{first}" for s, e, size in faults]
    (directory / "labels.csv").write_text("\n".join(labels) + "\n")
    return info


LARGE = tuple((f"car{i}", (f"speed{i}_mps", f"gap{i}_m", f"acceleration{i}_mps2")) for i in range(1, 6))


def test_small_run(tmp_path: Path) -> None:
    info = make_run(tmp_path / "a")
    began = time.monotonic()
    path = write_run_report(tmp_path / "a")
    assert time.monotonic() - began < 15
    assert path == tmp_path / "a" / "report.html"
    assert path.stat().st_size < 1_000_000
    text, seen = check_html(path)
    f = info["faults"][0]
    for expected in (
        info["model"],
        info["model_hash"],
        f["spec"],
        "k = 150",
        f"k = {f['detected_at']}",
        f"found {f['delay']} samples",
        "0 confirmed, 0 provisional",
        "alarm above 1",
    ):
        assert expected in text
    assert f"{info['margin_max']:.3g}" in text
    assert f"{100 * info['per_group']['measurement']['frames'] / 300:.3g} %" in text
    for frames in ("measurement", "periodic", "total", "bits", "bits_periodic"):
        assert str(info["frames"][frames]) in text
    for key in ("load_mean", "load_p99", "load_bound"):
        assert f"{100 * info['frames'][key]:.3g} %" in text
    for count in info["per_group"]["measurement"]["histogram"].values():
        assert str(count) in text
    for label in ("observer 1, r1", "observer 1, r2", "time (s)", "bus load (%)", "gap12 (m)", "speed1 (m/s)", "control1 (m/s²)", "late frames", "Guaranteed:"):
        assert label in text
    assert seen.counts["svg"] == 6


def test_same_input_same_bytes(tmp_path: Path) -> None:
    make_run(tmp_path / "a")
    shutil.copytree(tmp_path / "a", tmp_path / "b")
    assert write_run_report(tmp_path / "a").read_bytes() == write_run_report(tmp_path / "b").read_bytes()
    assert write_picture(tmp_path / "a", tmp_path / "a.png").read_bytes() == write_picture(tmp_path / "b", tmp_path / "b.png").read_bytes()


def test_large_run(tmp_path: Path) -> None:
    make_run(tmp_path, 10_000, 9, 2, LARGE, ((6000, 7000, 1.0),), stale=(2000, 2060))
    began = time.monotonic()
    path = write_run_report(tmp_path)
    assert time.monotonic() - began < 30  # 15 s on a free machine
    assert path.stat().st_size < 3_000_000
    text, seen = check_html(path)
    assert "10 residuals not drawn here (5 generators as a whole)" in text
    assert "Around fault F1" in text
    assert "18 residuals of 9 generators" in text
    assert seen.counts["svg"] == 10


def test_no_faults(tmp_path: Path) -> None:
    make_run(tmp_path, 120, faults=())
    text, _ = check_html(write_run_report(tmp_path))
    assert "No fault was injected; no false alarm." in text
    assert "fault found" not in text


def test_false_alarms(tmp_path: Path) -> None:
    make_run(tmp_path, 120, faults=(), alarms=(2, 1))
    assert headline(read_run(tmp_path)) == "No fault was injected; 1 confirmed and 2 provisional false alarms."
    assert "1 confirmed, 2 provisional" in check_html(write_run_report(tmp_path))[0]


def test_several_faults(tmp_path: Path) -> None:
    info = make_run(tmp_path, 600, 3, 2, faults=((100, 180, 1.0), (250, 330, 2.0), (335, 400, 0.02), (500, None, -1.5)))
    assert info["faults"][2]["detected_at"] is None
    text, _ = check_html(write_run_report(tmp_path))
    assert "3 of 4 faults were found" in text
    for label in ("F1", "F2", "F3", "F4", "not found", "1 not found"):
        assert label in text


def test_picture(tmp_path: Path) -> None:
    make_run(tmp_path, stale=(60, 90))
    data = write_picture(tmp_path, tmp_path / "run.png").read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert int.from_bytes(data[16:20], "big") == 1200
    assert len(data) < 500_000


def test_markup_in_names_is_text(tmp_path: Path) -> None:
    make_run(tmp_path)
    path = tmp_path / "run.json"
    path.write_text(path.read_text().replace('"scenario": "default"', '"scenario": "<script>alert(1)</script>"'))
    assert "<script>alert(1)</script>" in check_html(write_run_report(tmp_path))[0]


def test_infinite_thresholds(tmp_path: Path) -> None:
    make_run(tmp_path)
    lines = (tmp_path / "signals.csv").read_text().splitlines()
    place = lines[0].split(",").index("J1.1")
    for i in range(1, 9):
        fields = lines[i].split(",")
        fields[place] = "inf" if i % 2 else ""
        lines[i] = ",".join(fields)
    (tmp_path / "signals.csv").write_text("\n".join(lines) + "\n")
    check_html(write_run_report(tmp_path))


def edit_json(change: Callable[[dict[str, Any]], None]) -> Callable[[Path], None]:
    """Break run.json."""

    def apply(directory: Path) -> None:
        data = json.loads((directory / "run.json").read_text())
        change(data)
        (directory / "run.json").write_text(json.dumps(data))

    return apply


def edit_csv(change: Callable[[list[str]], list[str]]) -> Callable[[Path], None]:
    """Break signals.csv."""

    def apply(directory: Path) -> None:
        path = directory / "signals.csv"
        path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")

    return apply


def without(column: str) -> Callable[[list[str]], list[str]]:
    """signals.csv without a column."""

    def apply(lines: list[str]) -> list[str]:
        place = lines[0].split(",").index(column)
        return [",".join(f for i, f in enumerate(line.split(",")) if i != place) for line in lines]

    return apply


BROKEN: dict[str, tuple[Callable[[Path], None], str]] = {
    "no run.json": (lambda d: (d / "run.json").unlink(), r"run\.json: no such file"),
    "no signals.csv": (lambda d: (d / "signals.csv").unlink(), r"signals\.csv: no such file"),
    "no labels.csv": (lambda d: (d / "labels.csv").unlink(), r"labels\.csv: no such file"),
    "no JSON": (lambda d: _put(d / "run.json", "{"), r"run\.json: not valid JSON"),
    "JSON of another kind": (lambda d: _put(d / "run.json", "[1]"), r"run\.json: expected an object"),
    "no UTF-8": (lambda d: _put(d / "signals.csv", b"\xff\xfe\x00"), r"signals\.csv: not UTF-8"),
    "empty csv": (lambda d: _put(d / "signals.csv", ""), r"signals\.csv: empty"),
    "only names": (edit_csv(lambda lines: lines[:1]), r"signals\.csv: no samples"),
    "word in csv": (
        edit_csv(lambda lines: [*lines[:5], lines[5].replace(",", ",abc", 1), *lines[6:]]),
        r"signals\.csv: line 6, column 'k': 'abc5?4?' is not a number",
    ),
    "short line": (edit_csv(lambda lines: [*lines[:5], lines[5].rpartition(",")[0], *lines[6:]]), r"signals\.csv: line 6 has \d+ fields"),
    "no column k": (edit_csv(without("k")), r"column 'k' is missing"),
    "no threshold": (edit_csv(without("J1.2")), r"column 'J1\.2' is missing"),
    "no radius": (edit_csv(without("gap12_m.radius")), r"column 'gap12_m\.radius' is missing"),
    "no event": (edit_csv(without("event.measurement")), r"column 'event\.measurement' is missing"),
    "no bits": (edit_csv(without("bits")), r"column 'bits' is missing"),
    "time goes back": (edit_csv(lambda lines: [lines[0], lines[2], lines[1], *lines[3:]]), r"must be numbers that grow"),
    "no frames": (edit_json(lambda r: r.pop("frames")), r"key 'frames' is missing"),
    "load is text": (edit_json(lambda r: r["frames"].update(load_mean="much")), r"'load_mean' is 'much', expected a finite number"),
    "unknown verdict": (edit_json(lambda r: r["verdicts"][0].update(plant="well")), r"plant 'well' is not one of"),
    "unknown bus health": (edit_json(lambda r: r["verdicts"][0]["bus"].update(control="ill")), r"bus 'ill' is not one of"),
    "no judges": (edit_json(lambda r: r.pop("judges")), r"key 'judges' is missing"),
    "a judge too many": (edit_json(lambda r: r["judges"].append({"name": "bank of 4", "kind": "bank", "residuals": 1})), r"column 'r2\.1' is missing"),
    "unknown kind of judge": (edit_json(lambda r: r["judges"][0].update(kind="oracle")), r"kind 'oracle' is not one of"),
    "no time": (edit_json(lambda r: r.update(sample_time_s=0)), r"must be above 0"),
    "histogram": (edit_json(lambda r: r["per_group"]["control"].update(histogram={"a": 1})), r"'histogram' is not a count"),
    "label column": (lambda d: _put(d / "labels.csv", "start,name\n1,x\n"), r"labels\.csv: column 'end' is missing"),
    "label start": (lambda d: _put(d / "labels.csv", "start,end,name,kind,size,signal\nsoon,,x,bias,1,x\n"), r"labels\.csv: start 'soon' is not a sample"),
}


def _put(path: Path, data: str | bytes) -> None:
    path.write_bytes(data.encode() if isinstance(data, str) else data)


@pytest.mark.parametrize("case", BROKEN)
def test_broken_input(tmp_path: Path, case: str) -> None:
    make_run(tmp_path, 60, faults=())
    damage, message = BROKEN[case]
    damage(tmp_path)
    with pytest.raises(InputError, match=message) as caught:
        write_run_report(tmp_path)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "report.html").exists()


def test_report_into_a_missing_directory(tmp_path: Path) -> None:
    make_run(tmp_path / "a", 60, faults=())
    with pytest.raises(InputError, match=r"cannot be written"):
        write_picture(tmp_path / "a", tmp_path / "none" / "x.png")


# --- design report -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def platoon() -> Design:
    """The shipped design."""
    return design(load_model("platoon"))[0]


def test_design_report(tmp_path: Path, platoon: Design) -> None:
    path = tmp_path / "design.html"
    began = time.monotonic()
    write_design_report(platoon, path)
    assert time.monotonic() - began < 15
    assert path.stat().st_size < 1_500_000
    text, seen = check_html(path)
    for check in platoon.checks:
        assert check.name.removeprefix("generator 1: ") in text
    for matrix in ("G", "H", "L", "T", "W", "V", "Qu", "Lo", "Mo"):
        assert f"{matrix} (" in text
    for fault in platoon.model.faults[:3]:
        assert fault.name in text
    assert f"{platoon.generators[0].smallest[0]:.3g}" in text
    assert f"{100 * platoon.load_bound:.3g} %" in text
    assert "0x110" in text and "regularis" not in text
    assert seen.counts["svg"] >= 2
    write_design_report(platoon, tmp_path / "again.html")
    assert path.read_bytes() == (tmp_path / "again.html").read_bytes()


def test_design_report_says_when_it_was_regularised(tmp_path: Path, platoon: Design) -> None:
    g = platoon.generators[0]
    changed = replace(g, filter=replace(g.filter, regularised=1e-6), blind=np.full_like(g.blind, math.inf))
    stored = replace(platoon.stored, observers=(replace(platoon.stored.observers[0], regularised=1e-6),))
    write_design_report(replace(platoon, generators=(changed,), stored=stored), tmp_path / "d.html")
    text, _ = check_html(tmp_path / "d.html")
    assert "regularised" in text and "∞" in text


# --- live table ----------------------------------------------------------------------------------------------------------


def run_live(table: LiveTable, samples: int = 100) -> None:
    for k in range(samples):
        plant = "starting" if k < 5 else "none" if k < 60 else "confirmed"
        table.update(k, [1.0] * 6, [0.05] * 6, [0.3, 1.2 if k >= 60 else 0.4], plant, {"measurement": "good", "control": "good"}, k + k // 3)


def test_live_without_a_terminal_prints_changes_only(platoon: Design) -> None:
    out = io.StringIO()
    with LiveTable(platoon, 100, Console(file=out, force_terminal=False, width=120)) as table:
        run_live(table)
    lines = out.getvalue().splitlines()
    assert len(lines) == 3
    assert [line.split()[0] for line in lines] == ["k=0", "k=5", "k=60"]
    assert "plant confirmed" in lines[2] and "measurement good" in lines[2]


def test_live_on_a_terminal_is_throttled_and_leaves_the_last_state(platoon: Design) -> None:
    out = io.StringIO()
    began = time.monotonic()
    with LiveTable(platoon, 2000, Console(file=out, force_terminal=True, width=100, height=40, color_system="standard")) as table:
        run_live(table, 2000)
        drawn = table.drawn
    assert drawn <= 2 + 5 * (time.monotonic() - began)
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", out.getvalue())
    for expected in ("gap12_m", "speed1_mps", "observer 1, r2", "fault confirmed", "2000 of 2000 samples"):
        assert expected in text
    assert out.getvalue().count("\x1b[?25h") == out.getvalue().count("\x1b[?25l") > 0  # the cursor is back


def test_live_ends_cleanly_when_interrupted(platoon: Design) -> None:
    out = io.StringIO()
    with pytest.raises(KeyboardInterrupt), LiveTable(platoon, 10, Console(file=out, force_terminal=True, width=100, height=40)) as table:
        run_live(table, 10)
        raise KeyboardInterrupt
    assert out.getvalue().count("\x1b[?25h") == out.getvalue().count("\x1b[?25l") > 0
