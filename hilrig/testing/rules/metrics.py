"""Rules for metrics: numbers by axis, lower is better, on any record."""

from __future__ import annotations

import dataclasses
import itertools
from contextlib import nullcontext
from typing import Any

import numpy as np

from hilrig import Metric, PhaseRecord
from hilrig.testing.records import flawed, rows, swinging
from hilrig.testing.rule import noting, require, rule, same
from hilrig.testing.subject import Subject

GAP = slice(480, 580)
"""Unrecorded ticks: 5 % of a record"""
GAP_MATTERS = 0.2
"""How much the value of a record with that gap may differ from that of the complete record"""


@rule("metrics", whole=True)
def the_unit_is_a_text(subject: Subject) -> None:
    """`unit` must be a text, empty for a pure number."""
    unit: Any = subject.cls.unit  # pyright: ignore[reportAttributeAccessIssue]
    require(isinstance(unit, str), f"it is {unit!r}")


@rule("metrics", first=True)
def values_are_finite_numbers_by_axis(metric: Metric) -> None:
    """`measure` must return a finite float for each axis, or one under "" where there is no axis."""
    values = _measured(metric, flawed())
    require(values, "on a whole phase it returned nothing")
    for axis, value in values.items():
        require(np.isfinite(value), f"on a whole phase its value for '{axis}' is {value}")


@rule("metrics")
def lower_is_better(metric: Metric) -> None:
    """A trial with larger errors, torques and delays must not score less.

    A report marks the lowest value as the best. The errors have both signs, so that a metric of one of them may pass.
    """
    everything: list[dict[str, float]] = []
    for sign, first in ((1.0, "below"), (-1.0, "above")):
        none, small, large = (_measured(metric, swinging(scale, sign)) for scale in (0.0, 1.0, 3.0))
        for axis in small:
            scores = [values.get(axis, np.nan) for values in (none, small, large)]
            rising = all(not later < earlier for earlier, later in itertools.pairwise(scores))
            require(
                rising,
                "without errors, with some and with three times as large ones it gave {} for {} "
                "on 2 s in which position and force swing about their references, first {} them, and come to rest",
                scores,
                f"'{axis}'",
                first,
            )
        everything += [none, large]
    require(any(values != everything[0] for values in everything), f"every trial scores {everything[0]}")


@rule("metrics")
def a_record_of_few_ticks_is_no_error(metric: Metric) -> None:
    """A phase with one tick, a few, or none must not be an error: a trial may trip at once.

    No value, or NaN, means that there is nothing to measure.
    """
    for ticks in (3, 2, 1, 0):
        _measured(metric, rows(flawed(), slice(0, ticks)), f"with {ticks} ticks")


@rule("metrics")
def a_gap_is_not_a_jump(metric: Metric) -> None:
    """Ticks missing from the record must not look like an event.

    A gap of 5 % of the ticks may change the value by at most a fifth. `record.tick` and `record.time` show gaps.
    """
    whole, mask = flawed(), np.ones(2000, dtype=bool)
    mask[GAP] = False
    full, gappy = _measured(metric, whole), _measured(metric, rows(whole, mask), "with a gap")
    for axis, value in full.items():
        there = gappy.get(axis, np.nan)
        near = abs(there - value) <= GAP_MATTERS * abs(value)
        require(near or value == 0, f"with a gap the value for '{axis}' is {there:.6g} instead of {value:.6g}")


@rule("metrics")
def any_task_can_be_measured(metric: Metric) -> None:
    """A record with one axis or three, with all axes controlled alike, or over several phases must not be an error."""
    for axes, where in ((("z",), "on one axis"), (("x", "y", "z"), "on three axes")):
        _measured(metric, flawed(axes=axes, joints=7), where)
    for way, sigma in (("position", np.ones(2)), ("force", np.zeros(2))):
        _measured(metric, flawed(sigma=sigma), f"with every axis under {way} control")
    _measured(metric, flawed(phases=2), "over two phases")


@rule("metrics")
def the_record_is_only_read(metric: Metric) -> None:
    """`measure` must only read the record: the other metrics measure the same one."""
    whole, untouched = flawed(), flawed()
    metric.measure(whole)
    for field in dataclasses.fields(PhaseRecord):
        unchanged = same(getattr(whole, field.name), getattr(untouched, field.name))
        require(unchanged, f"it changed record.{field.name}")


def _measured(metric: Metric, record: PhaseRecord, where: str = "") -> dict[str, float]:
    """Return a metric's result. Raises Broken if it raises, or returns anything but floats by axis."""
    place = f"{where} " if where else ""
    with noting(where) if where else nullcontext():
        values: Any = metric.measure(record)
    require(isinstance(values, dict), f"{place}it returned a {type(values).__name__}, not a dict")
    for axis, value in values.items():
        require(axis in ("", *record.axes), f"{place}it returned a value for {axis!r}; the axes are {record.axes}")
        require(isinstance(value, float), f"{place}its value for '{axis}' is a {type(value).__name__}, not a float")
    return values
