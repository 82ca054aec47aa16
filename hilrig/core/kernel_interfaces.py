"""Kernels that robots and simulated plants may offer in addition, so that a whole trial can be compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hilrig.core.signals import Array, Kinematics, Measurement, PlantDisturbance, Truth


class RobotKernels(NamedTuple):
    """A robot as a kernel."""

    kinematics: Callable[[Any, Array, Array, Kinematics], None]
    """Writes `Robot.kinematics` at (q, q') into the given arrays; `constants` is its first argument"""
    constants: Any


class Observation(NamedTuple):
    """Arrays for what a plant reports at a tick; a kernel fills all of them."""

    measurement: Measurement
    """Without sensor errors, which the rig adds"""
    truth: Truth
    """All but the position of the surface: a number in a tuple cannot be written in place"""
    sample: Array
    """The measurement's stamp, s, and 1 if it is fresh, else 0, (2,); a kernel leaves them: nan and 1"""

    @classmethod
    def empty(cls, joints: int, axes: int) -> Observation:
        """Return arrays for n = `joints` and m = `axes`, filled with nan."""
        n, m, wrench = np.full(joints, np.nan), np.full(axes, np.nan), np.full(6, np.nan)
        return cls(
            Measurement(n.copy(), wrench, n.copy()),
            Truth(n.copy(), n.copy(), m.copy(), m.copy(), wrench.copy(), 0.0),
            np.array([np.nan, 1.0]),
        )


class PlantKernels(NamedTuple):
    """A simulated plant as kernels; `constants` and `state` are their first arguments."""

    observe: Callable[[Any, Array, PlantDisturbance, Observation], float]
    """Fills an `Observation` and returns the position of the surface, m"""
    advance: Callable[[Any, Array, PlantDisturbance, Array, Array], None]
    """Advances `state` by one period; the last two arguments are the command's torque and joint position"""
    constants: Any
    state: Array
    """Everything that changes during a trial"""
