"""When a trial must end for safety: limits on the driver's measurements, checked at every tick. Pure."""

from __future__ import annotations

import numpy as np

from hilrig.core.compiler import kernel_without_arrays
from hilrig.core.signals import Array, Measurement
from hilrig.experiment.limits import Limits


@kernel_without_arrays
def extremes(q: Array, last_q: Array, wrench: Array) -> tuple[bool, float, float]:
    """Return whether all values are finite, the norm of the force (N), and the largest step of a joint (rad).

    `q` and `last_q` are the joint positions now and at the previous tick, (n,) rad; `wrench` is (6,).
    """
    finite, step = True, 0.0
    for i in range(q.size):
        change = abs(q[i] - last_q[i])
        finite = finite and np.isfinite(change)
        step = max(step, change)
    for i in range(wrench.size):
        finite = finite and np.isfinite(wrench[i])
    return finite, np.sqrt(wrench[0] ** 2 + wrench[1] ** 2 + wrench[2] ** 2), step


def why_outside(tick: int, q: Array, tip: Array, joints: Array, tips: Array, period: float) -> str:
    """Return why the joints (n,) rad or the tip (m,) m end the trial; empty if they are in their ranges, (2, k)."""
    at = f"t = {tick * period:.4g} s (tick {tick})"
    for i, (value, low, high) in enumerate(zip(q, *joints, strict=True)):
        if not low <= value <= high:
            return f"joint {i + 1} is at {value:.4g} rad at {at}, outside its range of {low:.4g} to {high:.4g} rad"
    for i, (value, low, high) in enumerate(zip(tip, *tips, strict=True)):
        if value < low or value > high:
            return f"the tip is at {value:.4g} m along axis {i + 1} at {at}, outside {low:.4g} to {high:.4g} m"
    return ""


def why_unsafe(
    tick: int, measurement: Measurement, last_q: Array, period: float, limits: Limits, elapsed: float | None = None
) -> str:
    """Return why this measurement ends the trial: the limit, the value and the time. Empty if it is within limits.

    `elapsed` is the time since the sample of `last_q`, s; the period by default.
    """
    q, wrench = measurement.joint_position, measurement.wrench
    finite, force, step = extremes(q, last_q, wrench)
    if not finite:
        return f"tick {tick}: the measurement is not finite: joints {q}, wrench {wrench}"
    for what, value, limit, unit in (
        ("tip force", force, limits.tip_force, "N"),
        ("joint velocity", step / (elapsed or period), limits.joint_velocity, "rad/s"),
    ):
        if value > limit:
            at = f"t = {tick * period:.4g} s (tick {tick})"
            return f"{what} {value:.4g} {unit} at {at} is over the limit of {limit:.4g} {unit}"
    return ""
