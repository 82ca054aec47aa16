"""A curve through points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from hilrig.core.interfaces import Samples, Span
from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array
from hilrig.kinds.references._curve import Interpolation, check_points, curve, cut_off


@dataclass(frozen=True)
class Waypoints:
    """r(t) passes through (times_i, values_i), t counted from the start of the phase.

    cubic: the spline with continuous acceleration whose rate is zero at its first and last point; linear: straight
    lines. Before the first point and after the last, r stays at that point.
    """

    times: Annotated[tuple[float, ...], Parameter("s", "since the start of the phase, increasing", 0.0)]
    values: Annotated[tuple[float, ...], Parameter("m|N", "one for each time")]
    interpolation: Interpolation = "cubic"

    def __post_init__(self) -> None:
        """Raise ValueError if the points do not form a curve."""
        check_points(self.times, self.values)

    def sample(self, time: Array, span: Span) -> Samples:
        """Return the curve at `time` (N,) s. Raises ValueError if it begins after its phase has ended."""
        return curve(self.times, self.values, self.interpolation, time, span)

    def warnings(self, span: Span) -> list[str]:
        """Return a warning if the phase ends before the curve does."""
        return cut_off(self.times, span)
