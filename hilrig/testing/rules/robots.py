"""Rules for robots: geometry with consistent derivatives, and a physically possible model."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from hilrig import WRENCH_AXES, Array, Kinematics, OutOfReach, Robot
from hilrig.testing.rule import Broken, NotApplicableError, require, rule, same, shown

STEP = 1e-6
"""rad or s, step of a central difference"""
FAR = 1e6
"""m: where no robot reaches"""


class Pose(NamedTuple):
    """A state of the joints."""

    q: Array
    rate: Array


@rule("robots", first=True)
def sizes_agree(robot: Robot) -> None:
    """Joints, axes, limits, geometry and regressor must be finite float64 arrays of consistent sizes."""
    n, m, p = robot.joints, len(robot.axes), robot.dynamic_parameters().size
    unknown = [axis for axis in robot.axes if axis not in WRENCH_AXES]
    require(not unknown, f"it has an axis '{unknown[:1]}'; the axes there are: {', '.join(WRENCH_AXES)}")
    low, high = robot.joint_limits()
    for name, array in (("torque_limits", robot.torque_limits()), ("joint_limits", low), ("joint_limits", high)):
        _check_array(name, array, (n,))
    require((low < high).all(), "its joint limits are {} to {}", low, high)
    require((robot.torque_limits() > 0).all(), "its torque limits are {}", robot.torque_limits())
    first = _poses(robot)[0]
    _check_array("forward_kinematics", robot.forward_kinematics(first.q), (m,))
    sizes = ((m,), (m,), (m, n), (m, n), (2 * n + 1, n, p))
    for name, array, size in zip(Kinematics._fields, robot.kinematics(*first), sizes, strict=True):
        _check_array(f"kinematics.{name}", array, size)


@rule("robots")
def inverse_kinematics_reaches_the_position(robot: Robot) -> None:
    """`inverse_kinematics` must return joint positions that put the tip at the requested position."""
    for pose in _poses(robot):
        wanted = robot.forward_kinematics(pose.q)
        found = robot.inverse_kinematics(wanted.copy())
        _check_array("inverse_kinematics", found, (robot.joints,))
        reached = robot.forward_kinematics(found)
        require(np.allclose(reached, wanted, atol=1e-7), "asked for {} m it reaches {} m", wanted, reached)


@rule("robots")
def what_is_out_of_reach_is_refused(robot: Robot) -> None:
    """`inverse_kinematics` must raise OutOfReach for a position that the robot cannot reach."""
    try:
        found = robot.inverse_kinematics(np.full(len(robot.axes), FAR))
    except OutOfReach as error:
        require(str(error), "the error has no message")
    else:
        raise Broken(f"for a place {FAR:g} m away it returned {shown(found)}")


@rule("robots")
def kinematics_agree_with_the_position(robot: Robot) -> None:
    """`kinematics` must give the position of `forward_kinematics`, and the velocity J q'."""
    for pose, at in _seen(robot):
        position = robot.forward_kinematics(pose.q)
        require(
            np.allclose(at.position, position, atol=1e-10),
            "at {} it is at {} m by the one, and at {} m by the other",
            pose.q,
            at.position,
            position,
        )
        velocity = at.jacobian @ pose.rate
        require(
            np.allclose(at.velocity, velocity, atol=1e-10),
            "its velocity is {} m/s, and J q' is {} m/s",
            at.velocity,
            velocity,
        )


@rule("robots")
def the_jacobian_is_the_derivative_of_the_position(robot: Robot) -> None:
    """The Jacobian must be the derivative of the position."""
    for pose, at in _seen(robot):
        columns = [
            (robot.forward_kinematics(pose.q + STEP * e) - robot.forward_kinematics(pose.q - STEP * e)) / (2 * STEP)
            for e in np.eye(robot.joints)
        ]
        _compare(at.jacobian, np.stack(columns, axis=1), 1e-6, "at q = {} its Jacobian", pose.q)


@rule("robots")
def the_jacobians_rate_is_its_derivative(robot: Robot) -> None:
    """The Jacobian's rate must be the derivative of the Jacobian along the motion."""
    for pose, at in _seen(robot):
        ahead, behind = (robot.kinematics(pose.q + s * STEP * pose.rate, pose.rate).jacobian for s in (1, -1))
        rate = (ahead - behind) / (2 * STEP)
        _compare(at.jacobian_rate, rate, 1e-5, "at q = {} the Jacobian's rate", pose.q)


@rule("robots")
def inertia_is_symmetric_and_positive(robot: Robot) -> None:
    """The inertia in the regressor must be a symmetric positive definite matrix."""
    for pose in _modelled(robot):
        matrix = _mass(robot, pose.q)
        _compare(matrix, matrix.T, 1e-9, "at q = {} M", pose.q)
        least = float(np.linalg.eigvalsh(matrix)[0])
        require(least > 0, "at q = {} its smallest eigenvalue is {}", pose.q, least)


@rule("robots")
def coriolis_forces_fit_the_inertia(robot: Robot) -> None:
    """The Coriolis part of the regressor must fit its inertia: v^T (M' - 2 C) v = 0 for every v.

    Adaptive and sliding-mode laws rely on it; for v = q' it means that energy is conserved.
    """
    random = np.random.default_rng(7)
    for pose in _modelled(robot):
        inertia_rate = (_mass(robot, pose.q + STEP * pose.rate) - _mass(robot, pose.q - STEP * pose.rate)) / (2 * STEP)
        for v in (pose.rate, random.normal(size=robot.joints)):
            coriolis = _by_velocity(robot, pose.q, pose.rate, v) - _by_velocity(robot, pose.q, 0 * pose.rate, v)
            left = float(v @ inertia_rate @ v - 2 * v @ coriolis)
            scale = 1.0 + abs(float(v @ coriolis))
            require(abs(left) < 1e-5 * scale, "at q = {} it is {} for v = {}", pose.q, left, v)


