"""When a trial must end for safety: limits on what the driver measures, checked at every tick. Pure."""

from __future__ import annotations

import numpy as np

from hilrig.core.compiler import kernel
from hilrig.core.errors import Tripped
from hilrig.core.signals import Array, Measurement
from hilrig.experiment.trial import Limits


class Monitor:
    """Watches one trial against its limits."""

    def __init__(self, limits: Limits, period: float, last: Array | None = None) -> None:
        """`last` is where the joints were at the tick before, (n,) rad; None before the first."""
        self._limits, self._period, self._last = limits, period, last

    def check(self, tick: int, measurement: Measurement) -> None:
        """Raise Tripped if the measurement of `tick` is not finite or beyond a limit."""
        q, wrench = measurement.joint_position, measurement.wrench
        finite, force, step = extent(q, q if self._last is None else self._last, wrench)
        if not finite:
            raise Tripped(f"tick {tick}: the measurement is not finite: joints {q}, wrench {wrench}")
        self._check("tip force", tick, force, self._limits.tip_force, "N")
        self._check("joint velocity", tick, step / self._period, self._limits.joint_velocity, "rad/s")
        self._last = q

    def _check(self, what: str, tick: int, value: float, limit: float, unit: str) -> None:
        if value > limit:
            time = tick * self._period
            raise Tripped(
                f"{what} {value:.4g} {unit} at t = {time:.4g} s (tick {tick}) is over the limit of {limit:.4g} {unit}"
            )


@kernel
def extent(q: Array, last_q: Array, wrench: Array) -> tuple[bool, float, float]:
    """Return whether all is finite, the norm of the force (N), and the largest change of a joint position (rad)."""
    force = np.sqrt(wrench[0] ** 2 + wrench[1] ** 2 + wrench[2] ** 2)
    step = np.max(np.abs(q - last_q))
    return bool(np.isfinite(step) and np.isfinite(np.sum(wrench)) and np.isfinite(np.sum(q))), force, step
