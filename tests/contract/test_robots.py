"""What every robot keeps to."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.builders import example

from hilrig.core.interfaces import Robot
from hilrig.core.signals import WRENCH_AXES, Array
from hilrig.kinds.impedance import model_torque
from hilrig.kinds.registry import kinds, load

STEP = 1e-6


@pytest.fixture(params=kinds("robots"))
def robot(request: pytest.FixtureRequest) -> Robot:
    return example(load("robots", request.param))


def poses(robot: Robot, count: int = 20) -> list[tuple[Array, Array]]:
    """Return joint positions well inside the limits, and joint rates."""
    rng, (low, high) = np.random.default_rng(5), robot.joint_limits()
    return [(low + (high - low) * rng.uniform(0.1, 0.9, low.size), rng.normal(size=low.size)) for _ in range(count)]


def test_shapes(robot: Robot) -> None:
    n, m, p = robot.joints, len(robot.axes), robot.dynamic_parameters().size
    assert set(robot.axes) <= set(WRENCH_AXES)
    assert robot.torque_limits().shape == (n,)
    low, high = robot.joint_limits()
    assert low.shape == high.shape == (n,)
    assert (low < high).all()
    at = robot.kinematics(*poses(robot)[0])
    shapes = [part.shape for part in at]
    assert shapes == [(m,), (m,), (m, n), (m, n), (2 * n + 1, n, p if p else at.regressor.shape[2])]
    assert all(part.dtype == np.float64 for part in at)


def test_inverse_kinematics_reaches_the_position(robot: Robot) -> None:
    for q, _ in poses(robot):
        position = robot.forward_kinematics(q)
        np.testing.assert_allclose(robot.forward_kinematics(robot.inverse_kinematics(position)), position, atol=1e-9)


def test_kinematics_are_derivatives_of_the_position(robot: Robot) -> None:
    for q, rate in poses(robot):
        at = robot.kinematics(q, rate)
        columns = [
            (robot.forward_kinematics(q + STEP * e) - robot.forward_kinematics(q - STEP * e)) / (2 * STEP)
            for e in np.eye(robot.joints)
        ]
        ahead, behind = (robot.kinematics(q + s * STEP * rate, rate).jacobian for s in (1, -1))
        np.testing.assert_allclose(at.position, robot.forward_kinematics(q), atol=1e-14)
        np.testing.assert_allclose(at.jacobian, np.stack(columns, axis=1), atol=1e-7)
        np.testing.assert_allclose(at.velocity, at.jacobian @ rate, atol=1e-12)
        np.testing.assert_allclose(at.jacobian_rate, (ahead - behind) / (2 * STEP), atol=1e-6)


def test_the_regressor_is_a_passive_mechanism(robot: Robot) -> None:
    """M symmetric and positive, and power through inertia and Coriolis forces is the change of kinetic energy."""
    n, theta = robot.joints, robot.dynamic_parameters()
    if theta.size == 0:
        return  # a robot without a model
    still = np.zeros(n)

    def mass(q: Array) -> Array:
        return (robot.kinematics(q, still).regressor[1 + n :] @ theta).T

    for q, rate in poses(robot):
        matrix, regressor = mass(q), robot.kinematics(q, rate).regressor
        np.testing.assert_allclose(matrix, matrix.T, atol=1e-12)
        assert np.linalg.eigvalsh(matrix)[0] > 0
        coriolis = model_torque(regressor, rate, still, theta) - regressor[0] @ theta
        energy_rate = 0.5 * rate @ (mass(q + STEP * rate) - mass(q - STEP * rate)) @ rate / (2 * STEP)
        assert rate @ coriolis == pytest.approx(energy_rate, abs=1e-6)


def test_inputs_are_only_read(robot: Robot) -> None:
    q, rate = poses(robot)[0]
    before = q.copy(), rate.copy()
    at = robot.kinematics(q, rate)
    at.position[:] = 9.0
    np.testing.assert_array_equal((q, rate), before)
