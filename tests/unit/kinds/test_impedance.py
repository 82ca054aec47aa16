from __future__ import annotations

import numpy as np
import pytest
from helpers.builders import arm, impedance, reference, state
from hypothesis import given
from hypothesis import strategies as st

from hilrig.core.interfaces import POSITION_CLIP, VELOCITY_CLIP, Impedance
from hilrig.core.signals import State
from hilrig.kinds.impedance import advance_filter, desired_acceleration, joint_torque, model_torque, solve

PERIOD = 1e-3
HERE = np.array([0.3, 1.2])


def resting(force: tuple[float, float] = (0.0, 0.0)) -> State:
    return state(arm(), HERE, np.zeros(2), np.array(force))


def test_desired_acceleration_is_equation_4() -> None:
    """Both axes of the equation, written out by hand."""
    desired = Impedance(
        np.array([1.0, 0.0]), np.array([3.0, 6.0]), np.array([30.0, 60.0]), np.array([250.0, 99.0]), False
    )
    wanted = reference(
        position=np.array([0.2, 7.0]),
        velocity=np.array([0.5, 7.0]),
        acceleration=np.array([0.9, 7.0]),
        force=np.array([7.0, 3.5]),
    )
    at, rate, force = (0.1, 0.35), (0.4, -0.2), (1.5, 2.0)
    got = [desired_acceleration(desired, i, at[i], rate[i], force[i], wanted) for i in range(2)]
    along_x = (-30 * (0.4 - 0.5) - 250 * (0.1 - 0.2) - 1.5) / 3 + 0.9
    along_z = (-60 * -0.2 + 3.5 - 2.0) / 6
    np.testing.assert_allclose(got, [along_x, along_z], rtol=1e-13)


def test_measured_states_use_the_measurement() -> None:
    now = state(arm(), HERE, np.array([0.05, -0.04]), np.array([0.3, 1.0]))
    wanted = reference(position=np.array([0.1, 0.0]), force=np.array([0.0, 3.5]))
    place, speed = now.position + 0.003, now.velocity - 0.02
    old_place, old_speed = place.copy(), speed.copy()
    a_d = advance_filter(impedance(), PERIOD, place, speed, now, wanted)
    for i in range(2):
        at, rate, force = now.position[i], now.velocity[i], now.force[i]
        assert a_d[i] == pytest.approx(desired_acceleration(impedance(), i, at, rate, force, wanted))
    np.testing.assert_allclose(speed, old_speed + PERIOD * a_d, rtol=1e-13)
    np.testing.assert_allclose(place, old_place + PERIOD * speed, rtol=1e-13)


def test_reference_states_follow_the_second_order_system() -> None:
    """M_d e'' + B_d e' + K_d e = 0 in closed form, the measured state standing still."""
    now, step = resting(), 0.01
    wanted = reference(position=now.position + np.array([step, 0.0]))
    place, speed = now.position.copy(), np.zeros(2)
    decay, natural = 30.0 / (2 * 3.0), np.sqrt(250.0 / 3.0)
    damped = np.sqrt(natural**2 - decay**2)
    period = 1e-4
    for k in range(1, 10001):
        advance_filter(impedance(reference_states=True), period, place, speed, now, wanted)
        t = k * period
        left = np.exp(-decay * t) * (np.cos(damped * t) + decay / damped * np.sin(damped * t))
        assert place[0] - now.position[0] == pytest.approx(step * (1 - left), abs=2e-5)
    assert place[0] - now.position[0] == pytest.approx(step, rel=0.01)


def test_reference_states_yield_to_a_force_until_it_is_the_desired_one() -> None:
    """In a force axis v_d tends to (F_d - F) / B_d: M v' + B v = F_d - F."""
    now = resting((0.0, 2.0))
    wanted = reference(position=now.position, force=np.array([0.0, 3.5]))
    place, speed = now.position.copy(), np.zeros(2)
    for k in range(1, 201):
        advance_filter(impedance(reference_states=True), PERIOD, place, speed, now, wanted)
        expected = 1.5 / 30.0 * (1 - np.exp(-30.0 / 3.0 * k * PERIOD))
        assert speed[1] == pytest.approx(expected, abs=5e-4)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("reference_states", [False, True])
