"""Judged claims as table rows, and the whole result as a machine-readable document."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from hilrig.experiment.expecting import ended_early
from hilrig.recording.run_directory import reason_of as ended_because
from hilrig.report.dataset import RunData, TrialEntry
from hilrig.report.expectations import Expected
from hilrig.study.evidence import Judged
from hilrig.study.loading import Loaded


def claim_rows(judged: Sequence[Judged]) -> list[dict[str, Any]]:
    """Return one row per part of each claim, and one for each claim that no trial can decide."""
    rows: list[dict[str, Any]] = []
    for i, item in enumerate(judged, start=1):
        head = {"number": i, "where": item.claim.where, "claim": item.claim.claim, "claim_result": item.result}
        if not item.evidence:
            rows.append({**head, "reason": item.claim.undecided})
        for found in item.evidence:
            part, judgement = found.part, found.judgement
            rows.append(
                {
                    **head,
                    "experiment": part.experiment, "condition": part.condition, "controller": part.controller,
                    "metric": part.metric, "axis": part.axis, "phase": part.phase, "measured": found.measured,
                    "claimed": found.claimed, "value": found.means[0] if found.means else None,
                    "against": found.means[1] if len(found.means) > 1 else None,
                    "mean": judgement.mean, "low": judgement.low, "high": judgement.high,
                    "unit": found.unit, "repeats": judgement.pairs, "result": judgement.result,
                    "reason": judgement.reason,
                }
            )  # fmt: skip
    return rows


def summary(
    loaded: Loaded,
    judged: Sequence[Judged],
    expected: Mapping[str, Sequence[Expected]],
    runs: Mapping[str, RunData],
    overrides: Sequence[str],
) -> dict[str, Any]:
    """Return the whole result in machine-readable form."""
    experiments = [
        {
            "name": name, "question": experiment.question, "trials": len(runs[name].trials),
            "completed": sum(trial.counts for trial in runs[name].trials),
            "not_completed": [{"trial": trial.id, "outcome": trial.ending, "reason": reason(trial),
                               "as_expected": runs[name].as_expected(trial)}
                              for trial in runs[name].trials if not trial.counts],
        }
        for name, experiment in loaded.experiments.items()
    ]  # fmt: skip
    expectations = [{"experiment": name, **_rounded(vars(item))} for name, items in expected.items() for item in items]
    claims = [
        {
            "number": i, "claim": item.claim.claim, "where": item.claim.where, "result": item.result,
            "reason": item.claim.undecided or item.claim.reason,
            "parts": [{"measured": found.measured, "claimed": found.claimed, "unit": found.unit,
                       **_rounded(vars(found.judgement))} for found in item.evidence],
        }
        for i, item in enumerate(judged, start=1)
    ]  # fmt: skip
    return {
        "title": loaded.study.title, "overrides": list(overrides), "results": counts(judged),
        "experiments": experiments, "expectations": expectations,
        "claims": claims, "figures": [spec.figure for spec in loaded.study.figures],
    }  # fmt: skip


def _rounded(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values rounded to the digits of the tables."""
    return {
        key: float(f"{value:.9g}") if isinstance(value, float) and math.isfinite(value) else value
        for key, value in values.items()
    }


def counts(judged: Sequence[Judged]) -> dict[str, int]:
    """Return the number of claims with each result."""
    results = [item.result for item in judged]
    return {result: results.count(result) for result in ("reproduced", "not reproduced", "cannot tell")}


def reason(trial: TrialEntry) -> str:
    """Return why a trial did not complete; for a failure only where to look, because its text contains file names."""
    return "see its log" if trial.ending == "failed" else ended_because(trial.outcome)


def ended(run: RunData) -> str:
    """Return how many trials of a run completed, and how many others ended as expected."""
    early = ended_early([trial.ending for trial in run.trials if run.as_expected(trial)])
    return f"{sum(trial.counts for trial in run.trials)} of {len(run.trials)}{early}"
