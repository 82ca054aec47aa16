"""Schedules for testing disturbances: a few seconds long."""

from __future__ import annotations

import numpy as np

from hilrig import Array, Disturbance, DisturbanceSchedule

PERIOD = 1e-3
TIME: Array = np.arange(4000, dtype=np.float64) * PERIOD
"""s, span of the ticks that `applied` disturbs"""


def applied(*disturbances: Disturbance, seed: int = 0) -> DisturbanceSchedule:
    """Return the schedule of 4 s on two joints and the axes x and z, with `disturbances` applied in order."""
    schedule = DisturbanceSchedule.quiet(TIME.size, 2, 2)
    for disturbance in disturbances:
        disturbance.apply(schedule, TIME, ("x", "z"), np.random.default_rng(seed))
    return schedule


def named(schedule: DisturbanceSchedule) -> dict[str, Array]:
    """Return every array of the schedule, under the name that `acts_on` uses."""
    plain = {name: part for name, part in schedule._asdict().items() if name != "faults"}
    return plain | {f"faults.{name}": part for name, part in schedule.faults._asdict().items()}


def disturbed_ticks(schedule: DisturbanceSchedule) -> dict[str, np.ndarray]:
    """Return the ticks at which a field differs from a quiet schedule, for the fields with such ticks."""
    quiet, found = named(applied()), {}
    for name, part in named(schedule).items():
        differs = (part != quiet[name]).reshape(TIME.size, -1).any(axis=1)
        found |= {name: np.flatnonzero(differs)} if differs.any() else {}
    return found
