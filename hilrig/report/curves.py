"""The content of a panel: curves thinned without losing extremes, and limits that report what they cut off."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hilrig.core.signals import Array
from hilrig.report.style import Style

BUCKETS = 450
"""Time intervals across a panel; each keeps its smallest and its largest value"""

RUNAWAY = 20.0
"""A curve that reaches this many times further than every other is cut off, with a note"""


class Curve(NamedTuple):
    """One line of a panel."""

    label: str
    time: Array
    values: Array
    style: Style


class AxisLimits(NamedTuple):
    """The range of a panel's vertical axis, and notes on what lies outside it."""

    low: float
    high: float
    notes: tuple[str, ...]


def thin(time: Array, values: Array, buckets: int = BUCKETS) -> tuple[Array, Array]:
    """Return at most about two points per bucket of `values` (N,): the smallest and the largest, in order of time."""
    size = values.size // buckets
    if size <= 2:
        return time, values
    whole = values[: values.size // size * size].reshape(-1, size)
    first = np.arange(whole.shape[0]) * size
    extremes = np.stack([first + whole.argmin(axis=1), first + whole.argmax(axis=1)], axis=1)
    rest = np.arange(whole.size, values.size)
    rows = np.unique(np.concatenate([[0], extremes.ravel(), rest, [values.size - 1]]))
    return time[rows], values[rows]


def curve_window(curve: Curve, start: float, end: float) -> Curve:
    """Return the part of a curve with start <= t <= end."""
    first, last = np.searchsorted(curve.time, [start - 1e-9, end + 1e-9])
    return curve._replace(time=curve.time[first:last], values=curve.values[first:last])


def limits(curves: list[Curve], unit: str, reference: Array | None = None) -> AxisLimits:
    """Return a range that covers every finite value of every curve, and of `reference`.

    The exception is a curve that reaches `RUNAWAY` times further than all others and would flatten them to a line. Then
    the range is three times that of the others, and a note says which curve is cut off and how far it reaches.
    """
    finite = [curve.values[np.isfinite(curve.values)] for curve in curves]
    notes = [f"{c.label}: values that are not finite are not drawn" for c, f in zip(curves, finite, strict=True)
             if f.size < c.values.size]  # fmt: skip
    shown = [(c.label, f) for c, f in zip(curves, finite, strict=True) if f.size]
    fixed = [] if reference is None or reference.size == 0 else [reference]
    if not shown:
        return AxisLimits(-1.0, 1.0, tuple(notes))
    centre = float(np.median(np.concatenate([*fixed, *(f for _, f in shown)])))
    reach = sorted(((float(np.max(np.abs(f - centre))), label, f) for label, f in shown), key=lambda item: item[0])
    kept = [*fixed, *(f for _, f in shown)]
    if len(reach) > 1 and reach[-1][0] > RUNAWAY * reach[-2][0] > 0:
        others, (_, label, values) = reach[-2][0], reach[-1]
        kept = [*fixed, np.array([centre - 3 * others, centre + 3 * others])]
        notes.append(f"{label} goes off the axis: {values.min():.3g} to {values.max():.3g} {unit}".rstrip())
    low, high = min(float(k.min()) for k in kept), max(float(k.max()) for k in kept)
    margin = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    return AxisLimits(low - margin, high + margin, tuple(notes))
