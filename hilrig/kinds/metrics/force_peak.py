"""The largest force error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from hilrig.kinds.metrics._record import PhaseRecord, peak


@dataclass(frozen=True)
class ForcePeak:
    """Largest magnitude of the force error, for each force-controlled axis.

    peak_i = max_k |e_F,i(k)|,  e_F = F_d − F_e
    """

    unit: ClassVar[str] = "N"

    def measure(self, record: PhaseRecord) -> dict[str, float]:
        """Return the largest error by axis, N."""
        return {axis: peak(error) for axis, error in record.force_error().items()}
