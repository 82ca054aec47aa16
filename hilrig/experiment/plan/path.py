"""The planned path of a trial's tip, and the robot's Jacobian and mobility along it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hilrig.core.assessment import TipPath
from hilrig.core.signals import Array, Kinematics, Reference
from hilrig.experiment.plan.feasibility import instants, trajectory
from hilrig.experiment.trial import Trial, disturbance_schedule, references


def tip_paths(trials: Sequence[Trial]) -> tuple[TipPath, ...]:
    """Return the distinct paths of the trials, one condition each; all must be within reach."""
    different: dict[tuple[bytes, int], Trial] = {}
    for trial in {trial.condition_name: trial for trial in trials}.values():
        different.setdefault((trajectory(trial).tobytes(), _delay(trial)), trial)
    return tuple(_tip_path(trial, named=len(different) > 1) for trial in different.values())


def mobility(at: Kinematics, dynamic_parameters: Array) -> Array:
    """Return M_t^-1 = J M^-1 J^T (m, m) 1/kg at one place, with M from the regressor and theta (p,).

    It stays finite where J is singular, unlike M_t. Raises LinAlgError (a ValueError) if M is singular.
    """
    n = at.jacobian.shape[1]
    mass = (at.regressor[1 + n :] @ dynamic_parameters).T
    return at.jacobian @ np.linalg.solve(mass, at.jacobian.T)


def _delay(trial: Trial) -> int:
    return trial.actuation_delay + int(disturbance_schedule(trial).measurement_delay.max())


def _tip_path(trial: Trial, named: bool) -> TipPath:
    """Return the path of a trial; the condition is `named` if another one has a different path."""
    robot, path = trial.driver.robot, trajectory(trial)
    theta, still = robot.dynamic_parameters(), np.zeros(robot.joints)
    ticks = instants(trial, path)
    observations = [robot.kinematics(robot.inverse_kinematics(path[tick]), still) for tick in ticks]
    prefix = f"condition '{trial.condition_name}', " if named else ""
    return TipPath(
        trial.condition_name if named else "",
        _delay(trial),
        np.array(ticks) * trial.period,
        path[ticks],
        Reference(*(signal[ticks] for signal in references(trial))),
        np.array([at.jacobian for at in observations]),
        _mobilities(observations, theta),
        tuple(prefix + _words(trial, tick, path[tick]) for tick in ticks),
    )


def _mobilities(observations: list[Kinematics], theta: Array) -> Array | None:
    """Return M_t^-1 (K, m, m); None for a robot without a model, or whose M cannot be inverted."""
    try:
        return np.array([mobility(at, theta) for at in observations]) if theta.size else None
    except np.linalg.LinAlgError:
        return None


def _words(trial: Trial, tick: int, position: Array) -> str:
    phase = next(phase for phase in trial.phases if tick < trial.tick_of(phase.end))
    where = ", ".join(f"{axis} = {value:.3g} m" for axis, value in zip(trial.axes, position, strict=True))
    return f"phase '{phase.name}', t = {tick * trial.period:.4g} s ({where})"
