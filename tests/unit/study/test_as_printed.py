"""The kinds of the paper's study that take the paper at its word."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from helpers import rods
from helpers.builders import FAR_AWAY, PERIOD, STILL, arm, begin, state, task, torque_command, true_state
from helpers.paper import PAPER, DriverAsPrinted, LawAsPrinted, RobotAsPrinted
from helpers.tde_again import OTHER_NUMBERS, adapting, compared
from hilrig_drivers.two_link import TwoLink
from hypothesis import given
from hypothesis import strategies as st

from hilrig.core.signals import Array, Kinematics, Reference
from hilrig.kinds.controllers.tde_sliding_mode import TdeSlidingMode
from hilrig.kinds.robots.planar_2r import Planar2r
from hilrig.report.internals import memory_documents, unit_of

ARM = arm()
Q = np.array([0.4, 1.3])
MISPRINTS = {
    "estimator": "desired", "lyapunov": "transposed", "feedback": "positive", "switching": "printed",
    "adaptation": "printed",
}  # fmt: skip
angles, rates = st.floats(-3.1, 3.1), st.floats(-5.0, 5.0)
pairs = st.tuples(angles, angles).map(np.array)
rate_pairs = st.tuples(rates, rates).map(np.array)


def printed(*misprints: str, **numbers: Any) -> TdeSlidingMode:
    return LawAsPrinted(**{name: MISPRINTS[name] for name in misprints}, **numbers)


adapt_as_printed = sys.modules[LawAsPrinted.__module__].adapt_as_printed


def test_transposed_p_is_the_printed_one() -> None:
    """A P + P A^T = -I gives the paper's P_o = [[.1168, -.5], [-.5, 2.5167]]."""
    a = np.array([[0.0, 1.0], [-150.0, -30.0]])
    p = scipy.linalg.solve_continuous_lyapunov(a, -np.eye(2))
    np.testing.assert_allclose(p, [[0.1168, -0.5], [-0.5, 2.5167]], atol=5e-5)
    np.testing.assert_allclose(printed("lyapunov").surface_gains(), p[1], rtol=1e-10)


def test_sliding_dynamics_run_away_with_the_printed_p() -> None:
    """xi = p12 e + p22 e' = 0 is e' = -(p12/p22) e: as fast as with the solved P, and away from zero."""
    p12, p22 = printed("lyapunov").surface_gains()
    assert -p12 / p22 == pytest.approx(30.0 / 151.0)


@pytest.mark.parametrize(
    ("alphas_before", "outward", "step_1"),
    [
        ((0.005, 0.5, 0.5), False, +2.0),  # at its floor it rises
        ((0.006, 1.0, 1.0), True, +2.0),
        ((0.006, 0.5, 0.5), False, -0.5),
        ((0.006, 1.0, 0.5), False, 0.0),
        ((0.006, 0.5, 1.0), False, 0.0),
        ((0.006, 0.5, 0.5), True, 0.0),
    ],
)
def test_every_case_of_alpha_1(alphas_before: tuple[float, float, float], outward: bool, step_1: float) -> None:
    """alpha_1' = k_1 |xi|, -k_2 |xi| or 0, with k_1 = 2, k_2 = 0.5 and |xi| = 0.3."""
    controller = printed("adaptation", growth=2.0, decay=0.5, gains_start=alphas_before)
    law = controller.start(task(ARM), state(ARM, Q, np.zeros(2)))
    adapt_as_printed(law.parameters, law.memory, PERIOD, 0.3, outward)
    assert law.memory.alpha_1[0] == pytest.approx(alphas_before[0] + PERIOD * step_1 * 0.3, rel=1e-12)


