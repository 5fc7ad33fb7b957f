"""What each subcommand does, between the options (cli.py) and the modules that do the work."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from hullguard.bus import candump, choose, convert, formats
from hullguard.bus.link import opened
from hullguard.campaign import grid
from hullguard.campaign.campaign import Way, campaign, processes
from hullguard.campaign.case import Case, setup_of
from hullguard.campaign.chunks import Chunks
from hullguard.campaign.result import campaign_result, describe, write_results
from hullguard.campaign.table import check_table, table, write_table
from hullguard.codegen.c import Named
from hullguard.core.library import library
from hullguard.core.native import MOVING, REST, Native, Plant, Recording, Verdict
from hullguard.design import store, uio_sensors
from hullguard.design.design import Design, design, finish, stored_for
from hullguard.design.isolation import Pair, isolability
from hullguard.errors import BusError, ExpectationError, InputError
from hullguard.model import FaultSpec, Model, load_model, parse_fault, parse_override
from hullguard.model.schema import FAULTS_MAX, Scenario
from hullguard.plant.detect import Detector, from_bus, from_log
from hullguard.plant.estimates import estimate_facts, estimated, write_estimates
from hullguard.plant.filters import Followed, filter_facts, filter_words, filtered, write_filters
from hullguard.plant.recording import read_recording
from hullguard.plant.run import ALARMS, Bus, InProcess, OnCan, Pace, Run, Source, Trace, candidate_names, spoken, summary, write_files
from hullguard.plant.unknown import Continuous

INSIDE = "HULLGUARD_INSIDE"  # set for the copy of a command that runs where with-vcan made a bus
NODE_START_S = 20.0
ISOLABILITY_WINDOW = 30  # samples, for a model that has no bank


def say(args: argparse.Namespace, text: str) -> None:
    """A line for people: on stdout, or on stderr when stdout carries JSON."""
    if not args.quiet:
        print(text, file=sys.stderr if args.json else sys.stdout, flush=True)


def prepared(args: argparse.Namespace) -> tuple[Model, Design]:
    """The model with its overrides and scenario, and its design."""
    overrides = dict(parse_override(text) for text in args.set)
    model = load_model(args.model, overrides, getattr(args, "scenario", None))
    with progress(args, f"designing {model.name}") as tick:
        made, own = design(model, fresh=False, tick=tick, workers=os.cpu_count() or 1)
    if not own and not overrides and not model.scenario(getattr(args, "scenario", None)).set and store.read(store.path_of(model.path)) is None:
        _keep_design(args, model, made)
    return made.model, made


def _keep_design(args: argparse.Namespace, model: Model, made: Design) -> None:
    """A search is worth keeping beside the model, where that can be written."""
    path = store.path_of(model.path)
    with contextlib.suppress(OSError):
        store.write(path, model.path.stem, made.stored)
        say(args, f"design kept in {path.name}")


@contextlib.contextmanager
def progress(args: argparse.Namespace, title: str) -> Iterator[Callable[[str, int, int], None]]:
    """A progress bar on stderr for long work; silent where stderr is no terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    if not console.is_terminal or args.quiet:
        yield lambda what, step, total: None
        return
    with Progress(TextColumn(title), TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), console=console, transient=True) as bars:
        tasks: dict[str, Any] = {}

        def tick(what: str, step: int, total: int) -> None:
            if what not in tasks:
                tasks[what] = bars.add_task(what, total=total)
            bars.update(tasks[what], completed=step)

        yield tick


