"""Curves through points, shared by the references that are given as points."""

from __future__ import annotations

import itertools
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hilrig.core.interfaces import Samples
from hilrig.core.signals import Array

Interpolation = Literal["cubic", "linear"]


def check_points(times: tuple[float, ...], values: tuple[float, ...]) -> None:
    """Raise ValueError unless there are two points or more and the times rise from 0 or later."""
    if len(times) != len(values):
        raise ValueError(f"{len(times)} times, but {len(values)} values")
    if len(times) < 2:
        raise ValueError(f"a curve needs two points or more; there is {len(times)}")
    if not (np.isfinite(times).all() and np.isfinite(values).all()):
        raise ValueError("times and values must be finite numbers")
    if times[0] < 0:
        raise ValueError(f"times count from the start of the phase and cannot be negative ({times[0]:g} s)")
    for earlier, later in itertools.pairwise(times):
        if later <= earlier:
            raise ValueError(f"times must rise; {later:g} s follows {earlier:g} s")


def curve(times: tuple[float, ...], values: tuple[float, ...], kind: Interpolation, at: Array) -> Samples:
    """Return the curve through (times, values) at `at` (N,) s; it rests outside the points."""
    t, y = np.array(times), np.array(values)
    slope = np.diff(y) / np.diff(t)
    index = np.clip(np.searchsorted(t, at, side="right") - 1, 0, t.size - 2)
    inside = (at >= t[0]) & (at < t[-1])
    rest = np.where(at < t[0], y[0], y[-1])
    if kind == "linear":
        value = y[index] + slope[index] * (at - t[index])
        return Samples(np.where(inside, value, rest), np.where(inside, slope[index], 0.0), np.zeros(at.shape))
    samples = _hermite(t, y, _clamped_rates(t, slope), index, at)
    return Samples(*(np.where(inside, part, outside) for part, outside in zip(samples, (rest, 0.0, 0.0), strict=True)))


def _hermite(t: Array, y: Array, rates: Array, index: NDArray[np.intp], at: Array) -> Samples:
    h = t[index + 1] - t[index]
    s = (at - t[index]) / h
    y0, slope = y[index], (y[index + 1] - y[index]) / h
    m0, m1 = rates[index], rates[index + 1]
    b, c = 3 * slope - 2 * m0 - m1, m0 + m1 - 2 * slope
    return Samples(y0 + h * s * (m0 + s * (b + s * c)), m0 + s * (2 * b + 3 * s * c), (2 * b + 6 * s * c) / h)


def _clamped_rates(t: Array, slope: Array) -> Array:
    """Return the rates at the points of the cubic spline at rest at both ends, by elimination, O(K)."""
    h = np.diff(t)
    size = t.size
    rates, upper = np.zeros(size), np.zeros(size)
    for i in range(1, size - 1):
        a, c = h[i], h[i - 1]
        pivot = 2 * (a + c) - a * upper[i - 1]
        upper[i] = c / pivot
        rates[i] = (3 * (a * slope[i - 1] + c * slope[i]) - a * rates[i - 1]) / pivot
    for i in range(size - 3, 0, -1):
        rates[i] -= upper[i] * rates[i + 1]
    return rates
