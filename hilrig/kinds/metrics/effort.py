"""How much torque is commanded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from hilrig.kinds.metrics._record import PhaseRecord, rms


@dataclass(frozen=True)
class Effort:
    """Root mean square of the commanded joint torque, over ticks and joints.

    effort = √( (1/(n N)) Σ_k Σ_j τ_j(k)² )

    It includes the torque that holds the arm against gravity.
    """

    unit: ClassVar[str] = "N m"

    def measure(self, record: PhaseRecord) -> dict[str, float]:
        """Return the RMS torque, N m."""
        return {"": rms(record.torque)}
