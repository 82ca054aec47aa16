"""What the experiment expected, and whether it was so."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd


@dataclass(frozen=True)
class Expected:
    """One expectation in one condition and axis."""

    text: str
    """The expectation in words"""
    worst: float | None
    """The value of the repeat that is nearest to the limit, or furthest beyond it; None if nothing was measured"""
    met: bool


def judge(expectations: Sequence[Mapping[str, Any]], metrics: pd.DataFrame) -> list[Expected]:
    """Return each expectation with its worst value: it is met if every repeat of every condition and axis keeps it."""
    return [_judge(expectation, metrics) for expectation in expectations]


def _judge(expectation: Mapping[str, Any], metrics: pd.DataFrame) -> Expected:
    rows = metrics
    for column in ("metric", "controller", "phase", "axis", "condition"):
        wanted = expectation.get(column)
        if wanted is not None:
            rows = rows[rows[column] == wanted]
    below, above = expectation.get("below"), expectation.get("above")
    unit = rows["unit"].iloc[0] if len(rows) else ""
    bounds = [f"{word} {limit:g} {unit}".strip() for word, limit in (("below", below), ("above", above)) if limit is not None]
    where = " ".join(str(expectation[key]) for key in ("axis", "condition") if expectation.get(key))
    text = f"{expectation['metric']} of {expectation['controller']}, phase {expectation.get('phase', 'all')}"
    text = f"{text}{', ' + where if where else ''}: {' and '.join(bounds)}"
    values = rows["value"]
    if values.empty:
        return Expected(text, None, met=False)
    met = (below is None or bool((values < below).all())) and (above is None or bool((values > above).all()))
    return Expected(text, float(values.max() if below is not None else values.min()), met)
