"""Judges claims by the tables of metrics, in words and numbers. No I/O."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from hilrig.core.signals import Array
from hilrig.experiment.trial import ALL_PHASES
from hilrig.report.dataset import TrialEntry
from hilrig.report.page import number
from hilrig.report.verdict_table import metric_title, shown_unit
from hilrig.study.claims import (
    LEAST_CLAIM_PAIRS,
    Judgement,
    Range,
    Result,
    all_of,
    difference,
    judge_claim,
    paired,
    relative,
)
from hilrig.study.crosscheck import elsewhere
from hilrig.study.model import Claim, Part

Tables = Mapping[str, pd.DataFrame]
"""The metrics of each experiment, by name"""
Trials = Mapping[str, Sequence[TrialEntry]]
"""The planned trials of each experiment, by name"""


@dataclass(frozen=True)
class Evidence:
    """What was measured for one part of a claim."""

    part: Part
    measured: str
    """The judged number in words"""
    claimed: str
    """The range in which the number is claimed to be"""
    unit: str
    """Unit of the number; "" for a pure number"""
    judgement: Judgement
    means: tuple[float, ...]
    """Mean of the metric and, if there is one, of the other value, over the same repeats"""
    metric_unit: str

    @property
    def values(self) -> str:
        """The means, for display"""
        factor, unit = shown_unit(self.metric_unit)
        return " vs ".join(f"{number(factor * mean)} {unit}".strip() for mean in self.means)

    @property
    def number(self) -> str:
        """The judged number and its interval, for display"""
        found = self.judgement
        if found.mean is None:
            return "–"
        factor, unit = shown_unit(self.unit)
        mean = f"{number(factor * found.mean)} {unit}".strip()
        if found.low is None or found.high is None or found.low == found.high or math.isinf(found.low):
            return mean
        return f"{mean} [{number(factor * found.low)}, {number(factor * found.high)}]"


@dataclass(frozen=True)
class Judged:
    """A claim and its result."""

    claim: Claim
    result: Result
    evidence: tuple[Evidence, ...]


def judge_claims(claims: Sequence[Claim], tables: Tables, trials: Trials) -> list[Judged]:
    """Return every claim with its result and its evidence."""
    found = []
    for claim in claims:
        evidence = tuple(_judge_part(part, tables, trials) for part in claim.parts)
        found.append(Judged(claim, all_of([item.judgement.result for item in evidence]), evidence))
    return found


def _judge_part(part: Part, tables: Tables, trials: Trials) -> Evidence:
    """Judge one part by the repeats that completed; if there are too few, say what is missing."""
    values, metric_unit = _values(part, tables)
    other = part.less_than or part.equals_within
    places = (part,) if other is None else (part, elsewhere(part, other))
    columns = paired(values, values if other is None else _values(places[-1], tables)[0])[: len(places)]
    numbers, limits = _numbers(part, *columns)
    found = judge_claim(numbers, limits)
    if found.pairs < LEAST_CLAIM_PAIRS:
        why = [text for place in places if (text := _missing(place, tables, trials))]
        found = replace(found, reason="; ".join(dict.fromkeys([found.reason, *why])))
    unit = "" if part.equals_within else metric_unit
    means = tuple(float(np.mean(column)) for column in columns if column.size)
    return Evidence(part, *_words(part, places, metric_unit), unit, found, means, metric_unit)


def _numbers(part: Part, values: Array, others: Array | None = None) -> tuple[Array, Range]:
    """Return the numbers (n,) by which a part is judged, and their claimed range."""
    if others is not None and part.equals_within:
        return relative(values, others), (-part.equals_within.fraction, part.equals_within.fraction)
    if others is not None and part.less_than:
        return difference(values, others, part.less_than.times), (-math.inf, 0.0)
    return values, (_number(part.above, -math.inf), _number(part.below, math.inf))


def _words(part: Part, places: tuple[Part, ...], unit: str) -> tuple[str, str]:
    """Return in words what is measured and what is claimed."""
    subject = _subject(part)
    if part.equals_within:
        fraction = part.equals_within.fraction
        return f"{subject}, relative difference to {_against(*places)}", f"within ±{fraction:g}"
    if part.less_than:
        times = "" if part.less_than.times == 1 else f"{part.less_than.times:g} × "
        return f"{subject}, minus {times}that of {_against(*places)}", "below 0"
    return subject, _limit(part, unit)


def _values(part: Part, tables: Tables) -> tuple[dict[int, float], str]:
    """Return the values of a part's metric by repeat, and their unit."""
    table = tables[part.experiment]
    keys = ("controller", "condition", "phase", "metric", "axis")
    rows = [row for row in table.to_dict("records") if all(row[key] == getattr(part, key) for key in keys)]
    return {int(row["repeat"]): float(row["value"]) for row in rows}, str(rows[0]["unit"]) if rows else ""


def _missing(part: Part, tables: Tables, trials: Trials) -> str:
    """Return why values are missing: trials that did not complete, or an axis that the metric lacks."""
    mine = [t for t in trials[part.experiment] if (t.controller, t.condition) == (part.controller, part.condition)]
    lost = [trial for trial in mine if not trial.counts]
    if lost:
        outcomes = ", ".join(dict.fromkeys(trial.ending for trial in lost))
        return f"{len(lost)} of {len(mine)} trials of {part.controller} did not complete ({outcomes})"
    table = tables[part.experiment]
    axes = dict.fromkeys(str(axis) for axis in table.loc[table["metric"] == part.metric, "axis"])
    if part.axis in axes:
        return ""
    return f"{part.metric} has no axis '{part.axis}' (it has: {', '.join(repr(axis) for axis in axes) or 'none'})"


def _subject(part: Part) -> str:
    """Return what is measured, in words."""
    metric = part.metric.replace("memory_rms.", "RMS of ").replace("memory_peak.", "peak of ")
    where = "whole trial" if part.phase == ALL_PHASES else part.phase
    axis = f", component {part.axis}" if part.axis.isdigit() else f" {part.axis}" if part.axis else ""
    name = metric_title(metric) + axis
    return f"{name}, {part.controller} ({part.experiment}, {part.condition}, {where})"


def _against(part: Part, there: Part) -> str:
    """Return in words how the other value differs: its controller, experiment, condition or phase."""
    names = ("controller", "experiment", "condition", "phase")
    return ", ".join(getattr(there, name) for name in names if getattr(there, name) != getattr(part, name))


def _number(limit: float | str | None, default: float) -> float:
    """Return a limit as a number, which it is after the study has been checked; `default` if there is none."""
    return default if limit is None else float(limit)


def _limit(part: Part, unit: str) -> str:
    """Return the claimed limit of a value, in words."""
    factor, shown = shown_unit(unit)
    word, limit = ("below", part.below) if part.below is not None else ("above", part.above)
    return f"{word} {factor * _number(limit, 0.0):g} {shown}".strip()
