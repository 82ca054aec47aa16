from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hilrig import plugins
from hilrig.disturbances.force_pulse import ForcePulse
from hilrig.disturbances.force_sine import ForceSine
from hilrig.disturbances.friction_step import FrictionStep
from hilrig.disturbances.measurement_delay import MeasurementDelay
from hilrig.disturbances.sensor_bias import SensorBias
from hilrig.disturbances.sensor_noise import SensorNoise
from hilrig.disturbances.stiffness_step import StiffnessStep
from hilrig.disturbances.surface_motion import SurfaceMotion
from hilrig.interfaces import Disturbance
from hilrig.signals import Inputs

AXES = ("x", "z")
TIME = np.arange(4000) * 1e-3

EXAMPLES: dict[str, Disturbance] = {
    "force_pulse": ForcePulse(2.0, "z", 1.0, 0.5),
    "force_sine": ForceSine(2.0, 3.0, "x", at=1.0),
    "friction_step": FrictionStep(2.0, 1.0),
    "measurement_delay": MeasurementDelay(ticks=3),
    "sensor_bias": SensorBias(force=0.1, joint=1e-3),
    "sensor_noise": SensorNoise(force=0.1, joint=1e-3),
    "stiffness_step": StiffnessStep(3.0, 1.0),
    "surface_motion": SurfaceMotion(0.01, 3.0, at=1.0),
}


def applied(*disturbances: Disturbance, seed: int = 0, time: Any = TIME) -> Inputs:
    """Return quiet inputs with `disturbances` applied."""
    inputs = Inputs.quiet(time.size, 2, len(AXES))
    for disturbance in disturbances:
        disturbance.apply(inputs, time, AXES, np.random.default_rng(seed))
    return inputs


def changed(inputs: Inputs) -> set[str]:
    """Return the names of the fields that are not as in quiet inputs."""
    quiet = Inputs.quiet(TIME.size, 2, len(AXES))
    return {name for name in Inputs._fields if not np.array_equal(getattr(inputs, name), getattr(quiet, name))}


def test_every_kind_has_an_example() -> None:
    assert tuple(sorted(EXAMPLES)) == plugins.kinds("disturbances")


@pytest.mark.parametrize("kind", sorted(set(EXAMPLES) - {"friction_step"}))
def test_what_it_acts_on_is_exactly_what_changes(kind: str) -> None:
    disturbance = EXAMPLES[kind]
    assert changed(applied(disturbance)) == set(disturbance.acts_on)


def test_friction_changes_where_it_is_told() -> None:
    for of in ("surface", "joints"):
        step = FrictionStep(2.0, 1.0, of)
        found = changed(applied(step))
        assert len(found) == 1
        assert found <= set(step.acts_on)
    assert changed(applied(FrictionStep(2.0, 1.0, "joints"))) == {"plant_joint_friction_scale"}


@pytest.mark.parametrize("kind", sorted(EXAMPLES))
def test_the_same_seed_is_the_same_world(kind: str) -> None:
    first, second = applied(EXAMPLES[kind], seed=5), applied(EXAMPLES[kind], seed=5)
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("kind", sorted(EXAMPLES))
def test_disturbances_add_up(kind: str) -> None:
    once, twice = applied(EXAMPLES[kind]), applied(EXAMPLES[kind], EXAMPLES[kind])
    for name, one, both in zip(Inputs._fields, once, twice, strict=True):
        wanted = one**2 if name.endswith("_scale") else 2 * one
        np.testing.assert_allclose(both, wanted, rtol=1e-12)


def test_another_seed_is_another_noise() -> None:
    noise = EXAMPLES["sensor_noise"]
    assert not np.array_equal(applied(noise, seed=1).wrench_error, applied(noise, seed=2).wrench_error)


def test_noise_has_the_standard_deviation_asked_for_and_no_moments() -> None:
    inputs = applied(SensorNoise(force=0.05, joint=2e-5))
    np.testing.assert_allclose(inputs.wrench_error[:, :3].std(axis=0), 0.05, rtol=0.05)
    np.testing.assert_allclose(inputs.joint_error.std(axis=0), 2e-5, rtol=0.05)
    assert not inputs.wrench_error[:, 3:].any()
    white = np.corrcoef(inputs.wrench_error[1:, 0], inputs.wrench_error[:-1, 0])[0, 1]
    assert abs(white) < 4 / np.sqrt(TIME.size)


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
    inputs = applied(SurfaceMotion(amplitude, frequency, at, ramp))
    offset, velocity = inputs.plant_surface_offset, inputs.plant_surface_velocity
    differences = (offset[2:] - offset[:-2]) / 2e-3
    largest = amplitude * (frequency + 2 / ramp) ** 3 * 1e-6
    np.testing.assert_allclose(differences, velocity[1:-1], atol=10 * largest + 1e-12)
    assert np.abs(offset).max() <= amplitude
    assert not offset[at > TIME].any()


def test_a_surface_swings_with_its_full_amplitude_after_its_ramp() -> None:
    inputs = applied(SurfaceMotion(0.01, 2 * np.pi, at=0.5, ramp=1.0))
    assert inputs.plant_surface_offset[2750] == pytest.approx(0.01)
    assert inputs.plant_surface_velocity[3000] == pytest.approx(-0.01 * 2 * np.pi)


def test_steps_begin_and_end_on_their_tick() -> None:
    scale = applied(StiffnessStep(3.0, 1.0, 2.0)).plant_stiffness_scale
    np.testing.assert_array_equal(np.flatnonzero(scale == 3.0), np.arange(1000, 2000))
    assert set(scale) == {1.0, 3.0}


def test_a_bias_is_one_component_of_the_force_and_every_joint_or_each() -> None:
    inputs = applied(SensorBias(force=0.5, axis="z", joint=(1e-3, -2e-3), at=1.0))
    assert inputs.wrench_error[2000].tolist() == [0, 0, 0.5, 0, 0, 0]
    assert inputs.joint_error[2000].tolist() == [1e-3, -2e-3]
    assert not inputs.wrench_error[:1000].any()


def test_a_delay_is_told_in_ticks_or_as_a_time() -> None:
    assert set(applied(MeasurementDelay(delay=3e-3, at=1.0)).measurement_delay) == {0.0, 3.0}
    with pytest.raises(ValueError, match="no whole number of periods"):
        applied(MeasurementDelay(delay=1.5e-3))
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
