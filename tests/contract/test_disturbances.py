"""What every disturbance keeps to: it changes what it says, by its generator alone."""

from __future__ import annotations

import dataclasses
import itertools
import typing

import numpy as np
import pytest
from helpers.builders import TIME, applied, example

from hilrig.core.interfaces import Disturbance
from hilrig.core.signals import DisturbanceSchedule
from hilrig.kinds.registry import dump, kinds, load, restore

TELLING = {
    "factor": 2.0,
    "axis": "z",
    "ticks": 3,
    "force": 0.5,
    "joint": 1e-3,
    "at": 0.5,
    "joints": 2.0,
    "surface": 2.0,
    "duration": 0.5,
}
"""Values by field name that make a disturbance disturb, where its defaults are neutral."""


def variants(cls: type) -> list[Disturbance]:
    """Return a disturbance of this kind for every choice of words that it offers."""
    hints = typing.get_type_hints(cls)
    words = {name: typing.get_args(hint) for name, hint in hints.items() if typing.get_origin(hint) is typing.Literal}
    chosen = itertools.product(*words.values())
    return [example(cls, **{**TELLING, **dict(zip(words, choice, strict=True))}) for choice in chosen]


VARIANTS = {kind: variants(load("disturbances", kind)) for kind in kinds("disturbances")}
ALL = {f"{kind}-{i}": variant for kind, found in VARIANTS.items() for i, variant in enumerate(found)}


@pytest.fixture(params=ALL)
def disturbance(request: pytest.FixtureRequest) -> Disturbance:
    return ALL[request.param]


def named(schedule: DisturbanceSchedule) -> dict[str, np.ndarray]:
    """Return every array of the schedule by the name that `acts_on` has for it."""
    plain = {name: part for name, part in schedule._asdict().items() if name != "faults"}
    return plain | {f"faults.{name}": part for name, part in schedule.faults._asdict().items()}


def disturbed_ticks(schedule: DisturbanceSchedule) -> dict[str, np.ndarray]:
    """Return the ticks at which a field is not as in a quiet schedule, for the fields that have such ticks."""
    found = {}
    quiet = named(applied())
    for name, part in named(schedule).items():
        differs = (part != quiet[name]).reshape(TIME.size, -1).any(axis=1)
        found |= {name: np.flatnonzero(differs)} if differs.any() else {}
    return found


def assert_same(one: DisturbanceSchedule, other: DisturbanceSchedule) -> None:
    others = named(other)
    for name, part in named(one).items():
        np.testing.assert_array_equal(part, others[name])


@pytest.mark.parametrize("kind", VARIANTS)
def test_it_changes_exactly_what_it_acts_on(kind: str) -> None:
    """Each variant something of it, all of them together the whole."""
    touched = [set(disturbed_ticks(applied(variant))) for variant in VARIANTS[kind]]
    assert all(touched)
    assert set().union(*touched) == set(VARIANTS[kind][0].acts_on)


def test_what_it_puts_in_is_finite(disturbance: Disturbance) -> None:
    assert all(np.isfinite(part).all() for part in named(applied(disturbance)).values())


def test_the_same_seed_is_the_same_world(disturbance: Disturbance) -> None:
    assert_same(applied(disturbance), applied(disturbance))


def test_chance_comes_from_the_generator_alone(disturbance: Disturbance) -> None:
    """numpy's own global generator never matters."""
    np.random.seed(1)
    first = applied(disturbance)
    np.random.seed(2)
    assert_same(first, applied(disturbance))


def test_it_adds_to_what_is_there(disturbance: Disturbance) -> None:
    """The same twice is twice the disturbance, or the square of a scale: neither overwrites the other.

    But a message can be lost only once.
    """
    once, twice = named(applied(disturbance)), named(applied(disturbance, disturbance))
    for name, one in once.items():
        expected = one**2 if name.endswith("_scale") else one if name.endswith("_loss") else 2 * one
        np.testing.assert_allclose(twice[name], expected, rtol=1e-12)


@pytest.mark.parametrize("name", [name for name, variant in ALL.items() if hasattr(variant, "until")])
def test_it_is_there_from_its_beginning_to_its_end_and_at_no_other_time(name: str) -> None:
    found = disturbed_ticks(applied(dataclasses.replace(ALL[name], at=1.0, until=2.0)))
    assert found
    for ticks in found.values():
        assert ticks[0] in (1000, 1001), "a sine begins at zero"
        assert ticks[-1] == 1999


def test_it_survives_being_written_down(disturbance: Disturbance) -> None:
    assert dataclasses.is_dataclass(disturbance)
    assert restore("disturbances", dump(disturbance)) == disturbance
