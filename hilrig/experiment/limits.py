"""The safety limits of a trial: what the file can set, and the defaults, which are defined only here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np

from hilrig.core.interfaces import Robot
from hilrig.core.parameters import Parameter, PerAxis, per_axis
from hilrig.core.signals import Array

COMMANDED = ("torque", "torque_rate", "position", "position_rate")
"""The limits on commands. The others are on what is measured, and end the trial"""


@dataclass(frozen=True)
class Limits:
    """Safety limits. A measured quantity beyond one ends the trial; a command is brought within, unless `trip_on` it.

    Whatever ends a trial, the plant is held. The defaults are the robot's own limits; they can only be made tighter.
    """

    tip_force: Annotated[float, Parameter("N", "largest force at the tip", 1e-3, 1e5)] = 200.0
    joint_velocity: Annotated[float, Parameter("rad/s", "largest joint velocity", 1e-3, 1e3)] = 20.0
    joint_margin: Annotated[
        float | None, Parameter("rad", "least distance of the joints from the robot's limits; null: not checked", 0, 10)
    ] = 0.0
    workspace: Annotated[
        Mapping[str, tuple[float, ...]], Parameter("m", "lowest and highest position of the tip, by axis")
    ] = field(default_factory=dict)
    torque: Annotated[
        PerAxis | None, Parameter("N*m", "largest commanded torque of each joint; default: the robot's", 0, 1e5)
    ] = None
    torque_rate: Annotated[
        PerAxis | None, Parameter("N*m/s", "largest rate of each joint's commanded torque; default: none", 1e-3, 1e9)
    ] = None
    position_rate: Annotated[
        PerAxis | None,
        Parameter(
            "rad/s", "largest rate of each joint's commanded position; default: the robot's, if known", 1e-6, 1e6
        ),
    ] = None
    trip_on: Annotated[
        tuple[Literal["torque", "torque_rate", "position", "position_rate"], ...],
        Parameter("", "limits on commands that end the trial instead of changing the command"),
    ] = ()
    command_age: Annotated[
        float | None,
        Parameter(
            "s", "age of the command in effect at which the plant is held; default: 20 ms, or 5 periods if more",
            1e-4, 10, "log",
        ),
    ] = None  # fmt: skip
    sample_age: Annotated[
        float | None,
        Parameter("s", "age of the newest sample at which the plant is held; default: as command_age", 1e-4, 10, "log"),
    ] = None
    start_tolerance: Annotated[
        float, Parameter("rad", "how far each joint may be from the start when the trial starts", 1e-6, 10)
    ] = 0.02
    prepare_timeout: Annotated[float, Parameter("s", "how long the plant may take to prepare", 0.1, 3600)] = 60.0
    approach_timeout: Annotated[float, Parameter("s", "how long it may take to reach contact", 0.1, 3600)] = 30.0
    retract_timeout: Annotated[float, Parameter("s", "how long it may take to retract", 0.1, 3600)] = 30.0

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Limits:
        """Return the limits in the document of a trial."""
        workspace = {axis: tuple(ends) for axis, ends in document.get("workspace", {}).items()}
        values = {name: tuple(value) if isinstance(value, list) else value for name, value in document.items()}
        return cls(**{**values, "workspace": workspace})

    def command_age_limit(self, period: float, actuation_delay: int) -> float:
        """Return the age at which the plant is held, s: as given, or max(20 ms, (d + 4) l)."""
        return max(0.02, (actuation_delay + 4) * period) if self.command_age is None else self.command_age

    def sample_age_limit(self, period: float, actuation_delay: int) -> float:
        """Return the age of a sample at which the plant is held, s."""
        return self.command_age_limit(period, actuation_delay) if self.sample_age is None else self.sample_age

    def largest_torque(self, robot: Robot) -> Array:
        """Return the largest commanded torque, (n,) N m. Raises ValueError for a wrong number of values."""
        own = np.array(robot.torque_limits(), dtype=np.float64)
        return own if self.torque is None else np.minimum(own, per_axis(self.torque, robot.joints, "torque"))

    def torque_step(self, robot: Robot, period: float) -> Array:
        """Return the largest change of the commanded torque in one period, (n,) N m; inf for no limit."""
        rate = np.inf if self.torque_rate is None else self.torque_rate
        return per_axis(rate, robot.joints, "torque_rate") * period

    def position_step(self, robot: Robot, period: float) -> Array:
        """Return the largest change of the commanded position in one period, (n,) rad; inf for no limit."""
        offered = getattr(robot, "velocity_limits", None)
        own = per_axis(np.inf if offered is None else offered(), robot.joints, "velocity_limits")
        rate = np.inf if self.position_rate is None else self.position_rate
        return np.minimum(own, per_axis(rate, robot.joints, "position_rate")) * period

    def joint_range(self, robot: Robot) -> tuple[Array, Array]:
        """Return the lowest and highest joint positions, (n,) rad each; infinite where they are not checked."""
        n = robot.joints
        if self.joint_margin is None:
            return np.full(n, -np.inf), np.full(n, np.inf)
        low, high = robot.joint_limits()
        return np.asarray(low) + self.joint_margin, np.asarray(high) - self.joint_margin

    def tip_range(self, axes: tuple[str, ...]) -> Array:
        """Return the lowest and highest position of the tip, (2, m) m; infinite where there is no limit."""
        return np.array([self.workspace.get(axis, (-np.inf, np.inf)) for axis in axes], dtype=np.float64).T.copy()
