"""The baselines against what they should be, written a second time."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.builders import (
    FAR_AWAY,
    PERIOD,
    STILL,
    arm,
    begin,
    impedance,
    reference,
    state,
    task,
    torque_command,
    true_state,
)
from hilrig_drivers.two_link import TwoLink

from hilrig.core.interfaces import POSITION_CLIP, VELOCITY_CLIP, Controller, Law
from hilrig.core.signals import Array, Reference, State
from hilrig.kinds.controllers.adaptive import Adaptive
from hilrig.kinds.controllers.pd import Pd
from hilrig.kinds.controllers.sliding_mode import SlidingMode
from hilrig.kinds.controllers.tde_sliding_mode import TdeSlidingMode
from hilrig.kinds.impedance import advance_filter, model_torque

ARM = arm()
Q = np.array([0.4, 1.3])
STATES = task(ARM)._replace(impedance=impedance(reference_states=True))


def run(law: Law, now: State, wanted: Reference) -> Array:
    return law.step(law.parameters, law.memory, now, wanted)


def joint_error(law_s: Array, jacobian: Array) -> Array:
    return np.linalg.solve(jacobian, law_s)


def swing(controller: Controller, period: float, steps: int, horizontal: bool = True) -> list[tuple[State, Law]]:
    """Let the law move the arm in free space with exact velocities; return state and law at every tick."""
    robot = arm(gravity=(0.0, 0.0)) if horizontal else ARM
    plant = begin(TwoLink(robot, FAR_AWAY, substep=period), Q, period)
    start = state(robot, Q, np.zeros(2))
    law = controller.start(task(robot, period=period, impedance=STATES.impedance), start)
    wanted = reference(position=start.position + np.array([0.015, 0.0]), force=np.array([0.0, 0.5]))
    seen = []
    for _ in range(steps):
        true = true_state(plant)
        now = state(robot, true.joint_position, true.joint_velocity)._replace(elapsed=period)
        torque = run(law, now, wanted)
        seen.append((now, Law(law.step, law.parameters, type(law.memory)(*(np.copy(part) for part in law.memory)))))
        plant.advance(torque_command(torque), STILL)
    return seen


def test_adaptive_lyapunov_function_does_not_rise() -> None:
    """V = s_q' M s_q / 2 + |theta - estimate|^2 / (2 gamma), with s_q = J^-1 s, in nearly continuous time."""
    robot, values = arm(gravity=(0.0, 0.0)), []
    theta = robot.dynamic_parameters()
    for now, law in swing(Adaptive(slope=10.0, gain=50.0, rate=2.0), 1e-4, 4000):
        assert np.abs(law.memory.tracking_error).max() < 0.9 * POSITION_CLIP, "a clip would break the premise"
        assert np.abs(law.memory.filter_velocity - now.velocity).max() < 0.9 * VELOCITY_CLIP
        s_q = joint_error(law.memory.sliding_variable, now.jacobian)
        matrix = (now.regressor[3:] @ theta).T
        values.append(0.5 * s_q @ matrix @ s_q + np.sum((theta - law.memory.parameter_estimate) ** 2) / 4.0)
    kinetic = values[0] - np.sum(theta**2) / 4.0
    assert kinetic < 1e-6 * values[0], "it starts at rest with nothing learnt"
    fall = values[0] - values[-1]
    assert fall > 0
    assert np.diff(values).max() < 0.01 * fall / len(values), "it falls, but for the error of the sampling"


@pytest.mark.parametrize("controller", [Adaptive, Pd, SlidingMode, TdeSlidingMode])
def test_the_filter_moves_by_the_time_that_elapsed(controller: type) -> None:
    start = state(ARM, Q, np.array([0.01, -0.02]), np.array([0.4, 1.0]))._replace(elapsed=13 * PERIOD)
    law, wanted = controller().start(STATES, start), reference(position=start.position + np.array([0.01, 0.0]))
    p, v = start.position.copy(), start.velocity.copy()
    advance_filter(STATES.impedance, 13 * PERIOD, p, v, start, wanted)
    run(law, start, wanted)
    np.testing.assert_array_equal(law.memory.filter_position, p)
    np.testing.assert_array_equal(law.memory.filter_velocity, v)


@pytest.mark.parametrize("elapsed", [PERIOD, 13 * PERIOD])
def test_adaptive_estimate_moves_by_gamma_y_transposed_s(elapsed: float) -> None:
    start = state(ARM, Q, np.array([0.01, -0.02]), np.array([0.4, 1.0]))._replace(elapsed=elapsed)
    law = Adaptive(slope=20.0, gain=100.0, rate=0.7).start(STATES, start)
    wanted = reference(position=start.position + np.array([0.01, 0.0]), force=np.array([0.0, 1.0]))
    torque = run(law, start, wanted)
    p, v = law.memory.filter_position, law.memory.filter_velocity
    a_d = (v - start.velocity) / elapsed
    s = v - start.velocity + 20.0 * (p - start.position)
    inverse = np.linalg.inv(start.jacobian)
    joint_v = inverse @ (v + 20.0 * (p - start.position))
    joint_a = inverse @ (a_d + 20.0 * (v - start.velocity) - start.jacobian_rate @ joint_v)
    y = sum(c * part for c, part in zip([1.0, *joint_v, *joint_a], start.regressor, strict=True))
    estimate = elapsed * 0.7 * y.T @ inverse @ s
    np.testing.assert_allclose(law.memory.sliding_variable, s, rtol=1e-12)
    np.testing.assert_allclose(law.memory.parameter_estimate, estimate, rtol=1e-9)
    np.testing.assert_allclose(torque, y @ estimate + start.jacobian.T @ (start.force + 100.0 * s), rtol=1e-9)


