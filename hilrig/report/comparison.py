"""Which controller is best, according to the repeats: summary, verdicts and paired differences.

The rule: a cell is one metric on one axis in one phase of one condition. Repeat i has the same noise and disturbances
for every controller, so values are compared in pairs, over the repeats that both controllers completed. The controller
with the lowest mean is marked best only if, against every other controller, the paired difference has a 95 % confidence
interval (Student's t) above zero, from three pairs or more. If the repeats are identical to the last bit, there is no
spread: any difference above rounding counts, and the table says that the repeats are identical. With a single repeat,
or two that differ, no controller is marked. Cells are judged one by one, without correction for their number: of pairs
with no real difference, about one in twenty may be marked.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy import special

CELL = ["condition", "phase", "metric", "axis"]
LEAST_PAIRS = 3
ROUNDING = 1e-9
"""Relative difference below which two values count as equal"""


def interval(differences: np.ndarray) -> tuple[float, float]:
    """Return the 95 % confidence interval (Student's t) of the mean of `differences` (n,).

    It is (-inf, inf) for n < 2 and for values that are not finite.
    """
    n = differences.size
    if n < 2 or not np.all(np.isfinite(differences)):
        return -np.inf, np.inf
    mean = float(np.mean(differences))
    half = float(special.stdtrit(n - 1, 0.975) * np.std(differences, ddof=1) / np.sqrt(n))
    return mean - half, mean + half


class Difference(NamedTuple):
    """The mean difference in pairs of values, first minus second."""

    mean: float
    """NaN if there is no pair, or if in any pair both values are infinite or one is NaN"""
    low: float
    """Lower end of its 95 % confidence interval; -inf if there are too few pairs to judge"""
    high: float
    """Upper end of that interval; +inf if there are too few pairs to judge"""
    basis: str
    """What the interval is based on"""


def paired_difference(pairs: np.ndarray) -> Difference:
    """Return the mean difference of `pairs` (n, 2), first minus second, with its 95 % confidence interval.

    Pairs that are identical to the last bit have no spread: the interval is the difference itself. Other pairs have an
    interval (Student's t) if there are three or more. A difference within rounding of the two values counts as zero.
    """
    n = pairs.shape[0]
    if n == 0:
        return Difference(np.nan, -np.inf, np.inf, "no common repeat")
    first, second = pairs[:, 0], pairs[:, 1]
    with np.errstate(invalid="ignore"):
        differences = np.where(np.isfinite(first) & _close(first, second), 0.0, first - second)
        mean = float(np.mean(differences))
    if n > 1 and np.all(pairs == pairs[0]):
        return _exactly(float(differences[0]), f"{n} identical repeats")
    if n < LEAST_PAIRS:
        return Difference(mean, -np.inf, np.inf, f"only {n} repeat{'s' * (n > 1)}")
    if np.all(np.isinf(differences) & (differences == differences[0])):
        return _exactly(mean, f"paired, n = {n}")
    return Difference(mean, *interval(differences), f"paired, n = {n}")


def _exactly(difference: float, basis: str) -> Difference:
    """Return a difference without spread; one that is NaN has an infinite interval."""
    bounds = (-np.inf, np.inf) if np.isnan(difference) else (difference, difference)
    return Difference(difference, *bounds, basis)


@dataclass(frozen=True)
class Verdict:
    """The best controller in one cell, and why it is marked, or why none is."""

    best: str | None
    """The controller that is marked, or None"""
    lowest: str | None
    """The controller with the lowest mean, marked or not; None if there is a tie"""
    basis: str
    """In a few words: what the mark is based on, or why there is none"""


def verdict(values: pd.DataFrame) -> Verdict:
    """Judge one cell. `values` has one row per repeat and one column per controller, NaN if not completed."""
    values = values.dropna(axis="columns", how="all")
    if values.shape[1] < 2:
        return Verdict(None, None, "one controller")
    means = values.mean()
    if means.isna().all():
        return Verdict(None, None, "undefined")
    lowest = str(means.idxmin())
    others = [str(name) for name in values.columns if name != lowest]
    reasons = [_against(values[[lowest, other]].dropna().to_numpy()) for other in others]
    blocking = [basis for wins, basis in reasons if not wins]
    if "tie" in blocking:
        return Verdict(None, None, "tie")
    if blocking:
        return Verdict(None, lowest, blocking[0])
    return Verdict(lowest, lowest, reasons[0][1])


def _against(pairs: np.ndarray) -> tuple[bool, str]:
    """Judge `pairs` (n, 2) of the lowest and another controller; return whether the first wins, and the basis."""
    n = pairs.shape[0]
    if n and np.all(_close(pairs[:, 0], pairs[:, 1])):
        return False, "tie"
    found = paired_difference(pairs[:, ::-1])
    wins = found.low > 0
    return wins, found.basis if wins or n < LEAST_PAIRS else "within the spread"


def _close(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return where two values are equal up to rounding; infinities of the same sign are equal."""
    with np.errstate(invalid="ignore"):
        near = np.abs(a - b) <= ROUNDING * np.maximum(np.abs(a), np.abs(b))
    return (a == b) | (np.isfinite(a) & np.isfinite(b) & near)


def summarise_metrics(metrics: pd.DataFrame) -> pd.DataFrame:
    """Return mean, sample standard deviation and number of repeats by condition, phase, metric, axis, controller.

    The deviation is NaN for a single repeat or where a value is not finite.
    """
    grouped = metrics.groupby([*CELL, "unit", "controller"], sort=False)["value"]
    with np.errstate(invalid="ignore"):
        return grouped.agg(mean="mean", sd="std", repeats="count").reset_index()


def verdicts(metrics: pd.DataFrame) -> dict[tuple[str, str, str, str], Verdict]:
    """Return the verdict of every cell, by (condition, phase, metric, axis), in the table's order."""
    found: dict[tuple[str, str, str, str], Verdict] = {}
    cells: Any = metrics.groupby(CELL, sort=False)
    for (condition, phase, metric, axis), rows in cells:
        values = rows.pivot(index="repeat", columns="controller", values="value")
        found[condition, phase, metric, axis] = verdict(values)
    return found
