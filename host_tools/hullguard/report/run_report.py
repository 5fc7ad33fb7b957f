"""The report of a finished run: one HTML file that needs nothing else, and one picture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg

from hullguard.design.judges import BANK, STATISTIC
from hullguard.errors import InputError
from hullguard.model.detector import PUBLISHED
from hullguard.report import polynomial_section, published, uio_section
from hullguard.report import run_figures as draw
from hullguard.report.page import RC, Cell, esc, num, page, percent, picture, plural, table, tile
from hullguard.report.run_data import FaultRun, Run, read_run

VERDICTS_MAX = 200  # rows of the table of changes
COUNTERS = {
    "good": "frames that passed their check and were used",
    "lost": "frames missed, by their sequence counter",
    "crc": "damaged frames",
    "format": "wrong length or kind",
    "repeated": "duplicates, ignored",
    "early": "stamped ahead of the open sample, treated as lost",
    "late": "stamped behind the open sample, treated as lost",
    "numeric": "frames with a value out of range, refused",
    "invalid": "frames with a value that its sender marked invalid",
    "unknown": "identifiers that are not the model's",
    "overdue": "samples closed without their closing frame",
}
GUARANTEE = (
    "Guaranteed: as long as the plant keeps to the model, its disturbances, noise, initial state, signal ranges and slews stay within the bounds the model "
    "states, and no corrupted frame passes its end-to-end check, no residual can exceed its threshold, whatever is sent late, lost or not at all; so a "
    "confirmed fault means that the plant or one of these bounds is broken."
)
UNSOUND = (
    "Not guaranteed here: that there is no false alarm. The threshold is the publication's zonotope, which drops generators instead of covering them and so can be "
    "smaller than what a healthy plant can show. It is there for comparison; detector.threshold exact or zonotope gives the guarantee."
)
STATISTICAL = (
    "Not guaranteed: that there is no false alarm. The thresholds of a polynomial filter hold with a probability that follows from the moments of the noise the model declares; "
    "an alarm means that a healthy plant would hardly have shown this. Verdicts that rest on such a filter alone say so: their basis is statistical."
)
LIMITS = (
    "Not guaranteed: that every fault is found (one that stays below the thresholds is not), or that frames are authentic: the check protects against errors, "
    "not against an attacker."
)
CLOSEST = " Of a bank |r| of the certificate with the largest |r|/J is shown; it may be another one in every sample."
CANDIDATES = (
    "A fault is a candidate as long as it alone can explain every alarm of an episode. Confirmed alarms exclude for good; what a provisional one "
    "excludes may come back. With a single fault present, it is among the candidates whenever the alarm is confirmed."
)
HYPOTHESES = "Above its threshold “not X” has shown that no course of fault X explains what was received."
MOVING = "The threshold moves: it is the largest value a healthy plant can show, given what the detector knows."
MOVING_STATISTICAL = "The thresholds are levels that a healthy plant seldom reaches; the plain one moves with what the filter expects and with the radii."
MOVING_PUBLISHED = "The threshold moves with what the detector knows."
BAND = "The detector works on values and radii only: the true reading has to lie in the band. A sensor's fault is in the reading that is sent, and in the band."


def write_run_report(directory: Path) -> Path:
    """Read a finished run's directory and write report.html into it."""
    run = read_run(directory)
    with mpl.rc_context(RC):
        text = page(f"Run of {run.info['model']}", _body(run, uio_section.read_estimates(directory, run.info), polynomial_section.read_filters(directory, run.info)))
    path = directory / "report.html"
    _write(path, text.encode())
    return path


def write_picture(directory: Path, png_path: Path) -> Path:
    """Residuals, events and verdict of a run as one PNG, 1200 pixels wide; of a long run what is around the first fault that was found."""
    run = read_run(directory)
    with mpl.rc_context(RC | {"savefig.facecolor": "white"}):
        zoom = draw.close_up(run)
        figure = draw.overview_figure(run, zoom[0] if zoom else draw.whole(run))
        FigureCanvasAgg(figure)
        try:
            figure.savefig(png_path, format="png", dpi=120, metadata={"Software": None})
        except OSError as error:
            raise InputError(f"{png_path}: cannot be written: {error.strerror}") from error
    return png_path


def _write(path: Path, data: bytes) -> None:
    try:
        path.write_bytes(data)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error


