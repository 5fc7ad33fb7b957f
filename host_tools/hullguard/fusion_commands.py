"""What each subcommand does with a model of kind "fusion". Commands that look for bounds, or need a detector of bounds, refuse it in one line."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from hullguard.bus import candump, choose, convert, formats
from hullguard.bus.link import opened
from hullguard.codegen.fusion import emit_dbc, write_all
from hullguard.commands import INSIDE, bus_options, emit, launched, make_folder, make_speed, say, signalled
from hullguard.core.library import library
from hullguard.core.native import MOVING, REST, Verdict
from hullguard.core.tracker import Tracker, TrackerNative
from hullguard.design import fusion_model
from hullguard.design.fusion import LOSS_RATES
from hullguard.design.fusion_model import FusionDesign, design_fusion
from hullguard.design.store import path_of
from hullguard.errors import BusError, ExpectationError, InputError
from hullguard.inject.codec import Codec, read_codec
from hullguard.model.faults import FaultSpec
from hullguard.model.fusion import FusionModel, FusionScenario, load_fusion, parse_sensor_fault
from hullguard.model.schema import parse_override
from hullguard.model.table import Array
from hullguard.plant import fusion as plant
from hullguard.plant.detect import Detector, from_bus, from_log
from hullguard.plant.told import ToldModel

FAULTS_MAX = 16


def prepared(args: argparse.Namespace) -> FusionDesign:
    """The model with its overrides, and its design."""
    overrides = dict(parse_override(text) for text in args.set)
    made, own = design_fusion(load_fusion(args.model, overrides))
    if not own and not overrides:
        with contextlib.suppress(OSError):
            fusion_model.write(path_of(made.model.path), made.model.path.stem, made.model, made.found)
    return made


# ---- design ----


def _design_facts(made: FusionDesign) -> dict[str, Any]:
    """Thresholds, what silence is worth, and predicted errors."""
    model, t, first = made.model, made.tables, made.found[0]
    deviation = np.sqrt(np.diag(made.told))
    worth = {f"{p:g}": [1.0 / (1.0 + r) if r >= 0.0 else 0.0 for r in row] for p, row in zip(LOSS_RATES, t.table[0].relax, strict=True)}
    return {
        "model": model.name,
        "kind": "fusion",
        "model_hash": f"{t.hash:08x}",
        "states": list(model.plant.states),
        "sensors": model.names,
        "trigger": model.trigger.kind,
        "rates": list(first.rates),
        "rate": float(np.mean(first.rates)),
        "delta": list(first.delta),
        "silence_is_worth": worth,
        "predicted": dict(zip(model.plant.states, deviation.tolist(), strict=True)),
        "sets": [{"alive": plant.names_of(made, f.alive), "delta": list(f.delta), "rates": list(f.rates)} for f in made.found],
        "bytes": {"event": float(np.dot(first.rates, [s.message.length for s in t.source])), "periodic": sum(s.message.length for s in t.source)},
        "load_bound": made.load_bound,
        "repeats": t.judge.repeats if t.judge else None,
    }


def run_design(args: argparse.Namespace) -> int:
    """`hullguard design`."""
    from hullguard.report.fusion_design import write_fusion_design

    overrides = dict(parse_override(text) for text in args.set)
    model = load_fusion(args.model, overrides)
    made, own = design_fusion(model, args.fresh)
    out = Path(args.out) if args.out else Path("build") / model.name
    make_folder(out)
    beside = path_of(model.path) if not overrides else out / f"{model.path.stem}.design.toml"
    if not own or overrides:
        try:
            fusion_model.write(beside, model.path.stem, model, made.found)
        except OSError as error:
            raise InputError(f"{beside}: cannot be written ({error.strerror}); copy the model to a folder of your own") from error
    write_all(made, out)
    facts = _design_facts(made)
    write_fusion_design(made, facts, out / f"{model.name}.html")
    for i, name in enumerate(model.names):
        worth = ", ".join(f"{facts['silence_is_worth'][p][i]:.3f}" for p in ("0", "0.05", "0.1", "0.15"))
        say(
            args,
            f"  {name}: speaks beyond {facts['delta'][i]:.4g} standard deviations, {facts['rates'][i]:.3f} frames a sample; "
            f"silence is worth {worth} of a value at 0, 5, 10, 15 % loss",
        )
    say(args, "  predicted standard deviations: " + ", ".join(f"{n} {v:.4g}" for n, v in facts["predicted"].items()))
    say(args, f"model {model.name}, hash {made.tables.hash:08x}: tables, DBC and report in {out}" + ("" if own else f"; thresholds kept in {beside.name}"))
    emit(args, facts | {"out": str(out), "reused": own})
    return 0


# ---- run, replay, plant ----


def _faults(args: argparse.Namespace, model: FusionModel, usual: tuple[FaultSpec, ...], samples: int) -> list[FaultSpec]:
    """Faults of the command line, or else of the scenario."""
    faults = [parse_sensor_fault(text) for text in args.fault] if args.fault else ([] if args.no_fault else list(usual))
    if len(faults) > FAULTS_MAX:
        raise InputError(f"{len(faults)} faults: a run has room for {FAULTS_MAX}")
    for f in faults:
        model.sensor(f.name)
        if f.start >= samples:
            raise InputError(f"fault '{f}': it starts at sample {f.start}, the run has {samples}; use --samples or an earlier start")
    return faults


def _emulated(args: argparse.Namespace, model: FusionModel, scenario: FusionScenario, samples: int) -> Array:
    if scenario.drive == "traffic":
        return plant.traffic_drive(model, samples, args.seed)
    return plant.noise_drive(model, scenario, samples, args.seed)


def run_run(args: argparse.Namespace) -> int:
    """`hullguard run`."""
    made = prepared(args)
    scenario = made.model.scenario(args.scenario)
    samples = args.samples or scenario.samples
    return _drive(args, made, _emulated(args, made.model, scenario, samples), scenario, samples, scenario.faults, scenario.name)


def run_replay(args: argparse.Namespace) -> int:
    """`hullguard replay`."""
    made = prepared(args)
    drive = plant.recorded_drive(made.model, Path(args.csv))
    scenario = FusionScenario(Path(args.csv).name, len(drive), "recording", 0.0, 0.0, -1, (), ())
    return _drive(args, made, drive, scenario, min(args.samples or len(drive), len(drive)), (), scenario.name)


def _drive(args: argparse.Namespace, made: FusionDesign, drive: Array, scenario: FusionScenario, samples: int, usual: tuple[FaultSpec, ...], name: str) -> int:
    """Find the bus, run, write what was asked for, judge."""
    options = bus_options(args)
    if not options and args.bus == "auto" and choose.existing_vcan() is None and choose.launcher() is not None and INSIDE not in os.environ:
        return _drive_inside(args)
    faults = _faults(args, made.model, usual, samples)
    native = TrackerNative(library(args.real), made.tables)
    out = Path(args.out) if args.out else None
    convert.wanted(args.formats, out)
    if out is not None:
        make_folder(out)
    sensors = plant.Sensors(made, drive, faults, scenario, args.seed)
    told: dict[str, str] = {}
    with _bus(args, made, native, options, told) as (bus, lockstep, speed, bus_name):
        say(args, f"bus: {bus_name}")
        log = candump.Writer(out / "run.log", bus_name.split()[0] if not isinstance(bus, plant.InProcess) else "vcan0") if out else None
        run = plant.Run(made, native, bus, lockstep, speed, log)
        try:
            trace = run.samples(drive, sensors, samples, _watch(args, made))
        finally:
            if log is not None:
                log.close()
    facts = {"bus": bus_name, "seed": args.seed, "scenario": name, "loss": scenario.loss, "late": scenario.late}
    result = plant.summary(made, native, trace, faults, facts)
    result["copies"]["node_digest"] = told.get("state.digest")
    result |= {} if isinstance(bus, plant.InProcess) else run.told.facts()
    if out is not None:
        plant.write_files(out, made, trace, faults, result)
        (out / f"{made.model.name}.dbc").write_text(emit_dbc(made), encoding="utf-8")
        if INSIDE not in os.environ:
            _finish(args, made, out)
    _tell(args, result)
    emit(args, result)
    return _judged(args, result, run)


def _judged(args: argparse.Namespace, result: dict[str, Any], run: plant.Run) -> int:
    """Nodes that differ, and --expect."""
    if run.told.complaint is not None:
        raise ExpectationError(run.told.complaint)
    if run.mismatch:
        raise ExpectationError(f"the node's frames differ from this process's: {run.mismatch}")
    copies = result["copies"]
    if run.lockstep and copies["node_digest"] not in (None, copies["digest"]):
        raise ExpectationError(f"the node's states have the digest {copies['node_digest']}, this process's {copies['digest']}: build both from the same sources")
    if result["copies"]["samples_unequal"]:
        raise ExpectationError(f"copies of the filter differ in {result['copies']['samples_unequal']} samples")
    found, false = [f["detected_at"] is not None for f in result["faults"]], result["false_alarms"]["confirmed"]
    if args.expect == "quiet" and (false or any(found)):
        raise ExpectationError("expected a quiet run, but a sensor was suspected")
    if args.expect == "detect" and (not found or not all(found) or false):
        raise ExpectationError(f"expected every fault to be found: {sum(found)} of {len(found)} were, false alarms {false}")
    return 0


def _drive_inside(args: argparse.Namespace) -> int:
    """The same command once more where with-vcan makes a bus; the report is drawn out here."""
    os.environ[INSIDE] = "1"
    status = choose.inside(args.arguments)
    del os.environ[INSIDE]
    if args.out and (Path(args.out) / "run.json").is_file() and status in (0, 1):
        _finish(args, prepared(args), Path(args.out))
    return status


def _finish(args: argparse.Namespace, made: FusionDesign, out: Path) -> None:
    """The other formats of the log, and the report."""
    from hullguard.report.fusion_report import write_fusion_report

    for told in convert.beside(out / "run.log", convert.wanted(args.formats, out)):
        say(args, told)
    say(args, f"report: {write_fusion_report(out, made)}")


def _watch(args: argparse.Namespace, made: FusionDesign) -> Callable[[int, plant.Trace], None] | None:
    """A line at each change of the verdict, for people."""
    if args.json or args.quiet:
        return None
    said: list[tuple[str, int]] = []

    def watch(k: int, trace: plant.Trace) -> None:
        v = trace.verdict[-1]
        if not said or said[-1] != (v.plant, v.candidates):
            said.append((v.plant, v.candidates))
            say(args, f"k={k} sensors: {v.plant}" + (f", {', '.join(plant.names_of(made, v.candidates))}" if v.candidates else ""))

    return watch


@contextlib.contextmanager
def _bus(args: argparse.Namespace, made: FusionDesign, native: TrackerNative, options: dict[str, Any], told: dict[str, str]) -> Iterator[tuple[plant.Bus, bool, float, str]]:
    """The bus of a run, with a node at its other end, whose counters go into `told` when it has ended."""
    speed = make_speed(args.speed)
    lockstep = speed != 1.0  # only a real-time run uses the node's timer; at any other speed the run is deterministic
    if not options and args.bus == "auto":
        found = choose.existing_vcan()
        if found is None and INSIDE in os.environ:
            raise BusError("with-vcan ended without a vcan; run it by hand with -v to see why, or use --bus inprocess")
        options = {"interface": "socketcan", "channel": found} if found else {}
    elif not options and args.bus != "inprocess":
        options = {"interface": "socketcan", "channel": args.bus}
    if not options:
        yield plant.InProcess(), True, speed, "in process (no CAN bus)"
        return
    if options.get("interface") == "virtual":
        raise BusError("a virtual bus lives inside one process and has no second end; use --bus inprocess")
    with tempfile.TemporaryDirectory() as folder:
        health = Path(folder) / "health"
        with opened(**options) as link, launched(args, made, options, lockstep, REST, ("--health", str(health))):
            yield plant.OnCan(link, native, lockstep), lockstep, speed, _name_of(options)
        if health.is_file():
            told.update((name, value) for name, value in map(str.split, health.read_text(encoding="ascii").splitlines()))


def _name_of(options: dict[str, Any]) -> str:
    """A bus by its name."""
    return choose.describe(str(options.get("channel"))) if options.get("interface") == "socketcan" else f"{options.get('interface')}:{options.get('channel')}"


def _tell(args: argparse.Namespace, result: dict[str, Any]) -> None:
    """The result for people."""
    frames = result["frames"]
    share, whole = frames["bits_sensors"] / max(1, frames["bits_sensors_periodic"]), frames["bits"] / max(1, frames["bits_periodic"])
    say(
        args,
        f"{result['samples']} samples, {frames['measurement']} sensor frames of {frames['periodic']}; {100 * share:.1f} % of the sensors' bits, "
        f"{100 * whole:.1f} % of all with tick, verdicts and estimates",
    )
    for name, e in result["errors"].items():
        say(args, f"  {name}: rms error {e['rms']:.4g}, predicted {e['predicted']:.4g}; within two standard deviations {100 * e['within_2_deviations']:.1f} %")
    for f in result["faults"]:
        began = f"fault {f['spec']}: began at sample {f['start']}"
        say(
            args,
            f"{began}, not found" if f["detected_at"] is None else f"{began}, found {f['delay']} samples later; suspected: {', '.join(f['candidates'])}, out of the fusion since",
        )
    copies = result["copies"]
    same = f", the node's {copies['node_digest']}" if copies.get("node_digest") else ""
    say(
        args,
        f"{copies['nodes']} copies of the filter, {copies['samples_unequal']} samples in which they differ, digest {copies['digest']}{same}; "
        f"false alarms: {result['false_alarms']['confirmed']}",
    )


def run_plant(args: argparse.Namespace) -> int:
    """`hullguard plant`: sensors and tick alone."""
    made = prepared(args)
    scenario = made.model.scenario(args.scenario)
    samples = args.samples or scenario.samples
    faults = _faults(args, made.model, scenario.faults, samples)
    native, drive = TrackerNative(library(args.real), made.tables), _emulated(args, made.model, scenario, samples)
    options = bus_options(args) or {"interface": "socketcan", "channel": choose.existing_vcan() or "vcan0"}
    with opened(**options) as link:
        run = plant.Run(made, native, plant.OnCan(link, native, args.lockstep), args.lockstep, make_speed(args.speed), start=MOVING if args.moving else REST)
        trace = run.samples(drive, plant.Sensors(made, drive, faults, scenario, args.seed), samples)
    facts = {"bus": str(options.get("channel")), "seed": args.seed, "scenario": scenario.name, "loss": scenario.loss, "late": scenario.late}
    result = plant.summary(made, native, trace, faults, facts)
    _tell(args, result)
    result |= run.told.facts()
    emit(args, result)
    if run.told.complaint is not None:
        raise ExpectationError(run.told.complaint)
    if run.mismatch:
        raise ExpectationError(f"the node's frames differ from this process's: {run.mismatch}")
    return 0


# ---- detect ----


class FusionDetector(Detector):
    """A node fed with frames from anywhere."""

    def __init__(self, native: TrackerNative, start: int, lockstep: bool, send: Any, watch: Callable[[Verdict], None], period_s: float | None) -> None:
        self.tracker = Tracker(native, start)
        self.told = ToldModel(native.library, native.tables.name, native.tables.hash, native.config.status, native.tables.status)
        super().begin(self.tracker, native.tables.tick.id, lockstep, send, watch, period_s)


def run_detect(args: argparse.Namespace) -> int:
    """`hullguard detect`."""
    made = prepared(args)
    native, changes = TrackerNative(library(args.real), made.tables), list[dict[str, Any]]()

    def watch(v: Verdict) -> None:
        row = plant.changes(made, [v])[0]
        if not changes or {**changes[-1], "k": v.k} != row:
            changes.append(row)
            suspects = f" ({', '.join(row['candidates'])})" if row["candidates"] else ""
            say(args, f"k {v.k}: sensors {v.plant}{suspects}; bus {', '.join(f'{n} {s}' for n, s in row['bus'].items())}")

    start, period = REST if args.rest else MOVING, made.model.sample_time_s
    if args.log:
        detector = FusionDetector(native, start, False, None, watch, period)
        from_log(detector, formats.read(Path(args.log)), args.samples or 0)
    else:
        options = bus_options(args)
        if not options:
            raise InputError("detect needs a bus (-i INTERFACE -c CHANNEL) or a log (--log FILE)")
        with signalled() as stopped, opened(**options) as link:
            detector = FusionDetector(native, start, args.lockstep, None if args.listen else link.send, watch, None if args.lockstep else period)
            if args.ready:
                print("ready", flush=True)
            from_bus(detector, link, period, not args.lockstep, args.samples or 0, stopped)
    health = detector.tracker.health()
    estimate = dict(zip(made.model.plant.states, detector.tracker.value, strict=True))
    say(args, f"{detector.samples} samples, digest {detector.tracker.digest:08x}; " + ", ".join(f"{n} {v:.4g}" for n, v in estimate.items()))
    emit(args, {
        "model": made.model.name, "model_hash": f"{made.tables.hash:08x}", "real": args.real, "samples": detector.samples,
        "digest": f"{detector.tracker.digest:08x}", "estimate": estimate, "communication": health, "verdicts": changes, **detector.told.facts(),
    })  # fmt: skip
    if detector.told.complaint is not None:
        raise ExpectationError(detector.told.complaint)
    alarms = [c for c in changes if c["candidates"]]
    if args.expect == "quiet" and alarms:
        raise ExpectationError(f"expected quiet, but a sensor was suspected at sample {alarms[0]['k']}")
    if args.expect == "detect" and not alarms:
        raise ExpectationError("expected a detection, but no sensor was suspected")
    return 0


# ---- which command ----


def codec(args: argparse.Namespace) -> Codec:
    """What `inject` knows of the model's frames: its DBC."""
    made = prepared(args)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{made.model.name}.dbc"
        path.write_text(emit_dbc(made), encoding="utf-8")
        return read_codec(path)