def make_folder(path: Path) -> None:
    """The folder of --out."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {path}: cannot be made a folder ({error.strerror}); name another") from error


def emit(args: argparse.Namespace, result: dict[str, Any]) -> None:
    """The JSON object, when asked for."""
    if args.json:
        print(json.dumps(result), flush=True)


# ---- design ----


def fixed_point(made: Design) -> dict[str, Any]:
    """Units of signals and residuals (numbers are times 2^unit) and what rounding adds to a threshold, or why there is none."""
    fixed = made.tables.fixed
    if fixed is None:
        return {"refused": made.tables.not_fixed}
    names = [s.name for g in fixed.groups for s in g.signals]
    return {"units": dict(zip(names, fixed.units, strict=False)), "residual_units": list(fixed.units[fixed.width :]), "rounding": list(made.fixed_rounding)}


def matrices(made: Design) -> list[dict[str, Any]]:
    """Matrices of every generator by the names of the method note."""
    rows = []
    for i, g in enumerate(made.generators):
        named = {
            "A": g.plant.A, "B": g.plant.B, "C": g.plant.C, "D": g.plant.D, "Ed": g.plant.Ed, "Fd": g.plant.Fd,
            "T": g.observer.T, "G": g.observer.G, "H": g.observer.H, "L": g.observer.L, "W": g.observer.W, "V": g.observer.V, "Qu": g.observer.Qu,
            "Lo": g.filter.Lo, "Mo": g.filter.Mo,
        }  # fmt: skip
        row: dict[str, Any] = {name: value.tolist() for name, value in named.items()}
        row["poles"] = [[float(p.real), float(p.imag)] for p in np.linalg.eigvals(g.observer.G)]
        row["outputs"] = [made.model.signals[made.model.outputs[i]].name for i in g.spec.outputs]
        row["inputs"] = [made.model.signals[made.model.inputs[i]].name for i in g.spec.inputs]
        row["smallest_fault"] = _by_fault(made, g.spec.faults, g.smallest)
        row["smallest_fault_first_draw"] = _by_fault(made, g.spec.faults, g.first)
        row["delay"] = {"size": g.spec.search.size, "samples": _by_fault(made, g.spec.faults, g.delay)}
        row["smallest_fault_without_trigger_aware_filter"] = _by_fault(made, g.spec.faults, g.blind)
        row["event_weight"] = made.stored.observers[i].weight if i < len(made.stored.observers) else None
        row["regularised"] = g.filter.regularised
        row["rounding"] = g.tables.rounding.tolist()
        row["threshold_steady"] = g.tables.steady.tolist()
        row["ready_samples"] = {"rest": g.tables.ready_rest, "moving": g.tables.ready_moving}
        rows.append(row)
    return rows


def _by_fault(made: Design, faults: Sequence[int], values: Any) -> dict[str, float | None]:
    return {made.model.faults[f].name: (float(v) if np.isfinite(v) else None) for f, v in zip(faults, values, strict=True)}


def _isolability(args: argparse.Namespace, made: Design) -> list[Pair]:
    """Which faults can be told apart: where the model isolates, or on demand, for it takes a linear programme a pair and sample."""
    wish = made.model.detector.isolation or (made.model.detector.bank if args.isolability else None)
    if wish is None and not args.isolability:
        return []
    with progress(args, "isolability") as tick:
        return isolability(made.model, wish.window if wish else ISOLABILITY_WINDOW, tuple(range(len(made.model.faults))), tick=tick)


def run_design(args: argparse.Namespace) -> int:
    """`hullguard design`."""
    from hullguard.codegen import write_all
    from hullguard.design.bank_facts import bank_facts
    from hullguard.report.design_banks import as_json
    from hullguard.report.design_report import write_design_report

    overrides = dict(parse_override(text) for text in args.set)
    model = load_model(args.model, overrides)
    asked = [uio_sensors.asked(model, text.split(",")) for text in args.sensors]
    with progress(args, f"designing {model.name}") as tick:
        stored, own = stored_for(model, args.fresh, tick, os.cpu_count() or 1)
    made = finish(model, stored)
    out = Path(args.out) if args.out else Path("build") / model.name
    make_folder(out)
    beside = store.path_of(model.path)
    if not own and not overrides:
        try:
            store.write(beside, model.path.stem, stored)
        except OSError as error:
            raise InputError(f"{beside}: cannot be written ({error.strerror}); copy the model to a folder of your own") from error
    elif overrides:
        store.write(out / f"{model.path.stem}.design.toml", model.path.stem, stored)
    write_all(made, out)
    report = out / f"{model.name}.html"
    pairs = _isolability(args, made)
    write_design_report(made, report, pairs)
    for c in made.checks:
        say(args, f"  {c.name}: {c.value:.4g} (limit {c.limit:.4g})")
    for i, g in enumerate(made.generators):
        found = ", ".join(f"{made.model.faults[f].name} {v:.3g}" for f, v in zip(g.spec.faults, g.smallest, strict=True))
        say(args, f"  generator {i + 1}: order {g.spec.order}, {g.observer.W.shape[0]} residuals, smallest fault: {found or 'none asked for'}")
    for p, name in zip(made.tables.polynomials, made.judges[len(made.judges) - len(made.tables.polynomials) :], strict=True):
        levels = f"kappa {p.kappa:.3g}, J2 {p.joint**0.5:.3g}, drift {p.drift**0.5:.3g}"
        say(args, f"  {name}: {p.lifted} lifted states, {4 * p.reals} bytes of RAM in float32; levels: {levels}")
    for i, u in enumerate(made.uios):
        radii = ", ".join(f"{name} {r:.3g}" for name, r in zip(u.names, u.tables.steady, strict=True))
        say(args, f"  unknown-input observer {i + 1}: radii {radii}")
    for s in asked:
        say(args, f"  sensors {', '.join(s.outputs)}: " + (f"an observer with {s.free} free poles" if s.why_not is None else f"no unknown-input observer: {s.why_not}"))
    for f in bank_facts(made):
        found = ", ".join(f"{made.model.faults[i].name} {v:.3g}" for i, v in zip(f.faults, f.smallest[:, 0], strict=True))
        say(args, f"  {f.name}: {f.table.certificates} certificates over {f.table.window} samples, smallest fault within {f.within[0]} samples: {found}")
    say(args, "  fixed point: " + (made.tables.not_fixed or f"rounding is at most {100 * max(made.rounding_shares('q31'), default=0.0):.2g} % of a threshold"))
    say(args, f"model {model.name}, hash {made.tables.hash:08x}: tables, DBC and report in {out}" + ("" if own else f"; search kept in {beside.name}" if not overrides else ""))
    emit(args, {
        "model": model.name, "model_hash": f"{made.tables.hash:08x}", "out": str(out), "generators": matrices(made),
        "slews": {s.name: stored.slew[i].tolist() for i, s in enumerate(model.signals)},
        "state_range": stored.state_range.tolist(),
        "checks": [{"name": c.name, "value": c.value, "limit": c.limit, "passed": c.passed} for c in made.checks],
        "load_bound": made.load_bound, "reused": own, "fixed_point": fixed_point(made), **as_json(made, pairs), **uio_sensors.as_json(model, asked),
    })  # fmt: skip
    return 0


# ---- run, replay ----


def the_faults(args: argparse.Namespace, model: Model, scenario: Sequence[FaultSpec], samples: int) -> list[FaultSpec]:
    """Faults of the command line, or else of the scenario; each must exist and start within the run."""
    faults = [parse_fault(text) for text in args.fault] if args.fault else ([] if args.no_fault else list(scenario))
    if len(faults) > FAULTS_MAX:
        raise InputError(f"{len(faults)} faults: a run has room for {FAULTS_MAX}")
    for f in faults:
        model.signal(f.name)
        if f.start >= samples:
            raise InputError(f"fault '{f}': it starts at sample {f.start}, the run has {samples}; use --samples or an earlier start")
    return faults


def emulated(native: Native, made: Design, scenario: Scenario, faults: Sequence[FaultSpec], samples: int, seed: int) -> Source:
    """The emulated plant of a scenario."""
    if made.model.uios:
        return Continuous(made, native, scenario, faults, samples, seed)
    if made.model.polynomials:
        return Followed(native, made, scenario.reference, faults, seed)
    return Plant(native, made, scenario.reference, faults, seed)


def run_run(args: argparse.Namespace) -> int:
    """`hullguard run`."""
    model, made = prepared(args)
    scenario = model.scenario(args.scenario)
    samples = args.samples or scenario.samples
    faults = the_faults(args, model, scenario.faults, samples)
    native = Native(library(args.real), made.tables)
    source = emulated(native, made, scenario, faults, samples, args.seed)
    return _drive(args, made, native, source, samples, faults, scenario.name, REST, {"figures": scenario.figures} if scenario.figures else {})


def run_replay(args: argparse.Namespace) -> int:
    """`hullguard replay`."""
    model, made = prepared(args)
    series = read_recording(Path(args.csv), model)
    samples = min(args.samples or len(series), len(series))
    faults = the_faults(args, model, (), samples)
    native = Native(library(args.real), made.tables)
    source = Recording(native, model, series, args.noise, faults, args.seed)
    return _drive(args, made, native, source, samples, faults, Path(args.csv).name, MOVING)


def _drive(
    args: argparse.Namespace,
    made: Design,
    native: Native,
    source: Source,
    samples: int,
    faults: list[FaultSpec],
    scenario: str,
    start: int,
    more: dict[str, Any] | None = None,
) -> int:
    """Find the bus, run, write what was asked for, judge. `more` goes into the result."""
    options = bus_options(args)
    if not options and args.bus == "auto" and choose.existing_vcan() is None and choose.launcher() is not None and INSIDE not in os.environ:
        return _drive_inside(args)
    out = Path(args.out) if args.out else None
    convert.wanted(args.formats, out)
    if out is not None:
        make_folder(out)
    with _bus(args, made, native, options, start) as (bus, pace, name):
        say(args, f"bus: {name}")
        log = candump.Writer(out / "run.log", name.split()[0] if not isinstance(bus, InProcess) else "vcan0") if out else None
        try:
            run = Run(made, native, bus, pace, log, start)
            trace = _loop(args, made, source, samples, run)
        finally:
            if log is not None:
                log.close()
    facts = {"bus": name, "seed": args.seed, "scenario": scenario} | (more or {})
    result = summary(made, native, trace, faults, facts) | ({} if isinstance(bus, InProcess) else run.told.facts())
    found = estimated(made, native.library, trace, start, source.emulated if isinstance(source, Continuous) else None)
    result |= estimate_facts(found) if found else {}
    filters = filtered(made, native.library, trace, source.states if isinstance(source, Followed) else None)
    result |= filter_facts(filters, faults) if filters else {}
    if out is not None:
        write_files(out, made, native, trace, faults, result)
        if found:
            write_estimates(out, made, found)
        if filters:
            write_filters(out, made, filters)
        from hullguard.codegen.dbc import emit_dbc

        (out / f"{made.model.name}.dbc").write_text(emit_dbc(made), encoding="utf-8")
        if INSIDE not in os.environ:
            _finish(args, out)
    _tell(args, result)
    emit(args, result)
    _agreed(run)
    return _expected(args, result)


def _agreed(run: Run) -> None:
    """Refuse a run with a node of another model, or with other verdicts than this process's."""
    if run.told.complaint is not None:
        raise ExpectationError(run.told.complaint)
    if run.mismatch:
        raise ExpectationError(f"the node's verdicts differ from this process's: {run.mismatch}")


