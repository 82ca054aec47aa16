"""From the tables of metrics to what they say of each claim, in words and numbers. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import pandas as pd

from hilrig.report.dataset import TrialEntry
from hilrig.report.page import number
from hilrig.report.verdict_table import shown_unit
from hilrig.reproduction.claims import LEAST_PAIRS, Judgement, Result, all_of, difference, judge, paired, relative
from hilrig.reproduction.crosscheck import elsewhere
from hilrig.reproduction.model import Claim, Part
from hilrig.signals import Array
from hilrig.trial import ALL_PHASES

Tables = Mapping[str, pd.DataFrame]
"""The metrics of each experiment, by its name"""
Trials = Mapping[str, Sequence[TrialEntry]]
"""The planned trials of each experiment, by its name"""


@dataclass(frozen=True)
class Evidence:
    """What was measured for one part of a claim."""

    part: Part
    measured: str
    """What the number is that was judged"""
    claimed: str
    """Where the claim puts it"""
    unit: str
    """Of the number; "" for a pure number"""
    judgement: Judgement

    @property
    def number(self) -> str:
        """The number and its interval, as people read it"""
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
    """A claim and what it came to."""

    claim: Claim
    result: Result
    evidence: tuple[Evidence, ...]


def judge_claims(claims: Sequence[Claim], tables: Tables, trials: Trials) -> list[Judged]:
    """Return every claim with its result and what it rests on."""
    found = []
    for claim in claims:
        evidence = tuple(_judge_part(part, tables, trials) for part in claim.parts)
        found.append(Judged(claim, all_of([item.judgement.result for item in evidence]), evidence))
    return found


def _judge_part(part: Part, tables: Tables, trials: Trials) -> Evidence:
    values, unit = _values(part, tables)
    subject, other = _subject(part), part.less_than or part.equals_within
    if other is None:
        numbers = pd.Series(values, dtype=float).sort_index().to_numpy()
        limits = (_number(part.above, -math.inf), _number(part.below, math.inf))
        return _evidence(part, (part,), subject, _limit(part, unit), unit, numbers, limits, tables, trials)
    there = elsewhere(part, other)
    mine, others = paired(values, _values(there, tables)[0])
    against = _against(part, there)
    if part.equals_within is not None:
        fraction = part.equals_within.fraction
        measured = f"{subject}, relative difference to {against}"
        numbers, limits, claimed, unit = relative(mine, others), (-fraction, fraction), f"within ±{fraction:g}", ""
    else:
        times = part.less_than.times if part.less_than else 1.0
        measured = f"{subject}, less {'' if times == 1 else f'{times:g} × '}that of {against}"
        numbers, limits, claimed = difference(mine, others, times), (-math.inf, 0.0), "below 0"
    return _evidence(part, (part, there), measured, claimed, unit, numbers, limits, tables, trials)


def _evidence(
    part: Part, places: tuple[Part, ...], measured: str, claimed: str, unit: str, numbers: Array,
    limits: tuple[float, float], tables: Tables, trials: Trials,
) -> Evidence:  # fmt: skip
    """Judge the numbers; where they are too few, say what is missing."""
    found = judge(numbers, limits)
    if found.pairs < LEAST_PAIRS:
        why = [text for place in places if (text := _missing(place, tables, trials))]
        found = replace(found, reason="; ".join(dict.fromkeys([found.reason, *why])))
    return Evidence(part, measured, claimed, unit, found)


def _values(part: Part, tables: Tables) -> tuple[dict[int, float], str]:
    """Return the values of a part's metric by repeat, and their unit."""
    table = tables[part.experiment]
    keys = ("controller", "condition", "phase", "metric", "axis")
    rows = [row for row in table.to_dict("records") if all(row[key] == getattr(part, key) for key in keys)]
    return {int(row["repeat"]): float(row["value"]) for row in rows}, str(rows[0]["unit"]) if rows else ""


def _missing(part: Part, tables: Tables, trials: Trials) -> str:
    """Return why there are few values or none: trials that did not complete, or an axis without the metric."""
    mine = [t for t in trials[part.experiment] if (t.controller, t.condition) == (part.controller, part.condition)]
    lost = [trial for trial in mine if not trial.completed]
    if lost:
        outcomes = ", ".join(dict.fromkeys(str(trial.outcome["outcome"]) for trial in lost))
        return f"{len(lost)} of {len(mine)} trials of {part.controller} did not complete ({outcomes})"
    table = tables[part.experiment]
    axes = dict.fromkeys(str(axis) for axis in table.loc[table["metric"] == part.metric, "axis"])
    if part.axis in axes:
        return ""
    return f"{part.metric} has no axis '{part.axis}' (it has: {', '.join(repr(axis) for axis in axes) or 'none'})"


def _subject(part: Part) -> str:
    """Return what is measured, in words."""
    metric = part.metric.replace("_rmse", " RMSE").replace("memory_rms.", "RMS of ").replace("memory_peak.", "peak of ")
    where = "whole trial" if part.phase == ALL_PHASES else part.phase
    name = f"{metric.replace('_', ' ')} {part.axis}".strip()
    return f"{name}, {part.controller} ({part.experiment}, {part.condition}, {where})"


def _against(part: Part, there: Part) -> str:
    """Return what is different about the other value, in words."""
    names = ("controller", "experiment", "condition", "phase")
    return ", ".join(getattr(there, name) for name in names if getattr(there, name) != getattr(part, name))


def _number(limit: float | str | None, default: float) -> float:
    """Return a limit, which the check of the study has brought into its unit."""
    return default if limit is None else float(limit)


def _limit(part: Part, unit: str) -> str:
    """Return the claimed limit of a value, in words."""
    factor, shown = shown_unit(unit)
    word, limit = ("below", part.below) if part.below is not None else ("above", part.above)
    return f"{word} {factor * _number(limit, 0.0):g} {shown}".strip()