def test_sliding_mode_reaches_its_surface_on_the_nominal_plant() -> None:
    """With the nominal parameters exact, s' M_x s / 2 falls at all times and s comes to rest at zero."""
    seen = swing(SlidingMode(slope=20.0, gain=2.0, boundary=0.05), 1e-4, 6000, horizontal=False)
    theta, energies = ARM.dynamic_parameters(), []
    for now, law in seen:
        s_q = joint_error(law.memory.sliding_variable, now.jacobian)
        energies.append(s_q @ (now.regressor[3:] @ theta).T @ s_q)
    assert max(energies) > 0
    assert energies[-1] < 1e-3 * max(energies)
    assert np.abs(seen[-1][1].memory.tracking_error).max() < 1e-4


@pytest.mark.parametrize(("switching", "expected"), [("sign", (10.0, -4.0)), ("sat", (5.0, -4.0))])
def test_switching_force_is_sign_or_saturation(switching: str, expected: tuple[float, float]) -> None:
    """s = (0.05, -0.2) m/s with phi = 0.1 m/s and K = (10, 4) N."""
    start = state(ARM, Q, np.zeros(2))
    law = SlidingMode(slope=10.0, gain=(10.0, 4.0), boundary=0.1, switching=switching).start(STATES, start)
    law.memory.filter_position[:] += [0.005, -0.02]
    run(law, start, reference(position=law.memory.filter_position.copy()))
    s = law.memory.sliding_variable
    level = np.clip(s / 0.1, -1, 1) if switching == "sat" else np.sign(s)
    np.testing.assert_allclose(law.memory.switching_force, level * [10.0, 4.0], rtol=1e-12)
    np.testing.assert_allclose(law.memory.switching_force, expected, rtol=0.02)


def test_sliding_mode_is_the_model_plus_the_switching_force() -> None:
    start = state(ARM, Q, np.array([0.1, -0.3]), np.array([0.4, 1.0]))
    law = SlidingMode(slope=20.0, nominal_scale=1.3).start(STATES, start)
    wanted = reference(position=start.position + np.array([0.01, 0.0]), force=np.array([0.0, 1.0]))
    torque = run(law, start, wanted)
    p, v = law.memory.filter_position, law.memory.filter_velocity
    a_d, inverse = (v - start.velocity) / PERIOD, np.linalg.inv(start.jacobian)
    joint_v = inverse @ (v + 20.0 * (p - start.position))
    joint_a = inverse @ (a_d + 20.0 * (v - start.velocity) - start.jacobian_rate @ joint_v)
    model = model_torque(start.regressor, joint_v, joint_a, 1.3 * ARM.dynamic_parameters())
    expected = model + start.jacobian.T @ (start.force + law.memory.switching_force)
    np.testing.assert_allclose(torque, expected, rtol=1e-9)


@pytest.mark.parametrize("gravity", ["model", "start"])
def test_pd_holds_the_arm_where_it_is(gravity: str) -> None:
    """Nothing is asked for and nothing touches the arm: the torque is its weight, in both ways of knowing it."""
    plant = begin(TwoLink(ARM, FAR_AWAY), Q)
    weight = plant.holding_command().torque
    start = state(ARM, Q, np.zeros(2), torque=weight)
    law = Pd(gravity=gravity).start(task(ARM), start)
    np.testing.assert_allclose(run(law, start, reference(position=start.position)), weight, rtol=1e-12)


def test_pd_from_the_start_torque_leaves_out_the_contact() -> None:
    """The torque that holds the arm in contact is weight plus J^T F; only the weight is kept."""
    force = np.array([0.0, 2.0])
    weight = ARM.kinematics(Q, np.zeros(2)).regressor[0] @ ARM.dynamic_parameters()
    start = state(ARM, Q, np.zeros(2), force, weight + ARM.kinematics(Q, np.zeros(2)).jacobian.T @ force)
    law = Pd(gravity="start").start(task(ARM), start)
    np.testing.assert_allclose(law.parameters.start_torque, weight, rtol=1e-12)


def test_pd_direct_is_its_formula() -> None:
    now = state(ARM, Q, np.array([0.1, -0.2]), np.array([0.5, 2.0]))
    wanted = reference(
        position=now.position + np.array([0.01, 9.0]), velocity=np.array([0.3, 9.0]), force=np.array([9.0, 3.5])
    )
    law = Pd(stiffness=500.0, damping=40.0, force_gain=2.0, target="direct").start(task(ARM), now)
    run(law, now, wanted)
    along_x = 500.0 * 0.01 + 40.0 * (0.3 - now.velocity[0])
    along_z = 3.5 + 2.0 * (3.5 - 2.0) - 40.0 * now.velocity[1]
    np.testing.assert_allclose(law.memory.task_force, [along_x, along_z], rtol=1e-10)


def test_pd_on_the_filter_is_its_formula() -> None:
    now = state(ARM, Q, np.array([0.1, -0.2]), np.array([0.5, 2.0]))
    law = Pd(stiffness=500.0, damping=40.0).start(task(ARM), now)
    torque = run(law, now, reference(position=now.position + np.array([0.01, 0.0])))
    p, v = law.memory.filter_position, law.memory.filter_velocity
    force = 500.0 * (p - now.position) + 40.0 * (v - now.velocity)
    weight = now.regressor[0, :, :5] @ ARM.dynamic_parameters()[:5]
    np.testing.assert_allclose(torque, weight + now.jacobian.T @ force, rtol=1e-9)
