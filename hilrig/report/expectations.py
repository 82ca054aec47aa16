"""Judges whether the expectations of an experiment are met.

The rule: a limit on a metric is met if every repeat keeps it. A limit on the difference of two controllers is met if
the whole 95 % confidence interval of the mean paired difference keeps it (`comparison.paired_difference`, as for the
marks in the verdict tables). Both must hold on every axis and under every condition, unless one is named, and every
trial concerned must have completed within its timing budget. An expected outcome is met if every trial concerned ended
that way.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from hilrig.recording.run_directory import INVALID, reason_of
from hilrig.report.comparison import LEAST_PAIRS, Difference, paired_difference
from hilrig.report.dataset import TrialEntry

KEYS = ("metric", "phase", "axis", "condition")
Rows = Sequence[Mapping[Any, Any]]


@dataclass(frozen=True)
class Expected:
    """One expectation and the deciding value: the one nearest to the limit, or furthest beyond it."""

    subject: str
    """What is limited, in words"""
    limit: str
    """The limit, in words"""
    seen: str
    """The value, in words"""
    basis: str
    """Where the value was measured, and what it is based on"""
    met: bool
    missing: int
    """Number of trials concerned that did not complete or are invalid; if there are any, a limit is not met"""
    value: float | None
    """The value in the metric's unit, the mean for a difference; None if nothing was measured, and for an outcome"""
    low: float | None
    """Lower end of a difference's 95 % confidence interval, infinite if it cannot be judged; None for other values"""
    high: float | None
    """Upper end of it"""


class _Limits(NamedTuple):
    """The limits of a value; None for no limit."""

    below: float | None
    above: float | None

    def beyond(self, low: float, high: float) -> float:
        """Return how far the interval from `low` to `high` goes beyond a limit: negative within, inf for NaN."""
        over = -math.inf if self.below is None else high - self.below
        under = -math.inf if self.above is None else self.above - low
        return math.inf if math.isnan(low) or math.isnan(high) else max(over, under)

    def text(self, value: float) -> str:
        """Return `value` with four digits, or as many as needed to tell it from the limits."""
        given = [limit for limit in self if limit is not None]
        texts = (f"{value:.{digits}g}" for digits in range(4, 18))
        return next(text for text in texts if all(_sides(float(text), x) == _sides(value, x) for x in given))


def _sides(value: float, limit: float) -> tuple[bool, bool]:
    return value < limit, value > limit


class _Seen(NamedTuple):
    """A value to judge, and the interval in which it is known to lie."""

    value: float
    low: float
    high: float
    basis: str


def judge_expectations(
    expectations: Sequence[Mapping[str, Any]], metrics: pd.DataFrame, trials: Sequence[TrialEntry]
) -> list[Expected]:
    """Judge the expectations, given as in plan.json; return each with the value that decides it.

    `metrics` is the tidy table of the trials that are compared, `trials` are all planned trials.
    """
    return [
        _judge_outcome(item, trials) if item.get("outcome") else _judge_metric(item, metrics, trials)
        for item in expectations
    ]


def _judge_outcome(expectation: Mapping[str, Any], trials: Sequence[TrialEntry]) -> Expected:
    """Judge how trials ended; the basis is the first that ended otherwise, or else the first trial."""
    wanted = expectation["outcome"]
    own = [trial for trial in trials if _speaks_of(expectation, trial)]
    others = [trial for trial in own if trial.ending != wanted]
    counts = Counter(trial.ending for trial in own)
    alone = len(counts) == 1
    return Expected(
        subject=f"outcome of {expectation['controller']}{_where(expectation)}",
        limit=wanted,
        seen=", ".join(word if alone else f"{count} {word}" for word, count in counts.items()) or "nothing",
        basis=_ending((others or own)[0], len(own)) if own else "there is no such trial",
        met=bool(own) and not others,
        missing=0, value=None, low=None, high=None,
    )  # fmt: skip


def _ending(trial: TrialEntry, number: int) -> str:
    """Return which trial it is, out of how many, and why and when it ended."""
    outcome, first = trial.outcome, f", first of {number}" if number > 1 else ""
    # The text of a failure contains local file names; the reason of a trip contains its time.
    why = "see its log" if trial.ending == "failed" else reason_of(outcome) or trial.ending
    ticks = outcome.get("ticks", 0)
    when = (
        ""
        if " at t = " in why or not ticks or trial.ending == INVALID
        else f" at t = {ticks * trial.document['period']:.6g} s"
    )
    return f"{trial.condition}: repeat {trial.repeat}{first}, {why}{when}"


