"""What theory says of the proposed law and of the task, on a path that is planned."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from helpers.bounds import BEST, DERIVED, LOWER, MISMATCH, PRINTED, UPPER, estimating, tip_inertia
from helpers.builders import TIME, arm, surface
from hilrig_drivers.two_link import TwoLink

from hilrig.core.assessment import Assessment, Bound
from hilrig.experiment.plan.assessing import setting_of
from hilrig.experiment.plan.free_flight import assess_free_flight, free_flight
from hilrig.experiment.plan.path import mobility
from hilrig.experiment.trial import PhaseSpec, Trial
from hilrig.kinds.controllers._delay_estimation import assess_delay_estimation
from hilrig.kinds.controllers._inertia_window import highest_ratio
from hilrig.kinds.controllers.tde_sliding_mode import TdeSlidingMode
from hilrig.kinds.disturbances.measurement_delay import MeasurementDelay
from hilrig.kinds.disturbances.surface_motion import SurfaceMotion
from hilrig.kinds.references.hold import Hold
from hilrig.kinds.robots.planar_2r import Planar2r


def assessed(*trials: Trial) -> Assessment:
    """Return what the trials' controller says of itself."""
    controller: Any = trials[0].controller
    return controller.assess(setting_of(trials))


def bounds(*trials: Trial) -> dict[str, Bound]:
    """Return the bounds of the trials' controller, which can judge them all."""
    found = assessed(*trials)
    assert found.unknown == ()
    return {bound.name: bound for bound in found.bounds}


def flight(*trials: Trial) -> Bound:
    """Return the bound of the one force-controlled axis."""
    (bound,) = assess_free_flight(trials[0], setting_of(trials)).bounds
    return bound


def test_the_window_is_that_of_the_worst_places_of_the_path() -> None:
    one = estimating()
    eigenvalues = [np.linalg.eigvalsh(tip_inertia(arm(), 0.3 * np.sin(3 * t), 0.35)) for t in np.arange(0, 2, 1e-3)]
    heaviest, lightest = max(e[-1] for e in eigenvalues), min(e[0] for e in eigenvalues)
    found = bounds(one)
    assert found[LOWER].limit == pytest.approx(2 * heaviest * 1e-3 * 150 / 30, rel=1e-5)
    assert found[UPPER].limit == pytest.approx(highest_ratio(1, one.velocity_smoothing) * lightest, rel=1e-5)
    assert found[MISMATCH].value == pytest.approx(1 - 0.03 / heaviest, rel=1e-5)
    for name, which, eigenvalue in ((LOWER, -1, heaviest), (UPPER, 0, lightest)):
        where = re.fullmatch(r"phase 'swing', t = \S+ s \(x = (\S+) m, z = 0.35 m\)", found[name].where)
        assert where, found[name].where
        there = np.linalg.eigvalsh(tip_inertia(arm(), float(where[1]), 0.35))[which]
        assert there == pytest.approx(eigenvalue, rel=5e-3), "the place that is named is the place that decides"
    assert all(found[name].kept for name in (LOWER, UPPER, MISMATCH, BEST))


@pytest.mark.parametrize(("mhat", "broken"), [(0.01, LOWER), (0.4, UPPER), (0.05, None)])
def test_an_estimate_outside_its_window_is_found(mhat: float, broken: str | None) -> None:
    found = bounds(estimating(controller=TdeSlidingMode(inertia_estimate=mhat)))
    window = {name for name in (LOWER, UPPER) if not found[name].kept}
    assert window == ({broken} if broken else set())
    if broken:
        assert found[broken].margin < 1


def test_an_estimate_per_axis_is_judged_by_its_factor() -> None:
    """The same factor on both axes must bring it to the edge, whatever the unit."""
    upper = bounds(estimating(controller=TdeSlidingMode(inertia_estimate=(0.1, 0.05))))[UPPER]
    assert (upper.value, upper.unit) == (1.0, "x Mhat")
    at_edge = TdeSlidingMode(inertia_estimate=(0.1 * upper.limit, 0.05 * upper.limit))
    assert bounds(estimating(controller=at_edge))[UPPER].margin == pytest.approx(1.0)


@pytest.mark.parametrize(("delay", "expected"), [(0, 1e-3), (1, 1e-3), (3, 3e-3)])
def test_the_delay_is_the_actuations_and_a_period_at_least(delay: int, expected: float) -> None:
    found = bounds(estimating(actuation_delay=delay))
    assert [found[name].value for name in (PRINTED, DERIVED, BEST)] == pytest.approx([expected] * 3)


