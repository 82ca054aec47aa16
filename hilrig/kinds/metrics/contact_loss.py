"""How often the contact is lost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from hilrig.core.parameters import Parameter
from hilrig.kinds.metrics._record import PhaseRecord


@dataclass(frozen=True)
class ContactLoss:
    """Share of the time in which contact is required but lost, for each force-controlled axis.

    loss_i = #{k : F_d,i(k) > F₀ and F_e,i(k) < F₀} / #{k : F_d,i(k) > F₀},  F₀ = threshold

    Not defined where no contact is required.
    """

    threshold: Annotated[float, Parameter("N", "force below which there is no contact", low=0.0)] = 0.05

    unit: ClassVar[str] = ""

    def measure(self, record: PhaseRecord) -> dict[str, float]:
        """Return the share by axis, 0 to 1."""
        shares: dict[str, float] = {}
        for i in np.flatnonzero(record.sigma == 0):
            asked = record.reference_force[:, i] > self.threshold
            if asked.any():
                shares[record.axes[i]] = 1.0 - float(np.mean(record.force[asked, i] >= self.threshold))
        return shares
