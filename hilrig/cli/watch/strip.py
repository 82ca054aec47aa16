"""Strip charts made of characters: Braille patterns, each two dots wide and four high."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:  # importing signals loads numba, which a watcher does not need
    from hilrig.core.signals import Array

BLANK = 0x2800
"""The Braille pattern without dots"""
DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
"""Bit of each dot: left and right column, from the top"""
NICE = (1.0, 2.0, 5.0, 10.0)


def nice_limit(largest: float) -> float:
    """Return 1, 2 or 5 times a power of ten, not below `largest`; 1 if it is not positive and finite."""
    if not math.isfinite(largest) or largest <= 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(largest))
    return next(factor * power for factor in NICE if factor * power >= largest * (1 - 1e-12))


def strip(values: Array, low: float, high: float, width: int, height: int, most: int) -> list[str]:
    """Return a chart of `values` (N,), the newest at the right, as `height` lines of `width` characters.

    The width stands for `most` values; fewer leave the left side empty. Each column covers its lowest to its highest
    value and connects to the previous column, so no peak is lost. Values beyond `low` and `high` are clipped.
    """
    dots = np.zeros((4 * height, 2 * width), dtype=bool)
    share = np.nan_to_num(np.clip((high - values) / (high - low), 0.0, 1.0))
    rows = np.rint(share * (dots.shape[0] - 1)).astype(int)
    # The position of a value does not depend on how many there are so far: the chart scrolls, it does not stretch.
    edges = np.arange(dots.shape[1] + 1) * most // dots.shape[1] - (most - values.size)
    before: list[int] = []
    for column, (first, last) in enumerate(itertools.pairwise(edges)):
        shown = rows[max(first, 0) : max(last, first + 1, 0)]
        if shown.size:
            reached = [*before, *shown]
            dots[min(reached) : max(reached) + 1, column] = True
            before = [shown[-1]]
    return ["".join(chr(BLANK + bits) for bits in line) for line in _bits(dots, width, height)]


def _bits(dots: np.ndarray, width: int, height: int) -> np.ndarray:
    """Return the bits of each character, (height, width)."""
    cells = dots.reshape(height, 4, width, 2)
    bits = np.zeros((height, width), dtype=int)
    for right, column in enumerate(DOTS):
        for down, bit in enumerate(column):
            bits |= np.where(cells[:, down, :, right], bit, 0)
    return bits