def test_the_slowest_condition_and_the_widest_path_decide() -> None:
    late = estimating(condition_name="late", disturbances=(MeasurementDelay(ticks=2),))
    moving = estimating(condition_name="moving", disturbances=(SurfaceMotion(amplitude=0.05, frequency=3.0),))
    found = bounds(estimating(), late, moving)
    assert found[BEST].value == pytest.approx(3e-3)
    assert found[BEST].where == "condition 'late'"
    assert found[LOWER].where.startswith("condition 'moving', phase 'swing'")
    assert found[UPPER].where.startswith("condition 'late'")


def test_gains_without_a_bound_are_told() -> None:
    found = assess_delay_estimation(setting_of([estimating()]), 0.03, -150.0, -30.0)
    assert found.bounds == ()
    assert "not Hurwitz" in found.unknown[0]


def test_a_robot_without_a_model_is_told() -> None:
    @dataclass(frozen=True)
    class Unknown(Planar2r):
        def dynamic_parameters(self) -> np.ndarray:
            return np.zeros(0)

    robot = Unknown(lengths=(0.345, 0.2), masses=(1.8, 1.1))
    found = assessed(estimating(driver=TwoLink(robot, surface())))
    assert {bound.name for bound in found.bounds} == {PRINTED, DERIVED, BEST}
    assert "window of Mhat and condition (9) are not known" in found.unknown[0]


def test_mobility_is_the_inverse_of_the_tips_inertia() -> None:
    """Two rods written out: M from the energies of the links; M_t = J^-T M J^-1."""
    q1, q2, (l1, l2), (m1, m2) = 0.4, 1.3, (0.345, 0.2), (1.8, 1.1)
    at = arm().kinematics(np.array([q1, q2]), np.zeros(2))
    centre_1 = l1 / 2 * np.array([[-np.sin(q1), 0], [np.cos(q1), 0]])
    elbow, forearm = 2 * centre_1, l2 / 2 * np.array([[-np.sin(q1 + q2)], [np.cos(q1 + q2)]])
    turn_1, turn_2 = np.array([[1.0, 0.0]]), np.array([[1.0, 1.0]])
    mass = m1 * centre_1.T @ centre_1 + m1 * l1**2 / 12 * turn_1.T @ turn_1
    mass += m2 * (elbow + forearm @ turn_2).T @ (elbow + forearm @ turn_2) + m2 * l2**2 / 12 * turn_2.T @ turn_2
    inverse = np.linalg.inv(at.jacobian)
    found = mobility(at, arm().dynamic_parameters())
    np.testing.assert_allclose(np.linalg.inv(found), inverse.T @ mass @ inverse, rtol=1e-10)


def test_free_flight_approaches_its_speed() -> None:
    """M_d x'' + B_d x' = F_d integrated: 63.2 % of the speed after one time constant."""
    free = free_flight(-3.5, 6.0, 60.0)
    assert free == pytest.approx((3.5 / 60, 0.1))
    speed, step = 0.0, 1e-5
    for _ in range(round(free.time_constant / step)):
        speed += step * (3.5 - 60.0 * speed) / 6.0
    assert speed == pytest.approx((1 - np.exp(-1)) * free.speed, rel=1e-3)
    assert free_flight(3.5, 6.0, 0.0) == (np.inf, np.inf)
    assert free_flight(0.0, 6.0, 0.0) == (0.0, np.inf)


def test_the_task_has_a_bound_whatever_the_controller() -> None:
    found = flight(estimating())
    assert found.name == "joint speed in free flight along z"
    rates = [
        np.abs(np.linalg.inv(arm().kinematics(arm().inverse_kinematics(np.array([x, 0.35])), np.zeros(2)).jacobian))
        for x in 0.3 * np.sin(3 * TIME[:2000])
    ]
    assert found.value == pytest.approx(max(rate[:, 1].max() for rate in rates) * 3.5 / 60, rel=1e-5)
    assert found.basis == "F_d = 3.5 N in phase 'swing', F_d/B_d = 0.0583 m/s, M_d/B_d = 0.1 s"
    assert found.kept


def test_the_largest_force_of_all_phases_counts() -> None:
    first, last = estimating().phases[0], PhaseSpec("push", 2.0, 2.5, {"x": Hold(0.0)}, {"z": Hold(-9.0)})
    found = flight(estimating(phases=(first, last)))
    assert "F_d = 9 N in phase 'push', F_d/B_d = 0.15 m/s" in found.basis


def test_without_damping_nothing_bounds_the_speed() -> None:
    found = flight(estimating(task=replace(estimating().task, damping=(30.0, 0.0))))
    assert found.value == np.inf
    assert not found.kept
    assert found.warning == "the damping B_d along z is 0: without contact nothing bounds the speed of the tip"
