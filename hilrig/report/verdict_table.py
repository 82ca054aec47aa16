"""The verdict in words and as tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from hilrig.experiment.trial import ALL_PHASES
from hilrig.report.comparison import Verdict

Cell = tuple[str, str, str, str]
HEADLINES = ("force_rmse", "position_rmse", "auxiliary_error_rmse")
"""The metrics that the answer names; the tables show all"""


@dataclass(frozen=True)
class Entry:
    """One controller's value in a table row."""

    mean: float | None
    sd: float | None
    best: bool


@dataclass(frozen=True)
class VerdictRow:
    """One metric on one axis."""

    metric: str
    axis: str
    unit: str
    entries: list[Entry]
    basis: str


@dataclass(frozen=True)
class VerdictTable:
    """One phase of one condition."""

    condition: str
    phase: str
    rows: list[VerdictRow]


def verdict_tables(
    summary: pd.DataFrame, verdicts: Mapping[Cell, Verdict], controllers: tuple[str, ...]
) -> list[VerdictTable]:
    """Return a table for each condition and phase: the phases in their order, the whole trial last."""
    values = by_cell(summary)
    spans = dict.fromkeys((cell[0], cell[1]) for cell in shown_cells(values))
    return [
        VerdictTable(condition, phase, [_row(cell, rows, verdicts[cell], controllers) for cell, rows in values.items()
                                 if cell[:2] == (condition, phase)])
        for condition, phase in spans
    ]  # fmt: skip


def shown_cells(cells: Iterable[Cell]) -> list[Cell]:
    """Return the cells that the tables show: all, but of trials with one phase only those of the whole trial."""
    found = list(cells)
    spans = {(condition, phase) for condition, phase, *_ in found}
    several = {condition for condition, _ in spans if sum(other == condition for other, _ in spans) > 2}
    return [cell for cell in found if cell[1] == ALL_PHASES or cell[0] in several]


def by_cell(summary: pd.DataFrame) -> dict[Cell, dict[str, dict[str, Any]]]:
    """Return the rows of a summary by cell and controller."""
    found: dict[Cell, dict[str, dict[str, Any]]] = {}
    for row in summary.to_dict("records"):
        cell = (str(row["condition"]), str(row["phase"]), str(row["metric"]), str(row["axis"]))
        found.setdefault(cell, {})[str(row["controller"])] = {str(key): value for key, value in row.items()}
    return found


def _row(
    cell: Cell, values: Mapping[str, Mapping[str, Any]], verdict: Verdict, controllers: tuple[str, ...]
) -> VerdictRow:
    factor, unit = shown_unit(next(iter(values.values()))["unit"])
    entries = [
        Entry(factor * values[name]["mean"], factor * values[name]["sd"], verdict.best == name)
        if name in values
        else Entry(None, None, best=False)
        for name in controllers
    ]
    return VerdictRow(cell[2], cell[3], unit, entries, verdict.basis)


def shown_unit(unit: str) -> tuple[float, str]:
    """Return the factor and the unit for display: lengths are shown in millimetres."""
    return (1000.0, "mm") if unit == "m" else (1.0, unit)


def metric_title(kind: str) -> str:
    """Return the name of a metric as pages show it: "position RMSE" for position_rmse."""
    return kind.replace("_rmse", " RMSE").replace("_", " ")


def answer_question(verdicts: Mapping[Cell, Verdict], summary: pd.DataFrame, controllers: tuple[str, ...]) -> list[str]:
    """Return the answer: one sentence per condition, and one that counts the marks in all tables."""
    if len(controllers) < 2:
        return [f"Only one controller was run ({', '.join(controllers)}), so there is nothing to compare."]
    conditions = list(dict.fromkeys(cell[0] for cell in verdicts))
    values = by_cell(summary)
    sentences = [_sentence(condition, verdicts, values) for condition in conditions]
    marks = [verdicts[cell].best for cell in shown_cells(verdicts)]
    if not any(marks):
        return [*sentences, f"No controller is marked best in any of the {len(marks)} rows of the tables."]
    first, *others = controllers
    counts = ", ".join(
        [f"{first} is marked best in {marks.count(first)}", *(f"{n} in {marks.count(n)}" for n in others)]
    )
    return [*sentences, f"Of the {len(marks)} rows of the tables, {counts}, and none in {marks.count(None)}."]


def _sentence(condition: str, verdicts: Mapping[Cell, Verdict], values: Mapping[Cell, Any]) -> str:
    named = [cell for cell in verdicts if cell[:2] == (condition, ALL_PHASES) and cell[2] in HEADLINES]
    parts: list[str] = []
    unmarked: dict[str, list[str]] = {}
    for cell in sorted(named, key=lambda cell: HEADLINES.index(cell[2])):
        verdict = verdicts[cell]
        name = f"{metric_title(cell[2])} {cell[3]}".strip()
        if verdict.best is None:
            unmarked.setdefault(verdict.basis, []).append(name)
        else:
            row = values[cell][verdict.best]
            factor, unit = shown_unit(row["unit"])
            parts.append(f"{verdict.best} has the lowest {name} ({factor * row['mean']:.3g} {unit})")
    parts += [f"no verdict on {', '.join(names)} ({basis})" for basis, names in unmarked.items()]
    return f"Condition {condition}: {'; '.join(parts)}."