def _body(run: Run, estimates: Sequence[uio_section.Estimate], filters: Sequence[polynomial_section.Filter]) -> Iterator[str]:
    yield from _summary(run)
    whole = draw.whole(run)
    shown, hidden, judges = draw.chosen_residuals(run)
    if run.before:
        yield from published.section(run)
    yield from uio_section.section(run, estimates)
    yield from polynomial_section.section(run, filters)

    yield "<h2>Residuals and thresholds</h2>"
    left = ""
    if hidden:
        whose = f" ({plural(judges, 'generator')} as a whole)" if judges else ""
        left = f" {plural(hidden, 'residual')} not drawn here{whose}: those drawn alarmed first or came closest to their thresholds."
    yield f"<p>A fault is declared when a residual leaves its threshold. {_moving(run)}{esc(left)}</p>"
    zoom = draw.close_up(run)
    if zoom:
        w, fault = zoom
        yield picture(
            draw.residual_figure(run, w, draw.near(run, w, shown, 4)),
            "zoom",
            f"Residuals around fault {fault.label}",
            f"Around fault {fault.label} ({fault.spec}): residuals, dimensionless, that came closest to their thresholds.",
        )
    long = " Every column of the picture shows the least and the largest of its samples." if len(run.k) > 2 * draw.BINS else ""
    yield picture(
        draw.residual_figure(run, whole, shown),
        "residuals",
        "Residuals within their thresholds",
        f"Residuals, dimensionless, within ±J over the whole run.{CLOSEST if any(r.kind == BANK for r in shown) else ''}{long}",
    )
    if len(run.detecting) > 3:
        many = len({r.judge for r in run.detecting})
        yield picture(
            draw.ratio_figure(run, whole, run.detecting),
            "ratios",
            "All residuals relative to their thresholds",
            f"All {len(run.detecting)} residuals of {many} generators: |r|/J, the largest of each column.",
        )

    yield "<h2>Verdict</h2>"
    yield picture(
        draw.verdict_figure(run, whole),
        "verdict",
        "Verdict timeline",
        "What the detector said of the plant, and of the frames of each group, over the whole run. Where changes are too close to draw, the worst one shows.",
    )
    yield from _verdict_table(run)
    yield from _causes(run, whole, zoom[0] if zoom else None)

    yield "<h2>Events on the bus</h2>"
    yield picture(
        draw.event_figure(run, whole),
        "events",
        "Frames of each group",
        "When each group sent, how long it was silent before, and how often each interval occurred.",
    )
    yield _group_table(run)

    yield "<h2>Bus load</h2>"
    seconds = draw.load_window(run) * run.sample_time_s
    yield picture(
        draw.load_figure(run, whole),
        "load",
        "Bus load",
        f"All frames on the bus, averaged over the last {num(seconds)} s, at {num(run.bitrate / 1000)} kbit/s. Periodic: every group with every sample, same frames.",
    )
    yield _load_table(run)

    yield "<h2>Signals</h2>"
    yield f"<p>{esc(BAND)}</p>"
    if zoom:
        yield picture(draw.signal_figure(run, zoom[0]), "near", f"Signals around fault {zoom[1].label}", f"Around fault {zoom[1].label} ({zoom[1].spec}).")
    yield picture(draw.signal_figure(run, whole), "signals", "Signals as read and as known to the detector", f"The whole run.{long}")

    yield "<h2>Communication</h2>"
    yield _communication(run)
    yield "<h2>The run</h2>"
    yield _facts(run)


def _statistical(run: Run) -> bool:
    return any(j.kind == STATISTIC for j in run.judges)


def _moving(run: Run) -> str:
    """What moves the thresholds."""
    return MOVING_STATISTICAL if _statistical(run) else MOVING_PUBLISHED if run.info["threshold"] == PUBLISHED else MOVING


def _causes(run: Run, whole: draw.Window, zoom: draw.Window | None) -> Iterator[str]:
    """Which fault it may be, and how the others were excluded."""
    if not run.known_faults:
        return
    yield "<h2>Which fault it may be</h2>"
    yield f"<p>{esc(CANDIDATES)}</p>"
    if not any(v.plant in draw.ALARM_FILL for v in run.verdicts):
        yield "<p>There was no alarm, so there is no candidate.</p>"
    else:
        for w, name in ((zoom, "candidates-near"), (whole, "candidates")):
            if w is not None:
                yield picture(draw.candidate_figure(run, w), name, "Candidate faults", "When each fault of the model was a candidate" + (", close up." if w is zoom else "."))
    if run.isolating:
        yield picture(
            draw.ratio_figure(run, whole, run.isolating),
            "hypotheses",
            "Hypotheses relative to their thresholds",
            f"The {plural(len(run.isolating), 'bank')} of the hypotheses: |r|/J of the certificate that is closest to its threshold, the largest of each column. {HYPOTHESES}",
        )


# --- summary -------------------------------------------------------------------------------------------------------------


def _when(run: Run, k: int) -> str:
    return f"sample {k} ({num(k * run.sample_time_s, 5)} s)"


def _delay(run: Run, samples: float) -> str:
    return f"{num(samples)} sample{'' if samples == 1 else 's'} ({num(samples * run.sample_time_s)} s)"


