"""What the rows of a campaign say."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.special import betaincinv

from hullguard.campaign.case import Case, Rows
from hullguard.model.table import Array

CONFIDENCE = 0.95


def upper_bound(hits: int, runs: int) -> float:
    """Exact (Clopper and Pearson) one-sided upper confidence bound of a probability that showed in `hits` of `runs`."""
    return 1.0 if hits >= runs else float(betaincinv(hits + 1, runs - hits, CONFIDENCE))


def summary(parts: Sequence[tuple[Case, Rows]]) -> dict[str, Any]:
    """One case, or several together."""
    rows = {name: np.concatenate([r[name] for _, r in parts]) for name in parts[0][1]}
    runs = len(rows["run"])
    possible = sum(len(r["run"]) * case.samples * case.senders for case, r in parts)
    samples = sum(len(r["run"]) * case.samples for case, r in parts)
    false = int((rows["false_confirmed"] > 0).sum())
    result: dict[str, Any] = {
        "runs": runs,
        "samples": parts[0][0].samples,
        "false_alarm_runs": false,
        "false_alarm_upper": upper_bound(false, runs),
        "provisional_alarm_runs": int((rows["false_provisional"] > 0).sum()),
        "measurement_share": float(rows["measurement"].sum() / max(1, possible)),
        "silent_share": float(rows["silent"].sum() / samples),
        "frames_lost": int(rows["lost"].sum()),
        "bits_mean": float(rows["bits"].mean()),
        **_margins(rows),
    }
    attacked = rows["attacked"] > 0
    if attacked.any():
        for name, chosen in (("attacked", attacked), ("not_attacked", ~attacked)):
            result[name] = {"runs": int(chosen.sum()), **_margins({k: v[chosen] for k, v in rows.items()})}
    if any(case.faults for case, _ in parts):
        result |= _found(parts)
    return result


def _margins(rows: Rows) -> dict[str, float]:
    """Largest |r|/J before a fault: over the whole run, and without the start, which the initial state decides."""
    return {
        "margin_max": float(rows["margin"].max(initial=0.0)),
        "margin_settled_max": float(rows["margin_settled"].max(initial=0.0)),
        "margin_settled_mean": float(rows["margin_settled"].mean()) if len(rows["run"]) else 0.0,
    }


def _delays(parts: Sequence[tuple[Case, Rows]], column: str) -> Array:
    """Samples from the first fault to the alarm, of the runs that had one."""
    each = [rows[column][rows[column] >= 0] - case.fault_start for case, rows in parts if case.fault_start is not None]
    return np.concatenate(each).astype(np.float64)


def _found(parts: Sequence[tuple[Case, Rows]]) -> dict[str, Any]:
    delays, sure = _delays(parts, "provisional_at"), _delays(parts, "confirmed_at")
    low, high = np.percentile(delays, [10, 90]).tolist() if len(delays) else (None, None)
    return {
        "faults": list(dict.fromkeys(str(f) for case, _ in parts for f in case.faults)),
        "detected_runs": len(delays),
        "confirmed_runs": len(sure),
        "delay_mean": float(delays.mean()) if len(delays) else None,
        "delay_p10": low,
        "delay_p90": high,
        "delay_max": int(delays.max()) if len(delays) else None,
        "confirmed_delay_mean": float(sure.mean()) if len(sure) else None,
        **_isolated(parts),
    }


def _isolated(parts: Sequence[tuple[Case, Rows]]) -> dict[str, Any]:
    """Where a detector isolates, and each run has one fault that the model names: was it always a candidate, and which were left within LATER samples after detection."""
    kept, alone, runs = 0, 0, 0
    left: Counter[str] = Counter()
    for case, rows in parts:
        named = [f.name for f in case.setup.model.faults]
        if case.setup.model.detector.isolation is None or len(case.faults) != 1 or case.faults[0].name not in named:
            return {}
        bit, found = 1 << named.index(case.faults[0].name), rows["provisional_at"] >= 0
        later = rows["candidates_later"][found]
        runs += int(found.sum())
        kept += int((rows["candidates_always"][found] & bit > 0).sum())
        alone += int((later == bit).sum())
        left.update({n: count for i, n in enumerate(named) if (count := int((later >> i & 1).sum()))})
    return {"true_candidate_runs": kept, "isolated_runs": alone, "candidates_later": dict(left)} if runs else {}
