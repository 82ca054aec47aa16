"""Histograms and quantiles of durations.

The bins are those of an HdrHistogram with 7 significant bits: whole nanoseconds below 128 ns; above that, the octave
from 2^e to 2^(e+1) has 64 bins of equal width 2^(e-6). No bin is wider than 1/64 of its lower edge, from nanoseconds to
hours. Negative values are counted in the mirror images of these bins.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

BITS = 7
"""Significant bits of a bin's edge"""
QUANTILES = {"p50": 50.0, "p99": 99.0, "p99.9": 99.9, "max": 100.0}


def lower_edges(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the smallest whole number in the bin of each value (N,)."""
    values = np.asarray(values, dtype=np.int64)
    size = np.abs(values)
    bits = np.frexp(size.astype(np.float64))[1].astype(np.int64)
    width = np.left_shift(np.int64(1), np.maximum(bits - BITS, 0))
    inner = size // width * width
    return np.where(values < 0, -(inner + width - 1), inner)


def histogram(values: NDArray[np.int64]) -> list[list[int]]:
    """Return [lower edge, count] of every bin that is not empty, in order of the edges. Every value is counted."""
    edges, counts = np.unique(lower_edges(values), return_counts=True)
    return [[int(edge), int(count)] for edge, count in zip(edges, counts, strict=True)]


def tail(bins: list[list[int]]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the lower edges (B,) and the share of values at or above each edge (B,), which is exact there."""
    edges, counts = np.array(bins, dtype=np.int64).reshape(-1, 2).T
    return edges, np.cumsum(counts[::-1])[::-1] / max(int(counts.sum()), 1)


def quantiles(values: NDArray[Any]) -> dict[str, float]:
    """Return p50, p99, p99.9 and max of at least one value, by the names in QUANTILES.

    They are computed from the values themselves, not from bins: numpy's percentiles, linear between neighbours.
    """
    return dict(zip(QUANTILES, map(float, np.percentile(values, list(QUANTILES.values()))), strict=True))


def quantiles_us(nanoseconds: NDArray[np.int64]) -> dict[str, float] | None:
    """Return the quantiles of durations in ns, in microseconds to a tenth; None if there are none."""
    if nanoseconds.size == 0:
        return None
    return {name: round(value / 1e3, 1) for name, value in quantiles(nanoseconds).items()}
