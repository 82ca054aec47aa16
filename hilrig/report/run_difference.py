"""The paired difference of two runs, metric by metric."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from hilrig.core.errors import RunDirectoryError
from hilrig.report.comparison import CELL, interval
from hilrig.report.dataset import RunData, load_run, read_signals
from hilrig.report.measures import all_metrics, measure_trial, read_table, table, without

KEY = ["controller", *CELL]


def run_metrics(run: RunData) -> pd.DataFrame:
    """Return the metrics of a run's compared trials, from its metrics.csv or, if there is none, by measuring now."""
    stored = run.path / "metrics.csv"
    if stored.exists():
        return read_table(stored)
    metrics, failed, rows = all_metrics(), {}, []
    for trial in run.trials:
        signals = read_signals(trial) if trial.counts else None
        rows += measure_trial(trial, signals, metrics, failed) if signals else []
    return table(without(failed, rows))


def compare_runs(run_a: Path, run_b: Path) -> pd.DataFrame:
    """Return the difference b - a of every metric that both runs have, over the repeats that both completed.

    Columns: controller, condition, phase, metric, axis, unit, a, b, difference, relative, low, high, repeats. `low` and
    `high` are the 95 % confidence interval (Student's t) of the mean difference; they are infinite for fewer than two
    repeats, and if the seeds of the runs differ, because then repeats are not paired. `attrs["notes"]` lists what
    limits the comparison. Raises RunDirectoryError if a directory is not a run, or if the runs have nothing in common.
    """
    a, b = load_run(run_a), load_run(run_b)
    tables = [run_metrics(run) for run in (a, b)]
    first, second = (table.dropna(subset="value") for table in tables)
    both = first.merge(second.drop(columns=["trial", "unit"]), on=[*KEY, "repeat"], suffixes=("_a", "_b"))
    paired = a.manifest.get("seed") == b.manifest.get("seed")
    groups: Any = both.groupby(KEY, sort=False)
    rows = [_row(key, rows, paired) for key, rows in groups]
    columns = [*KEY, "unit", "a", "b", "difference", "relative", "low", "high", "repeats"]
    if not rows:
        raise RunDirectoryError(f"{run_a} and {run_b} have no controller, condition and phase in common")
    result = pd.DataFrame(rows, columns=columns)
    result.attrs["notes"] = _notes(a, b, len(first) + len(second) - 2 * len(both))
    return result


def _row(key: tuple[str, ...], rows: pd.DataFrame, paired: bool) -> tuple[object, ...]:
    a, b = rows["value_a"].to_numpy(), rows["value_b"].to_numpy()
    with np.errstate(invalid="ignore", divide="ignore"):
        differences = b - a
        relative = np.mean(differences) / np.abs(np.mean(a))
    low, high = interval(differences) if paired else (-np.inf, np.inf)
    means = (np.mean(a), np.mean(b), np.mean(differences))
    return (*key, rows["unit"].iloc[0], *means, relative, low, high, len(rows))


def _notes(a: RunData, b: RunData, unmatched: int) -> list[str]:
    """Return how the two runs differ as experiments, and what cannot be compared."""
    notes = [
        f"{what} differs: {a.manifest.get(what)} and {b.manifest.get(what)}"
        for what in ("name", "seed", "commit", "clock")
        if a.manifest.get(what) != b.manifest.get(what)
    ]
    if a.manifest.get("seed") != b.manifest.get("seed"):
        notes.append("the runs have different seeds, so repeats are not pairs and there is no interval")
    if a.experiment.get("period") != b.experiment.get("period"):
        notes.append("the periods differ, so chattering cannot be compared")
    if unmatched:
        notes.append(f"values that only one run has, left out: {unmatched}")
    return notes


def _signed(difference: float) -> str:
    """Return the difference with its sign; a dash if it is NaN, because both values are infinite."""
    return "–" if np.isnan(difference) else f"{difference:+.3g}"


def render(differences: pd.DataFrame) -> str:
    """Return the table of `compare` as text for a terminal, "*" where the interval excludes zero, with the notes."""
    table: Any = differences.itertuples()
    rows = [("controller", "condition", "phase", "metric", "first", "second", "change", "", "")]
    rows += [_cells(row) for row in table]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join(
            cell.ljust(width) if column < 4 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
    lines.append("Lower is better in every metric.")
    if any(row[-1] for row in rows):
        lines.append("* the 95 % confidence interval of the paired difference excludes zero")
    return "\n".join([*lines, *(f"note: {note}" for note in differences.attrs["notes"])])


def _cells(row: Any) -> tuple[str, ...]:
    name = " ".join(filter(None, (row.metric, row.axis, row.unit and f"[{row.unit}]")))
    mark = "*" if row.low > 0 or row.high < 0 else ""
    change = f"{row.relative:+.1%}" if np.isfinite(row.relative) else ""
    values = (f"{row.a:.4g}", f"{row.b:.4g}", _signed(row.difference))
    return (row.controller, row.condition, row.phase, name, *values, change, mark)
