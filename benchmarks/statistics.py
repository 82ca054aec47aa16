"""From samples to what is told of them: quantiles within one repeat, the median and the spread over the repeats."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

QUANTILES = {"p50": 50.0, "p99": 99.0, "max": 100.0}


@dataclass(frozen=True)
class Spread:
    """One quantity over the repeats of the run."""

    median: float
    lowest: float
    highest: float
    values: tuple[float, ...]
    """One for each repeat that has it, in their order"""


def spread(values: Sequence[float]) -> Spread:
    """Return median, lowest and highest of `values`. Raises ValueError if there are none."""
    if not values:
        raise ValueError("a spread needs one value or more")
    return Spread(statistics.median(values), min(values), max(values), tuple(values))


def quantiles(nanoseconds: ArrayLike, name: str) -> dict[str, float]:
    """Return p50, p99 and max (linear between neighbours) of times in ns as <name>_<quantile>_us, in microseconds."""
    values = np.percentile(np.asarray(nanoseconds, dtype=np.float64), list(QUANTILES.values())) / 1e3
    return {f"{name}_{quantile}_us": float(value) for quantile, value in zip(QUANTILES, values, strict=True)}
