"""What the experiment expected, and whether it was so."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import pandas as pd

from hilrig.report.dataset import TrialEntry

KEYS = ("metric", "controller", "phase", "axis", "condition")


@dataclass(frozen=True)
class Expected:
    """One expectation in one condition and axis."""

    text: str
    """The expectation in words"""
    worst: float | None
    """The value of the repeat that is nearest to the limit, or furthest beyond it; None if nothing was measured"""
    met: bool
    missing: int
    """Trials it speaks of that did not complete: with one missing it is not met"""


def judge(
    expectations: Sequence[Mapping[str, Any]], metrics: pd.DataFrame, trials: Sequence[TrialEntry]
) -> list[Expected]:
    """Return each expectation with its worst value: it is met if every repeat of every condition and axis keeps it."""
    return [_judge(expectation, metrics, trials) for expectation in expectations]


def _judge(expectation: Mapping[str, Any], metrics: pd.DataFrame, trials: Sequence[TrialEntry]) -> Expected:
    keys = [key for key in KEYS if expectation.get(key) is not None]
    rows = [row for row in metrics.to_dict("records") if all(row[key] == expectation[key] for key in keys)]
    below, above = expectation.get("below"), expectation.get("above")
    text = _text(expectation, str(rows[0]["unit"]) if rows else "")
    missing = sum(not trial.completed and _speaks_of(expectation, trial) for trial in trials)
    values = [float(row["value"]) for row in rows]
    if not values:
        return Expected(text, None, False, missing)
    met = all((below is None or value < below) and (above is None or value > above) for value in values)
    return Expected(text, max(values, key=partial(_beyond, below, above)), met and not missing, missing)


def _speaks_of(expectation: Mapping[str, Any], trial: TrialEntry) -> bool:
    return expectation["controller"] == trial.controller and expectation.get("condition") in (None, trial.condition)


def _beyond(below: float | None, above: float | None, value: float) -> float:
    """Return how far `value` is beyond the nearer limit; negative within the limits, infinite for NaN."""
    over = -math.inf if below is None else value - below
    under = -math.inf if above is None else above - value
    return math.inf if math.isnan(value) else max(over, under)


def _text(expectation: Mapping[str, Any], unit: str) -> str:
    limits = ((word, expectation.get(word)) for word in ("below", "above"))
    bounds = " and ".join(f"{word} {limit:g} {unit}".strip() for word, limit in limits if limit is not None)
    where = "".join(f", {expectation[key]}" for key in ("axis", "condition") if expectation.get(key))
    subject = f"{expectation['metric']} of {expectation['controller']}, phase {expectation.get('phase', 'all')}"
    return f"{subject}{where}: {bounds}"
