"""The typical size of the force error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from hilrig.kinds.metrics._record import PhaseRecord, rms


@dataclass(frozen=True)
class ForceRmse:
    """Root mean square of the force error, for each force-controlled axis.

    RMSE_i = √( (1/N) Σ_k e_F,i(k)² ),  e_F = F_d − F_e
    """

    unit: ClassVar[str] = "N"

    def measure(self, record: PhaseRecord) -> dict[str, float]:
        """Return the RMS error by axis, N."""
        return {axis: rms(error) for axis, error in record.force_error().items()}