def _drive_inside(args: argparse.Namespace) -> int:
    """The same command once more where with-vcan makes a bus; the report is drawn out here, where there is more processor."""
    os.environ[INSIDE] = "1"
    status = choose.inside(args.arguments)
    del os.environ[INSIDE]
    if args.out and (Path(args.out) / "run.json").is_file() and status in (0, 1):
        _finish(args, Path(args.out))
    return status


def _finish(args: argparse.Namespace, out: Path) -> None:
    """The other formats of the log, and the report."""
    for told in convert.beside(out / "run.log", convert.wanted(args.formats, out)):
        say(args, told)
    _report(args, out)


def _report(args: argparse.Namespace, out: Path) -> None:
    from hullguard.report.run_report import write_run_report

    say(args, f"report: {write_run_report(out)}")


def _loop(args: argparse.Namespace, made: Design, source: Source, samples: int, run: Run) -> Trace:
    from hullguard.report.live import LiveTable

    if args.json or args.quiet:
        return run.samples(source, samples)
    with LiveTable(made, samples) as table:

        def watch(k: int, trace: Trace) -> None:
            ratios = [abs(r) / J for r, J in zip(trace.r[-1], trace.J[-1], strict=True)]
            v = trace.verdict[-1]
            bus = dict(zip((g.name for g in made.tables.groups), v.bus, strict=True))
            table.update(k, trace.value[-1], trace.radius[-1], ratios, v.plant, bus, trace.counts["measurement"], candidate_names(made, v.candidates))

        return run.samples(source, samples, watch)


