"""A constant value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from hilrig.core.interfaces import Samples, Span
from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array


@dataclass(frozen=True)
class Hold:
    """r(t) = value."""

    value: Annotated[float, Parameter("m|N", "the constant")]

    def sample(self, time: Array, span: Span) -> Samples:
        """Return the constant at `time` (N,) s, with zero derivatives."""
        zero = np.zeros(time.shape)
        return Samples(np.full(time.shape, float(self.value)), zero, zero.copy())