def delay_of(f: FaultRun) -> float | None:
    """Samples from a fault's start to its detection."""
    return f.delay if f.delay is not None else None if f.detected is None else float(f.detected - f.start)


def headline(run: Run) -> str:
    """The run in one sentence or two."""
    alarms = run.info["false_alarms"]
    false = round(alarms["provisional"]), round(alarms["confirmed"])
    if not run.faults:
        first = "No fault was injected"
    elif len(run.faults) == 1:
        f, delay = run.faults[0], delay_of(run.faults[0])
        first = f"{f.spec} began at {_when(run, f.start)} and was " + (
            "not found" if delay is None else "found in the same sample" if delay == 0 else f"found {_delay(run, delay)} later"
        )
    else:
        found = [f for f in run.faults if f.detected is not None]
        slowest = max((delay_of(f) or 0.0 for f in found), default=0.0)
        first = f"{len(found)} of {len(run.faults)} faults {'was' if len(found) == 1 else 'were'} found" + (
            f", {'the slowest after ' if len(found) > 1 else 'after '}{_delay(run, slowest)}" if found else ""
        )
    if not any(false):
        second = "no false alarm"
    else:
        second = f"{plural(false[1], 'confirmed')} and {plural(false[0], 'provisional').removesuffix('s')} false alarm{'' if sum(false) == 1 else 's'}".replace(
            "confirmeds", "confirmed"
        )
    return f"{first}; {second}."


def _summary(run: Run) -> Iterator[str]:
    info = run.info
    seconds = num(len(run.k) * run.sample_time_s, 5)
    yield f"<h1>hullguard run: {esc(info['model'])}, scenario {esc(info['scenario'])}</h1>"
    length = f"{len(run.k)} samples, {seconds} s at {num(run.sample_time_s * 1000)} ms"
    how = f"bus {info['bus']}; {info['real']} arithmetic; seed {info['seed']}; model hash"
    yield f'<p class="note">{esc(length)}; {esc(how)} <code>{esc(info["model_hash"])}</code></p>'
    yield f'<p class="lead">{esc(headline(run))}</p>'
    yield '<div class="tiles">' + "".join(_tiles(run)) + "</div>"
    if run.faults:
        yield _fault_table(run)
    promise = STATISTICAL if _statistical(run) else UNSOUND if info["threshold"] == PUBLISHED else GUARANTEE
    yield f'<aside><p>{esc(promise)}</p><p class="note">{esc(LIMITS)}</p></aside>'


def _tiles(run: Run) -> Iterator[str]:
    info, frames = run.info, run.info["frames"]
    if run.faults:
        f = min(run.faults, key=lambda f: f.start)
        yield tile(
            "fault began" if len(run.faults) == 1 else f"first of {len(run.faults)} faults began",
            f"k = {f.start}",
            f"{num(f.start * run.sample_time_s, 5)} s: {f.name}, {f.kind}",
        )
        found = [f for f in run.faults if f.detected is not None]
        if len(run.faults) == 1:
            if found and f.detected is not None:
                confirmed = "not confirmed" if f.confirmed is None else "confirmed at once" if f.confirmed == f.detected else f"confirmed k = {f.confirmed}"
                yield tile("fault found", f"k = {f.detected}", f"{num(f.detected * run.sample_time_s, 5)} s, {confirmed}", "good")
            else:
                yield tile("fault found", "no", "not within this run", "bad")
        else:
            missed = len(run.faults) - len(found)
            yield tile("faults found", f"{len(found)} of {len(run.faults)}", "all of them" if not missed else f"{missed} not found", "bad" if missed else "good")
        delays = [d for d in (delay_of(f) for f in found) if d is not None]
        if delays:
            mean = sum(delays) / len(delays)
            longest = "" if len(delays) == 1 else f", longest {plural(round(max(delays)), 'sample')}"
            yield tile("delay (samples)" if len(delays) == 1 else "mean delay (samples)", num(mean), f"{num(mean * run.sample_time_s)} s{longest}")
    alarms = info["false_alarms"]
    confirmed, provisional = round(alarms["confirmed"]), round(alarms["provisional"])
    yield tile("false alarms", str(confirmed + provisional), f"{confirmed} confirmed, {provisional} provisional", "bad" if confirmed + provisional else "good")
    event = [g for g in run.groups if not draw.is_every_sample(g, len(run.k))]
    if event:
        sent, all_of_them = sum(g.frames for g in event), len(event) * len(run.k)
        yield tile("event frames sent", percent(sent / all_of_them), f"{sent} of {all_of_them} periodic")
    yield tile(
        "bits on the bus",
        percent(frames["bits"] / frames["bits_periodic"] if frames["bits_periodic"] else None),
        f"of periodic; mean load {percent(frames['load_mean'])}",
    )
    margin = info["margin_max"]
    yield tile("largest |r|/J" + (" before the fault" if run.faults else ""), num(margin), "alarm above 1", "" if margin is None else "good" if margin <= 1 else "bad")


