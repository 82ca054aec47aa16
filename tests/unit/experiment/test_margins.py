"""How far an experiment keeps the bounds, and what it is warned of."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.builders import TIME, arm, surface, trial
from helpers.experiments import EXPERIMENTS, parameters
from hilrig_drivers.two_link import TwoLink

from hilrig.core.errors import ExperimentError
from hilrig.core.interfaces import DelayEstimation
from hilrig.experiment import load
from hilrig.experiment.plan import plan
from hilrig.experiment.plan.margins import Check, Margins, margins
from hilrig.experiment.plan.warnings import warnings
from hilrig.experiment.trial import PhaseSpec, Trial
from hilrig.kinds.controllers.pd import Pd
from hilrig.kinds.controllers.tde_sliding_mode import TdeSlidingMode
from hilrig.kinds.delay_bounds import highest_ratio
from hilrig.kinds.disturbances.measurement_delay import MeasurementDelay
from hilrig.kinds.disturbances.surface_motion import SurfaceMotion
from hilrig.kinds.references.hold import Hold
from hilrig.kinds.references.sine import Sine
from hilrig.kinds.robots.planar_2r import Planar2r

QUICKSTART = EXPERIMENTS / "quickstart.yaml"


def estimating(**changes: Any) -> Trial:
    """Return a trial of the proposed law that swings along the rail."""
    phases = (PhaseSpec("swing", 0.0, 2.0, {"x": Sine(0.3, 3.0)}, {"z": Hold(3.5)}),)
    plain = {"controller": TdeSlidingMode(), "phases": phases, "start_position": (0.0, 0.35)}
    return trial(**{**plain, **changes})


def checks(*trials: Trial) -> dict[str, Check]:
    """Return the checks of the one controller with time delay estimation."""
    (found,) = margins(trials).estimators.values()
    assert found.unknown == ()
    return {check.bound: check for check in found.checks}


def tip_inertia(robot: Planar2r, x: float, z: float) -> np.ndarray:
    """Return M_t (2, 2) kg at a place, from the joint torques of unit accelerations."""
    at = robot.kinematics(robot.inverse_kinematics(np.array([x, z])), np.zeros(2))
    mass = np.stack([at.regressor[3 + i] @ robot.dynamic_parameters() for i in range(2)], axis=1)
    inverse = np.linalg.inv(at.jacobian)
    return inverse.T @ mass @ inverse


def test_the_window_is_that_of_the_worst_places_of_the_path() -> None:
    one = estimating()
    eigenvalues = [np.linalg.eigvalsh(tip_inertia(arm(), 0.3 * np.sin(3 * t), 0.35)) for t in np.arange(0, 2, 1e-3)]
    heaviest, lightest = max(e[-1] for e in eigenvalues), min(e[0] for e in eigenvalues)
    found = checks(one)
    assert found["inertia_lower"].limit == pytest.approx(2 * heaviest * 1e-3 * 150 / 30, rel=1e-5)
    assert found["inertia_upper"].limit == pytest.approx(highest_ratio(1, one.velocity_smoothing) * lightest, rel=1e-5)
    assert found["mismatch"].value == pytest.approx(1 - 0.03 / heaviest, rel=1e-5)
    for bound, which, eigenvalue in (("inertia_lower", -1, heaviest), ("inertia_upper", 0, lightest)):
        where = re.fullmatch(r"phase 'swing', t = \S+ s \(x = (\S+) m, z = 0.35 m\)", found[bound].where)
        assert where, found[bound].where
        there = np.linalg.eigvalsh(tip_inertia(arm(), float(where[1]), 0.35))[which]
        assert there == pytest.approx(eigenvalue, rel=5e-3), "the place that is named is the place that decides"
    assert all(found[bound].kept for bound in ("inertia_lower", "inertia_upper", "mismatch", "delay_best"))


@pytest.mark.parametrize(("mhat", "broken"), [(0.01, "inertia_lower"), (0.4, "inertia_upper"), (0.05, None)])
def test_an_estimate_outside_its_window_is_found(mhat: float, broken: str | None) -> None:
    found = checks(estimating(controller=TdeSlidingMode(inertia_estimate=mhat)))
    window = {bound for bound in ("inertia_lower", "inertia_upper") if not found[bound].kept}
    assert window == ({broken} if broken else set())
    if broken:
        assert found[broken].margin < 1


def test_an_estimate_per_axis_is_judged_by_its_factor() -> None:
    """The same factor on both axes must bring it to the edge, whatever the unit."""
    found = checks(estimating(controller=TdeSlidingMode(inertia_estimate=(0.1, 0.05))))
    upper = found["inertia_upper"]
    assert (upper.value, upper.unit) == (1.0, "x Mhat")
    at_edge = TdeSlidingMode(inertia_estimate=(0.1 * upper.limit, 0.05 * upper.limit))
    assert checks(estimating(controller=at_edge))["inertia_upper"].margin == pytest.approx(1.0)


@pytest.mark.parametrize(("delay", "expected"), [(0, 1e-3), (1, 1e-3), (3, 3e-3)])
def test_the_delay_is_the_actuations_and_a_period_at_least(delay: int, expected: float) -> None:
    assert checks(estimating(actuation_delay=delay))["delay_derived"].value == pytest.approx(expected)


def test_a_value_at_its_limit_does_not_keep_it() -> None:
    """The bounds are strict: at the edge the loop neither grows nor decays."""
    for must in ("below", "above"):
        assert not Check("mismatch", 1.0, must, 1.0, "").kept


def test_the_slowest_condition_and_the_widest_path_decide() -> None:
    late = estimating(condition_name="late", disturbances=(MeasurementDelay(ticks=2),))
    moving = estimating(condition_name="moving", disturbances=(SurfaceMotion(amplitude=0.05, frequency=3.0),))
    found = checks(estimating(), late, moving)
    assert found["delay_derived"].value == pytest.approx(3e-3)
    assert found["delay_derived"].where == "condition 'late'"
    assert found["inertia_lower"].where.startswith("condition 'moving', phase 'swing'")
    assert found["inertia_upper"].where.startswith("condition 'late'")


def test_gains_without_a_bound_are_told() -> None:
    @dataclass(frozen=True)
    class Odd(Pd):
        def delay_estimation(self, axes: int) -> DelayEstimation:
            return DelayEstimation(np.full(axes, 0.03), np.full(axes, -150.0), np.full(axes, -30.0))

    (found,) = margins([estimating(controller=Odd())]).estimators.values()
    assert found.checks == ()
    assert "not Hurwitz" in found.unknown[0]


def test_a_robot_without_a_model_is_told() -> None:
    @dataclass(frozen=True)
    class Unknown(Planar2r):
        def dynamic_parameters(self) -> np.ndarray:
            return np.zeros(0)

    robot = Unknown(lengths=(0.345, 0.2), masses=(1.8, 1.1))
    (found,) = margins([estimating(driver=TwoLink(robot, surface()))]).estimators.values()
    assert {check.bound for check in found.checks} == {"delay_printed", "delay_derived", "delay_best"}
    assert "window of Mhat and condition (9) are not known" in found.unknown[0]


def test_a_law_without_delay_estimation_has_free_flight_alone() -> None:
    found = margins([estimating(controller=Pd())])
    assert found.estimators == {}
    (flight,) = found.flights
    assert (flight.axis, flight.speed, flight.time_constant) == ("z", pytest.approx(3.5 / 60), pytest.approx(0.1))
    rates = [
        np.abs(np.linalg.inv(arm().kinematics(arm().inverse_kinematics(np.array([x, 0.35])), np.zeros(2)).jacobian))
        for x in 0.3 * np.sin(3 * TIME[:2000])
    ]
    assert flight.joints.value == pytest.approx(max(rate[:, 1].max() for rate in rates) * 3.5 / 60, rel=1e-5)
    assert flight.joints.kept


def test_the_largest_force_of_all_phases_counts() -> None:
    first, last = estimating().phases[0], PhaseSpec("push", 2.0, 2.5, {"x": Hold(0.0)}, {"z": Hold(-9.0)})
    (flight,) = margins([estimating(phases=(first, last))]).flights
    assert (flight.phase, flight.force, flight.speed) == ("push", 9.0, pytest.approx(0.15))


def test_without_damping_nothing_bounds_the_speed() -> None:
    spec = replace(estimating().task, damping=(30.0, 0.0))
    (flight,) = margins([estimating(task=spec)]).flights
    assert flight.speed == np.inf
    assert not flight.joints.kept


def test_margins_are_plain_data() -> None:
    document = json.loads(json.dumps(margins([estimating()]).document()))
    (estimator,) = document["estimators"].values()
    assert [check["bound"] for check in estimator["checks"]][:3] == ["delay_printed", "delay_derived", "delay_best"]
    assert [check["kept"] for check in estimator["checks"]][:3] == [False, False, True]
    assert document["flights"][0]["joints"]["kept"] is True


def warned(*overrides: str) -> list[str]:
    experiment = load(QUICKSTART, overrides)
    return [str(problem) for problem in warnings(experiment, margins(plan(experiment)))]


@pytest.mark.parametrize("path", parameters(EXPERIMENTS.glob("*.yaml")))
def test_the_projects_own_experiments_only_hear_of_the_papers_kappa(path: Path) -> None:
    experiment = load(path)
    found = margins(plan(experiment))
    told = warnings(experiment, found)
    assert len(told) == len(found.estimators)
    for problem in told:
        assert problem.place is not None
        assert "proposed:" in path.read_text().splitlines()[problem.place.line - 1]
        assert "1 ms is over the 0.75 ms of the delay bound (24)" in problem.message
        assert "with kappa = 0.0178 the bound is 2.82 ms, and it is kept" in problem.message


@pytest.mark.parametrize(
    ("override", "count", "words"),
    [
        ("period=0.5 ms", 0, ""),
        ("actuation_delay=3", 1, "3 ms is over the delay bound (24): 2.82 ms with the best kappa, 0.0178, and 0.75 ms"),
        ("controllers.proposed.inertia_estimate=0.01", 2, "Mhat = 0.01 kg is below 0.0177 kg, the lower edge"),
        ("controllers.proposed.inertia_estimate=0.3", 2, "Mhat = 0.3 kg is above 0.27 kg, the upper edge"),
        ("controllers.proposed.inertia_estimate=[0.3, 0.02]", 2, "condition (9) is not kept: |M_t^-1 Mhat - I| is 1.0"),
        ("controllers.proposed.inertia_estimate=[0.005, 0.01]", 2, "Mhat is too small, by a factor of "),
        ("controllers.proposed.position_gain=1500", 2, "the lower edge"),
        ("task.impedance.damping=[30, 0]", 2, "the damping B_d along z is 0"),
        ("task.impedance.damping=[30, 0.5]", 2, "may reach F_d/B_d = 7 m/s along z (F_d = 3.5 N, phase 'up_and_down')"),
        ("safety={joint_velocity: 0.2 rad/s}", 2, "turn at 0.307 rad/s, over the safety limit of 0.2 rad/s, at phase"),
    ],
)
def test_a_warning_names_value_limit_and_place(override: str, count: int, words: str) -> None:
    told = warned(override)
    assert len(told) == count, told
    assert words == "" or any(words in line for line in told), told


@pytest.mark.parametrize(
    ("returned", "words"),
    [
        ("(1.0, 2.0)", "it must return a DelayEstimation"),
        ("DelayEstimation(np.ones(3), np.ones(2), np.ones(2))", "delay_estimation: inertia_estimate: 3 values"),
        ("DelayEstimation(-np.ones(2), np.ones(2), np.ones(2))", "it must be above 0 kg"),
    ],
)
def test_what_a_users_law_says_wrong_is_an_error_with_its_place(tmp_path: Path, returned: str, words: str) -> None:
    source = (EXPERIMENTS / "my_controller.py").read_text()
    source = source.replace(
        "import numpy as np\n", "import numpy as np\nfrom hilrig.core.interfaces import DelayEstimation\n"
    )
    (tmp_path / "my_controller.py").write_text(
        f"{source}\n    def delay_estimation(self, axes):\n        return {returned}\n"
    )
    (tmp_path / "mine.yaml").write_text((EXPERIMENTS / "my_controller.yaml").read_text())
    with pytest.raises(ExperimentError, match=r"mine\.yaml:29") as caught:
        plan(load(tmp_path / "mine.yaml"))
    assert words in str(caught.value)


def test_a_users_law_gets_the_same_checks(tmp_path: Path) -> None:
    source = (EXPERIMENTS / "my_controller.py").read_text()
    source = source.replace(
        "import numpy as np\n", "import numpy as np\nfrom hilrig.core.interfaces import DelayEstimation\n"
    )
    numbers = "DelayEstimation(np.full(axes, 0.5), np.full(axes, 150.0), np.full(axes, 30.0))"
    (tmp_path / "my_controller.py").write_text(
        f"{source}\n    def delay_estimation(self, axes):\n        return {numbers}\n"
    )
    (tmp_path / "mine.yaml").write_text((EXPERIMENTS / "my_controller.yaml").read_text())
    found: Margins = margins(plan(load(tmp_path / "mine.yaml")))
    broken = {check.bound for check in found.estimators["mine"].checks if not check.kept}
    assert broken == {"delay_printed", "delay_derived", "inertia_upper"}


def test_what_several_controllers_hear_is_said_once() -> None:
    experiment = load(EXPERIMENTS / "paper" / "errata.yaml")
    (message,) = [str(problem) for problem in warnings(experiment, margins(plan(experiment)))]
    line = next(i for i, text in enumerate((EXPERIMENTS / "paper" / "errata.yaml").read_text().splitlines(), 1)
                if text.startswith("  as_read:"))  # fmt: skip
    assert f"errata.yaml:{line}:" in message
    assert "controllers 'as_read', 'no_preload', 'printed_lyapunov'" in message
    assert message.count("over the 0.75 ms") == 1
