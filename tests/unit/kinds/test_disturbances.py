from __future__ import annotations

import numpy as np
import pytest
from helpers.builders import TIME, applied
from hypothesis import given
from hypothesis import strategies as st

from hilrig.kinds.disturbances.force_pulse import ForcePulse
from hilrig.kinds.disturbances.force_sine import ForceSine
from hilrig.kinds.disturbances.friction_step import FrictionStep
from hilrig.kinds.disturbances.measurement_delay import MeasurementDelay
from hilrig.kinds.disturbances.sensor_bias import SensorBias
from hilrig.kinds.disturbances.sensor_noise import SensorNoise
from hilrig.kinds.disturbances.stiffness_step import StiffnessStep
from hilrig.kinds.disturbances.surface_motion import SurfaceMotion


def test_friction_changes_where_it_is_told() -> None:
    of_surface, of_joints = applied(FrictionStep(2.0, 1.0)), applied(FrictionStep(2.0, 1.0, "joints"))
    assert set(of_surface.plant_surface_friction_scale) == set(of_joints.plant_joint_friction_scale) == {1.0, 2.0}
    assert set(of_surface.plant_joint_friction_scale) == set(of_joints.plant_surface_friction_scale) == {1.0}


def test_another_seed_is_another_noise() -> None:
    noise = SensorNoise(force=0.1)
    assert not np.array_equal(applied(noise, seed=1).wrench_error, applied(noise, seed=2).wrench_error)


def test_noise_has_the_standard_deviation_asked_for_and_no_moments() -> None:
    schedule = applied(SensorNoise(force=0.05, joint=2e-5))
    np.testing.assert_allclose(schedule.wrench_error[:, :3].std(axis=0), 0.05, rtol=0.05)
    np.testing.assert_allclose(schedule.joint_error.std(axis=0), 2e-5, rtol=0.05)
    assert not schedule.wrench_error[:, 3:].any()


def test_noise_is_independent_from_tick_to_tick_and_from_channel_to_channel() -> None:
    schedule = applied(SensorNoise(force=0.05, joint=2e-5))
    channels = np.column_stack([schedule.wrench_error[:, :3], schedule.joint_error])
    alike = np.corrcoef(np.column_stack([channels[1:], channels[:-1]]), rowvar=False) - np.eye(10)
    assert np.abs(alike).max() < 4 / np.sqrt(TIME.size)


@given(st.floats(0.1, 10.0))
def test_twice_the_noise_is_the_same_noise_twice_as_large(factor: float) -> None:
    one, more = applied(SensorNoise(0.05, 1e-5)), applied(SensorNoise(factor * 0.05, factor * 1e-5))
    np.testing.assert_allclose(more.joint_error, factor * one.joint_error, rtol=1e-12)
    np.testing.assert_allclose(more.wrench_error, factor * one.wrench_error, rtol=1e-12)


@given(st.integers(0, 3000), st.integers(1, 900))
def test_a_pulse_lasts_exactly_as_long_as_it_is_told(at: int, duration: int) -> None:
    force = applied(ForcePulse(-2.0, "z", at * 1e-3, duration * 1e-3)).plant_tip_force
    np.testing.assert_array_equal(np.flatnonzero(force[:, 1]), np.arange(at, at + duration))
    assert set(force[:, 1]) <= {0.0, -2.0}
    assert not force[:, 0].any()


def test_a_force_sine_begins_at_its_phase_angle_and_ends() -> None:
    force = applied(ForceSine(2.0, np.pi, "x", angle=np.pi / 2, at=1.0, until=2.0)).plant_tip_force[:, 0]
    assert force[1000] == pytest.approx(2.0)
    assert force[1500] == pytest.approx(0.0, abs=1e-9)
    assert not force[:1000].any()
    assert not force[2000:].any()


@given(st.floats(0.0, 0.05), st.floats(0.1, 20.0), st.floats(0.0, 3.0), st.floats(0.1, 2.0))
def test_a_moving_surfaces_velocity_is_the_derivative_of_its_offset(
    amplitude: float, frequency: float, at: float, ramp: float
) -> None:
    schedule = applied(SurfaceMotion(amplitude, frequency, at, ramp))
    offset, velocity = schedule.plant_surface_offset, schedule.plant_surface_velocity
    differences = (offset[2:] - offset[:-2]) / 2e-3
    largest = amplitude * (frequency + 2 / ramp) ** 3 * 1e-6
    np.testing.assert_allclose(differences, velocity[1:-1], atol=10 * largest + 1e-12)
    assert np.abs(offset).max() <= amplitude
    assert not offset[at > TIME].any()


def test_a_surface_swings_with_its_full_amplitude_after_its_ramp() -> None:
    schedule = applied(SurfaceMotion(0.01, 2 * np.pi, at=0.5, ramp=1.0))
    assert schedule.plant_surface_offset[2750] == pytest.approx(0.01)
    assert schedule.plant_surface_velocity[3000] == pytest.approx(-0.01 * 2 * np.pi)


def test_steps_begin_and_end_on_their_tick() -> None:
    scale = applied(StiffnessStep(3.0, 1.0, 2.0)).plant_stiffness_scale
    np.testing.assert_array_equal(np.flatnonzero(scale == 3.0), np.arange(1000, 2000))
    assert set(scale) == {1.0, 3.0}


def test_a_bias_is_one_component_of_the_force_and_every_joint_or_each() -> None:
    schedule = applied(SensorBias(force=0.5, axis="z", joint=(1e-3, -2e-3), at=1.0))
    assert schedule.wrench_error[2000].tolist() == [0, 0, 0.5, 0, 0, 0]
    assert schedule.joint_error[2000].tolist() == [1e-3, -2e-3]
    assert not schedule.wrench_error[:1000].any()


def test_a_delay_is_told_in_ticks_or_as_a_time() -> None:
    assert set(applied(MeasurementDelay(delay=3e-3, at=1.0)).measurement_delay) == {0.0, 3.0}
    for delay in (1.5e-3, 0.0):
        with pytest.raises(ValueError, match="not a whole number of periods"):
            applied(MeasurementDelay(delay=delay))
    with pytest.raises(ValueError, match="either 'ticks' or 'delay'"):
        MeasurementDelay()


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match=r"no axis 'y' \(axes: x, z\)"):
        applied(ForcePulse(1.0, "y", 0.0, 1.0))
    with pytest.raises(ValueError, match="before it begins"):
        applied(StiffnessStep(2.0, 2.0, 1.0))
    with pytest.raises(ValueError, match="3 values"):
        applied(SensorBias(joint=(1e-3, 1e-3, 1e-3)))


def test_rounding_of_a_time_does_not_move_its_tick() -> None:
    scale = applied(StiffnessStep(3.0, at=0.1 + 0.2)).plant_stiffness_scale  # 0.30000000000000004 > TIME[300]
    assert np.flatnonzero(scale == 3.0)[0] == 300
