"""The result of a campaign: one object for JSON, lines for people, and the files of its folder."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from hullguard.campaign.case import Case, Rows
from hullguard.campaign.summary import CONFIDENCE, summary
from hullguard.campaign.table import NO_PYARROW, has_parquet, table, write_table
from hullguard.core.native import LATER
from hullguard.errors import InputError

ROWS_MAX = 2000  # runs that are listed one by one; of more, the table has them


def campaign_result(parts: Sequence[tuple[Case, Rows]], scenario: str | None, limits: Sequence[float | None] = ()) -> dict[str, Any]:
    """What --json prints: all cases together, each case, and the rows of few runs."""
    first = parts[0][0]
    head: dict[str, Any] = {"model": first.setup.model.name, "real": first.setup.real, "scenario": first.setup.model.scenario(scenario).name, "confidence": CONFIDENCE}
    head["thresholds"] = sorted({case.setup.model.detector.threshold for case, _ in parts})
    head["basis"] = "statistical" if first.setup.model.polynomials else "set"
    shared = {k: v for k, v in first.labels().items() if all(case.labels()[k] == v for case, _ in parts)}
    told = names([case for case, _ in parts])
    cases = [{"case": i, "name": told[i], **case.labels(), **summary([(case, rows)])} for i, (case, rows) in enumerate(parts)]
    for case, limit in zip(cases, limits, strict=False):
        case["limit"] = limit
    result: dict[str, Any] = {**head, **shared, **summary(parts), "cases": cases}
    if result["runs"] <= ROWS_MAX:
        result["rows"] = [
            ({"case": i} if len(parts) > 1 else {}) | {name: values[n].item() for name, values in rows.items()}
            for i, (_, rows) in enumerate(parts)
            for n in range(len(rows["run"]))
        ]
    return result


def names(cases: Sequence[Case]) -> list[str]:
    """What tells each case from the others, in words."""
    labels = [{k: v for k, v in case.labels().items() if k not in ("model_hash", "size")} for case in cases]
    telling = [k for k in labels[0] if any(one[k] != labels[0][k] for one in labels)]
    return [", ".join(_told(k, one[k]) for k in telling) or "all" for one in labels]


def _told(key: str, value: Any) -> str:
    if key == "fault":
        return str(value) or "no fault"
    return f"{key.rpartition('.')[2].replace('_', ' ')} " + (f"{value:g}" if isinstance(value, (int, float)) else str(value))


def describe(result: dict[str, Any]) -> Iterator[str]:
    """Lines for people: all together, then each case."""
    yield (
        f"measurement frames {100 * result['measurement_share']:.1f} % of periodic, {result['frames_lost']} lost; "
        f"{100 * result['silent_share']:.1f} % of the samples in a silent phase"
    )
    yield (
        f"runs with a false alarm: {result['provisional_alarm_runs']} provisional, {result['false_alarm_runs']} confirmed of {result['runs']} "
        f"(with {100 * CONFIDENCE:.0f} % confidence fewer than {100 * result['false_alarm_upper']:.2g} %); largest |r|/J before a fault {result['margin_max']:.3f}"
    )
    if "attacked" in result:
        hard, easy = result["attacked"], result["not_attacked"]
        yield (
            f"largest |r|/J once the start is over: {hard['margin_settled_max']:.3f} in {hard['runs']} runs under attack (mean {hard['margin_settled_mean']:.3f}), "
            f"{easy['margin_settled_max']:.3f} in the other {easy['runs']} (mean {easy['margin_settled_mean']:.3f})"
        )
    many = len(result["cases"]) > 1
    for case in result["cases"]:
        if "faults" in case:
            delay = "never" if case["delay_mean"] is None else f"mean delay {case['delay_mean']:.2f} samples, longest {case['delay_max']}"
            delay += "" if case.get("limit") is None else f", limit {case['limit']:.2f}"
            yield f"{case['name'] if many else ', '.join(case['faults'])}: found in {case['detected_runs']} of {case['runs']} runs, {delay}"
            if "isolated_runs" in case:
                left = ", ".join(f"{name} {count}" for name, count in case["candidates_later"].items()) or "none"
                alone = f"the only one within {LATER} samples after detection in {case['isolated_runs']}"
                yield f"    always a candidate in {case['true_candidate_runs']}, {alone}; left by then: {left}"
        elif many:
            yield f"{case['name']}: {case['provisional_alarm_runs']} runs with a provisional alarm, {case['false_alarm_runs']} confirmed"


def write_results(out: Path, parts: Sequence[tuple[Case, Rows]], result: dict[str, Any]) -> list[str]:
    """campaign.json, the table, the report and its pictures; what is to be said about them."""
    from hullguard.report.campaign_report import write_campaign_report

    parquet = has_parquet()
    try:
        (out / "campaign.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        write_table(out / ("results.parquet" if parquet else "results.csv"), table(parts))
        report = write_campaign_report(out)
    except OSError as error:
        raise InputError(f"--out {out}: cannot be written ({error.strerror}); name another folder") from error
    return [f"report: {report}"] if parquet else [f"report: {report}; results as CSV: {NO_PYARROW}"]
