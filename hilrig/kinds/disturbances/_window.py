"""When a disturbance is active, and on which axis: shared by the kinds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hilrig.core.errors import nearest
from hilrig.core.signals import Array

TOLERANCE = 1e-9
"""s: tolerance when comparing times, so that rounding of k l does not shift an onset by a tick"""


def window(time: Array, at: float, until: float | None) -> NDArray[np.bool_]:
    """Return where at <= t < until, (N,); `until` None means forever.

    Raises ValueError if it ends before it begins.
    """
    if until is not None and until <= at:
        raise ValueError(f"it would end (until: {until:g} s) before it begins (at: {at:g} s)")
    begun = time >= at - TOLERANCE
    return begun if until is None else begun & (time < until - TOLERANCE)


def axis_index(axis: str, axes: tuple[str, ...]) -> int:
    """Return the column of `axis`. Raises ValueError if there is no such axis."""
    if axis not in axes:
        raise ValueError(f"there is no axis '{axis}'{nearest(axis, axes)} (axes: {', '.join(axes)})")
    return axes.index(axis)
