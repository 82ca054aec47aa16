"""The verdict in words and as tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from hilrig.report.comparison import Verdict
from hilrig.report.dataset import ALL_PHASES

Cell = tuple[str, str, str, str]
HEADLINES = ("force_rmse", "position_rmse", "auxiliary_error_rmse")
"""The metrics that the answer names; the table has all"""


@dataclass(frozen=True)
class Entry:
    """One controller's place in a row."""

    mean: float | None
    sd: float | None
    best: bool


@dataclass(frozen=True)
class Row:
    """One metric on one axis."""

    metric: str
    axis: str
    unit: str
    entries: list[Entry]
    basis: str


@dataclass(frozen=True)
class Table:
    """One phase of one condition."""

    condition: str
    phase: str
    rows: list[Row]


def verdict_tables(
    summary: pd.DataFrame, verdicts: Mapping[Cell, Verdict], controllers: tuple[str, ...]
) -> list[Table]:
    """Return a table for each condition and phase, the phases in their order and the whole trial last."""
    tables = []
    for (condition, phase), rows in summary.groupby(["condition", "phase"], sort=False):
        cells = rows.groupby(["metric", "axis", "unit"], sort=False)
        lines = [
            _row(part, verdicts[str(condition), str(phase), metric, axis], metric, axis, unit, controllers)
            for (metric, axis, unit), part in cells
        ]
        tables.append(Table(str(condition), str(phase), lines))
    return tables


def _row(
    part: pd.DataFrame, verdict: Verdict, metric: str, axis: str, unit: str, controllers: tuple[str, ...]
) -> Row:
    values = {str(row["controller"]): row for _, row in part.iterrows()}
    entries = [
        Entry(float(values[name]["mean"]), float(values[name]["sd"]), verdict.best == name)
        if name in values
        else Entry(None, None, best=False)
        for name in controllers
    ]
    return Row(metric, axis, unit, entries, verdict.basis)


def answer(verdicts: Mapping[Cell, Verdict], summary: pd.DataFrame, controllers: tuple[str, ...]) -> list[str]:
    """Return the answer, a sentence for each condition, and one that counts the marks of the whole table."""
    if len(controllers) < 2:
        return [f"Only one controller, {controllers[0]}, was run: there is nothing to compare."]
    conditions = list(dict.fromkeys(cell[0] for cell in verdicts))
    sentences = [_sentence(condition, verdicts, summary) for condition in conditions]
    marks = [verdict.best for verdict in verdicts.values()]
    counts = ", ".join(f"{name} {marks.count(name)}" for name in controllers)
    none = marks.count(None)
    return [*sentences, f"Marked best in {len(marks)} cells of the table: {counts}; nobody in {none}."]


def _sentence(condition: str, verdicts: Mapping[Cell, Verdict], summary: pd.DataFrame) -> str:
    parts = []
    for (where, phase, metric, axis), verdict in verdicts.items():
        if where != condition or phase != ALL_PHASES or metric not in HEADLINES:
            continue
        name = f"{metric.replace('_rmse', ' RMSE').replace('_', ' ')} {axis}".strip()
        if verdict.best is None:
            parts.append(f"no verdict on {name} ({verdict.basis})")
        else:
            parts.append(f"{verdict.best} has the lowest {name} ({_mean(summary, (where, phase, metric, axis), verdict.best)})")
    return f"{condition}: {'; '.join(parts)}."


def _mean(summary: pd.DataFrame, cell: Cell, controller: str) -> str:
    keys = ["condition", "phase", "metric", "axis", "controller"]
    chosen = summary
    for key, value in zip(keys, (*cell, controller), strict=True):
        chosen = chosen[chosen[key] == value]
    return f"{chosen['mean'].iloc[0]:.3g} {chosen['unit'].iloc[0]}"
