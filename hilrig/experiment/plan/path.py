"""Where a trial's tip is meant to be, and what the robot is like there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hilrig.core.signals import Array, Kinematics
from hilrig.experiment.plan.feasibility import instants, trajectory
from hilrig.experiment.trial import Trial, disturbance_schedule
from hilrig.kinds.delay_bounds import mobility


class TipPath(NamedTuple):
    """The path of one condition at K instants, as the check of the workspace looks at it."""

    condition: str
    """Name of the condition; empty where all conditions have the same course"""
    places: tuple[str, ...]
    """Phase, time and tip position in words, (K,)"""
    mobility: Array | None
    """M_t^-1, (K, m, m) 1/kg; None if there is no M to invert"""
    joint_rates: Array
    """J^+, joint rates for a tip velocity, (K, n, m) rad/m"""
    delay: int
    """Most samples between a measurement and its command's effect: actuation and measurement delay"""

    def place(self, index: int) -> str:
        """Return in words where instant `index` is."""
        return f"{self.prefix}{self.places[index]}"

    @property
    def prefix(self) -> str:
        """The condition in words, if it matters."""
        return f"condition '{self.condition}', " if self.condition else ""


def tip_paths(trials: Sequence[Trial]) -> list[TipPath]:
    """Return the different courses of the trials, whose path is within reach."""
    found: dict[tuple[bytes, int], TipPath] = {}
    for trial in {trial.condition_name: trial for trial in trials}.values():
        path = trajectory(trial)
        delay = trial.actuation_delay + int(disturbance_schedule(trial).measurement_delay.max())
        if (path.tobytes(), delay) not in found:
            found[path.tobytes(), delay] = _course(trial, path, delay)
    if len(found) == 1:
        return [course._replace(condition="") for course in found.values()]
    return list(found.values())


def _course(trial: Trial, path: Array, delay: int) -> TipPath:
    robot = trial.driver.robot
    theta, still = robot.dynamic_parameters(), np.zeros(robot.joints)
    ticks = instants(trial, path)
    observations = [robot.kinematics(robot.inverse_kinematics(path[tick]), still) for tick in ticks]
    return TipPath(
        trial.condition_name,
        tuple(_words(trial, tick, path[tick]) for tick in ticks),
        _mobilities(observations, theta),
        np.array([np.linalg.pinv(at.jacobian) for at in observations], dtype=np.float64),
        delay,
    )


def _mobilities(observations: list[Kinematics], theta: Array) -> Array | None:
    """Return M_t^-1 (K, m, m); None for a robot without a model, or with one whose M cannot be inverted."""
    try:
        return np.array([mobility(at, theta) for at in observations]) if theta.size else None
    except np.linalg.LinAlgError:
        return None


def _words(trial: Trial, tick: int, position: Array) -> str:
    phase = next(phase for phase in trial.phases if tick < trial.tick_of(phase.end))
    where = ", ".join(f"{axis} = {value:.3g} m" for axis, value in zip(trial.axes, position, strict=True))
    return f"phase '{phase.name}', t = {tick * trial.period:.4g} s ({where})"
