"""A sine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from hilrig.core.interfaces import Samples, Span
from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array


@dataclass(frozen=True)
class Sine:
    """r(t) = offset + amplitude sin(frequency (t - t0) + angle)

    t0 is the start of the trial (since: trial) or of the phase (since: phase). With `trial`, t continues when the
    amplitude changes from one phase to the next, as in the paper's 0.3 sin t followed by 0.2 sin t.
    """

    amplitude: Annotated[float, Parameter("m|N", "half the range from lowest to highest value", 0.0)]
    frequency: Annotated[float, Parameter("rad/s", "angular frequency; '1 Hz' is 2 pi rad/s", 0.0, 1e4, "log")]
    offset: Annotated[float, Parameter("m|N", "mean value")] = 0.0
    angle: Annotated[float, Parameter("rad", "phase angle at t0")] = 0.0
    since: Literal["trial", "phase"] = "trial"

    def sample(self, time: Array, span: Span) -> Samples:
        """Return the sine at `time` (N,) s."""
        a, w = self.amplitude, self.frequency
        angle = w * (time - (span.start if self.since == "phase" else 0.0)) + self.angle
        swing = a * np.sin(angle)
        return Samples(self.offset + swing, a * w * np.cos(angle), -w * w * swing)
