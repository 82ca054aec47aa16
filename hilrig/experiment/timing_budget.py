"""The timing budget of a real-time trial: what the file can set, and the defaults, which are defined only here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from hilrig.core.parameters import Parameter

AGE_MARGIN = 0.25
"""Default margin of a command's age beyond the actuation delay, in periods"""


@dataclass(frozen=True)
class TimingBudget:
    """Timing limits of a real-time loop; a trial that exceeds one is invalid and is not compared."""

    late_fraction: Annotated[float, Parameter("", "largest share of late ticks", 0.0, 1.0)] = 0.005
    command_age_p99: Annotated[
        float | None,
        Parameter(
            "s", "largest 99th percentile of the age of the command in effect; default: actuation delay + 1/4 period",
            1e-5, 1e3, "log",
        ),
    ] = None  # fmt: skip

    def command_age_limit(self, period: float, actuation_delay: int) -> float:
        """Return the limit on the 99th percentile of the command's age, s: as given, or (d + 1/4) l."""
        return (actuation_delay + AGE_MARGIN) * period if self.command_age_p99 is None else self.command_age_p99
