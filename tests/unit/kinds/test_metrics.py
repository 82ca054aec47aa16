"""Metrics against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from helpers.builders import PERIOD, record
from hypothesis import given
from hypothesis import strategies as st

from hilrig.kinds.registry import load_kind

TICKS = 10_000
SIZES = st.floats(0.01, 100.0)


def measured(kind: str, **changes: Any) -> dict[str, float]:
    """Return what a metric says of 10 s of rest with `changes`."""
    return load_kind("metrics", kind)().measure(record(TICKS, **changes))


def column(x: np.ndarray | float, z: np.ndarray | float) -> np.ndarray:
    return np.stack(np.broadcast_arrays(x, z, np.zeros(TICKS))[:2], axis=1)


def sine(amplitude: float, turns: int) -> np.ndarray:
    return amplitude * np.sin(2 * np.pi * turns * np.arange(TICKS) / TICKS)


def motion(amplitude: float, rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a sine and its first two derivatives, (TICKS,) each."""
    angle = rate * np.arange(TICKS) * PERIOD
    return amplitude * np.sin(angle), amplitude * rate * np.cos(angle), -amplitude * rate**2 * np.sin(angle)


@given(SIZES, st.integers(1, 50))
def test_rmse_and_peak_of_a_sine(amplitude: float, turns: int) -> None:
    wave, wanted = sine(amplitude, turns), sine(2.0, 3)
    moves = {"position": column(wanted + wave, 99.0), "reference_position": column(wanted, 7.0)}
    presses = {"force": column(99.0, wanted + wave), "reference_force": column(7.0, wanted)}
    assert measured("position_rmse", **moves) == pytest.approx({"x": amplitude / np.sqrt(2)})
    assert measured("force_rmse", **presses) == pytest.approx({"z": amplitude / np.sqrt(2)})
    assert measured("position_peak", **moves) == pytest.approx({"x": amplitude}, rel=1e-3)
    assert measured("force_peak", **presses) == pytest.approx({"z": amplitude}, rel=1e-3)


@given(SIZES, st.integers(1, 50))
def test_chattering_of_a_square_wave(size: float, half: int) -> None:
    """A jump of 2 A every `half` ticks in one of two joints: A / half a tick, up to the edges."""
    square = size * np.where(np.arange(TICKS) // half % 2, -1.0, 1.0)
    jumps = (TICKS - 1) // half
    assert measured("chattering", torque=column(square, 7.0))[""] == pytest.approx(size * jumps / (TICKS - 1))


def test_chattering_does_not_count_a_gap() -> None:
    tick = np.arange(TICKS, dtype=np.float64)
    tick[5000:] += 3
    step = np.where(tick < 5000, 0.0, 1.0)
    assert measured("chattering", tick=tick, torque=column(step, 0.0)) == {"": 0.0}


@given(SIZES)
def test_effort_of_constant_torque(size: float) -> None:
    assert measured("effort", torque=column(size, -size))[""] == pytest.approx(size)


@given(st.floats(0.02, 0.5), st.floats(0.05, 1.0))
def test_settling_time_of_an_exponential(size: float, constant: float) -> None:
    """|e| = A exp(-t / T) meets the band b at T ln(A / b) after the phase's beginning, here at 3 s."""
    time = np.arange(TICKS) * PERIOD
    error, band = size * np.exp(-time / constant), max(0.005, 0.02 * size)
    changes = {"time": time + 3.0, "position": column(-error, 0.0), "reference_step": np.array([size, 0.0])}
    found = measured("settling_time", **changes)
    assert found["x"] == pytest.approx(constant * np.log(size / band), abs=1.01 * PERIOD)


def test_settling_time_at_the_edges() -> None:
    assert measured("settling_time") == {"x": 0.0}
    assert measured("settling_time", position=column(1.0, 0.0)) == {"x": np.inf}
    assert measured("settling_time", position=column(np.nan, 0.0)) == {"x": np.inf}
    assert measured("settling_time", phases=2) == {}


@given(st.integers(0, TICKS))
def test_contact_loss_is_the_share_of_ticks(without: int) -> None:
    """Less than 0.05 N is no contact."""
    force = np.where(np.arange(TICKS) < without, 0.04, 3.5)
    wanted = column(0.0, 3.5)
    assert measured("contact_loss", force=column(0.0, force), reference_force=wanted)["z"] == pytest.approx(
        without / TICKS
    )


def test_contact_loss_needs_contact_to_be_asked_for_and_does_not_trust_nan() -> None:
    assert measured("contact_loss", reference_force=column(0.0, 0.04)) == {}
    assert measured("contact_loss", force=column(0.0, np.nan), reference_force=column(0.0, 1.0)) == {"z": 1.0}


@given(st.integers(0, TICKS))
def test_late_fraction(late: int) -> None:
    assert measured("late_fraction", late=(np.arange(TICKS) < late) * 1.0)[""] == pytest.approx(late / TICKS)


@given(st.floats(0.1, 2.0), st.floats(0.5, 5.0))
def test_auxiliary_error_is_zero_on_a_solution_of_the_desired_dynamics(amplitude: float, rate: float) -> None:
    """Choose two motions, and let force and desired force be what eq. (3) demands of them.

    References of an axis that is not so controlled count for nothing.
    """
    (x, v, a), (x_d, v_d, a_d) = motion(amplitude, rate), motion(0.7, 1.9)
    force_x = -(3.0 * (a - a_d) + 30.0 * (v - v_d) + 250.0 * (x - x_d))
    signals = {
        "position": column(x, x), "velocity": column(v, v), "acceleration": column(a, a),
        "reference_position": column(x_d, 9.0), "reference_velocity": column(v_d, 9.0),
        "reference_acceleration": column(a_d, 9.0),
        "force": column(force_x, 1.0), "reference_force": column(9.0, 6.0 * a + 60.0 * v + 1.0),
    }  # fmt: skip
    assert measured("auxiliary_error_rmse", **signals) == pytest.approx({"x": 0.0, "z": 0.0}, abs=1e-9)


def test_auxiliary_error_damps_the_force_axis() -> None:
    """Erratum 14: the full velocity counts, also where sigma is zero."""
    assert measured("auxiliary_error_rmse", velocity=column(0.0, 0.5))["z"] == pytest.approx(30.0)


def test_ticks_that_nobody_answered_are_late_too() -> None:
    """Ticks 10 and 11 are missing and were late, as was 12 itself; 3 of TICKS + 2."""
    tick = np.arange(TICKS) + 2 * (np.arange(TICKS) >= 10)
    late = 3.0 * (tick == 12)
    assert measured("late_fraction", tick=tick, late=late)[""] == pytest.approx(3 / (TICKS + 2))