def report(args: argparse.Namespace, directory: Path) -> int | None:
    """`hullguard report` of a fusion run's folder; None for another one."""
    told = directory / "run.json"
    result = json.loads(told.read_text(encoding="utf-8")) if told.is_file() else {}
    if result.get("kind") != "fusion":
        return None
    from hullguard.report.fusion_report import write_fusion_report

    made, _ = design_fusion(load_fusion(result["model"]))
    say(args, f"report: {write_fusion_report(directory, made)}")
    return 0


COMMANDS = {"design": run_design, "run": run_run, "replay": run_replay, "detect": run_detect, "plant": run_plant}
INSTEAD = {
    "freeze": "its filter has no residuals to keep; run --out writes what every sample showed",
    "monitor": "hullguard detect MODEL prints its verdicts, and the DBC of hullguard design shows its frames in any CAN tool",
    "campaign": "make fusion-study judges it over thousands of runs, and run --out puts its figures into the report",
    "limit": "a limit is that of bounds, and this filter has probabilities; see make fusion-study",
}


def dispatch(args: argparse.Namespace) -> int:
    """The command, or a line that says which one to take."""
    if args.command not in COMMANDS:
        raise InputError(f'{args.command} does not take a model of kind "fusion": {INSTEAD[args.command]}')
    return COMMANDS[args.command](args)
