"""The time delay estimation loop on one mass as the linear map of one period: an independent truth for stability.

A mass M on a straight line is driven by tau_k, held over each period l and `delay` samples late. The law is
tau_k = Mhat (a_d + k_d e' + k_p e) + tau_{k-1} - Mhat (v_k - v_{k-1})/l without its robust term, and v is measured.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hilrig.core.signals import Array


class Loop(NamedTuple):
    """What the loop depends on."""

    estimate: float
    """Mhat, kg"""
    mass: float = 1.0
    """M, kg"""
    delay: int = 0
    """Extra samples from measurement to effect"""
    period: float = 1e-3
    """l, s"""
    position_gain: float = 150.0
    velocity_gain: float = 30.0
    damping: float = 0.0
    """B_d / M_d of a filter on the measured states, 1/s"""
    stiffness: float = 0.0
    """K_d / M_d of a filter on the measured states, 1/s^2"""
    smoothing: float | None = None
    """a of the velocity filter on differences of x; None: the velocity is known exactly"""
    desired: bool = False
    """Whether the estimate takes a_d one period ago, as printed in (11), in place of the measured acceleration"""


def upper_edge(delay: int) -> float:
    """Return Mhat / M at which the plain loop z^(d+1) - z^d + Mhat/M = 0 loses stability, velocity known exactly.

    On the unit circle e^(i d w) (e^(i w) - 1) = -Mhat/M, and e^(i w) - 1 = 2 i sin(w/2) e^(i w/2): the angles agree at
    w = pi/(2 d + 1), the magnitudes at Mhat/M = 2 sin(w/2).
    """
    return 2.0 * np.sin(np.pi / (2 * (2 * delay + 1)))


def upper_edge_of_differences(delay: int) -> float:
    """Return the same with velocities by unfiltered differences of x: z^(d+2) - z^(d+1) + (Mhat/M) (z + 1)/2 = 0.

    The mean of two periods turns by another half period: w = pi/(2 d + 2) and Mhat/M = 2 tan(w/2).
    """
    return 2.0 * np.tan(np.pi / (4 * (delay + 1)))


def matrix(loop: Loop) -> Array:
    """Return the map of one period on (x, v, x_prev, v_meas, v_meas_prev, p_d, v_d, a_d_prev, tau_1..tau_{d+1})."""
    size = 8 + loop.delay + 1
    return np.stack([period(loop, column) for column in np.eye(size)], axis=1)


def period(loop: Loop, s: Array) -> Array:
    """Return the loop's variables one period later."""
    x, v, last_x, filtered, last_measured, p, w, last_a = s[:8]
    past = s[8:]
    length = loop.period
    smoothed = filtered + (loop.smoothing or 0.0) * ((x - last_x) / length - filtered)
    measured = v if loop.smoothing is None else smoothed
    a = -loop.damping * measured - loop.stiffness * x
    w = w + length * a
    p = p + length * w
    u = a + loop.velocity_gain * (w - measured) + loop.position_gain * (p - x)
    before = last_a if loop.desired else (measured - last_measured) / length
    tau = past[0] + loop.estimate * (u - before)
    queue = np.concatenate([[tau], past])
    push = queue[loop.delay] / loop.mass
    ahead = [x + length * v + 0.5 * length**2 * push, v + length * push, x, measured, measured, p, w, a]
    return np.concatenate([ahead, queue[:-1]])


def growth(loop: Loop) -> float:
    """Return the largest |z| of the loop, but for the integrators of a filter without stiffness, which stand at one."""
    z = np.linalg.eigvals(matrix(loop))
    return float(np.max(np.abs(z[np.abs(z - 1) > 1e-6])))


def edge(stable: Callable[[float], bool], low: float, high: float) -> float:
    """Return where `stable` changes between `low` and `high`, by bisection."""
    below = stable(low)
    while high - low > 1e-6 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) == below else (low, middle)
    return low
