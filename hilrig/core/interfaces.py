"""The interface of each group of plug-ins. A kind is a file with one public frozen dataclass; fields are parameters."""

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
"""m/s: how far v_d may deviate from x' (anti-windup)"""
POSITION_CLIP = 0.02
"""m: how far p_d may deviate from x (anti-windup). At an obstacle, one clip without the other fails."""


class Impedance(NamedTuple):
    """The desired dynamics, eq. (3), one entry per task axis, and the anti-windup limits of its filter."""

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
    """How far v_d may deviate from x', m/s; inf for no limit"""
    position_clip: float = POSITION_CLIP
    """How far p_d may deviate from x, m; inf for no limit"""


class Task(NamedTuple):
    """What a control law receives before a trial."""

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

    `step` writes its state into the arrays of `memory` and returns the joint torque (n,) before limits.
    Every field of `memory` is published and recorded under its name.
    """

    step: Callable[[Any, Any, State, Reference], Array]
    parameters: Any
    memory: Any


class Controller(Protocol):
    """Group `controllers`. One whose law has known bounds may also offer `hilrig.core.assessment.Assessing`."""

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
    """Last value of the previous phase; None in the first phase"""


class Samples(NamedTuple):
    """A scalar reference over time, three arrays (N,): value and its first two derivatives."""

    value: Array
    rate: Array
    acceleration: Array


class ReferenceSignal(Protocol):
    """Group `references`: one scalar desired quantity (a position in m or a force in N).

    A kind that takes its data from a file names the field with the path in a class variable `reads`, and offers
    `filled(text)`, which returns the kind with the data from the file's text, or raises ValueError if it is unusable.

    A kind may offer `warnings(span)`, which returns a list of sentences about what is probably unintended in the phase.
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
        """Add the disturbance to `schedule` in place, for trial times `time` (N,) s.

        Raises ValueError if its axis does not exist.
        """
        ...


def is_fault(disturbance: Disturbance) -> bool:
    """Return whether it is a fault of the real-time loop, not of the plant or the measurements."""
    return any(field.startswith("faults.") for field in disturbance.acts_on)


class Robot(Protocol):
    """Group `robots`: geometry and nominal dynamics, shared by controller and driver.

    A robot that also offers `kernels() -> RobotKernels` can be part of a compiled trial.
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
    """Supported clocks, from "lockstep" and "realtime" """
    disturbances: tuple[str, ...]
    """The plant fields of `DisturbanceSchedule` that it can apply"""
    simulated: bool
    """Whether the plant waits for the command; a robot does not"""
    stop_time: float = 0.0
    """Longest time that `hold` and `close` may take together, s; nothing interrupts them before"""


class TrialStart(NamedTuple):
    """What a driver receives before a trial."""

    period: float
    """s"""
    joint_position: Array
    """Where the trial begins, at rest, (n,) rad"""
    force: Array
    """F_d at the first tick, (m,) N; zero in position-controlled axes"""


class Progress(NamedTuple):
    """What a plant does for one period before or after the ticks of a trial."""

    what: str
    """In words, such as "going to the start"."""
    value: float = np.nan
    """How far it is, in `unit`; nan if unknown"""
    target: float = np.nan
    """Where it ends"""
    unit: str = ""
    command: Command | None = None
    """Command for this period, which passes the envelope as those of a law do; None if the plant moves by itself"""


class Plant(Protocol):
    """A driver's plant during one trial. `measure` is called first.

    A simulated plant that also offers `kernels() -> PlantKernels` can be part of a compiled trial.

    Any plant may offer `hold`, and one that is not simulated must: `hold()` stops the plant where it is and keeps it
    there, without further calls, whatever it was doing. It may be called at any time after `connect`, also twice.

    A plant may offer steps around the ticks, as generators that yield a `Progress` once per period, without blocking:
    `prepare()` tares the sensors and moves the arm slowly to the start, `approach()` moves until contact is felt,
    `retract()` moves away after the last tick. Each can be left at any period through `hold`.

    A plant may offer `await_sample(timeout_s)`: wait for a sample newer than the last measured one; return when it
    arrived, in s of `time.monotonic`, or None if it has not. The samples then begin the ticks of a real-time trial.
    """

    def measure(self, disturbance: PlantDisturbance) -> Measurement:
        """Return the newest sensor readings."""
        ...

    def advance(self, command: Command, disturbance: PlantDisturbance) -> None:
        """Apply `command` for one period. A real plant sends it and returns."""
        ...

    def holding_command(self) -> Command:
        """Return the command that keeps the plant where it is; in effect until the law's first command arrives."""
        ...

    def truth(self, disturbance: PlantDisturbance) -> Truth | None:
        """Return the current true state, or None if it is unknown."""
        ...

    def close(self) -> None:
        """Release the plant, which is held. Called once, after `hold`."""
        ...


class Driver(Protocol):
    """Group `drivers`: code that talks to one plant. It knows nothing about the bus.

    A driver may also offer `render(joint_positions, width, height)`, which returns a picture (height, width, 3) uint8
    for each row of `joint_positions` (F, n) rad, for the report's animation.

    A driver that needs software that may not be installed offers `missing() -> str`: what is missing on this machine,
    and what to do, in one line; empty if nothing is missing. The driver must still be constructible, because reports
    read plans on any machine.
    """

    capabilities: ClassVar[Capabilities]
    robot: Robot

    @property
    def servo_gain(self) -> float | None:
        """k_ref of eq. (26), N m/rad, if the plant takes joint positions; None if it takes torques."""
        ...

    @property
    def surface_position(self) -> float:
        """Nominal position of the surface along the last task axis, m."""
        ...

    def connect(self, start: TrialStart) -> Plant:
        """Return the plant for one trial. Nothing moves yet; a simulated plant is at rest at the start."""
        ...


class Metric(Protocol):
    """Group `metrics`: one figure of merit for one phase of one trial; lower is better."""

    unit: ClassVar[str]

    def measure(self, record: Any) -> dict[str, float]:
        """Return the value for each axis name, or under "" if the metric has no axes.

        `record` is the `hilrig.kinds.metrics._record.PhaseRecord` of the phase.
        """
        ...
