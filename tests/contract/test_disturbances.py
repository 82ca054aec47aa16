"""What every disturbance keeps to: it changes what it says, by its generator alone."""

from __future__ import annotations

import dataclasses
import itertools
import typing

import numpy as np
import pytest
from builders import example

from hilrig.interfaces import Disturbance
from hilrig.plugins import dump, kinds, load, restore
from hilrig.signals import Inputs

TIME = np.arange(4000) * 1e-3
AXES = ("x", "z")
TELLING = {
    "factor": 2.0,
    "axis": "z",
    "ticks": 3,
    "force": 0.5,
    "joint": 1e-3,
    "at": 0.5,
    "joints": 2.0,
    "surface": 2.0,
}
"""Values by field name that make a disturbance disturb, where its defaults are neutral."""


def variants(cls: type) -> list[Disturbance]:
    """Return a disturbance of this kind for every choice of words that it offers."""
    hints = typing.get_type_hints(cls)
    words = {name: typing.get_args(hint) for name, hint in hints.items() if typing.get_origin(hint) is typing.Literal}
    chosen = itertools.product(*words.values())
    return [example(cls, **{**TELLING, **dict(zip(words, choice, strict=True))}) for choice in chosen]


VARIANTS = {kind: variants(load("disturbances", kind)) for kind in kinds("disturbances")}


@pytest.fixture(
    params=[(kind, i) for kind, found in VARIANTS.items() for i in range(len(found))], ids=lambda p: f"{p[0]}-{p[1]}"
)
def disturbance(request: pytest.FixtureRequest) -> Disturbance:
    kind, index = request.param
    return VARIANTS[kind][index]


def applied(disturbance: Disturbance, seed: int = 1) -> Inputs:
    inputs = Inputs.quiet(TIME.size, 2, len(AXES))
    disturbance.apply(inputs, TIME, AXES, np.random.default_rng(seed))
    return inputs


def changed(inputs: Inputs) -> set[str]:
    quiet = Inputs.quiet(TIME.size, 2, len(AXES))
    return {name for name in Inputs._fields if not np.array_equal(getattr(inputs, name), getattr(quiet, name))}


@pytest.mark.parametrize("kind", VARIANTS)
def test_it_changes_exactly_what_it_acts_on(kind: str) -> None:
    """Each variant something of it, all of them together the whole."""
    touched = [changed(applied(variant)) for variant in VARIANTS[kind]]
    assert all(touched)
    assert set().union(*touched) == set(VARIANTS[kind][0].acts_on)


def test_what_it_puts_in_is_finite(disturbance: Disturbance) -> None:
    assert all(np.isfinite(part).all() for part in applied(disturbance))


def test_the_same_seed_is_the_same_world(disturbance: Disturbance) -> None:
    for a, b in zip(applied(disturbance), applied(disturbance), strict=True):
        np.testing.assert_array_equal(a, b)


def test_chance_comes_from_the_generator_alone(disturbance: Disturbance) -> None:
    """Either no seed matters, or each does; numpy's own global generator never does."""
    np.random.seed(1)
    first = applied(disturbance)
    np.random.seed(2)
    for a, b in zip(first, applied(disturbance), strict=True):
        np.testing.assert_array_equal(a, b)


def test_it_adds_to_what_is_there(disturbance: Disturbance) -> None:
    """Two of a kind disturb more than one: none of them overwrites the other."""
    twice = applied(disturbance)
    disturbance.apply(twice, TIME, AXES, np.random.default_rng(2))
    once = applied(disturbance)
    assert all(not np.array_equal(getattr(once, name), getattr(twice, name)) for name in changed(once))


def test_it_survives_being_written_down(disturbance: Disturbance) -> None:
    assert dataclasses.is_dataclass(disturbance)
    assert restore("disturbances", dump(disturbance)) == disturbance
