from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hilrig.core.interfaces import ReferenceSignal, Samples, Span
from hilrig.kinds.references.csv import Csv
from hilrig.kinds.references.hold import Hold
from hilrig.kinds.references.min_jerk import MinJerk
from hilrig.kinds.references.sine import Sine
from hilrig.kinds.references.waypoints import Waypoints

SPAN = Span(2.0, 6.0, 0.5)
TIME = np.linspace(SPAN.start, SPAN.end, 4001)

values = st.floats(-2.0, 2.0)
curves = st.lists(st.tuples(st.floats(0.2, 1.0), values), min_size=2, max_size=6)


def waypoints(steps: list[tuple[float, float]], interpolation: Any = "cubic") -> Waypoints:
    """Return a curve whose points are `steps` (time since the point before, value) apart."""
    times = np.cumsum([step for step, _ in steps])
    return Waypoints(tuple(times.tolist()), tuple(value for _, value in steps), interpolation)


signals = st.one_of(
    st.builds(Hold, values),
    st.builds(Sine, st.floats(0, 2), st.floats(0, 5), values, values, st.sampled_from(["trial", "phase"])),
    st.builds(MinJerk, values, st.none() | values, st.none() | st.floats(0.5, 4.0)),
    curves.map(waypoints),
)


def assert_derivative(value: Any, rate: Any, scale: float) -> None:
    """Assert that `rate` is the derivative of `value` over TIME, but for single kinks."""
    step = TIME[1] - TIME[0]
    differences = (value[2:] - value[:-2]) / (2 * step)
    error = np.abs(differences - rate[1:-1])
    assert np.quantile(error, 0.99) <= 1e-4 * scale


@settings(max_examples=60, deadline=None)
@given(signals)
def test_rates_are_the_derivatives(signal: ReferenceSignal) -> None:
    samples = signal.sample(TIME, SPAN)
    assert all(part.shape == TIME.shape and part.dtype == np.float64 for part in samples)
    scale = 1.0 + float(max(np.abs(part).max() for part in samples))
    assert_derivative(samples.value, samples.rate, scale)
    assert_derivative(samples.rate, samples.acceleration, 100 * scale)


@settings(max_examples=60, deadline=None)
@given(signals)
def test_position_and_rate_are_continuous(signal: ReferenceSignal) -> None:
    samples = signal.sample(TIME, SPAN)
    step = TIME[1] - TIME[0]
    fastest, sharpest = np.abs(samples.rate).max(), np.abs(samples.acceleration).max()
    assert np.abs(np.diff(samples.value)).max() <= 1.01 * step * fastest + 1e-12
    assert np.abs(np.diff(samples.rate)).max() <= 1.01 * step * sharpest + 1e-12


@settings(max_examples=30, deadline=None)
@given(signals, st.integers(0, TIME.size - 1))
def test_one_sample_is_the_same_alone(signal: ReferenceSignal, index: int) -> None:
    together = signal.sample(TIME, SPAN)
    alone = signal.sample(TIME[index : index + 1], SPAN)
    np.testing.assert_allclose([part[0] for part in alone], [part[index] for part in together], rtol=1e-12, atol=1e-12)


def test_hold_is_constant() -> None:
    samples = Hold(3.5).sample(TIME, SPAN)
    assert (samples.value == 3.5).all()
    assert not samples.rate.any()
    assert not samples.acceleration.any()


def test_a_sine_counts_time_from_the_trial_or_from_the_phase() -> None:
    at = np.array([2.0])
    assert Sine(0.3, 1.0).sample(at, SPAN).value[0] == pytest.approx(0.3 * np.sin(2.0))
    assert Sine(0.3, 1.0, offset=0.1, angle=0.2, since="phase").sample(at, SPAN).value[0] == pytest.approx(
        0.1 + 0.3 * np.sin(0.2)
    )


def test_a_sines_amplitude_and_frequency_are_what_it_swings_with() -> None:
    samples = Sine(0.3, np.pi).sample(TIME, SPAN)
    assert samples.value.max() == pytest.approx(0.3)
    assert samples.rate.max() == pytest.approx(0.3 * np.pi)
    assert samples.acceleration.max() == pytest.approx(0.3 * np.pi**2)


