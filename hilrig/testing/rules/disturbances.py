"""Rules for disturbances: each acts only on what it names, with only its own generator."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from hilrig import Disturbance, DisturbanceSchedule
from hilrig.testing.rule import Broken, noting, require, rule, same
from hilrig.testing.schedule import TIME, applied, disturbed_ticks, named
from hilrig.testing.subject import Subject, parameters

FIELDS = tuple(named(applied()))


@rule("disturbances", first=True)
def it_can_be_applied(disturbance: Disturbance) -> None:
    """`apply` must run on a schedule of 4 s, two joints and the axes x and z."""
    applied(disturbance)


@rule("disturbances", whole=True)
def acts_on_names_fields_of_the_schedule(subject: Subject) -> None:
    """`acts_on` must name fields of the DisturbanceSchedule."""
    acts_on = subject.cls.acts_on  # pyright: ignore[reportAttributeAccessIssue]
    require(isinstance(acts_on, tuple) and acts_on, f"it is {acts_on!r}, which is not a tuple of names")
    unknown = sorted(set(acts_on) - set(FIELDS))
    require(not unknown, f"it names {', '.join(unknown)} (fields: {', '.join(FIELDS)})")


@rule("disturbances", whole=True)
def it_changes_what_it_acts_on_and_nothing_else(subject: Subject) -> None:
    """Each choice must change something that `acts_on` names, and all choices together all of it, and nothing else."""
    acts_on: set[str] = set(subject.cls.acts_on)  # pyright: ignore[reportAttributeAccessIssue]
    touched: set[str] = set()
    for variant in subject.variants:
        fields = set(disturbed_ticks(applied(variant)))
        more = fields - acts_on
        require(not more, f"{variant!r} changes {', '.join(sorted(more))}, which `acts_on` does not name")
        require(fields, f"{variant!r} changes nothing; give the test values that have an effect")
        touched |= fields
    left = acts_on - touched
    require(not left, f"it never changes {', '.join(sorted(left))}; give the test values that have an effect")


@rule("disturbances")
def what_it_puts_in_is_finite(disturbance: Disturbance) -> None:
    """What a disturbance puts into the schedule must be finite."""
    for name, part in named(applied(disturbance)).items():
        require(np.isfinite(part).all(), f"{name} is not")


@rule("disturbances")
def the_same_seed_is_the_same_world(disturbance: Disturbance) -> None:
    """The same seed must give the same disturbance, and NumPy's global generator must not matter.

    Every controller meets the same disturbances, so that differences are paired.
    """
    np.random.seed(1)
    first = named(applied(disturbance))
    np.random.seed(2)
    for name, part in named(applied(disturbance)).items():
        require(same(part, first[name]), f"{name} was different the second time")


@rule("disturbances")
def it_adds_to_what_is_there(disturbance: Disturbance) -> None:
    """A disturbance must add itself to what others have put into the schedule, and multiply scales.

    A message, however, can be lost only once.
    """
    alone, both = named(applied(disturbance)), named(_crowded(disturbance))
    for name, before in named(_crowded()).items():
        expected = before * alone[name] if name.endswith("_scale") else before + alone[name]
        if name.endswith("_loss"):
            expected = np.maximum(before, alone[name])
        agrees = np.allclose(both[name], expected, rtol=1e-9, atol=1e-12)
        require(agrees, f"{name} is not what was there combined with what it gives alone")


@rule("disturbances")
def it_lasts_from_at_to_until(disturbance: Any) -> None:
    """A disturbance with `at` and `until` must act from `at` to `until`, and at no other time."""
    if not (hasattr(disturbance, "at") and hasattr(disturbance, "until")):
        return
    windowed = dataclasses.replace(disturbance, at=1.0, until=2.0)
    for name, ticks in disturbed_ticks(applied(windowed)).items():
        first, last = TIME[ticks[0]], TIME[ticks[-1]]
        # A sine begins at zero, and may end there.
        right = 1000 <= ticks[0] <= 1002 and 1997 <= ticks[-1] < 2000
        require(right, f"at = 1 s, until = 2 s changed {name} from {first:g} s to {last:g} s")


@rule("disturbances")
def an_axis_that_is_not_there_is_refused(disturbance: Any) -> None:
    """`apply` must refuse an axis that the robot does not have with a ValueError that names it."""
    if parameters(type(disturbance)).get("axis", (None,))[0] is not str:
        return
    try:
        moved = dataclasses.replace(disturbance, axis="sideways")
        moved.apply(DisturbanceSchedule.quiet(TIME.size, 1, 1), TIME, ("x",), np.random.default_rng(0))
    except (ValueError, KeyError) as error:
        require(isinstance(error, ValueError) and "sideways" in str(error), f"it raised {error!r}")
    else:
        raise Broken("it took the axis 'sideways' where there is only x")


@rule("disturbances")
def it_fits_any_robot_and_any_length(disturbance: Disturbance) -> None:
    """A disturbance must fit seven joints, three axes and a trial of one tick, or refuse with a ValueError."""
    for ticks, joints, axes in ((TIME.size, 7, ("x", "y", "z")), (TIME.size, 1, ("z",)), (1, 2, ("x", "z"))):
        schedule = DisturbanceSchedule.quiet(ticks, joints, len(axes))
        where = f"with {joints} joints, {len(axes)} axes and {ticks} ticks"
        try:
            with noting(where):
                disturbance.apply(schedule, TIME[:ticks], axes, np.random.default_rng(0))
        except ValueError as error:
            require(str(error), f"{where} it raised a ValueError without a message")
        for name, part in named(schedule).items():
            require(np.isfinite(part).all(), f"{where} {name} is not finite")


@rule("disturbances")
def times_are_only_read(disturbance: Disturbance) -> None:
    """`apply` must only read the times."""
    time = TIME.copy()
    disturbance.apply(DisturbanceSchedule.quiet(TIME.size, 2, 2), time, ("x", "z"), np.random.default_rng(0))
    require(same(time, TIME), "it changed them")


def _crowded(*disturbances: Disturbance) -> DisturbanceSchedule:
    """Return a schedule in which others have put something everywhere, with `disturbances` applied."""
    schedule, random = DisturbanceSchedule.quiet(TIME.size, 2, 2), np.random.default_rng(3)
    for name, part in named(schedule).items():
        if name.endswith("_loss"):
            part[:] = random.random(part.shape) < 0.1
        elif name == "measurement_delay":
            part[:] = random.integers(0, 5, part.shape)
        else:
            part[:] = 0.5 + random.random(part.shape)
    for disturbance in disturbances:
        disturbance.apply(schedule, TIME, ("x", "z"), np.random.default_rng(0))
    return schedule