def test_printed_adaptation_holds_alpha_1_where_no_case_applies() -> None:
    """xi stands still (not outward) while alpha_2, alpha_3 are above their floors: neither printed case applies.

    With |xi| = 0.28, alpha_3 reaches its floor at .375/0.28 = 1.33 s; then the second case applies.
    """
    controller = printed("adaptation", gains_start=(0.1, 1.0, 1.0))
    t, alpha_1, alpha_2, alpha_3 = adapting(controller, lambda t: np.full(2, 0.2), 2.0, adapt_as_printed).T
    uncovered = (t > 0.0015) & ((alpha_2 > 0.5) | (alpha_3 > 0.5)) & (t < 0.3)
    assert np.ptp(alpha_1[uncovered]) == 0.0
    covered = (t > 1.35) & (t < 1.49)
    np.testing.assert_allclose(np.diff(alpha_1[covered]) / PERIOD, -0.2 * np.sqrt(2), rtol=1e-9)


@pytest.mark.parametrize("numbers", [{}, OTHER_NUMBERS], ids=["default", "other numbers"])
@pytest.mark.parametrize("misprints", [*([name] for name in MISPRINTS), list(MISPRINTS)], ids="+".join)
def test_step_is_the_law_written_again(misprints: list[str], numbers: dict[str, Any]) -> None:
    controller = printed(*misprints, growth=2.0, decay=0.5, preload=False, **numbers)
    memory, largest = compared(controller, misprints)
    assert memory.alpha_2[0] == controller.gains_floor[1], "the walk passed through the adaptation"
    if "lyapunov" in misprints:
        assert memory.alpha_3[0] == controller.gains_floor[2], (
            "with the large printed p22, through that of alpha_3, too"
        )
        assert largest > controller.boundary, "and out of the boundary layer"


def test_each_misprint_shows_in_the_walk() -> None:
    """Each changes the torque of some step, and without any the law is `tde_sliding_mode`."""
    steps = {}
    for name in ("", *MISPRINTS):
        steps[name] = torques(printed(*([name] if name else []), boundary=1e-4))
    assert len(set(steps.values())) == len(steps)
    assert steps[""] == torques(TdeSlidingMode(boundary=1e-4))


def test_what_it_remembers_has_its_captions_in_the_report() -> None:
    documents = memory_documents(str(PAPER / "law_as_printed.py"))
    assert documents == memory_documents("tde_sliding_mode")
    assert unit_of(documents["estimate"]) == "N"


def torques(controller: TdeSlidingMode) -> bytes:
    """Return the torques of a few steps, all bits."""
    law = controller.start(task(ARM), state(ARM, Q, np.zeros(2), torque=np.array([1.0, 2.0])))
    found = []
    for rate in ([0.1, 0.1], [0.2, 0.1], [0.1, 0.0], [0.05, 0.0]):
        now = state(ARM, Q, np.array(rate), torque=np.array([1.0, 2.0]))
        wanted = Reference(now.position + 0.1, np.zeros(2), np.zeros(2), np.ones(2))
        found.append(law.step(law.parameters, law.memory, now, wanted))
    return np.array(found).tobytes()


def robot_as_printed(**changes: Any) -> Planar2r:
    return RobotAsPrinted(**{**vars(ARM), **changes})


def curl(robot: Planar2r, q: Array) -> Array:
    """Return dJ_i1/dq2 - dJ_i2/dq1 of each row i of the Jacobian, (2,): zero for the derivative of a position."""
    h = 1e-6

    def jacobian(step: Array) -> Array:
        return robot.kinematics(q + step, np.zeros(2)).jacobian

    first, second = ((jacobian(h * e) - jacobian(-h * e)) / (2 * h) for e in np.eye(2))
    return second[:, 0] - first[:, 1]


@given(q=pairs)
def test_the_printed_jacobian_is_the_derivative_of_no_position(q: Array) -> None:
    """[[s1 + s12, s12], [c12, c12 + c1]]: d c12/dq2 - d(c12 + c1)/dq1 = s1. Row 1 is that of -x, for 1 m links."""
    unit, misprinted = arm(lengths=(1.0, 1.0)), robot_as_printed(lengths=(1.0, 1.0))
    np.testing.assert_allclose(curl(unit, q), 0.0, atol=1e-8)
    np.testing.assert_allclose(curl(misprinted, q), [0.0, np.sin(q[0])], atol=1e-8)
    s1, s12, c1, c12 = np.sin(q[0]), np.sin(q[0] + q[1]), np.cos(q[0]), np.cos(q[0] + q[1])
    told, still = misprinted.kinematics(q, np.zeros(2)).jacobian, unit.kinematics(q, np.zeros(2)).jacobian
    np.testing.assert_allclose(told, [[s1 + s12, s12], [c12, c12 + c1]], atol=1e-14)
    np.testing.assert_allclose(told, [-still[0], still[1, ::-1]], atol=1e-14)


