"""The deviation from the desired dynamics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from hilrig.kinds.metrics._record import PhaseRecord, rms


@dataclass(frozen=True)
class AuxiliaryErrorRmse:
    """Root mean square of the auxiliary error, eq. (25): the deviation from the desired impedance, per axis.

    RMSE_i = √( (1/N) Σ_k e_aux,i(k)² ),
    e_aux = M_d (x″ − Σ x_d″) + B_d (x′ − Σ x_d′) + K_d Σ (x − x_d) − (I − Σ) F_d + F_e

    x″ is the central difference of x′. A law that tracks x_d, not the impedance, need not keep it small.
    """

    unit: ClassVar[str] = "N"

    def measure(self, record: PhaseRecord) -> dict[str, float]:
        """Return the RMS auxiliary error by axis, N."""
        error = record.auxiliary_error()
        return {axis: rms(error[:, i]) for i, axis in enumerate(record.axes)}
