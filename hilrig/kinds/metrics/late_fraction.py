"""How often a tick was late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hilrig.kinds.metrics._record import PhaseRecord


@dataclass(frozen=True)
class LateFraction:
    """Share of late ticks, by the rule of the timing certificate (docs/certificate.md).

    late = #{k : late(k)} / N, over the N ticks from the first to the last, including those without an answer

    Always 0 in lockstep, where the driver waits.
    """

    unit: ClassVar[str] = ""

    def measure(self, record: PhaseRecord) -> dict[str, float]:
        """Return the share, 0 to 1."""
        if record.late.size == 0:
            return {}
        ticks = int(record.tick[-1]) - int(record.tick[0]) + 1
        return {"": float(np.sum(record.late[1:]) + min(record.late[0], 1.0)) / ticks}
