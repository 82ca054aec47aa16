"""A trial: one controller under one condition, once; everything the rig needs to know to run it.

No YAML and no units here: the rig's processes read trials and must start fast.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hilrig.core.errors import PluginError
from hilrig.core.interfaces import (
    POSITION_CLIP,
    VELOCITY_CLIP,
    Controller,
    Disturbance,
    Driver,
    Impedance,
    ReferenceSignal,
    Samples,
    Span,
    Task,
    TrialStart,
)  # fmt: skip
from hilrig.core.signals import Array, DisturbanceSchedule, Kinematics, Reference, State
from hilrig.experiment.limits import Limits
from hilrig.experiment.rig_settings import RigSettings
from hilrig.experiment.timing_budget import TimingBudget
from hilrig.kinds.registry import dump, restore
from hilrig.kinds.user_files import code_of

ALL_PHASES = "all"
"""Name for all phases together, in metrics and expectations"""


class UnusableReferenceError(ValueError):
    """A reference that cannot be sampled in its phase, which has the number `index`."""

    def __init__(self, index: int, message: str) -> None:
        self.index = index
        super().__init__(message)


@dataclass(frozen=True)
class TaskSpec:
    """The task; per-axis values have one entry for each axis of the robot."""

    force_axes: tuple[str, ...]
    """Axes that are force-controlled; the others are position-controlled"""
    inertia: tuple[float, ...]
    """M_d, kg"""
    damping: tuple[float, ...]
    """B_d, N s/m"""
    stiffness: tuple[float, ...]
    """K_d, N/m"""
    states: str
    """States that the impedance filter runs on: "measured" or "reference\""""
    velocity_cutoff: float
    """f_c of the joint velocity filter, Hz"""
    anti_windup: str = "clip"
    """Whether the filter's p_d, v_d are kept near the measured state, "clip", or run free, "none\""""
    on_stale_sample: str = "hold"
    """What happens where a sample is not fresh: the last command is held, "hold", or the law is called, "call\""""

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> TaskSpec:
        """Return the task that `Trial.to_document` wrote."""
        return cls(**{name: _tupled(value) for name, value in document.items()})


@dataclass(frozen=True)
class PhaseSpec:
    """A span of the trial, `start <= t < end`, with its references."""

    name: str
    start: float
    """s, a whole number of periods"""
    end: float
    """s, a whole number of periods"""
    position: Mapping[str, ReferenceSignal]
    """x_d for each position-controlled axis, m"""
    force: Mapping[str, ReferenceSignal]
    """F_d for each force-controlled axis, N"""


