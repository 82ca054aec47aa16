"""Whether a claim holds according to the repeats. No I/O.

Every part of a claim is judged by one number per repeat and the range claimed for it. Repeat i has the same noise and
disturbances for every controller, so two values are compared by their difference in each repeat. If the 95 % confidence
interval (Student's t) of the mean number lies inside the range, the result is `reproduced`; if it lies outside, `not
reproduced`; otherwise, and with fewer than `LEAST_PAIRS` repeats, `cannot tell`. Repeats that are identical to the last
bit (no noise) have no spread: their interval is a point. Claims are judged one by one, without correction for their
number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hilrig.core.signals import Array
from hilrig.report.comparison import interval

LEAST_CLAIM_PAIRS = 10

Result = Literal["reproduced", "not reproduced", "cannot tell"]
Range = tuple[float, float]
"""The range that is claimed for a number: low < number < high"""


@dataclass(frozen=True)
class Judgement:
    """The result of one part of a claim, from the repeats."""

    result: Result
    mean: float | None
    """Mean of the judged number; None if there is none"""
    low: float | None
    """Lower end of its 95 % confidence interval"""
    high: float | None
    pairs: int
    """Number of repeats on which it is based"""
    reason: str = ""
    """Why the repeats are inconclusive, or what is special about them; empty otherwise"""


def paired(values: Mapping[int, float], others: Mapping[int, float]) -> tuple[Array, Array]:
    """Return the values (n,) and the others (n,) of the repeats that both have."""
    common = sorted(values.keys() & others.keys())
    return np.array([values[i] for i in common], dtype=float), np.array([others[i] for i in common], dtype=float)


def difference(values: Array, others: Array, times: float = 1.0) -> Array:
    """Return values - times · others, (n,); NaN where both are infinite."""
    with np.errstate(invalid="ignore"):
        return values - times * others


def relative(values: Array, others: Array) -> Array:
    """Return (values - others) / others, (n,); not finite where the other is zero."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return (values - others) / others


def judge_claim(numbers: Array, claimed: Range) -> Judgement:
    """Judge the numbers (n,) of n repeats by their claimed range."""
    n = int(numbers.size)
    if n == 0:
        return Judgement("cannot tell", None, None, None, 0, "nothing was measured")
    if not np.all(np.isfinite(numbers)):
        return _judge_infinite(numbers, claimed)
    mean = float(np.mean(numbers))
    identical = n > 1 and bool(np.all(numbers == numbers[0]))
    low, high = (float(numbers[0]),) * 2 if identical else interval(numbers)
    if n < LEAST_CLAIM_PAIRS:
        return Judgement("cannot tell", mean, low, high, n, f"only {n} of the {LEAST_CLAIM_PAIRS} repeats needed")
    return Judgement(_side(low, high, claimed), mean, low, high, n, "the same in every repeat" if identical else "")


def _side(low: float, high: float, claimed: Range) -> Result:
    """Return the result for an interval, by where it lies relative to the claimed range."""
    if claimed[0] < low and high < claimed[1]:
        return "reproduced"
    return "not reproduced" if high <= claimed[0] or low >= claimed[1] else "cannot tell"


def _judge_infinite(numbers: Array, claimed: Range) -> Judgement:
    """Judge numbers that are not all finite; there is a result only if all are infinite with the same sign."""
    n = int(numbers.size)
    odd = int(np.sum(~np.isfinite(numbers)))
    for end in (-np.inf, np.inf):
        if np.all(numbers == end) and n >= LEAST_CLAIM_PAIRS:
            result: Result = "reproduced" if end in claimed else "not reproduced"
            return Judgement(result, end, end, end, n, "infinite in every repeat")
    return Judgement("cannot tell", None, None, None, n, f"not finite in {odd} of {n} repeats")


def all_of(results: Sequence[Result]) -> Result:
    """Return the result of a claim from those of its parts, all of which must hold; "cannot tell" without parts."""
    if "not reproduced" in results:
        return "not reproduced"
    return "cannot tell" if "cannot tell" in results or not results else "reproduced"
