"""Whether a claim holds, as far as the repeats allow one to say. Pure.

Every part of a claim comes down to one number for each repeat and a range in which the claim puts it. Repeat i is the
same world for every controller, so where two values are compared it is their difference in each pair that counts.
The 95 % t interval of the mean number then says: wholly inside the range, `reproduced`; wholly outside,
`not reproduced`; else, or with fewer than `LEAST_PAIRS` repeats, `cannot tell`. Repeats that are identical to the last
bit (no noise) are one world, which is known exactly: their interval is a point. Claims are judged one by one, without
correction for their number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hilrig.core.signals import Array
from hilrig.report.comparison import interval

LEAST_PAIRS = 10

Result = Literal["reproduced", "not reproduced", "cannot tell"]
Range = tuple[float, float]
"""Where a claim puts a number: low < number < high"""


@dataclass(frozen=True)
class Judgement:
    """What the repeats say of one part of a claim."""

    result: Result
    mean: float | None
    """Mean of the number that was judged; None if there is none"""
    low: float | None
    """Lower end of its 95 % interval"""
    high: float | None
    pairs: int
    """Repeats that went into it"""
    reason: str = ""
    """Why one cannot tell, or what is special; else empty"""


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


def judge(numbers: Array, claimed: Range) -> Judgement:
    """Judge the numbers (n,) of n repeats by the range in which the claim puts them."""
    n = int(numbers.size)
    if n == 0:
        return Judgement("cannot tell", None, None, None, 0, "nothing was measured")
    if not np.all(np.isfinite(numbers)):
        return _judge_infinite(numbers, claimed)
    mean = float(np.mean(numbers))
    identical = n > 1 and bool(np.all(numbers == numbers[0]))
    low, high = (float(numbers[0]),) * 2 if identical else interval(numbers)
    if n < LEAST_PAIRS:
        return Judgement("cannot tell", mean, low, high, n, f"{n} of the {LEAST_PAIRS} repeats that are needed")
    return Judgement(_side(low, high, claimed), mean, low, high, n, "the same in every repeat" if identical else "")


def _side(low: float, high: float, claimed: Range) -> Result:
    """Return on which side of the claimed range an interval lies."""
    if claimed[0] < low and high < claimed[1]:
        return "reproduced"
    return "not reproduced" if high <= claimed[0] or low >= claimed[1] else "cannot tell"


def _judge_infinite(numbers: Array, claimed: Range) -> Judgement:
    """Judge numbers of which some are not finite: one can tell only if all lie infinitely far on one side."""
    n = int(numbers.size)
    odd = int(np.sum(~np.isfinite(numbers)))
    for end in (-np.inf, np.inf):
        if np.all(numbers == end) and n >= LEAST_PAIRS:
            result: Result = "reproduced" if end in claimed else "not reproduced"
            return Judgement(result, end, end, end, n, "infinite in every repeat")
    return Judgement("cannot tell", None, None, None, n, f"not finite in {odd} of {n} repeats")


def all_of(results: Sequence[Result]) -> Result:
    """Return the result of a claim from those of its parts: all must hold. Without parts one cannot tell."""
    if "not reproduced" in results:
        return "not reproduced"
    return "cannot tell" if "cannot tell" in results or not results else "reproduced"