@dataclass(frozen=True)
class Trial:
    """One controller under one condition, once."""

    id: str
    """<controller>.<condition>.<repeat>"""
    controller_name: str
    condition_name: str
    repeat: int
    seed: tuple[int, ...]
    """(seed of the experiment, repeat): the same for every controller"""
    period: float
    """l, s"""
    clock: str
    """"lockstep" or "realtime\""""
    actuation_delay: int
    """Ticks from a measurement to the tick at which its command acts"""
    driver: Driver
    controller: Controller
    task: TaskSpec
    phases: tuple[PhaseSpec, ...]
    disturbances: tuple[Disturbance, ...]
    limits: Limits
    start_position: tuple[float, ...]
    """Where the tip starts, at rest, (m,) m"""
    rig: RigSettings = field(default_factory=RigSettings)
    """The real-time set-up"""
    timing: TimingBudget = field(default_factory=TimingBudget)
    """Timing limits of the loop in real time"""

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the m task axes."""
        return self.driver.robot.axes

    @property
    def ticks(self) -> int:
        """Number of ticks, N."""
        return self.tick_of(self.phases[-1].end)

    @property
    def velocity_smoothing(self) -> float:
        """a = 1 - exp(-2 pi f_c l) of the joint velocity filter q' += a ((q - q_prev)/l - q')."""
        return 1.0 - np.exp(-2.0 * np.pi * self.task.velocity_cutoff * self.period)

    def tick_of(self, time: float) -> int:
        """Return the tick at trial time `time` (s, a whole number of periods)."""
        return round(time / self.period)

    def to_document(self) -> dict[str, Any]:
        """Return the trial as plain data for JSON, exact to the last bit."""
        return {
            **{name: getattr(self, name) for name in _PLAIN},
            "axes": list(self.axes),
            "seed": list(self.seed),
            "driver": dump(self.driver),
            "controller": dump(self.controller),
            "task": dump(self.task),
            "phases": dump(self.phases),
            "disturbances": dump(self.disturbances),
            "limits": dump(self.limits),
            "start_position": list(self.start_position),
            "rig": dump(self.rig),
            "timing": dump(self.timing),
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Trial:
        """Return the trial that `to_document` wrote.

        Raises PluginError if one of its kinds is gone or has changed.
        """
        return cls(
            **{name: document[name] for name in _PLAIN},
            seed=tuple(document["seed"]),
            driver=restore("drivers", document["driver"]),
            controller=restore("controllers", document["controller"]),
            task=TaskSpec.from_document(document["task"]),
            phases=tuple(_phase(item) for item in document["phases"]),
            disturbances=tuple(restore("disturbances", item) for item in document["disturbances"]),
            limits=Limits.from_document(document["limits"]),
            start_position=tuple(document["start_position"]),
            rig=RigSettings(**document.get("rig", {})),  # missing in plans older than these settings
            timing=TimingBudget(**document["timing"]),
        )


_PLAIN = ("id", "controller_name", "condition_name", "repeat", "period", "clock", "actuation_delay")


def times(trial: Trial) -> Array:
    """Return t = k l of every tick, (N,) s."""
    return np.arange(trial.ticks, dtype=np.float64) * trial.period


def references(trial: Trial) -> Reference:
    """Return the references of every tick, arrays (N, m).

    Raises UnusableReferenceError, a ValueError naming phase and axis, if one cannot be sampled.
    """
    shape = (trial.ticks, len(trial.axes))
    position, velocity, acceleration, force = (np.zeros(shape) for _ in range(4))
    for i, axis in enumerate(trial.axes):
        if axis in trial.task.force_axes:
            force[:, i] = sample_axis(trial, axis).value
        else:
            position[:, i], velocity[:, i], acceleration[:, i] = sample_axis(trial, axis)
    return Reference(position, velocity, acceleration, force)


def sample_axis(trial: Trial, axis: str) -> Samples:
    """Return the reference of one axis at every tick, three arrays (N,).

    Raises UnusableReferenceError, naming phase and axis.
    """
    time = times(trial)
    parts: list[Samples] = []
    previous: float | None = None
    for index, phase in enumerate(trial.phases):
        signal = (phase.force if axis in trial.task.force_axes else phase.position)[axis]
        ticks = slice(trial.tick_of(phase.start), trial.tick_of(phase.end))
        # One sample more than the phase has ticks: its end is where the next phase starts.
        moments = np.append(time[ticks], phase.end)
        try:
            with code_of(signal):
                samples = Samples(*signal.sample(moments, Span(phase.start, phase.end, previous)))
                if any(np.shape(array) != moments.shape or not np.isfinite(array).all() for array in samples):
                    raise ValueError(f"sample must return three arrays of {moments.size} finite numbers")
        except PluginError as error:
            message = f"phase '{phase.name}', axis {axis}: {error}"
            raise UnusableReferenceError(index, message) from error
        previous = float(samples.value[-1])
        parts.append(Samples(*(array[:-1] for array in samples)))
    return Samples(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def disturbance_schedule(trial: Trial) -> DisturbanceSchedule:
    """Return the trial's disturbances at every tick.

    Each disturbance draws from its own generator, seeded by (seed, repeat, its index in the condition): repeat i has
    the same disturbances for every controller. Raises ValueError if a disturbance does not fit the robot.
    """
    robot = trial.driver.robot
    result = DisturbanceSchedule.quiet(trial.ticks, robot.joints, len(robot.axes))
    for index, disturbance in enumerate(trial.disturbances):
        disturbance.apply(result, times(trial), robot.axes, np.random.default_rng([*trial.seed, index]))
    return result


def make_impedance(task: TaskSpec, axes: tuple[str, ...]) -> Impedance:
    """Return the desired dynamics of a task on these axes."""
    sigma = np.array([0.0 if axis in task.force_axes else 1.0 for axis in axes])
    free = task.anti_windup == "none"
    return Impedance(
        sigma, np.array(task.inertia), np.array(task.damping), np.array(task.stiffness), task.states == "reference",
        np.inf if free else VELOCITY_CLIP, np.inf if free else POSITION_CLIP,
    )  # fmt: skip


def make_task(trial: Trial) -> Task:
    """Return what the control law receives before the trial."""
    robot = trial.driver.robot
    impedance = make_impedance(trial.task, trial.axes)
    # Copies, because a law may write into what it is given, and these may be the robot's own.
    model, limits = np.array(robot.dynamic_parameters()), np.array(robot.torque_limits())
    return Task(trial.period, trial.axes, impedance, model, limits)


def start_joint_position(trial: Trial) -> Array:
    """Return the joint position (n,) rad at which the trial starts. Raises OutOfReach."""
    return trial.driver.robot.inverse_kinematics(np.array(trial.start_position))


def trial_start(trial: Trial) -> TrialStart:
    """Return what the driver receives before the trial. Raises OutOfReach."""
    return TrialStart(trial.period, start_joint_position(trial), references(trial).force[0])


def first_state(trial: Trial, q: Array, force: Array, torque: Array, elapsed: float) -> State:
    """Return what a law sees at its first measurement: joints at q (n,) rad, at rest since there is no earlier sample.

    `force` is along the task axes (m,) N, `torque` the torque in effect (n,) N m, `elapsed` in s.
    """
    still = np.zeros(trial.driver.robot.joints)
    at = Kinematics(*(np.array(part) for part in trial.driver.robot.kinematics(q.copy(), still.copy())))
    return State(
        q.copy(), still, at.position, at.velocity, at.jacobian, at.jacobian_rate, at.regressor,
        np.array(force), torque.copy(), elapsed,
    )  # fmt: skip


def _phase(document: Mapping[str, Any]) -> PhaseSpec:
    position = {axis: restore("references", item) for axis, item in document["position"].items()}
    force = {axis: restore("references", item) for axis, item in document["force"].items()}
    return PhaseSpec(document["name"], document["start"], document["end"], position, force)


def _tupled(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
