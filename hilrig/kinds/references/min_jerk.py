"""A move along a minimum-jerk polynomial."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from hilrig.core.interfaces import Samples, Span
from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array

TOLERANCE = 1e-9
"""s: how much longer than its phase a move may be, for rounding"""


@dataclass(frozen=True)
class MinJerk:
    """r(t) = start + (end - start) (10 s^3 - 15 s^4 + 6 s^5),  s = (t - t0) / duration, then r = end

    t0 is the start of the phase. The move begins and ends at rest, with zero acceleration.
    Source: Flash and Hogan 1985.
    """

    end: Annotated[float, Parameter("m|N", "where the move ends")]
    start: Annotated[float | None, Parameter("m|N", "where it starts; default: end of the previous phase")] = None
    duration: Annotated[float | None, Parameter("s", "how long it takes; default: the phase", 1e-3, 1e5, "log")] = None

    def sample(self, time: Array, span: Span) -> Samples:
        """Return the move at `time` (N,) s.

        Raises ValueError without a start, or if the move takes longer than its phase.
        """
        start = self.start if self.start is not None else span.previous
        if start is None:
            raise ValueError("min_jerk in the first phase needs 'start': there is no phase before it to start from")
        length = span.end - span.start
        duration = self.duration if self.duration is not None else length
        if duration > length + TOLERANCE:
            raise ValueError(f"min_jerk takes {duration:.6g} s, but its phase lasts {length:.6g} s")
        s = np.clip((time - span.start) / duration, 0.0, 1.0)
        way = self.end - start
        value = start + way * s**3 * (10 - 15 * s + 6 * s**2)
        rate = way / duration * 30 * s**2 * (1 - s) ** 2
        return Samples(value, rate, way / duration**2 * 60 * s * (1 - s) * (1 - 2 * s))