def _fault_table(run: Run) -> str:
    rows = []
    for f in run.faults:
        found: object = Cell("not found", "bad") if f.detected is None else f.detected
        delay = delay_of(f)
        until = "end" if f.end is None else f.end
        rows.append([f.label, f.spec, f.start, until, found, f.confirmed, delay, None if delay is None else delay * run.sample_time_s, _named(f)])
    return table(["", "fault", "#start", "#until", "#detected", "#confirmed", "#delay (samples)", "#delay (s)", "candidates named"], rows)


def _named(f: FaultRun) -> str:
    """Candidates when the fault was detected, and what later alarms left of them."""
    first = ", ".join(f.candidates) or "–"
    return first if f.narrowed_at is None or f.narrowed_to == f.candidates else f"{first}; from k = {f.narrowed_at} {', '.join(f.narrowed_to) or draw.NO_SINGLE}"


# --- tables --------------------------------------------------------------------------------------------------------------


def _group_table(run: Run) -> str:
    rows = []
    for g in run.groups:
        sends = "every sample" if draw.is_every_sample(g, len(run.k)) else "by events"
        rows.append([g.name, sends, g.frames, percent(g.frames / len(run.k)), g.interval_min, g.interval_mean, g.interval_max])
    return table(["group", "sends", "#frames", "#of periodic", "#shortest interval", "#mean", "#longest"], rows, "Intervals in samples.")


def _load_table(run: Run) -> str:
    f = run.info["frames"]
    rows = [
        ["frames of measurements", f["measurement"], ""],
        ["frames, periodic sending", f["periodic"], "all groups, every sample, same codec"],
        ["frames on the bus", f["total"], "verdict and status frames included"],
        ["bits on the bus", f["bits"], "stuff bits and interframe space included"],
        ["bits, periodic sending", f["bits_periodic"], "all groups, every sample; without verdict and status frames"],
        ["load, mean", percent(f["load_mean"]), ""],
        ["load, 99 % of seconds below", percent(f["load_p99"]), ""],
        ["load, worst case of the design", percent(f["load_bound"]), "every sender at its shortest interval, longest stuffing"],
    ]
    if f.get("lockstep_replies"):
        rows.append(["answers in lockstep", f["lockstep_replies"], "frames that only pace the run; not counted above"])
    return table(["", "#value", ""], rows)


def _communication(run: Run) -> str:
    counters = run.info["communication"]
    rows = [[name.replace("_", " "), value, COUNTERS.get(name, "")] for name, value in counters.items() if isinstance(value, (int, float))]
    if not rows:
        return "<p>No counters.</p>"
    quiet = not any(value for name, value in counters.items() if name != "good" and isinstance(value, (int, float)))
    lead = "Nothing was lost, damaged, late or refused." if quiet else "What the detector's receive side met. What is lost, late or refused widens radii; it never raises an alarm."
    return f"<p>{esc(lead)}</p>" + table(["counter", "#count", "meaning"], rows)


def _verdict_table(run: Run) -> Iterator[str]:
    rows = [[v.k, num(v.k * run.sample_time_s, 6), v.plant, ", ".join(v.candidates) or "–", ", ".join(f"{g} {h}" for g, h in v.bus.items())] for v in run.verdicts[:VERDICTS_MAX]]
    more = "" if len(run.verdicts) <= VERDICTS_MAX else f"The first {VERDICTS_MAX} of {len(run.verdicts)}; all are in run.json."
    if rows:
        drawn = table(["#sample", "#time (s)", "plant", "may be", "bus"], rows, more)
        yield f"<details><summary>{plural(len(run.verdicts), 'change')} of the verdict</summary>{drawn}</details>"


def _facts(run: Run) -> str:
    info = run.info
    rows = [
        ["model", f"{info['model']}, hash {info['model_hash']}"],
        ["scenario", info["scenario"]],
        ["samples", f"{len(run.k)} of {num(run.sample_time_s * 1000)} ms"],
        ["seed", info["seed"]],
        ["arithmetic", info["real"]],
        ["bus", f"{info['bus']}, {num(run.bitrate / 1000)} kbit/s"],
        ["signals, groups, residuals", f"{len(run.signals)}, {len(run.groups)}, {len(run.residuals)}"],
        ["judged by", ", ".join(j.name for j in run.judges)],
    ]
    return table(["", ""], rows) + '<p class="note">All numbers come from run.json and signals.csv in the same directory; the same seed gives the same run.</p>'