@rule("robots")
def gravity_has_a_potential(robot: Robot) -> None:
    """Gravity in the regressor must be the derivative of a potential: its own derivative is a symmetric matrix."""
    for pose in _modelled(robot):
        columns = [
            (_constant(robot, pose.q + STEP * e) - _constant(robot, pose.q - STEP * e)) / (2 * STEP)
            for e in np.eye(robot.joints)
        ]
        matrix = np.stack(columns, axis=1)
        _compare(matrix, matrix.T, 1e-5, "at q = {} dG/dq", pose.q)


@rule("robots")
def friction_takes_energy(robot: Robot) -> None:
    """Friction in the nominal model must dissipate energy, or be absent."""
    for pose in _modelled(robot):
        still = 0 * pose.rate
        coulomb = _constant(robot, pose.q, pose.rate) - _constant(robot, pose.q)
        power = float(pose.rate @ (coulomb + _by_velocity(robot, pose.q, still, pose.rate)))
        require(power > -1e-9, "at q' = {} it gives {} W", pose.rate, -power)


@rule("robots")
def inputs_are_only_read_and_outputs_the_callers_own(robot: Robot) -> None:
    """The methods must only read their arrays, and return new ones at each call."""
    pose, other = _poses(robot)[:2]
    q, rate = pose.q.copy(), pose.rate.copy()
    at = robot.kinematics(q, rate)
    kept = [part.copy() for part in at]
    robot.kinematics(*other)
    require(same(q, pose.q) and same(rate, pose.rate), "kinematics changed the joints' state")
    for name, part, was in zip(at._fields, at, kept, strict=True):
        require(same(part, was), f"kinematics.{name} of one call was changed by the next")
        part[...] = 9.0
        require(same(q, pose.q) and same(rate, pose.rate), f"kinematics.{name} is the array that it was given")
    for name in ("dynamic_parameters", "torque_limits"):
        first = getattr(robot, name)()
        was = first.copy()
        first[...] = 9.0
        require(same(getattr(robot, name)(), was), f"what {name} returned before, changed by its owner, came again")


@rule("robots")
def kernels_give_the_same_bits(robot: Any) -> None:
    """The kernels of a robot, if it offers any, must fill in what `kinematics` returns, to the last bit.

    They get arrays with the values of an earlier state; entries of a regressor that are always zero may be left alone.
    """
    if not hasattr(robot, "kernels"):
        return
    kernels, poses = robot.kernels(), _poses(robot)
    room = Kinematics(*(part.copy() for part in robot.kinematics(*poses[-1])))
    for pose in poses:
        kernels.kinematics(kernels.constants, *pose, room)
        for name, part, wanted in zip(room._fields, room, robot.kinematics(*pose), strict=True):
            require(same(part, wanted), "at q = {} {} is {} instead of {}", pose.q, name, part, wanted)


def _poses(robot: Robot, count: int = 12) -> list[Pose]:
    """Return joint positions well inside the limits, and joint rates."""
    random, (low, high) = np.random.default_rng(5), robot.joint_limits()
    return [
        Pose(low + (high - low) * random.uniform(0.1, 0.9, low.size), random.normal(size=low.size))
        for _ in range(count)
    ]


def _seen(robot: Robot) -> Iterator[tuple[Pose, Kinematics]]:
    for pose in _poses(robot):
        yield pose, robot.kinematics(*pose)


def _modelled(robot: Robot) -> list[Pose]:
    if robot.dynamic_parameters().size == 0:
        raise NotApplicableError("it has no dynamic model")
    return _poses(robot)


def _mass(robot: Robot, q: Array) -> Array:
    """Return M(q), (n, n) kg m^2."""
    regressor = robot.kinematics(q, 0 * q).regressor
    return (regressor[1 + robot.joints :] @ robot.dynamic_parameters()).T


def _by_velocity(robot: Robot, q: Array, rate: Array, v: Array) -> Array:
    """Return the part of the model's torque that is linear in v, (n,) N m: C(q, q') v, and viscous friction."""
    regressor = robot.kinematics(q, rate).regressor[1 : 1 + robot.joints]
    return np.einsum("i,ijk,k->j", v, regressor, robot.dynamic_parameters())


def _constant(robot: Robot, q: Array, rate: Array | None = None) -> Array:
    """Return the part of the model's torque without v and a, (n,) N m: G(q), and Coulomb friction."""
    regressor = robot.kinematics(q, 0 * q if rate is None else rate).regressor[0]
    return regressor @ robot.dynamic_parameters()


def _check_array(name: str, array: Any, shape: tuple[int, ...]) -> None:
    require(isinstance(array, np.ndarray), f"{name} is a {type(array).__name__}")
    require(array.shape == shape, f"{name} is an array {array.shape} instead of {shape}")
    require(array.dtype == np.float64, f"{name} is an array of {array.dtype}")
    require(np.isfinite(array).all(), "{} is {}", name, array)


def _compare(given: Array, expected: Array, tolerance: float, what: str, *values: Any) -> None:
    scale = 1.0 + np.abs(expected).max()
    agrees = np.allclose(given, expected, atol=tolerance * scale, rtol=0)
    require(agrees, f"{what} is {{}} instead of {{}}", *values, given, expected)