def test_the_filter_stays_near_the_measured_state(sign: float, reference_states: bool) -> None:
    now = resting((sign * 1e3, sign * 1e3))
    place, speed = now.position.copy(), np.zeros(2)
    for _ in range(1000):
        advance_filter(impedance(reference_states=reference_states), PERIOD, place, speed, now, reference())
        assert (np.abs(speed) <= VELOCITY_CLIP + 1e-15).all()
        assert (np.abs(place - now.position) <= POSITION_CLIP + 1e-15).all()
    np.testing.assert_allclose(speed, -sign * VELOCITY_CLIP)
    np.testing.assert_allclose(place - now.position, -sign * POSITION_CLIP)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_clips_go_with_the_moving_tip(sign: float) -> None:
    """v_d is kept about x', and what p_d integrates is v_d as kept."""
    now = state(arm(), HERE, np.array([0.9, -0.7]), np.full(2, sign * 1e5))
    place, speed = now.position.copy(), now.velocity.copy()
    advance_filter(impedance(), PERIOD, place, speed, now, reference())
    kept = now.velocity - sign * VELOCITY_CLIP
    np.testing.assert_allclose(speed, kept, rtol=1e-13)
    np.testing.assert_allclose(place, now.position + PERIOD * kept, rtol=1e-13)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("reference_states", [False, True])
def test_without_clips_the_filter_integrates_freely(sign: float, reference_states: bool) -> None:
    """At a standing tip under a constant force, p_d and v_d go where the double integral goes."""
    free = impedance(reference_states=reference_states)._replace(velocity_clip=np.inf, position_clip=np.inf)
    now = resting((0.0, sign * 300.0))
    place, speed = now.position.copy(), np.zeros(2)
    for _ in range(1000):
        advance_filter(free, PERIOD, place, speed, now, reference(position=now.position))
    t, b = 1.0, 30.0 / 3.0
    if reference_states:  # M v' + B v = -F
        v, p = -100.0 / b * (1 - np.exp(-b * t)), -100.0 / b * (t - (1 - np.exp(-b * t)) / b)
    else:  # the measured x' stays zero: no damping
        v, p = -100.0 * t, -50.0 * t**2
    assert speed[1] == pytest.approx(sign * v, rel=0.01)
    assert place[1] - now.position[1] == pytest.approx(sign * p, rel=0.01)


def test_joint_torque_is_the_transposed_jacobian_times_the_force() -> None:
    jacobian, force = np.random.default_rng(2).normal(size=(2, 3)), np.array([3.0, -4.0])
    np.testing.assert_allclose(joint_torque(jacobian, force), jacobian.T @ force)


@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_solve_agrees_with_lapack(n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix, vector = rng.normal(size=(n, n)), rng.normal(size=n)
    matrix[0, 0] = 0.0 if n > 1 else 1.0  # pivoting is needed
    before = matrix.copy(), vector.copy()
    accuracy = 1e-12 * np.linalg.cond(matrix) * np.abs(vector).max()
    np.testing.assert_allclose(matrix @ solve(matrix, vector), vector, atol=max(accuracy, 1e-12))
    np.testing.assert_allclose(solve(matrix.T, vector), np.linalg.solve(matrix.T, vector), rtol=1e-6, atol=accuracy)
    np.testing.assert_array_equal(matrix, before[0])
    np.testing.assert_array_equal(vector, before[1])


def test_solve_refuses_a_singular_matrix() -> None:
    with pytest.raises(ValueError, match="the matrix is singular"):
        solve(np.array([[1.0, 2.0], [2.0, 4.0]]), np.ones(2))


def test_model_torque_is_linear_in_the_parameters() -> None:
    rng = np.random.default_rng(1)
    regressor, theta = rng.normal(size=(5, 2, 9)), rng.normal(size=9)
    v, a = rng.normal(size=2), rng.normal(size=2)
    expected = sum(c * part for c, part in zip([1.0, *v, *a], regressor, strict=True)) @ theta
    np.testing.assert_allclose(model_torque(regressor, v, a, theta), expected)