def bus_options(args: argparse.Namespace) -> dict[str, Any]:
    """python-can's options as they were given; empty when none was."""
    given = {k: getattr(args, k) for k in ("channel", "interface", "bitrate", "fd", "data_bitrate", "timing") if hasattr(args, k)}
    return given | (getattr(args, "bus_kwargs", None) or {})


@contextlib.contextmanager
def _bus(args: argparse.Namespace, made: Design, native: Native, options: dict[str, Any], start: int) -> Iterator[tuple[Bus, Pace, str]]:
    """The bus of a run, with a detector node at its other end."""
    speed = make_speed(args.speed)
    pace = Pace(speed != 1.0, speed)  # only a real-time run uses the node's timer; at any other speed the run is deterministic
    if not options and args.bus == "auto":
        found = choose.existing_vcan()
        if found is None and INSIDE in os.environ:
            raise BusError("with-vcan ended without a vcan; run it by hand with -v to see why, or use --bus inprocess")
        options = {"interface": "socketcan", "channel": found} if found else {}
    elif not options and args.bus != "inprocess":
        options = {"interface": "socketcan", "channel": args.bus}
    if not options:
        yield InProcess(), pace, "in process (no CAN bus)"
        return
    if options.get("interface") == "virtual":
        raise BusError("a virtual bus lives inside one process and has no second end; use --bus inprocess")
    if any(m.flags & candump.FD for m in [*(g.message for g in native.tables.groups), native.tables.verdict, native.tables.status]):
        options.setdefault("fd", True)
    with opened(**options) as link, launched(args, made, options, pace.lockstep, start):
        name = choose.describe(str(options.get("channel"))) if options.get("interface") == "socketcan" else f"{options.get('interface')}:{options.get('channel')}"
        yield OnCan(link, native, pace), pace, name


