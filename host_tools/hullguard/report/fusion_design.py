"""The design report of a fusion filter: who may speak how often, what silence is worth, and the errors to expect."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from hullguard.design.fusion import LOSS_RATES
from hullguard.design.fusion_model import FusionDesign
from hullguard.report.page import BLUE, EDGE, GREEN, RC, esc, num, page, percent, picture, table, tile

SHOWN = (0.0, 0.05, 0.10, 0.15)


def _worth(facts: dict[str, Any]) -> Figure:
    """Share of a value that arrives with a frame, and with silence, a sensor."""
    figure = Figure(figsize=(9.2, 2.6), layout="constrained")
    axes = figure.subplots()
    names, rates = facts["sensors"], facts["rates"]
    silence = [(1.0 - r) * b for r, b in zip(rates, facts["silence_is_worth"]["0"], strict=True)]
    axes.barh(names, rates, color=BLUE, label="by frames")
    axes.barh(names, silence, left=rates, color=GREEN, label="by silence")
    axes.axvline(1.0, color=EDGE, linewidth=0.8)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.05)
    axes.set_xlabel("share of the information of periodic sending")
    axes.legend(loc="upper center", ncols=2, bbox_to_anchor=(0.5, 1.25))
    return figure


def write_fusion_design(made: FusionDesign, facts: dict[str, Any], path: Path) -> Path:
    """Write NAME.html."""
    model, t = made.model, made.tables
    rows = [
        [
            s.name,
            f"0x{s.message.id:X}",
            s.message.length,
            model.sensors[i].sigma,
            facts["delta"][i],
            facts["rates"][i],
            *(facts["silence_is_worth"][f"{p:g}"][i] for p in SHOWN),
        ]
        for i, s in enumerate(t.source)
    ]
    head = ["sensor", "frame", "#bytes", "#σ", "#δ, standard deviations", "#frames a sample", *(f"#silence at {100 * p:g} % loss" for p in SHOWN)]
    sets = [[", ".join(s["alive"]), ", ".join(f"{d:.3g}" for d in s["delta"]), ", ".join(f"{r:.3f}" for r in s["rates"])] for s in facts["sets"]]
    with mpl.rc_context(RC):
        figure = _worth(facts)
    share = facts["bytes"]["event"] / facts["bytes"]["periodic"]
    body = [
        f"<h1>{esc(model.name)}: design of a fusion filter</h1>",
        f'<p class="lead">{t.sensors} scalar sensors, {t.states} states, a sample every {num(model.sample_time_s)} s. A sensor speaks when the common prediction does not '
        "already say what it sees; its silence is information.</p>",
        '<div class="tiles">',
        tile("frames a sensor and sample", num(facts["rate"]), "without the heartbeat's"),
        tile("bytes", percent(share), "of periodic sending"),
        tile("bus load", percent(facts["load_bound"]), "at most"),
        tile("model hash", facts["model_hash"], "as in the status frame"),
        "</div>",
        "<h2>Sensors</h2>",
        table(head, rows, "Silence: the share of a value that it is worth, at that rate of lost frames."),
        picture(figure, "worth", "Information by frames and by silence", "What each sensor contributes without losses, by its frames and by its silence."),
        "<h2>Errors to expect</h2>",
        table(["state", "#standard deviation"], list(facts["predicted"].items()), "From the mean course of the covariance, without losses; no simulation is part of it."),
        "<h2>When a sensor is out</h2>",
        table(["sensors alive", "thresholds", "frames a sample"], sets, "Those that are left share the whole budget. Where they do not see every state, the first line serves."),
        f'<p class="note">Tables for loss rates {", ".join(num(p) for p in LOSS_RATES)}. Heartbeat {t.heartbeat_sensor} samples, watchdog {t.watchdog}.</p>',
    ]
    path.write_text(page(f"{model.name}: design", body), encoding="utf-8")
    return path
