"""How often a command was late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hilrig.metrics._record import PhaseRecord


@dataclass(frozen=True)
class LateFraction:
    """Share of the ticks at which the command was not there in time, so that the last one was held.

    late = #{k : late(k)} / N

    Always 0 in lockstep, where the driver waits.
    """

    unit: ClassVar[str] = ""

    def measure(self, record: PhaseRecord) -> dict[str, float]:
        """Return the share, 0 to 1."""
        return {"": float(np.mean(record.late))} if record.late.size else {}