@given(q=pairs, rate=rate_pairs)
def test_the_printed_jacobians_rate_is_its_derivative(q: Array, rate: Array) -> None:
    misprinted, h = robot_as_printed(), 1e-6
    at = misprinted.kinematics(q, rate)
    before, after = misprinted.kinematics(q - h * rate, rate), misprinted.kinematics(q + h * rate, rate)
    np.testing.assert_allclose(at.jacobian_rate, (after.jacobian - before.jacobian) / (2 * h), atol=1e-7)
    np.testing.assert_allclose(at.velocity, at.jacobian @ rate, atol=1e-12)


def test_compiled_and_plain_trials_are_told_the_same() -> None:
    misprinted, rate = robot_as_printed(), np.array([0.3, -0.7])
    plain, kernels = misprinted.kinematics(Q, rate), misprinted.kernels()
    filled = Kinematics(*(np.zeros_like(part) for part in plain))
    kernels.kinematics(kernels.constants, Q, rate, filled)
    for got, wanted in zip(filled, plain, strict=True):
        np.testing.assert_array_equal(got, wanted)


def spun(kind: type[TwoLink]) -> Array:
    """Return the energy, J, of the arm in free space, without gravity or friction, spun up and then left to itself."""
    weightless = arm(gravity=(0.0, 0.0))
    plant = begin(kind(weightless, FAR_AWAY), (0.2, 1.0), 1e-3)
    for _ in range(100):
        plant.advance(torque_command((3.0, 0.0)), STILL)
    energies = []
    for _ in range(1000):
        now = true_state(plant)
        energies.append(rods.energy(weightless, now.joint_position, now.joint_velocity))
        plant.advance(torque_command((0.0, 0.0)), STILL)
    return np.array(energies)


def test_the_printed_coriolis_matrix_makes_energy_from_nothing() -> None:
    """q'^T (M' - 2C) q' = 0 keeps the energy; with the printed second row of C, [0, h q2'], it is not zero."""
    kept, made = spun(TwoLink), spun(DriverAsPrinted)
    assert kept[0] > 0.1, "it does spin"
    np.testing.assert_allclose(kept, kept[0], rtol=1e-7)
    assert made.max() > 5.0 * made[0]
    assert made.min() < 0.5 * made[0], "and it loses some to nothing"


def test_the_printed_coriolis_matrix_adds_the_power_that_it_leaves_out() -> None:
    """dE/dt = q'^T (C - C_printed) q' = h q2' (q1'^2 - q2'^2) with h = m2 c2 l1 sin q2."""
    dt = 1e-4
    robot = arm(gravity=(0.0, 0.0), lengths=(1.0, 1.0), masses=(1.0, 2.0), centers_of_mass=(1.0, 1.0), inertias=(0, 0))
    plant = begin(DriverAsPrinted(robot, FAR_AWAY, substep=dt), Q, dt)
    for _ in range(5000):
        plant.advance(torque_command((9.0, -6.0)), STILL)
    seen = [true_state(plant)]
    for _ in range(2):
        plant.advance(torque_command((0.0, 0.0)), STILL)
        seen.append(true_state(plant))
    before, after = (rods.energy(robot, now.joint_position, now.joint_velocity) for now in (seen[0], seen[2]))
    rate1, rate2 = seen[1].joint_velocity
    power = 2.0 * np.sin(seen[1].joint_position[1]) * rate2 * (rate1**2 - rate2**2)
    assert abs(power) > 1.0
    assert (after - before) / (2 * dt) == pytest.approx(power, rel=1e-4)
