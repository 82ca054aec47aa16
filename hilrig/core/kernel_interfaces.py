"""What robots and simulated plants may offer besides their plain interfaces, so that a whole trial can be compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hilrig.core.signals import Array, Kinematics, Measurement, PlantDisturbance, Truth


class RobotKernels(NamedTuple):
    """A robot as a kernel."""

    kinematics: Callable[[Any, Array, Array, Kinematics], None]
    """Writes `Robot.kinematics` at (q, q') into the arrays it is given; `constants` is its first argument"""
    constants: Any


class Observation(NamedTuple):
    """Room for what a plant says of itself at a tick; a kernel fills all its arrays."""

    measurement: Measurement
    """Before the sensors' errors, which the rig adds"""
    truth: Truth
    """All but the place of the surface: a number in a tuple cannot be written in place"""

    @classmethod
    def empty(cls, joints: int, axes: int) -> Observation:
        """Return room for n = `joints` and m = `axes`; every array holds nan."""
        n, m, wrench = np.full(joints, np.nan), np.full(axes, np.nan), np.full(6, np.nan)
        return cls(
            Measurement(n.copy(), wrench, n.copy()), Truth(n.copy(), n.copy(), m.copy(), m.copy(), wrench.copy(), 0.0)
        )


class PlantKernels(NamedTuple):
    """A simulated plant as kernels; `constants` and `state` are their first arguments."""

    observe: Callable[[Any, Array, PlantDisturbance, Observation], float]
    """Fills a `Observation` and returns the place of the surface, m"""
    advance: Callable[[Any, Array, PlantDisturbance, Array, Array], None]
    """Moves `state` on by one period; the last two arguments are torque and joint position of the command"""
    constants: Any
    state: Array
    """All that changes during a trial"""
