"""What every metric keeps to, on the plainest of records: a good trial with a small error that dies out."""

from __future__ import annotations

import dataclasses
import inspect

import numpy as np
import pytest
from helpers.builders import PERIOD, example, record

from hilrig.core.interfaces import Metric
from hilrig.kinds.metrics._record import PhaseRecord
from hilrig.kinds.registry import kinds, load

TICKS = 2000


def flawed(scale: float = 1.0) -> PhaseRecord:
    """Return a phase of 2 s with errors of this scale that die out: off its path, out of contact, restless and late."""
    time = np.arange(TICKS) * PERIOD
    fading = scale * np.exp(-5 * time)[:, None]
    error, force = fading * np.array([0.01, 0.0]), np.array([0.0, 3.5]) * np.ones((TICKS, 1))
    return record(
        TICKS, position=-error, velocity=5 * error, acceleration=-25 * error,
        force=np.maximum(force - fading * np.array([0.0, 4.0]), 0.0), reference_force=force,
        reference_step=np.array([0.01, 0.0]), torque=scale * np.sin(20 * time)[:, None] * np.array([1.0, -1.0]),
        late=(np.arange(TICKS) < 10 * scale) * 1.0,
    )  # fmt: skip


@pytest.fixture(params=kinds("metrics"))
def metric(request: pytest.FixtureRequest) -> Metric:
    return example(load("metrics", request.param))


def test_it_has_a_unit_and_values_by_axis(metric: Metric) -> None:
    assert isinstance(metric.unit, str)
    values = metric.measure(flawed())
    assert values
    assert set(values) <= {"", "x", "y", "z"}
    assert all(type(value) is float and np.isfinite(value) for value in values.values())


def test_smaller_is_better_and_nothing_is_zero(metric: Metric) -> None:
    """A trial without error, torque or lateness scores zero, one with them more; a larger error never scores less."""
    nothing, small, large = (metric.measure(flawed(scale)) for scale in (0.0, 1.0, 3.0))
    for axis in small:
        assert nothing[axis] == pytest.approx(0.0, abs=1e-12)
        assert 1e-6 < small[axis] <= large[axis]


def test_a_record_without_ticks_is_no_crash(metric: Metric) -> None:
    """A trial that tripped at once has phases without a tick: no value, or not a number, and no error."""
    whole = flawed()
    per_tick = {
        f.name: getattr(whole, f.name)[:0]
        for f in dataclasses.fields(whole)
        if np.shape(getattr(whole, f.name))[:1] == (TICKS,)
    }
    values = metric.measure(dataclasses.replace(whole, **per_tick))
    assert all(np.isnan(value) or value == 0.0 for value in values.values())


def test_the_record_is_only_read(metric: Metric) -> None:
    whole, copy = flawed(), flawed()
    metric.measure(whole)
    for field in dataclasses.fields(whole):
        np.testing.assert_array_equal(getattr(whole, field.name), getattr(copy, field.name))


def test_it_is_defined_in_its_docstring(metric: Metric) -> None:
    assert "=" in (inspect.getdoc(type(metric)) or "")