def make_speed(text: str) -> float:
    """--speed: a multiple of real time; infinity for max."""
    if text == "max":
        return math.inf
    try:
        speed = float(text)
    except ValueError:
        speed = float("nan")
    if not 0.0 < speed < 1e6:
        raise InputError(f"--speed '{text}': expected max, or a number above 0 (1 is real time)")
    return speed


def node_command(args: argparse.Namespace, made: Named, options: dict[str, Any], lockstep: bool, start: int, more: Sequence[str] = ()) -> list[str]:
    """The C node where it has this very model compiled in, with `more` options, otherwise the same library behind python-can."""
    flags = (["--lockstep"] if lockstep else []) + (["--rest"] if start == REST else [])
    if options.get("interface") == "socketcan" and args.real in ("f32", "f64"):
        binary = choose.NODE if args.real == "f32" else choose.NODE.with_name("detector_node_f64")
        if binary.is_file():
            listed = subprocess.run([str(binary), "--list"], capture_output=True, text=True, check=False).stdout.split("\n")
            if f"{made.model.name} {made.tables.hash:08x}" in listed:
                command = [str(binary), "--model", made.model.name, "--interface", str(options["channel"])]
                return [*command, *flags, *more]
    command = [sys.executable, "-m", "hullguard", "detect", args.model, "--quiet", "--ready", "--real", args.real]
    command += [x for text in args.set for x in ("--set", text)] + (["--scenario", args.scenario] if getattr(args, "scenario", None) else [])
    for key, value in options.items():
        if key == "fd":
            command += ["--fd"] if value else []
        elif key in ("interface", "channel", "bitrate", "data_bitrate"):
            command += [f"--{key.replace('_', '-')}", str(value)]
        else:
            command += ["--bus-kwargs", f"{key}={value}"]
    return command + flags


