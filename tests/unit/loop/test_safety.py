from __future__ import annotations

import itertools

import numpy as np
import pytest
from helpers.builders import PERIOD, arm, surface, trial
from helpers.in_memory import Nodes
from hilrig_drivers.two_link import TwoLink

from hilrig.core.errors import Tripped
from hilrig.core.signals import Array, Measurement
from hilrig.experiment.trial import Limits
from hilrig.loop.safety import why_unsafe

STILL = np.zeros(2)


def measured(q: tuple[float, float] = (0.0, 0.0), force: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Measurement:
    return Measurement(np.array(q), np.array([*force, 0.0, 0.0, 0.0]), np.zeros(2))


def judged(tick: int, measurement: Measurement, last: Array = STILL, period: float = 1e-3) -> str:
    return why_unsafe(tick, measurement, last, period, Limits(tip_force=50.0, joint_velocity=2.0))


def test_within_the_limits_nothing_happens() -> None:
    assert judged(1, measured((3.00199, -3.0), (30.0, 0.0, -39.9)), np.array([3.0, -3.0])) == ""


def test_a_value_at_its_limit_is_within_it() -> None:
    """30 and 40 N make 50 N, and half a radian in a quarter of a second 2 rad/s, exactly."""
    assert judged(1, measured(force=(30.0, 0.0, -40.0))) == ""
    assert judged(1, measured((0.5, 0.0)), period=0.25) == ""


@pytest.mark.parametrize("force", [*itertools.permutations((30.0, 0.0, -40.01))])
def test_too_much_force_names_limit_value_and_time(force: tuple[float, float, float]) -> None:
    """The norm counts: 30 and 40 N make 50 N."""
    assert judged(1500, measured(force=force)) == "tip force 50.01 N at t = 1.5 s (tick 1500) is over the limit of 50 N"


@pytest.mark.parametrize("step", [0.0021, -0.0021])
def test_too_fast_a_joint_trips(step: float) -> None:
    reason = judged(1, measured((0.0, step)))
    assert reason == "joint velocity 2.1 rad/s at t = 0.001 s (tick 1) is over the limit of 2 rad/s"


def test_velocity_is_by_the_trials_period() -> None:
    """0.0039 rad in 2 ms are 1.95 rad/s."""
    assert judged(1, measured((0.0039, 0.0)), period=2e-3) == ""
    reason = judged(2, measured((0.008, 0.0)), np.array([0.0039, 0.0]), 2e-3)
    assert reason.startswith("joint velocity 2.05 rad/s at t = 0.004 s (tick 2)")


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", ["joint", "force", "moment"])
def test_a_measurement_that_is_not_finite_trips(bad: float, where: str) -> None:
    reading = measured()
    (reading.joint_position if where == "joint" else reading.wrench)[5 if where == "moment" else 0] = bad
    assert "tick 3: the measurement is not finite" in judged(3, reading)


def test_a_joint_that_comes_back_from_no_number_trips() -> None:
    assert "not finite" in judged(3, measured(), np.array([0.0, np.nan]))


def test_infinities_of_both_signs_do_not_cancel() -> None:
    assert "not finite" in judged(0, measured(force=(np.inf, -np.inf, 0.0)))


def first_ticks(limits: Limits) -> list[dict[str, Array]]:
    """Return the truth of two ticks of an arm that starts 10 mm deep in a surface without friction, and is pushed."""
    pressed = trial(TwoLink(arm(), surface(friction=0.0)), start_position=(0.1, 0.36), limits=limits)
    nodes, seen = Nodes(pressed), []
    for tick in range(2):
        seen.append(nodes.measured(tick)[1])
        nodes.heard_command.acting.torque[:] = 5.0, 1.0
        nodes.driver.advance()
    return seen


def test_a_trial_at_its_limits_goes_on_and_a_little_below_them_it_trips() -> None:
    """Force and velocity of its first two ticks, as the limits of the same trial."""
    free = first_ticks(Limits(tip_force=1e3, joint_velocity=1e3))
    force = max(abs(now["wrench"][2]) for now in free)
    velocity = np.abs(free[1]["joint_position"] - free[0]["joint_position"]).max() / PERIOD
    assert force > 1.0
    assert velocity > 0.01
    assert len(first_ticks(Limits(force, velocity))) == 2
    with pytest.raises(Tripped, match="tip force"):
        first_ticks(Limits(np.nextafter(force, 0.0), velocity))
    with pytest.raises(Tripped, match="joint velocity"):
        first_ticks(Limits(force, np.nextafter(velocity, 0.0)))
