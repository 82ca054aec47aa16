"""How long the position takes to settle after a change of reference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array
from hilrig.kinds.metrics._record import PhaseRecord


@dataclass(frozen=True)
class SettlingTime:
    """Time from the start of a phase until the position error stays in a band, for each position-controlled axis.

    T_i = min { t : |e_i(τ)| ≤ b_i for all τ ≥ t in the phase },
    b_i = max(band, fraction · |Δx_d,i|),  e = x_d − x

    Δx_d is the jump of the reference at the start, so the band is the same for every controller. Infinite
    if the error is outside the band at the end of the phase. Not defined for a span of several phases.
    """

    band: Annotated[float, Parameter("m", "smallest half-width of the band", low=0.0)] = 0.005
    fraction: Annotated[float, Parameter("", "share of the reference's jump", low=0.0, high=1.0)] = 0.02

    unit: ClassVar[str] = "s"

    def measure(self, record: PhaseRecord) -> dict[str, float]:
        """Return the settling time by axis, s; empty for a span of several phases."""
        if record.phases != 1:
            return {}
        step = dict(zip(record.axes, np.abs(record.reference_step), strict=True))
        return {
            axis: self._settled(error, record, max(self.band, self.fraction * float(step[axis])))
            for axis, error in record.position_error().items()
        }

    def _settled(self, error: Array, record: PhaseRecord, band: float) -> float:
        """Return the time from the start until one period after `error` (N,) is last outside ±band."""
        outside = np.flatnonzero(~(np.abs(error) <= band))
        if outside.size == 0:
            return 0.0
        if outside[-1] == error.size - 1:
            return float("inf")
        return float(record.time[outside[-1] + 1] - record.time[0])
