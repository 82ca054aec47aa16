"""Whether a trial can be run: software, references, disturbances, workspace, and the controller's parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hilrig.core.errors import OutOfReach, PluginError
from hilrig.core.interfaces import Law
from hilrig.core.law_memory import memory_problems
from hilrig.core.signals import Array
from hilrig.experiment.document import Keys
from hilrig.experiment.trial import (
    Trial,
    UnusableReferenceError,
    disturbance_schedule,
    first_state,
    make_task,
    sample_axis,
    start_joint_position,
)
from hilrig.kinds.user_files import code_of, place_of

CHECK_EVERY = 0.01
"""s between the instants at which a trajectory is checked against the workspace, in addition to its extremes"""


class InfeasibleError(Exception):
    """A trial cannot be run as planned; `path` leads to the cause in the experiment."""

    def __init__(self, path: Keys, message: str) -> None:
        self.path = path
        super().__init__(message)


def sampled(trial: Trial, axis: str) -> Array:
    """Return the reference of `axis` at every tick, (N,). Raises InfeasibleError at a phase."""
    try:
        return sample_axis(trial, axis).value
    except UnusableReferenceError as error:
        field = "force" if axis in trial.task.force_axes else "position"
        raise InfeasibleError(("phases", error.index, field), str(error)) from error


def check_driver(trial: Trial) -> None:
    """Raise InfeasibleError if the driver needs software that is not installed on this machine."""
    missing = getattr(trial.driver, "missing", None)
    if missing is not None and (message := missing()):
        raise InfeasibleError(("driver", "kind"), message)


def check_disturbances(trial: Trial) -> None:
    """Raise InfeasibleError if one of the condition's disturbances does not fit the robot."""
    for index, disturbance in enumerate(trial.disturbances):
        try:
            with code_of(disturbance):
                disturbance_schedule(replace(trial, disturbances=(disturbance,)))
        except PluginError as error:
            raise InfeasibleError(("conditions", trial.condition_name, index), str(error)) from error


def check_workspace(trial: Trial) -> None:
    """Raise InfeasibleError, naming phase, time and place, if the path leaves the workspace or joint limits.

    The path follows the references in position axes and the moving surface in the force axis; it is checked every
    10 ms and at its extremes in every axis. Force references are sampled as well.
    """
    path = trajectory(trial)
    start = np.array(trial.start_position)
    if not np.array_equal(start, path[0]):
        _check_point(trial, start, "the start", ("task", "start"))
    last = 0
    for tick in instants(trial, path):
        try:
            _check_tick(trial, tick, path[tick])
        except InfeasibleError:
            # Report the first tick that is out of reach, not the first one checked.
            for earlier in range(last, tick + 1):
                _check_tick(trial, earlier, path[earlier])
        last = tick


def trajectory(trial: Trial) -> Array:
    """Return the planned tip position at every tick, (N, m) m."""
    path = np.tile(np.array(trial.start_position), (trial.ticks, 1))
    for i, axis in enumerate(trial.axes):
        reference = sampled(trial, axis)
        if axis not in trial.task.force_axes:
            path[:, i] = reference
        elif axis == trial.axes[-1]:
            path[:, i] = trial.driver.surface_position + disturbance_schedule(trial).plant_surface_offset
    return path


def instants(trial: Trial, path: Array) -> list[int]:
    """Return the ticks to check: every 10 ms, and the extremes of every axis in every phase."""
    ticks = set(range(0, trial.ticks, max(1, round(CHECK_EVERY / trial.period))))
    for phase in trial.phases:
        start = trial.tick_of(phase.start)
        part = path[start : trial.tick_of(phase.end)]
        ticks |= {start + int(i) for i in (*part.argmin(axis=0), *part.argmax(axis=0))}
    return sorted(ticks)


def _check_tick(trial: Trial, tick: int, position: Array) -> None:
    index = next(i for i, phase in enumerate(trial.phases) if tick < trial.tick_of(phase.end))
    when = f"phase '{trial.phases[index].name}', t = {tick * trial.period:.4g} s"
    _check_point(trial, position, when, ("phases", index, "position"))


def _check_point(trial: Trial, position: Array, when: str, path: Keys) -> None:
    robot = trial.driver.robot
    where = ", ".join(f"{axis} = {value:.4g} m" for axis, value in zip(trial.axes, position, strict=True))
    try:
        q = robot.inverse_kinematics(position)
    except OutOfReach as error:
        raise InfeasibleError(path, f"{when}: {where} is out of reach: {error}") from error
    lower, upper = robot.joint_limits()
    for joint, (value, low, high) in enumerate(zip(q, lower, upper, strict=True), start=1):
        if not low <= value <= high:
            limits = f"its range is {low:.4g} to {high:.4g} rad"
            raise InfeasibleError(path, f"{when}: {where} needs joint {joint} at {value:.4g} rad; {limits}")


def check_controller(trial: Trial) -> None:
    """Raise InfeasibleError if the controller's parameters do not fit the task, by starting its law once."""
    path: Keys = ("controllers", trial.controller_name)
    q, still = start_joint_position(trial), np.zeros(trial.driver.robot.joints)
    task, state = make_task(trial), first_state(trial, q, np.zeros(len(trial.axes)), still, trial.period)
    try:
        with code_of(trial.controller):
            law = trial.controller.start(task, state)
            if not isinstance(law, Law):
                raise TypeError(f"start returned a {type(law).__name__}; it must return a Law")
    except PluginError as error:
        raise InfeasibleError(path, str(error)) from error
    problems = [
        f"{place_of(type(law.memory), name)}: {text}" if name else text
        for name, text in memory_problems(law.memory).items()
    ]
    if problems:
        raise InfeasibleError(path, "; ".join(problems))
