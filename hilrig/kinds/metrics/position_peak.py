"""The largest position error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from hilrig.kinds.metrics._record import PhaseRecord, peak


@dataclass(frozen=True)
class PositionPeak:
    """Largest magnitude of the position error, for each position-controlled axis.

    peak_i = max_k |e_i(k)|,  e = x_d − x
    """

    unit: ClassVar[str] = "m"

    def measure(self, record: PhaseRecord) -> dict[str, float]:
        """Return the largest error by axis, m."""
        return {axis: peak(error) for axis, error in record.position_error().items()}
