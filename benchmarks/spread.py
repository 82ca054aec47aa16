"""One quantity over the repeats of a run: its median and its spread."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Spread:
    """One quantity over the repeats of a run."""

    median: float
    lowest: float
    highest: float
    values: tuple[float, ...]
    """One for each repeat that has it, in order"""


def spread(values: Sequence[float]) -> Spread:
    """Return median, lowest and highest of `values`. Raises ValueError if there are none."""
    if not values:
        raise ValueError("a spread needs one value or more")
    return Spread(statistics.median(values), min(values), max(values), tuple(values))
