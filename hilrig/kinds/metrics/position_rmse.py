"""The typical size of the position error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from hilrig.kinds.metrics._record import PhaseRecord, rms


@dataclass(frozen=True)
class PositionRmse:
    """Root mean square of the position error, for each position-controlled axis.

    RMSE_i = √( (1/N) Σ_k e_i(k)² ),  e = x_d − x
    """

    unit: ClassVar[str] = "m"

    def measure(self, record: PhaseRecord) -> dict[str, float]:
        """Return the RMS error by axis, m."""
        return {axis: rms(error) for axis, error in record.position_error().items()}
