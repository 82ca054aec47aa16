"""Curves through points, shared by the references that are defined by points."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Literal

import numpy as np

from hilrig.core.interfaces import Samples, Span
from hilrig.core.signals import Array

Interpolation = Literal["cubic", "linear"]

TOLERANCE = 1e-9
"""s: how far a point may lie beyond the end of its phase, for rounding"""


def check_points(times: Sequence[float], values: Sequence[float], places: Sequence[str] | None = None) -> None:
    """Raise ValueError unless there are at least two finite points and the times increase from 0 or later.

    `places` names each point in messages, such as "line 3"; by default "point 3".
    """
    if len(times) != len(values):
        raise ValueError(f"{len(times)} times, but {len(values)} values")
    if len(times) < 2:
        raise ValueError(f"a curve needs at least two points; this one has {len(times)}")
    if not (np.isfinite(times).all() and np.isfinite(values).all()):
        raise ValueError("times and values must be finite numbers")
    places = places or [f"point {i}" for i in range(1, len(times) + 1)]
    if times[0] < 0:
        raise ValueError(
            f"{places[0]}: the time {times[0]:.12g} s is before the start of the phase, from which times count"
        )
    for place, (before, time) in zip(places[1:], itertools.pairwise(times), strict=True):
        if time <= before:
            raise ValueError(f"{place}: the time {time:.12g} s follows {before:.12g} s; times must rise")


def curve(times: Sequence[float], values: Sequence[float], kind: Interpolation, at: Array, span: Span) -> Samples:
    """Return the curve through (span.start + times, values) at trial times `at` (N,) s.

    cubic is the spline with continuous acceleration whose rate is zero at its first and last point. Outside the points
    the curve stays at the nearest one. Raises ValueError if it begins after its phase has ended.
    """
    length = span.end - span.start
    if times[0] >= length:
        raise ValueError(
            f"the curve begins {times[0]:.12g} s after the start of its phase, which lasts {length:.6g} s; "
            "its times must count from the start of the phase, in s"
        )
    t, y, since_start = np.array(times), np.array(values), at - span.start
    inside = (since_start >= t[0]) & (since_start < t[-1])
    value, rate, acceleration = (_cubic if kind == "cubic" else _linear)(t, y, since_start)
    rest = np.where(since_start < t[0], y[0], y[-1])
    return Samples(np.where(inside, value, rest), np.where(inside, rate, 0.0), np.where(inside, acceleration, 0.0))


def cut_off(times: Sequence[float], span: Span) -> list[str]:
    """Return a list with a warning if points lie beyond the end of the phase; else an empty list."""
    length = span.end - span.start
    beyond = sum(time > length + TOLERANCE for time in times)
    if not beyond:
        return []
    return [
        f"{beyond} of the curve's {len(times)} points are never reached: its last time is {times[-1]:.12g} s, and the "
        f"phase lasts {length:.6g} s"
    ]


def _cubic(t: Array, y: Array, at: Array) -> tuple[Array, Array, Array]:
    # The import takes longer than a short trial; only processes that sample a spline should pay for it.
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(t, y, bc_type="clamped")
    return spline(at), spline(at, 1), spline(at, 2)


def _linear(t: Array, y: Array, at: Array) -> tuple[Array, Array, Array]:
    slope = np.diff(y) / np.diff(t)
    index = np.clip(np.searchsorted(t, at, side="right") - 1, 0, t.size - 2)
    return y[index] + slope[index] * (at - t[index]), slope[index], np.zeros(at.shape)
