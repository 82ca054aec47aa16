"""The hybrid impedance filter shared by all control laws, eqs. (3) to (5) of the paper, and small linear algebra."""

from __future__ import annotations

import numpy as np

from hilrig.core.compiler import kernel, kernel_without_arrays
from hilrig.core.interfaces import Impedance
from hilrig.core.signals import Array, Reference, State


@kernel_without_arrays
def desired_acceleration(
    impedance: Impedance, i: int, position: float, velocity: float, force: float, reference: Reference
) -> float:
    """Return a_d of eq. (4) along axis `i`, m/s^2, at x = `position`, x' = `velocity` and F_e = `force`.

    a_d = M_d^-1 [-B_d (x' - Sigma x_d') - K_d Sigma (x - x_d) + (I - Sigma) F_d - F_e] + Sigma x_d''
    """
    sigma = impedance.sigma[i]
    drive = (
        -impedance.damping[i] * (velocity - sigma * reference.velocity[i])
        - impedance.stiffness[i] * sigma * (position - reference.position[i])
        + (1.0 - sigma) * reference.force[i]
        - force
    )
    return drive / impedance.inertia[i] + sigma * reference.acceleration[i]


@kernel
def advance_filter(
    impedance: Impedance,
    period: float,
    filter_position: Array,
    filter_velocity: Array,
    state: State,
    reference: Reference,
) -> Array:
    """Integrate p_d and v_d of eq. (5) by one period, in place, and return a_d (m,) m/s^2.

    With reference states the filter runs on p_d, v_d (an admittance); otherwise on the measured x, x', as printed.
    Both integrals are clipped to the measured state: v_d within x' +- velocity_clip, p_d within x +- position_clip.
    """
    acceleration = np.empty(filter_position.size)
    move_filter(impedance, period, filter_position, filter_velocity, state, reference, acceleration)
    return acceleration


@kernel_without_arrays
def move_filter(
    impedance: Impedance,
    period: float,
    filter_position: Array,
    filter_velocity: Array,
    state: State,
    reference: Reference,
    acceleration: Array,
) -> None:
    """Do the work of `advance_filter`; a_d goes into `acceleration`."""
    for i in range(acceleration.size):
        x, v = state.position[i], state.velocity[i]
        if impedance.reference_states:
            at, rate = filter_position[i], filter_velocity[i]
        else:
            at, rate = x, v
        acceleration[i] = desired_acceleration(impedance, i, at, rate, state.force[i], reference)
        speed = filter_velocity[i] + period * acceleration[i]
        filter_velocity[i] = min(max(speed, v - impedance.velocity_clip), v + impedance.velocity_clip)
        # The new v_d, clipped: p_d would otherwise keep moving while v_d stands at its limit.
        place = filter_position[i] + period * filter_velocity[i]
        filter_position[i] = min(max(place, x - impedance.position_clip), x + impedance.position_clip)


@kernel
def sliding_reference(
    slope: float, acceleration: Array, filter_position: Array, filter_velocity: Array, state: State
) -> tuple[Array, Array, Array, Array]:
    """Return e = p_d - x, s = e' + Lambda e (m,), and the joint reference v, a (n,) on which s is zero.

    v = J^-1 (v_d + Lambda e), a = J^-1 (a_d + Lambda e' - J' v), with Lambda = `slope` (1/s) and a_d = `acceleration`.
    """
    e = filter_position - state.position
    e_rate = filter_velocity - state.velocity
    v = solve(state.jacobian, filter_velocity + slope * e)
    a = solve(state.jacobian, acceleration + slope * e_rate - np.dot(state.jacobian_rate, v))
    return e, e_rate + slope * e, v, a


@kernel
def joint_torque(jacobian: Array, task_force: Array) -> Array:
    """Return J^T f: the joint torque (n,) N m of a task force (m,) N."""
    torque = np.zeros(jacobian.shape[1])
    for i in range(jacobian.shape[0]):
        for j in range(torque.size):
            torque[j] += jacobian[i, j] * task_force[i]
    return torque


@kernel
def solve(matrix: Array, vector: Array) -> Array:
    """Return matrix^-1 vector, (n,). Raises ValueError if the matrix is singular."""
    x = vector.copy()
    eliminate(matrix.copy(), x)
    return x


@kernel_without_arrays
def eliminate(a: Array, x: Array) -> None:
    """Turn `x` (n,) into a^-1 x by elimination with pivoting; overwrites `a` (n, n). Raises ValueError if singular.

    A LAPACK call costs fifteen times more than this for the two or three axes of a task.
    """
    n = x.size
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if a[pivot, k] == 0.0:
            raise ValueError("the matrix is singular: the arm is stretched out, or its Jacobian is not square")
        for j in range(n):
            a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
        x[k], x[pivot] = x[pivot], x[k]
        for i in range(k + 1, n):
            factor = a[i, k] / a[k, k]
            for j in range(k, n):
                a[i, j] -= factor * a[k, j]
            x[i] -= factor * x[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            x[k] -= a[k, j] * x[j]
        x[k] /= a[k, k]


@kernel
def model_torque(regressor: Array, v: Array, a: Array, parameters: Array) -> Array:
    """Return M a + C v + G + F for theta = `parameters` (p,), from the regressor R of `Kinematics`; (n,) N m."""
    return np.dot(regressor_matrix(regressor, v, a), parameters)


@kernel
def regressor_matrix(regressor: Array, v: Array, a: Array) -> Array:
    """Return Y = R[0] + sum v_i R[1+i] + sum a_i R[1+n+i], (n, p)."""
    n = v.size
    matrix = regressor[0].copy()
    for i in range(n):
        matrix += v[i] * regressor[1 + i] + a[i] * regressor[1 + n + i]
    return matrix
