"""The tidy table of metrics: one row per trial, phase, metric and axis."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterator, Mapping, MutableMapping
from typing import Any

import numpy as np
import pandas as pd

from hilrig.core.errors import PluginError, RunDirectoryError
from hilrig.core.interfaces import Metric
from hilrig.experiment.trial import ALL_PHASES
from hilrig.kinds import registry as plugins
from hilrig.kinds.metrics._record import PhaseRecord
from hilrig.kinds.user_files import code_of
from hilrig.report.dataset import TrialEntry, TrialSignals

METRIC_COLUMNS = ("trial", "controller", "condition", "repeat", "phase", "metric", "axis", "value", "unit")

_TYPES: Any = {**dict.fromkeys(METRIC_COLUMNS, str), "repeat": int, "value": float}

_OVER_TIME = (
    "tick", "time", "position", "velocity", "acceleration", "force", "reference_position", "reference_velocity",
    "reference_acceleration", "reference_force", "torque", "late",
)  # fmt: skip


def all_metrics() -> dict[str, Metric]:
    """Return every metric that can be loaded, with its default parameters, by kind."""
    return {kind: cls() for kind, cls in plugins.load_kinds("metrics")[0].items()}


def spans(record: PhaseRecord, phases: list[Mapping[str, Any]]) -> Iterator[tuple[str, PhaseRecord]]:
    """Yield (name, record) of each phase with recorded ticks, then of the whole trial under "all"."""
    record = _read_only(record)
    for phase in phases:
        first, last = (round(phase[edge] / record.period) for edge in ("start", "end"))
        rows = np.flatnonzero((record.tick >= first) & (record.tick < last))
        if rows.size:
            yield phase["name"], _cut(record, int(rows[0]), int(rows[-1]) + 1)
    yield ALL_PHASES, record


def _cut(record: PhaseRecord, first: int, last: int) -> PhaseRecord:
    """Return rows first to last - 1 as the record of one phase."""
    changed: dict[str, Any] = {name: getattr(record, name)[first:last] for name in _OVER_TIME}
    desired = record.reference_position
    step = desired[first] - desired[first - 1] if first else record.reference_step
    return dataclasses.replace(record, phases=1, reference_step=step, **changed)


def measure_trial(
    trial: TrialEntry, signals: TrialSignals, metrics: Mapping[str, Metric], failed: MutableMapping[str, str]
) -> list[tuple[Any, ...]]:
    """Return the rows of one trial, in the order of `METRIC_COLUMNS`.

    A metric that fails gives no row. Its kind and the reason go into `failed`, and it is not called again.
    """
    head = (trial.id, trial.controller, trial.condition, trial.repeat)
    rows = []
    for phase, record in spans(signals.record, trial.document["phases"]):
        for kind, metric in metrics.items():
            try:
                values = {} if kind in failed else _values(metric, record)
            except PluginError as error:
                failed[kind] = str(error)
            else:
                rows += [(*head, phase, kind, axis, value, metric.unit) for axis, value in values.items()]
    return without(failed, rows)


def without(failed: Collection[str], rows: list[tuple[Any, ...]]) -> list[tuple[Any, ...]]:
    """Return the rows of the metrics that did not fail."""
    return [row for row in rows if row[METRIC_COLUMNS.index("metric")] not in failed]


def _values(metric: Metric, record: PhaseRecord) -> dict[str, float]:
    """Return what a metric measures, by axis. Raises PluginError if it fails or returns something else."""
    with code_of(metric):
        found = metric.measure(record)
        if not isinstance(found, Mapping):
            raise TypeError(f"measure returned a {type(found).__name__}; it must return a dict: axis -> value")
        return {str(axis): float(value) for axis, value in found.items()}


def _read_only(record: PhaseRecord) -> PhaseRecord:
    """Return the record with views of its arrays that nobody can write to: every metric sees the same."""
    arrays = {name: value.view() for name, value in vars(record).items() if isinstance(value, np.ndarray)}
    for array in arrays.values():
        array.flags.writeable = False
    return dataclasses.replace(record, **arrays)


def table(rows: list[tuple[Any, ...]]) -> pd.DataFrame:
    """Return the tidy table with these rows."""
    return pd.DataFrame(rows, columns=list(METRIC_COLUMNS))


def read_table(text: Any) -> pd.DataFrame:
    """Read a metrics.csv (path or file); empty axes and units stay empty strings. Raises RunDirectoryError."""
    try:
        found = pd.read_csv(text, dtype=_TYPES, keep_default_na=False, na_values={"value": ["nan", "NaN", ""]})
    except ValueError as error:
        raise RunDirectoryError(f"{text}: not a table of metrics ({error})") from error
    if missing := set(METRIC_COLUMNS) - set(found.columns):
        raise RunDirectoryError(f"{text}: not a table of metrics, the column '{min(missing)}' is missing")
    return found
