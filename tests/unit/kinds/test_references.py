from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hilrig.core.interfaces import ReferenceSignal, Span
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


@given(curves)
def test_a_cubic_curve_is_the_spline_with_zero_rates_at_its_ends(steps: list[tuple[float, float]]) -> None:
    """Against the cubics of all stretches, solved for at once: points, equal rates and accelerations, ends at rest."""
    curve = waypoints(steps)
    t, y = np.array(curve.times), np.array(curve.values)
    cubics = dense_spline(t, y)
    since_start = np.linspace(t[0], t[-1], 501)[1:-1]
    index = np.searchsorted(t, since_start, side="right") - 1
    s, (a, b, c, d) = since_start - t[index], cubics[index].T
    samples = curve.sample(SPAN.start + since_start, SPAN)
    scale = 1.0 + max(float(np.abs(part).max()) for part in samples)
    np.testing.assert_allclose(samples.value, a + s * (b + s * (c + s * d)), atol=1e-9 * scale)
    np.testing.assert_allclose(samples.rate, b + s * (2 * c + s * 3 * d), atol=1e-9 * scale)
    np.testing.assert_allclose(samples.acceleration, 2 * c + 6 * d * s, atol=1e-9 * scale)


def dense_spline(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return a, b, c, d of a + b s + c s^2 + d s^3 for each stretch, s from its first point."""
    count = t.size - 1
    matrix, right = np.zeros((4 * count, 4 * count)), np.zeros(4 * count)
    row = iter(range(4 * count))
    for i, h in enumerate(np.diff(t)):
        value, rate, bend = np.array([1, h, h**2, h**3]), np.array([0, 1, 2 * h, 3 * h**2]), np.array([0, 0, 2, 6 * h])
        here, there = slice(4 * i, 4 * i + 4), slice(4 * i + 4, 4 * i + 8)
        k = next(row)
        matrix[k, 4 * i], right[k] = 1, y[i]
        k = next(row)
        matrix[k, here], right[k] = value, y[i + 1]
        if i == 0:
            matrix[next(row), 1] = 1
        if i == count - 1:
            matrix[next(row), here] = rate
        else:
            for ending, starting in ((rate, [0, 1, 0, 0]), (bend, [0, 0, 2, 0])):
                k = next(row)
                matrix[k, here], matrix[k, there] = ending, -np.array(starting)
    return np.linalg.solve(matrix, right).reshape(count, 4)


def test_a_linear_curve_is_straight() -> None:
    samples = Waypoints((0.0, 2.0, 4.0), (0.0, 1.0, 0.0), "linear").sample(np.array([3.0, 5.0]), SPAN)
    np.testing.assert_allclose(samples.value, [0.5, 0.5])
    np.testing.assert_allclose(samples.rate, [0.5, -0.5])


@pytest.mark.parametrize(
    ("times", "points", "words"),
    [
        ((0.0,), (0.0,), "at least two points; this one has 1"),
        ((0.0, 0.0), (1.0, 2.0), "point 2: the time 0 s follows 0 s"),
        ((-1.0, 0.0), (1.0, 2.0), "point 1: the time -1 s is before the start"),
        ((0.0, np.nan), (1.0, 2.0), "finite"),
        ((0.0, 1.0), (1.0,), "2 times, but 1 values"),
    ],
)
def test_points_that_make_no_curve_are_refused(times: tuple, points: tuple, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Waypoints(times, points)


@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
def test_a_curve_that_begins_after_its_phase_is_refused(interpolation: Any) -> None:
    """Such as times since 1970: the reference would rest at the first value, whatever the table says."""
    length = SPAN.end - SPAN.start
    with pytest.raises(ValueError, match=r"begins 1760000000 s after .* lasts 4 s; .* count from the start"):
        Waypoints((1.76e9, 1.76e9 + 1), (0.0, 1.0), interpolation).sample(TIME, SPAN)
    with pytest.raises(ValueError, match="begins 4 s after"):
        Waypoints((length, 2 * length), (0.0, 1.0), interpolation).sample(TIME, SPAN)
    assert Waypoints((length - 0.1, length), (0.0, 1.0), interpolation).sample(TIME, SPAN).value.any()


def test_a_curve_that_outlasts_its_phase_is_warned_of() -> None:
    in_ms = Waypoints((0.0, 10.0, 20.0), (0.0, 1.0, 2.0))
    assert in_ms.warnings(SPAN) == [
        "2 of the curve's 3 points are never reached: its last time is 20 s, and the phase lasts 4 s"
    ]
    assert Csv("a.csv", "x").filled("time,x\n0,0\n4.1,1\n").warnings(SPAN)
    assert Waypoints((0.0, 2.0), (0.0, 1.0)).warnings(SPAN) == []
    third = Span(0.1, 0.1 + 0.1 + 0.1, None)
    assert Waypoints((0.0, 0.2), (0.0, 1.0)).warnings(third) == [], "what is lost by rounding is no point"
