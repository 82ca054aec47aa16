from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hilrig.kinds.actuation import Actuation, holding_position, motor_torque, position_reference

vectors = st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0)).map(np.array)
STILL = np.zeros(2)


@given(torque=vectors, q=vectors, k_ref=st.floats(0.1, 1e4))
def test_a_servo_as_stiff_as_k_ref_gives_the_torque_at_rest(torque: np.ndarray, q: np.ndarray, k_ref: float) -> None:
    servo = Actuation("position_servo", k_ref, k_ref).constants()
    given_torque = motor_torque(servo, STILL, position_reference(torque, q, k_ref), q, STILL, STILL)
    np.testing.assert_allclose(given_torque, torque, atol=1e-8 * k_ref)


def test_a_stiff_servo_multiplies_the_torque() -> None:
    servo = Actuation("position_servo", k_ref=15.0, stiffness=60.0).constants()
    torque, q = np.array([1.0, -2.0]), np.array([0.3, 0.4])
    np.testing.assert_allclose(
        motor_torque(servo, STILL, position_reference(torque, q, 15.0), q, STILL, STILL), 4.0 * torque
    )


@pytest.mark.parametrize("compensated", [False, True])
@given(torque=vectors, q=vectors, gravity=vectors)
def test_holding_position_gives_the_torque(
    compensated: bool, torque: np.ndarray, q: np.ndarray, gravity: np.ndarray
) -> None:
    servo = Actuation("position_servo", 15.0, 40.0, 0.5, compensated).constants()
    reference = holding_position(torque, q, servo, gravity)
    np.testing.assert_allclose(motor_torque(servo, STILL, reference, q, STILL, gravity), torque, atol=1e-10)


def test_servo_damping_brakes_and_compensation_adds_gravity() -> None:
    q, rate, gravity = np.array([0.1, 0.2]), np.array([2.0, -1.0]), np.array([5.0, 6.0])
    plain = Actuation("position_servo", damping=0.5).constants()
    lifted = Actuation("position_servo", damping=0.5, gravity_compensation=True).constants()
    np.testing.assert_allclose(motor_torque(plain, STILL, q, q, rate, gravity), -0.5 * rate)
    np.testing.assert_allclose(motor_torque(lifted, STILL, q, q, rate, gravity), gravity - 0.5 * rate)


def test_torque_actuation_passes_the_torque_and_ignores_the_position() -> None:
    torque = np.array([1.0, 2.0])
    got = motor_torque(Actuation().constants(), torque, np.array([9.0, 9.0]), STILL, np.ones(2), np.ones(2))
    np.testing.assert_array_equal(got, torque)
    np.testing.assert_array_equal(position_reference(torque, np.array([0.1, 0.2]), 0.0), [0.1, 0.2])


def test_a_servo_without_stiffness_holds_where_it_is() -> None:
    servo = Actuation("position_servo", stiffness=0.0).constants()
    np.testing.assert_array_equal(holding_position(np.ones(2), np.array([0.1, 0.2]), servo, STILL), [0.1, 0.2])