@contextlib.contextmanager
def launched(args: argparse.Namespace, made: Named, options: dict[str, Any], lockstep: bool, start: int, more: Sequence[str] = ()) -> Iterator[None]:
    """A detector node as a process of its own, ready before the first frame and ended after the last."""
    command = node_command(args, made, options, lockstep, start, more)
    say(args, f"node: {Path(command[0]).name if 'hullguard' not in command else 'hullguard detect'}, a process of its own")
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)
    try:
        assert process.stdout is not None
        if process.stdout.readline().strip() != "ready":
            raise BusError(f"the detector node did not start (exit status {process.wait(NODE_START_S)}): {' '.join(command)}")
        yield
    finally:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(5.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _tell(args: argparse.Namespace, result: dict[str, Any]) -> None:
    """The result for people."""
    frames, period = result["frames"], result["sample_time_s"]
    total, share = frames["bits"], frames["bits"] / max(1, frames["bits_periodic"])
    say(args, f"{result['samples']} samples, {frames['measurement']} measurement frames, {total} bits on the bus: {100 * share:.1f} % of periodic sending")
    for f in result["faults"]:
        began = f"fault {f['spec']}: began at sample {f['start']} ({f['start'] * period:g} s)"
        if f["detected_at"] is None:
            say(args, f"{began}, not found")
        else:
            sure = "confirmed at once" if f["confirmed_at"] == f["detected_at"] else f"confirmed at {f['confirmed_at']}" if f["confirmed_at"] is not None else "not confirmed"
            say(args, f"{began}, found at sample {f['detected_at']} ({f['delay']} samples, {f['delay'] * period:g} s), {sure}; may be: {', '.join(f['candidates'])}" + _narrowed(f))
    for v in result.get("isolation", []):
        say(args, _isolated(v))
    for row in result.get("filters", []):
        say(args, filter_words(row))
    alarms = result["false_alarms"]
    say(args, f"false alarms before the fault: {alarms['provisional']} provisional, {alarms['confirmed']} confirmed; largest |r|/J {result['margin_max']:.3f}")


def _isolated(v: dict[str, Any]) -> str:
    """What isolation says of a force that should not be there."""
    share = ", ".join(f"{name} {100 * s:.3g} %" for name, s in v["share"].items() if name in v["candidates"])
    return f"observer {v['observer']}: the cause is {v['cause']}" + (f", may be {', '.join(v['candidates'])}" if v["candidates"] else "") + (f"; missing: {share}" if share else "")


def _narrowed(f: dict[str, Any]) -> str:
    """What is left of a fault's candidates, where later alarms have excluded some."""
    if f["narrowed_at"] is None or f["narrowed_to"] == f["candidates"]:
        return ""
    return f"; from sample {f['narrowed_at']} on {', '.join(f['narrowed_to']) or 'no single one of them'}"


def _expected(args: argparse.Namespace, result: dict[str, Any]) -> int:
    """--expect."""
    alarms = result["false_alarms"]
    if args.expect == "quiet" and (alarms["provisional"] or any(f["detected_at"] is not None for f in result["faults"])):
        raise ExpectationError("expected a quiet run, but there was an alarm")
    if args.expect == "detect":
        if not result["faults"]:
            raise ExpectationError("expected a detection, but the run has no fault; give --fault")
        missed = [f["spec"] for f in result["faults"] if f["confirmed_at"] is None]
        if missed or alarms["provisional"]:
            raise ExpectationError(f"expected every fault to be found: missed {', '.join(missed) or 'none'}, false alarms {alarms['provisional']}")
    return 0


# ---- plant, detect ----


def run_plant(args: argparse.Namespace) -> int:
    """`hullguard plant`: the emulator alone."""
    model, made = prepared(args)
    scenario = model.scenario(args.scenario)
    samples = args.samples or scenario.samples
    faults = the_faults(args, model, scenario.faults, samples)
    native = Native(library(args.real), made.tables)
    source = emulated(native, made, scenario, faults, samples, args.seed)
    options = bus_options(args) or {"interface": "socketcan", "channel": choose.existing_vcan() or "vcan0"}
    pace = Pace(args.lockstep, make_speed(args.speed))
    with opened(**options) as link:
        run = Run(made, native, OnCan(link, native, pace), pace, start=MOVING if args.moving else REST)
        trace = run.samples(source, samples)
    result = summary(made, native, trace, faults, {"bus": str(options.get("channel")), "seed": args.seed, "scenario": scenario.name}) | run.told.facts()
    _tell(args, result)
    emit(args, result)
    _agreed(run)
    return 0


@contextlib.contextmanager
def signalled() -> Iterator[Callable[[], bool]]:
    """Whether SIGINT or SIGTERM has come; inside, neither ends the process by itself."""
    came: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        came.append(number)

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: bool(came)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def run_detect(args: argparse.Namespace) -> int:
    """`hullguard detect`."""
    from hullguard.report.live import may_be

    _, made = prepared(args)
    native = Native(library(args.real), made.tables)
    changes: list[dict[str, Any]] = []

    def watch(v: Verdict) -> None:
        row = spoken(made, v)
        if not changes or {**changes[-1], "k": v.k} != row:
            changes.append(row)
            say(args, f"k {v.k}: plant {v.plant}{may_be(v.plant, row['candidates'], bool(made.model.faults))}; bus {', '.join(f'{n} {s}' for n, s in row['bus'].items())}")

    start = REST if args.rest else MOVING
    if args.log:
        detector = Detector(native, start, False, None, watch, made.model.sample_time_s)
        from_log(detector, formats.read(Path(args.log)), args.samples or 0)
    else:
        options = bus_options(args)
        if not options:
            raise InputError("detect needs a bus (-i INTERFACE -c CHANNEL) or a log (--log FILE)")
        with signalled() as stopped, opened(**options) as link:
            period = None if args.lockstep else made.model.sample_time_s
            detector = Detector(native, start, args.lockstep, None if args.listen else link.send, watch, period)
            if args.ready:
                print("ready", flush=True)
            from_bus(detector, link, made.model.sample_time_s, not args.lockstep, args.samples or 0, stopped)
    health = detector.node.health()
    say(args, f"{detector.samples} samples; " + ", ".join(f"{n} {c}" for n, c in health.items() if c))
    emit(args, {
        "model": made.model.name, "model_hash": f"{made.tables.hash:08x}", "real": args.real, "samples": detector.samples, "communication": health, "verdicts": changes,
        **detector.told.facts(),
    })  # fmt: skip
    if detector.told.complaint is not None:
        raise ExpectationError(detector.told.complaint)
    alarms = [c for c in changes if c["plant"] in ALARMS]
    if args.expect == "quiet" and alarms:
        raise ExpectationError(f"expected quiet, but there was an alarm at sample {alarms[0]['k']}")
    if args.expect == "detect" and not alarms:
        raise ExpectationError("expected a detection, but there was no alarm")
    return 0


# ---- convert ----


def run_convert(args: argparse.Namespace) -> int:
    """`hullguard convert`."""
    made = convert.convert(Path(args.source), Path(args.target), args.channel, Path(args.dbc) if args.dbc else None)
    for told in made.losses:
        print(f"hullguard: {args.target}: {told}", file=sys.stderr)
    say(args, f"{made.frames} frames from {args.source} to {args.target}")
    emit(args, {"frames": made.frames, "source": args.source, "target": args.target, "losses": made.losses})
    return 0


# ---- campaign, report ----


def _campaign_designs(args: argparse.Namespace, keep: Path | None) -> list[tuple[dict[str, Any], Design]]:
    """A design for every combination of what --vary names; searches are kept in a folder, where there is one."""
    given = dict(parse_override(text) for text in args.set)
    made = []
    combinations = grid.combinations(args.vary)
    if combinations == [{}]:
        return [({}, prepared(args)[1])]
    for i, varied in enumerate(combinations):
        model = load_model(args.model, given | varied, args.scenario)
        path = keep / f"{model.sha256[:24]}.design.toml" if keep else None
        old = store.read(path) if path else None
        say(args, f"design {i + 1} of {len(combinations)}: {', '.join(f'{k} = {v}' for k, v in varied.items())}" + (" (kept)" if old else ""))
        with progress(args, f"designing {model.name}") as tick:
            stored = old or stored_for(model, False, tick)[0]
        if path and not old:
            store.write(path, model.path.stem, stored)
        made.append((varied, finish(model, stored)))
    return made


def _campaign_cases(args: argparse.Namespace, keep: Path | None) -> list[Case]:
    """The grid that the options span."""
    losses, bursts = grid.losses(args.loss), grid.bursts(args.loss_burst)
    sizes = grid.sizes(args.size) if args.size else []
    attack = grid.share("--attack", args.attack)
    cases = []
    for varied, made in _campaign_designs(args, keep):
        scenario = made.model.scenario(args.scenario)
        samples = args.samples or scenario.samples
        faults = the_faults(args, made.model, scenario.faults, samples)
        if args.plants and made.model.plant.interval is None:
            raise InputError(f"--plants: model {made.model.name} has no interval to draw from; give a parameter as {{ value = 1.0, pm = 0.1 }}")
        if attack and min((f.start for f in faults), default=1) < 1:
            raise InputError("--attack aims at samples before the first fault: let it start at sample 1 or later")
        if attack:
            _need_bounds(made.model, "--attack")
        base = Case(setup_of(made, args.real), samples, scenario.reference, (), args.seed, attack=attack, plants=args.plants, varied=tuple(varied.items()))
        cases += [replace(base, faults=f, loss=p, burst=b) for f in grid.fault_sets(faults, args.each_fault, sizes) for p in losses for b in bursts]
    return cases


@contextlib.contextmanager
def _way(args: argparse.Namespace) -> Iterator[Way]:
    """Where the chunks are worked off."""
    workers = args.workers or os.cpu_count() or 1
    if args.scheduler:
        from hullguard.campaign.cluster import cluster

        with cluster(args.scheduler, workers) as way:
            yield way
    else:
        yield processes(workers)


def run_campaign(args: argparse.Namespace) -> int:
    """`hullguard campaign`."""
    if args.runs < 1:
        raise InputError(f"--runs {args.runs}: expected at least 1")
    if args.inject:
        from hullguard.campaign.frames_command import run_frames

        return run_frames(args)
    if args.table:
        check_table(Path(args.table))
    out = Path(args.out) if args.out else None
    if out is not None:
        make_folder(out / "designs")
    cases = _campaign_cases(args, out / "designs" if out else None)
    kept = Chunks(out / "chunks") if out else None
    began = time.monotonic()
    with progress(args, "campaign") as tick, _way(args) as way:
        done = [0] * len(cases)

        def more(place: int, count: int) -> None:
            done[place] += count
            tick("runs", sum(done), args.runs * len(cases))

        parts = list(zip(cases, campaign(cases, args.runs, way, more, kept), strict=True))
    result = campaign_result(parts, args.scenario, _campaign_limits(args, cases))
    took = time.monotonic() - began
    notes = write_results(out, parts, result) if out else []
    if args.table:
        write_table(Path(args.table), table(parts))
    there = f"; {kept.found} runs were there already" if kept and kept.found else ""
    say(args, f"{len(cases)} case{'s' * (len(cases) > 1)}, {args.runs} runs of {result['samples']} samples each, in {took:.1f} s{there}")
    for line in [*describe(result), *notes]:
        say(args, line)
    emit(args, result)
    return _campaign_expected(args, result)


def _campaign_limits(args: argparse.Namespace, cases: Sequence[Case]) -> list[float | None]:
    if not args.limit:
        return []
    from hullguard.campaign.limit_case import limit_of

    with progress(args, "limit") as tick:
        found = []
        for i, case in enumerate(cases):
            found.append(limit_of(case, args.runs))
            tick("cases", i + 1, len(cases))
    return found


def _campaign_expected(args: argparse.Namespace, result: dict[str, Any]) -> int:
    provisional, faulty = result["provisional_alarm_runs"], "faults" in result
    if args.expect == "quiet" and (provisional or (faulty and result["detected_runs"])):
        raise ExpectationError(f"expected quiet runs: {provisional} had an alarm before any fault")
    if args.expect == "detect" and (not faulty or result["confirmed_runs"] < result["runs"] or provisional):
        raise ExpectationError("expected every run to find its fault, and none to alarm before")
    return 0


def _need_bounds(model: Model, what: str) -> None:
    """Refuse what reasons with the bounds of a linear plant."""
    if model.polynomials:
        raise InputError(f"{what}: model {model.name} has noise with a distribution and no bounds to choose within; choose a linear model")


def run_limit(args: argparse.Namespace) -> int:
    """`hullguard limit`."""
    from hullguard.campaign.limit_study import RUNS_TASK, LimitJob, limit_study
    from hullguard.report.limit_table import show_limits

    model, made = prepared(args)
    scenario = model.scenario(args.scenario)
    known = [f.name for f in model.faults]
    for name in args.fault:
        if name not in known:
            raise InputError(f"--fault '{name}': model {model.name} has no such fault: {', '.join(known) or 'none'}")
    faults, sizes = list(dict.fromkeys(args.fault or known)), _sizes(args.size)
    if not faults:
        raise InputError(f"model {model.name} has no faults to look for: add [[faults]]")
    _need_bounds(model, "limit")
    job = LimitJob(made.model, made.stored, args.real, args.window, args.samples or scenario.samples, scenario.reference, args.seed)
    with progress(args, "limit") as tick:
        done, total = [0], len(faults) * len(sizes) * -(-args.runs // RUNS_TASK)

        def more(count: int) -> None:
            done[0] += count
            tick("parts", done[0], total)

        rows = limit_study(job, faults, sizes, args.runs, args.workers or os.cpu_count() or 1, more)
    if not args.quiet:
        show_limits(rows, job.start, model.name, scenario.name, sys.stderr if args.json else sys.stdout)
    emit(args, {
        "model": model.name, "model_hash": f"{made.tables.hash:08x}", "real": args.real, "scenario": scenario.name, "seed": args.seed,
        "samples": job.samples, "start": job.start, "window": job.window, "rows": rows,
    })  # fmt: skip
    return 0


def _sizes(text: str) -> list[float]:
    """The numbers of --size, each once, in their order."""
    try:
        sizes = [float(part) for part in text.split(",")]
    except ValueError:
        sizes = []
    if not sizes or not all(math.isfinite(s) and s != 0.0 for s in sizes):
        raise InputError(f"--size '{text}': expected numbers other than 0, for example 0.5,1,2")
    return list(dict.fromkeys(sizes))


def run_report(args: argparse.Namespace) -> int:
    """`hullguard report`."""
    directory = Path(args.directory)
    if not directory.is_dir():
        raise InputError(f"{directory}: no such folder; give the --out folder of a run or campaign")
    if (directory / "campaign.json").is_file():
        from hullguard.report.campaign_report import write_campaign_report

        say(args, f"report: {write_campaign_report(directory)}")
        return 0
    from hullguard.fusion_commands import report

    if (status := report(args, directory)) is not None:
        return status
    _report(args, directory)
    if args.png:
        from hullguard.report.run_report import write_picture

        say(args, f"picture: {write_picture(directory, Path(args.png))}")
    return 0
