"""The numbers by which claims are judged: the metrics, and measures of a law's memory."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from hilrig.core.errors import PluginError
from hilrig.core.interfaces import Metric
from hilrig.core.signals import Array
from hilrig.experiment.trial import ALL_PHASES
from hilrig.kinds.metrics._record import peak, rms
from hilrig.report.dataset import TrialEntry, TrialSignals
from hilrig.report.internals import memory_documents, unit_of
from hilrig.report.measures import measure_trial

MEMORY_PREFIX: Mapping[str, Callable[[Array], float]] = {"memory_rms": rms, "memory_peak": peak}
"""Measures of one component m of a field of a law's memory: √(mean m²), and max |m|"""


def memory_field(metric: str) -> str | None:
    """Return the field that "memory_rms.<field>" or "memory_peak.<field>" names; None for another metric."""
    prefix, dot, field = metric.partition(".")
    return field if dot and prefix in MEMORY_PREFIX else None


def components(values: Array, axes: tuple[str, ...]) -> dict[str, Array]:
    """Return the columns of a field (N, k) by name: axis names if there is one column per axis, else numbers from 1."""
    names = axes if values.shape[1] == len(axes) else tuple(str(i + 1) for i in range(values.shape[1]))
    return {name: values[:, i] for i, name in enumerate(names)}


def measure_all(
    trial: TrialEntry, signals: TrialSignals, metrics: Mapping[str, Metric], wanted: Iterable[str]
) -> list[tuple[Any, ...]]:
    """Return the rows of one trial: every metric, and the `wanted` measures of the law's memory.

    Raises PluginError if a metric fails.
    """
    failed: dict[str, str] = {}
    rows = measure_trial(trial, signals, metrics, failed)
    for kind, reason in failed.items():
        raise PluginError(f"the metric '{kind}' failed: {reason}")
    documents = memory_documents(trial.document["controller"]["kind"])
    for metric in wanted:
        field = memory_field(metric)
        if field in signals.internals:
            rows += _memory_rows(trial, signals, metric, field, unit_of(documents.get(field, "")) or "")
    return rows


def _memory_rows(trial: TrialEntry, signals: TrialSignals, metric: str, field: str, unit: str) -> list[tuple[Any, ...]]:
    """Return the rows of one measure of one field, for each phase and the whole trial."""
    record, head = signals.record, (trial.id, trial.controller, trial.condition, trial.repeat)
    reduce = MEMORY_PREFIX[metric.partition(".")[0]]
    edges = [(phase["name"], phase["start"], phase["end"]) for phase in trial.document["phases"]]
    rows = []
    for phase, start, end in [*edges, (ALL_PHASES, 0.0, float("inf"))]:
        inside = (record.tick >= np.round(start / record.period)) & (record.tick < np.round(end / record.period))
        for axis, values in components(signals.internals[field], record.axes).items():
            if inside.any():
                rows.append((*head, phase, metric, axis, reduce(values[inside]), unit))
    return rows
