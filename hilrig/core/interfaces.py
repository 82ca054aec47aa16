"""What each kind of plug-in must offer. A kind is a file with one public frozen dataclass; fields are parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from hilrig.core.signals import (
    Array,
    Command,
    DisturbanceSchedule,
    Kinematics,
    Measurement,
    PlantDisturbance,
    Reference,
    State,
    Truth,
)

VELOCITY_CLIP = 0.1
"""m/s: how far v_d may run from x' (anti-windup)"""
POSITION_CLIP = 0.02
"""m: how far p_d may run from x (anti-windup). At an obstacle one clip without the other fails."""


class Impedance(NamedTuple):
    """The desired dynamics, eq. (3), one entry per task axis, and how its filter is kept from winding up."""

    sigma: Array
    """Diagonal of Sigma, (m,): 1 position-controlled, 0 force-controlled"""
    inertia: Array
    """M_d, (m,) kg"""
    damping: Array
    """B_d, (m,) N s/m"""
    stiffness: Array
    """K_d, (m,) N/m; unused in force-controlled axes"""
    reference_states: bool
    """Whether the filter runs on its own states p_d, v_d (True) or on the measured x, x' (False)"""
    velocity_clip: float = VELOCITY_CLIP
    """How far v_d may run from x', m/s; inf for any distance"""
    position_clip: float = POSITION_CLIP
    """How far p_d may run from x, m; inf for any distance"""


class Task(NamedTuple):
    """What a control law is told before a trial."""

    period: float
    """l, s"""
    axes: tuple[str, ...]
    """Names of the m task axes"""
    impedance: Impedance
    dynamic_parameters: Array
    """theta of the nominal robot, (p,); empty if the robot has no model"""
    torque_limit: Array
    """(n,) N m"""


class Law(NamedTuple):
    """A control law ready to run: torque = step(parameters, memory, state, reference).

    `step` writes what it must remember into the arrays of `memory` and returns the joint torque (n,) before limits.
    Every field of `memory` is published and recorded under its name.
    """

    step: Callable[[Any, Any, State, Reference], Array]
    parameters: Any
    memory: Any


class Controller(Protocol):
    """Group `controllers`. One that knows bounds of its law may also offer `hilrig.core.assessment.Assessing`."""

    def start(self, task: Task, state: State) -> Law:
        """Return the law for a trial that begins in `state`. Raises ValueError if a parameter does not fit the task."""
        ...


class Span(NamedTuple):
    """The phase for which a reference is sampled."""

    start: float
    """s, trial time"""
    end: float
    """s, trial time"""
    previous: float | None
    """Last value of the phase before; None in the first phase"""


class Samples(NamedTuple):
    """A scalar reference over time, three arrays (N,): value and its first two derivatives."""

    value: Array
    rate: Array
    acceleration: Array


class ReferenceSignal(Protocol):
    """Group `references`: one scalar desired quantity (a position in m or a force in N).

    A kind that takes its data from a file names the field with the path in a class variable `reads`, and offers
    `filled(text)`, which returns the kind with the data of the file's text; it raises ValueError if they are unusable.

    A kind may offer `warnings(span)`, which returns a list of sentences: what in this phase is probably not meant.
    `hilrig check` prints them.
    """

    def sample(self, time: Array, span: Span) -> Samples:
        """Return the reference at trial times `time` (N,) s, all within `span`. Raises ValueError if it cannot."""
        ...


class Disturbance(Protocol):
    """Group `disturbances`."""

    acts_on: ClassVar[tuple[str, ...]]
    """The fields of `DisturbanceSchedule` it changes; those of `DisturbanceSchedule.faults` as "faults.<field>\""""

    def apply(
        self, schedule: DisturbanceSchedule, time: Array, axes: tuple[str, ...], random: np.random.Generator
    ) -> None:
        """Add itself to `schedule` in place, for trial times `time` (N,) s. Raises ValueError if it lacks its axis."""
        ...


