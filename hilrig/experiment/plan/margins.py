"""How far an experiment keeps within the bounds of `hilrig.kinds.delay_bounds`: numbers for check and report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from hilrig.core.interfaces import DelayEstimation
from hilrig.experiment.plan.feasibility import delay_estimation, sampled
from hilrig.experiment.plan.path import TipPath, tip_paths
from hilrig.experiment.trial import Trial
from hilrig.kinds import delay_bounds as bounds

Bound = Literal[
    "delay_printed", "delay_derived", "delay_best", "inertia_lower", "inertia_upper", "mismatch", "joint_speed"
]


class Check(NamedTuple):
    """One value against one limit."""

    bound: Bound
    value: float
    must: Literal["below", "above"]
    limit: float
    unit: str
    where: str = ""
    """The place that decides, in words"""
    kappa: float | None = None
    """Of a delay bound: the free scalar of (21)"""

    @property
    def kept(self) -> bool:
        """Whether the value is on the right side of its limit."""
        return self.value < self.limit if self.must == "below" else self.value > self.limit

    @property
    def margin(self) -> float:
        """By how much the value may be multiplied, or divided, to meet its limit; below 1 the limit is not kept."""
        part, whole = (self.value, self.limit) if self.must == "below" else (self.limit, self.value)
        return whole / part if part else np.inf

    def document(self) -> dict[str, Any]:
        """Return the check as plain data."""
        return {**self._asdict(), "kept": self.kept, "margin": self.margin}


class Estimator(NamedTuple):
    """A controller with time delay estimation."""

    checks: tuple[Check, ...]
    unknown: tuple[str, ...]
    """What cannot be judged, and why"""


class Flight(NamedTuple):
    """A force-controlled axis without contact, under its largest desired force."""

    axis: str
    phase: str
    force: float
    """Largest |F_d|, N"""
    speed: float
    """F_d/B_d, m/s"""
    time_constant: float
    """M_d/B_d, s"""
    joints: Check
    """The joint speed that this takes, against the limit of `safety`"""


class Margins(NamedTuple):
    """What was found for an experiment."""

    estimators: dict[str, Estimator]
    """By controller"""
    flights: tuple[Flight, ...]

    def document(self) -> dict[str, Any]:
        """Return it as plain data for JSON."""
        estimators = {
            name: {"checks": [check.document() for check in found.checks], "unknown": list(found.unknown)}
            for name, found in self.estimators.items()
        }
        flights = [{**flight._asdict(), "joints": flight.joints.document()} for flight in self.flights]
        return {"estimators": estimators, "flights": flights}


def margins(trials: Sequence[Trial]) -> Margins:
    """Return the margins of a plan's trials: all controllers, the worst place of all conditions."""
    paths = tip_paths([trial for trial in trials if trial.repeat == trials[0].repeat])
    controllers = {trial.controller_name: trial for trial in trials}
    estimators = {
        name: _estimator(found, trial, paths)
        for name, trial in controllers.items()
        if (found := delay_estimation(trial)) is not None
    }
    flights = (_flight(trials[0], axis, paths) for axis in trials[0].axes if axis in trials[0].task.force_axes)
    return Margins(estimators, tuple(flights))


def _estimator(found: DelayEstimation, trial: Trial, paths: list[TipPath]) -> Estimator:
    dynamics = bounds.error_dynamics(found.position_gain, found.velocity_gain, found.position_gain.size)
    try:
        bounds.lyapunov_matrix(dynamics.undelayed)
    except ValueError as error:
        return Estimator((), (f"no bound is known for its gains k_p, k_d: {error}",))
    checks = list(_delay_checks(dynamics, trial.period, paths))
    if paths[0].mobility is None:
        return Estimator(
            tuple(checks), ("the window of Mhat and condition (9) are not known: the robot's model has no M to invert",)
        )
    return Estimator((*checks, *_window_checks(found, trial, paths), _mismatch_check(found, paths)), ())


def _delay_checks(dynamics: bounds.ErrorDynamics, period: float, paths: list[TipPath]) -> Iterator[Check]:
    """Yield the delay against (24): as printed and as derived with the paper's kappa, and with the best kappa."""
    slowest = max(paths, key=lambda path: path.delay)
    # Without extra samples the estimate still is one period old.
    delay = max(slowest.delay, 1) * period
    where = slowest.prefix.removesuffix(", ") if len({path.delay for path in paths}) > 1 else ""
    kappa = bounds.PAPER_KAPPA
    yield Check("delay_printed", delay, "below", bounds.delay_bound(dynamics, "printed"), "s", where, kappa)
    yield Check("delay_derived", delay, "below", bounds.delay_bound(dynamics), "s", where, kappa)
    best = bounds.best_delay_bound(dynamics)
    yield Check("delay_best", delay, "below", best.delay, "s", where, best.kappa)


def _window_checks(found: DelayEstimation, trial: Trial, paths: list[TipPath]) -> Iterator[Check]:
    """Yield Mhat against both edges of its window; as a factor on the Mhat given if it differs between axes."""
    estimate = found.inertia_estimate
    value, unit = (float(estimate[0]), "kg") if np.ptp(estimate) == 0 else (1.0, "x Mhat")
    ratios = [bounds.inertia_ratios(_known(path), estimate) for path in paths]
    lowest, place = _least([ratio[:, 0] for ratio in ratios], paths)
    least = bounds.lowest_ratio(trial.period, found.position_gain, found.velocity_gain)
    yield Check("inertia_lower", value, "above", value * least / lowest if lowest > 0 else np.inf, unit, place)
    rooms = [
        bounds.highest_ratio(path.delay, trial.velocity_smoothing) / ratio[:, -1]
        for path, ratio in zip(paths, ratios, strict=True)
    ]
    room, place = _least(rooms, paths)
    yield Check("inertia_upper", value, "below", value * room, unit, place)


def _mismatch_check(found: DelayEstimation, paths: list[TipPath]) -> Check:
    sizes = [-bounds.estimation_mismatch(_known(path), found.inertia_estimate) for path in paths]
    least, place = _least(sizes, paths)
    return Check("mismatch", -least, "below", 1.0, "", place)


def _known(path: TipPath) -> np.ndarray:
    assert path.mobility is not None, "all courses are of one robot"
    return path.mobility


def _least(values: list[np.ndarray], paths: list[TipPath]) -> tuple[float, str]:
    """Return the smallest of all values, an array (K,) for each path, and its place in words."""
    k = int(np.argmin([array.min() for array in values]))
    return float(values[k].min()), paths[k].place(int(values[k].argmin()))


def _flight(trial: Trial, axis: str, paths: list[TipPath]) -> Flight:
    i = trial.axes.index(axis)
    forces = np.abs(sampled(trial, axis))
    tick = int(forces.argmax())
    phase = next(phase.name for phase in trial.phases if tick < trial.tick_of(phase.end))
    free = bounds.free_flight(float(forces[tick]), trial.task.inertia[i], trial.task.damping[i])
    least, place = _least([-np.abs(path.joint_rates[:, :, i]).max(axis=1) for path in paths], paths)
    rate = -least * free.speed if free.speed else 0.0
    joints = Check("joint_speed", rate, "below", trial.limits.joint_velocity, "rad/s", place)
    return Flight(axis, phase, float(forces[tick]), free.speed, free.time_constant, joints)