def _judge_metric(expectation: Mapping[str, Any], metrics: pd.DataFrame, trials: Sequence[TrialEntry]) -> Expected:
    limits = _Limits(expectation.get("below"), expectation.get("above"))
    keys = [key for key in KEYS if expectation.get(key) is not None]
    rows = [row for row in metrics.to_dict("records") if all(row[key] == expectation[key] for key in keys)]
    unit = str(rows[0]["unit"]) if rows else ""
    second = expectation.get("minus")
    found = list(_differences(expectation, rows, limits, unit) if second else _values(expectation, rows))
    worst = max(found, key=lambda seen: limits.beyond(seen.low, seen.high), default=None)
    mine = [trial for trial in trials if _speaks_of(expectation, trial)]
    missing = sum(not trial.counts for trial in mine)
    basis = [worst.basis] if worst else [] if missing else ["the metric has no value here"]
    basis += [_missing(mine)] * (missing > 0)
    return Expected(
        subject=_subject(expectation),
        limit=" and ".join(f"{word} {x:g} {unit}".strip() for word, x in limits._asdict().items() if x is not None),
        seen=f"{limits.text(worst.value)} {unit}".strip() if worst else "nothing",
        basis="; ".join(basis),
        met=bool(found) and not missing and all(limits.beyond(seen.low, seen.high) < 0 for seen in found),
        missing=missing,
        value=worst.value if worst else None,
        low=worst.low if worst and second else None,
        high=worst.high if worst and second else None,
    )


def _missing(trials: Sequence[TrialEntry]) -> str:
    """Return how many of the trials have no metrics, and why."""
    invalid = sum(trial.ending == INVALID for trial in trials)
    others = sum(not trial.counts for trial in trials) - invalid
    counts = ((others, "not completed"), (invalid, "invalid (timing)"))
    return ", ".join(f"{count} trial{'s' * (count > 1)} {what}" for count, what in counts if count)


def _speaks_of(expectation: Mapping[str, Any], trial: TrialEntry) -> bool:
    named = (expectation["controller"], expectation.get("minus"))
    return trial.controller in named and expectation.get("condition") in (None, trial.condition)


def _subject(expectation: Mapping[str, Any]) -> str:
    of = " minus ".join(expectation[key] for key in ("controller", "minus") if expectation.get(key))
    return f"{expectation['metric']} of {of}, phase {expectation.get('phase', 'all')}{_where(expectation)}"


def _where(expectation: Mapping[str, Any]) -> str:
    return "".join(f", {expectation[key]}" for key in ("axis", "condition") if expectation.get(key))


def _values(expectation: Mapping[str, Any], rows: Rows) -> Iterator[_Seen]:
    """Yield the metric in every repeat, under every condition and on every axis."""
    own = [row for row in rows if row["controller"] == expectation["controller"]]
    worst = f", worst of {len(own)}" if len(own) > 1 else ""
    for row in own:
        value = float(row["value"])
        yield _Seen(value, value, value, f"{_place(row['condition'], row['axis'])}: repeat {row['repeat']}{worst}")


def _differences(expectation: Mapping[str, Any], rows: Rows, limits: _Limits, unit: str) -> Iterator[_Seen]:
    """Yield the mean paired difference under every condition and on every axis."""
    cells: dict[tuple[str, str], tuple[dict[int, float], dict[int, float]]] = {}
    for row in rows:
        for side, key in enumerate(("controller", "minus")):
            if row["controller"] == expectation[key]:
                cell = cells.setdefault((row["condition"], row["axis"]), ({}, {}))
                cell[side][row["repeat"]] = float(row["value"])
    for (condition, axis), (first, second) in cells.items():
        pairs = [(first[repeat], second[repeat]) for repeat in sorted(first.keys() & second.keys())]
        found = paired_difference(np.array(pairs, dtype=np.float64).reshape(-1, 2))
        basis = f"{_place(condition, axis)}: {_basis(found, len(pairs), limits, unit)}"
        yield _Seen(found.mean, found.low, found.high, basis)


def _basis(found: Difference, pairs: int, limits: _Limits, unit: str) -> str:
    if pairs and math.isnan(found.mean):
        return "the difference is undefined in a repeat"
    if pairs < LEAST_PAIRS and math.isinf(found.high):
        return f"{found.basis}, too few to judge a difference ({LEAST_PAIRS} are needed)"
    if found.low == found.high:
        return found.basis
    ends = f"{limits.text(found.low)} to {limits.text(found.high)} {unit}".strip()
    return f"{found.basis}, 95 % confidence interval {ends}"


def _place(condition: str, axis: str) -> str:
    return f"{condition}, {axis}" if axis else condition