def is_fault(disturbance: Disturbance) -> bool:
    """Return whether it is a fault of the real-time loop, and not of the plant or of what is measured."""
    return any(field.startswith("faults.") for field in disturbance.acts_on)


class Robot(Protocol):
    """Group `robots`: geometry and nominal dynamics, shared by controller and driver.

    One that also offers `kernels() -> RobotKernels` can be part of a compiled trial.
    """

    axes: ClassVar[tuple[str, ...]]
    """Names of the m task axes; the last one is the surface's normal"""
    joints: ClassVar[int]
    """Number of joints, n; the laws that come with hilrig need n = m"""

    def forward_kinematics(self, joint_position: Array) -> Array:
        """Return x (m,) m."""
        ...

    def inverse_kinematics(self, position: Array) -> Array:
        """Return q (n,) rad. Raises OutOfReach."""
        ...

    def kinematics(self, joint_position: Array, joint_velocity: Array) -> Kinematics:
        """Return geometry and regressor at (q, q')."""
        ...

    def dynamic_parameters(self) -> Array:
        """Return the nominal theta (p,); empty if the robot has no model."""
        ...

    def torque_limits(self) -> Array:
        """Return the largest joint torque, (n,) N m."""
        ...

    def joint_limits(self) -> tuple[Array, Array]:
        """Return the lowest and highest joint position, (n,) rad each."""
        ...


class Capabilities(NamedTuple):
    """What a driver can do."""

    clocks: tuple[str, ...]
    """Of "lockstep" and "realtime" """
    disturbances: tuple[str, ...]
    """The plant fields of `DisturbanceSchedule` it can apply"""
    simulated: bool
    """Whether the plant waits for the command; a robot does not"""


class TrialStart(NamedTuple):
    """What a driver is told before a trial."""

    period: float
    """s"""
    joint_position: Array
    """Where the trial begins, at rest, (n,) rad"""


class Plant(Protocol):
    """A driver at work in one trial. `measure` is called before anything else.

    One that also offers `kernels() -> PlantKernels` can be part of a compiled trial.
    """

    def measure(self, disturbance: PlantDisturbance) -> Measurement:
        """Return what the sensors say now."""
        ...

    def advance(self, command: Command, disturbance: PlantDisturbance) -> None:
        """Apply `command` for one period. A real plant sends it and returns."""
        ...

    def hold(self) -> Command:
        """Return the command that holds the plant where it is; in effect until the first command arrives."""
        ...

    def truth(self, disturbance: PlantDisturbance) -> Truth | None:
        """Return the true state now, or None where nobody knows it."""
        ...

    def close(self) -> None:
        """Leave the plant in a safe state."""
        ...


class Driver(Protocol):
    """Group `drivers`: code that speaks to one plant. It knows nothing of the bus.

    A driver may also offer `render(joint_positions, width, height)`: a picture (height, width, 3) uint8 for each row of
    `joint_positions` (F, n) rad, for the report's animation.

    One that needs software that may not be installed offers `missing() -> str`: what is missing on this machine, and
    what to do, in one line; empty if nothing is. It can be constructed all the same: reports read plans anywhere.
    """

    capabilities: ClassVar[Capabilities]
    robot: Robot

    @property
    def servo_gain(self) -> float | None:
        """k_ref of eq. (26), N m/rad, if the plant takes joint positions; None if it takes torques."""
        ...

    @property
    def surface_position(self) -> float:
        """Nominal place of the surface along the last task axis, m."""
        ...

    def begin(self, begin: TrialStart) -> Plant:
        """Take hold of the plant, at rest at the given joint position."""
        ...


class Metric(Protocol):
    """Group `metrics`: one figure of merit of one phase of one trial; lower is better."""

    unit: ClassVar[str]

    def measure(self, record: Any) -> dict[str, float]:
        """Return the value for each axis name, or under "" where there is no axis.

        `record` is the `hilrig.kinds.metrics._record.PhaseRecord` of the phase.
        """
        ...
