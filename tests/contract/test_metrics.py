"""What every metric keeps to, on the plainest of records: a good trial with a small error that dies out."""

from __future__ import annotations

import dataclasses
import inspect

import numpy as np
import pytest
from builders import example

from hilrig.interfaces import Metric
from hilrig.metrics._record import PhaseRecord
from hilrig.plugins import kinds, load

TICKS, PERIOD = 2000, 1e-3


def record(scale: float = 1.0) -> PhaseRecord:
    """Return a phase of 2 s, x position-controlled and z force-controlled, with errors of this scale."""
    time = np.arange(TICKS) * PERIOD
    error = scale * np.exp(-5 * time)[:, None] * np.array([0.01, 0.0])
    zeros, force = np.zeros((TICKS, 2)), np.array([0.0, 3.5]) * np.ones((TICKS, 1))
    press = force - scale * 0.5 * np.exp(-5 * time)[:, None] * np.array([0.0, 1.0])
    wave = np.sin(20 * time)[:, None] * np.array([1.0, -1.0]) * scale
    return PhaseRecord(
        tick=np.arange(TICKS, dtype=np.float64), time=time, phases=1, period=PERIOD, axes=("x", "z"),
        sigma=np.array([1.0, 0.0]), inertia=np.array([3.0, 6.0]), damping=np.array([30.0, 60.0]),
        stiffness=np.array([250.0, 0.0]), position=-error, velocity=5 * error, acceleration=-25 * error, force=press,
        reference_position=zeros, reference_velocity=zeros, reference_acceleration=zeros, reference_force=force,
        reference_step=np.array([0.01, 0.0]), torque=wave, late=np.zeros(TICKS),
    )  # fmt: skip


@pytest.fixture(params=kinds("metrics"))
def metric(request: pytest.FixtureRequest) -> Metric:
    return example(load("metrics", request.param))


def test_it_has_a_unit_and_values_by_axis(metric: Metric) -> None:
    assert isinstance(metric.unit, str)
    values = metric.measure(record())
    assert values
    assert set(values) <= {"", "x", "y", "z"}
    assert all(type(value) is float and np.isfinite(value) for value in values.values())


def test_smaller_is_better_and_nothing_is_zero(metric: Metric) -> None:
    """A trial without error, torque or lateness scores zero; a larger error never scores less."""
    nothing, small, large = (metric.measure(record(scale)) for scale in (0.0, 1.0, 3.0))
    for axis in small:
        assert nothing[axis] == pytest.approx(0.0, abs=1e-12)
        assert nothing[axis] <= small[axis] <= large[axis]


def test_a_record_without_ticks_is_no_crash(metric: Metric) -> None:
    """A trial that tripped at once has phases without a tick: no value, or not a number, and no error."""
    whole = record()
    per_tick = {
        f.name: getattr(whole, f.name)[:0]
        for f in dataclasses.fields(whole)
        if np.shape(getattr(whole, f.name))[:1] == (TICKS,)
    }
    values = metric.measure(dataclasses.replace(whole, **per_tick))
    assert all(np.isnan(value) or value == 0.0 for value in values.values())


def test_the_record_is_only_read(metric: Metric) -> None:
    whole, copy = record(), record()
    metric.measure(whole)
    for field in dataclasses.fields(whole):
        np.testing.assert_array_equal(getattr(whole, field.name), getattr(copy, field.name))


def test_it_is_defined_in_its_docstring(metric: Metric) -> None:
    assert "=" in (inspect.getdoc(type(metric)) or "")
