"""How fast the task lets the tip move without contact: a bound of the task, independent of the controller."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from hilrig.core.assessment import Assessment, Bound, Setting
from hilrig.experiment.plan.feasibility import sampled
from hilrig.experiment.trial import Trial

NOTE = (
    "Without contact the impedance filter M_d x″ + B_d x′ = F_d approaches the speed F_d/B_d with the time constant "
    "M_d/B_d, and the tip meets the surface no faster than that. This holds for controllers that follow the filter. "
    "The value is the speed of the fastest joint at that speed of the tip."
)


class FreeFlight(NamedTuple):
    """The desired motion M_d x'' + B_d x' = F_d of a force-controlled axis without contact."""

    speed: float
    """F_d/B_d, m/s: the largest speed when starting at rest; infinite without damping"""
    time_constant: float
    """M_d/B_d, s"""


def free_flight(force: float, inertia: float, damping: float) -> FreeFlight:
    """Return the speed and time constant, after (3), for F_d (N), M_d (kg) and B_d (N s/m)."""
    if damping == 0.0:
        return FreeFlight(np.inf if force else 0.0, np.inf)
    return FreeFlight(abs(force) / damping, inertia / damping)


def assess_free_flight(trial: Trial, setting: Setting) -> Assessment:
    """Return the joint speed in free flight along each force-controlled axis, against the safety limit.

    The largest desired force of all phases counts, at the place on the path where the joints are fastest. All trials of
    an experiment have the same task, so one of them represents all.
    """
    bounds = tuple(_bounds(trial, setting))
    return Assessment(bounds, note=NOTE if bounds else "")


def _bounds(trial: Trial, setting: Setting) -> Iterator[Bound]:
    inverses = [np.abs(np.linalg.pinv(path.jacobian)) for path in setting.paths]
    for i, axis in enumerate(trial.axes):
        if axis in trial.task.force_axes:
            rate, place = setting.highest([inverse[:, :, i].max(axis=1) for inverse in inverses])
            yield _bound(trial, axis, rate, place)


def _bound(trial: Trial, axis: str, rate: float, place: str) -> Bound:
    """Return the bound for one axis, along which a joint turns by at most `rate` rad/m."""
    i, forces = trial.axes.index(axis), np.abs(sampled(trial, axis))
    tick = int(forces.argmax())
    phase = next(phase.name for phase in trial.phases if tick < trial.tick_of(phase.end))
    force, damping, limit = float(forces[tick]), trial.task.damping[i], trial.limits.joint_velocity
    free = free_flight(force, trial.task.inertia[i], damping)
    joint_speed = rate * free.speed if free.speed else 0.0
    if damping == 0.0:
        warning = f"the damping B_d along {axis} is 0: without contact nothing bounds the speed of the tip"
    else:
        warning = (
            f"without contact the tip may reach F_d/B_d = {free.speed:.3g} m/s along {axis} (F_d = {force:.3g} N, "
            f"phase '{phase}'); a joint would turn at {joint_speed:.3g} rad/s, over the safety limit of {limit:.3g} "
            f"rad/s, at {place}"
        )
    basis = (
        f"F_d = {force:.3g} N in phase '{phase}', F_d/B_d = {free.speed:.3g} m/s, M_d/B_d = {free.time_constant:.3g} s"
    )
    return Bound(
        f"joint speed in free flight along {axis}", joint_speed, "below", limit, "rad/s", warning, place, basis,
        ("task", "impedance", "damping"),
    )  # fmt: skip