@given(values, values, st.floats(0.5, 4.0))
def test_a_move_begins_and_ends_at_rest(start: float, end: float, duration: float) -> None:
    ends = np.array([SPAN.start, SPAN.start + duration])
    samples = MinJerk(end, start, duration).sample(ends, SPAN)
    np.testing.assert_allclose(samples.value, [start, end], atol=1e-9)
    np.testing.assert_allclose(samples.rate, 0.0, atol=1e-9)
    np.testing.assert_allclose(samples.acceleration, 0.0, atol=1e-8)


def test_a_moves_peak_speed_is_15_eighths_of_its_mean() -> None:
    samples = MinJerk(1.0, 0.0, 2.0).sample(TIME, SPAN)
    assert samples.rate.max() == pytest.approx(15 / 8 / 2.0)
    assert samples.value[1000] == pytest.approx(0.5)


def test_a_move_starts_where_the_phase_before_ended_and_fills_its_phase() -> None:
    samples = MinJerk(1.0).sample(TIME, SPAN)
    assert samples.value[0] == 0.5
    assert samples.value[-1] == pytest.approx(1.0)
    assert samples.value[-2] < 1.0


def test_a_move_without_start_or_time_is_refused() -> None:
    with pytest.raises(ValueError, match="needs 'start'"):
        MinJerk(1.0).sample(TIME, SPAN._replace(previous=None))
    with pytest.raises(ValueError, match="takes 5 s, but its phase lasts 4 s"):
        MinJerk(1.0, 0.0, 5.0).sample(TIME, SPAN)


@given(curves, st.sampled_from(["cubic", "linear"]))
def test_a_curve_passes_through_its_points_and_rests_outside(
    steps: list[tuple[float, float]], interpolation: str
) -> None:
    curve = waypoints(steps, interpolation)
    at = SPAN.start + np.array(curve.times)
    np.testing.assert_allclose(curve.sample(at, SPAN).value, curve.values, atol=1e-9)
    outside = curve.sample(np.array([at[0] - 0.1, at[-1] + 0.1]), SPAN)
    np.testing.assert_array_equal(outside.value, [curve.values[0], curve.values[-1]])
    assert not outside.rate.any()


@given(curves)
def test_a_cubic_curves_acceleration_is_continuous_between_its_ends(steps: list[tuple[float, float]]) -> None:
    curve = waypoints(steps)
    inner = SPAN.start + np.array(curve.times[1:-1])
    before, after = (curve.sample(inner + side, SPAN).acceleration for side in (-1e-9, 1e-9))
    scale = 1.0 + np.abs(np.concatenate([before, after])).max(initial=0.0)
    np.testing.assert_allclose(before, after, atol=1e-5 * scale)


def test_a_linear_curve_is_straight() -> None:
    samples = Waypoints((0.0, 2.0, 4.0), (0.0, 1.0, 0.0), "linear").sample(np.array([3.0, 5.0]), SPAN)
    np.testing.assert_allclose(samples.value, [0.5, 0.5])
    np.testing.assert_allclose(samples.rate, [0.5, -0.5])


@pytest.mark.parametrize(
    ("times", "points", "words"),
    [
        ((0.0,), (0.0,), "two points"),
        ((0.0, 0.0), (1.0, 2.0), "rise"),
        ((-1.0, 0.0), (1.0, 2.0), "negative"),
        ((0.0, 1.0), (1.0,), "2 times, but 1 values"),
    ],
)
def test_points_that_make_no_curve_are_refused(times: tuple, points: tuple, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Waypoints(times, points)


def test_a_table_is_the_curve_through_its_rows() -> None:
    text = "time, x\n0, 0\n1, 0.5\n2, 0.25\n"
    table = Csv("a.csv", "x").filled(text)
    same: Samples = Waypoints((0.0, 1.0, 2.0), (0.0, 0.5, 0.25)).sample(TIME, SPAN)
    for found, wanted in zip(table.sample(TIME, SPAN), same, strict=True):
        np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no column 'time'"),
        ("time,y\n0,1\n", r"no column 'x' \(columns: time, y\)"),
        ("time,x\n0,1\n1,\n", "line 3"),
        ("time,x\n0,1\n1,a\n", "'a' is not a number"),
        ("time,x\n0,1\n", "two points"),
        ("time,x\n0,1\n1,nan\n", "finite"),
        ("time,x\n1,1\n0,1\n", "rise"),
        ("time,x\n0,1\n1\n", "line 3"),
    ],
)
def test_tables_that_are_no_curve_are_refused(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Csv("a.csv", "x").filled(text)
