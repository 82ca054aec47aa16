from __future__ import annotations

import numpy as np
import pytest
from helpers import rods
from helpers.builders import arm
from hypothesis import given, settings
from hypothesis import strategies as st

from hilrig.core.errors import OutOfReach
from hilrig.core.signals import Array
from hilrig.kinds.impedance import model_torque
from hilrig.kinds.robots.planar_2r import Planar2r

ARMS = {
    "rods": arm(gravity=(-3.0, -9.0)),
    "shifted": arm(centers_of_mass=(0.2, 0.05), inertias=(0.03, 0.002), gravity=(1.0, -2.0)),
    "points": arm(centers_of_mass=(0.345, 0.2), inertias=(0.0, 0.0)),
    "two sets of lengths": arm(lengths=(1.0, 1.0), dynamic_lengths=(0.2, 0.1)),
}
angles = st.floats(-3.1, 3.1)
rates = st.floats(-5.0, 5.0)
pairs = st.tuples(angles, angles).map(np.array)
rate_pairs = st.tuples(rates, rates).map(np.array)


@pytest.fixture(params=ARMS, scope="module")
def robot(request: pytest.FixtureRequest) -> Planar2r:
    return ARMS[request.param]


def parts(robot: Planar2r, q: Array, rate: Array) -> tuple[Array, Array]:
    """Return M (2, 2) and C (2, 2) as the regressor has them."""
    regressor, theta = robot.kinematics(q, rate).regressor, robot.dynamic_parameters()
    return (regressor[3:] @ theta).T, (regressor[1:3] @ theta).T


@given(q=pairs, rate=rate_pairs)
def test_jacobian_and_its_rate_are_the_derivatives(robot: Planar2r, q: Array, rate: Array) -> None:
    at, h = robot.kinematics(q, rate), 1e-6
    columns = [(robot.forward_kinematics(q + h * e) - robot.forward_kinematics(q - h * e)) / (2 * h) for e in np.eye(2)]
    before, after = robot.kinematics(q - h * rate, rate), robot.kinematics(q + h * rate, rate)
    np.testing.assert_allclose(at.jacobian, np.stack(columns, axis=1), atol=1e-8)
    np.testing.assert_allclose(at.jacobian_rate, (after.jacobian - before.jacobian) / (2 * h), atol=1e-7)
    np.testing.assert_allclose(at.velocity, at.jacobian @ rate, atol=1e-12)
    np.testing.assert_allclose(at.position, robot.forward_kinematics(q), atol=1e-15)


@pytest.mark.parametrize("elbow", ["positive", "negative"])
@given(q1=angles, bend=st.floats(0.05, 3.0))
def test_inverse_kinematics_is_the_inverse(elbow: str, q1: float, bend: float) -> None:
    sign = 1 if elbow == "positive" else -1
    robot, q = arm(elbow=elbow), np.array([q1, sign * bend])
    np.testing.assert_allclose(robot.inverse_kinematics(robot.forward_kinematics(q)), q, atol=1e-9)


@pytest.mark.parametrize("position", [(0.6, 0.0), (0.0, -0.546), (0.1, 0.0), (np.nan, 0.2)])
def test_out_of_reach_is_refused(position: tuple[float, float]) -> None:
    with pytest.raises(OutOfReach, match=r"reaches from 0\.145 m to 0\.545 m"):
        arm().inverse_kinematics(np.array(position))


@given(q=pairs)
def test_mass_matrix_is_symmetric_and_positive(robot: Planar2r, q: Array) -> None:
    matrix, _ = parts(robot, q, np.zeros(2))
    assert matrix[0, 1] == matrix[1, 0]
    assert np.linalg.eigvalsh(matrix)[0] > -1e-15 if robot is ARMS["points"] else np.linalg.eigvalsh(matrix)[0] > 1e-4


@given(q=pairs, rate=rate_pairs)
def test_coriolis_is_passive(robot: Planar2r, q: Array, rate: Array) -> None:
    """M' - 2C is skew-symmetric, not only power-free."""
    h = 1e-6
    matrix_rate = (parts(robot, q + h * rate, rate)[0] - parts(robot, q - h * rate, rate)[0]) / (2 * h)
    skew = matrix_rate - 2 * parts(robot, q, rate)[1]
    np.testing.assert_allclose(skew, -skew.T, atol=1e-8)


@settings(max_examples=50)
@given(q=pairs, rate=rate_pairs, acceleration=rate_pairs)
def test_dynamics_are_those_of_two_rods(robot: Planar2r, q: Array, rate: Array, acceleration: Array) -> None:
    """The regressor against Lagrange's equations of point masses that stand for the rods."""
    regressor, theta = robot.kinematics(q, rate).regressor, robot.dynamic_parameters()
    np.testing.assert_allclose(parts(robot, q, rate)[0], rods.mass_matrix(robot, q), atol=1e-12)
    np.testing.assert_allclose(regressor[0] @ theta, rods.gravity_torque(robot, q), atol=1e-12)
    expected = rods.inverse_dynamics(robot, q, rate, acceleration)
    np.testing.assert_allclose(model_torque(regressor, rate, acceleration, theta), expected, atol=1e-7)


def test_friction_columns_are_coulomb_and_viscous() -> None:
    rate, v = np.array([0.01, -2.0]), np.array([0.3, 0.4])
    theta = np.array([0, 0, 0, 0, 0, 0.5, 0.7, 2.0, 3.0])
    torque = model_torque(arm().kinematics(np.array([0.3, 0.4]), rate).regressor, v, np.zeros(2), theta)
    np.testing.assert_allclose(torque, [0.5 * np.tanh(2.0) + 2.0 * 0.3, 0.7 * np.tanh(-400.0) + 3.0 * 0.4])


def test_inertia_of_a_rod_is_a_twelfth() -> None:
    _, inertias = arm().mass_distribution()
    np.testing.assert_allclose(inertias, (1.8 * 0.345**2 / 12, 1.1 * 0.2**2 / 12))
