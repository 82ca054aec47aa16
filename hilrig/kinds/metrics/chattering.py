"""How much the command changes from tick to tick."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hilrig.kinds.metrics._record import PhaseRecord


@dataclass(frozen=True)
class Chattering:
    """Mean absolute change of the commanded joint torque from one tick to the next, over ticks and joints.

    chattering = (1/(n (N − 1))) Σ_k Σ_j |τ_j(k) − τ_j(k−1)|

    Only pairs of successive ticks count. The value depends on the period: compare only runs with the same period.
    """

    unit: ClassVar[str] = "N m"

    def measure(self, record: PhaseRecord) -> dict[str, float]:
        """Return the mean change, N m; empty if no two successive ticks were recorded."""
        successive = np.diff(record.tick) == 1
        changes = np.abs(np.diff(record.torque, axis=0))[successive]
        return {"": float(np.mean(changes))} if changes.size else {}
