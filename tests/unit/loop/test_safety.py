from __future__ import annotations

import itertools

import numpy as np
import pytest

from hilrig.core.errors import Tripped
from hilrig.core.signals import Measurement
from hilrig.experiment.trial import Limits
from hilrig.loop.safety import Monitor


def measured(q: tuple[float, float] = (0.0, 0.0), force: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Measurement:
    return Measurement(np.array(q), np.array([*force, 0.0, 0.0, 0.0]), np.zeros(2))


def monitor() -> Monitor:
    return Monitor(Limits(tip_force=50.0, joint_velocity=2.0), 1e-3)


def test_within_the_limits_nothing_happens() -> None:
    watch = monitor()
    watch.check(0, measured((3.0, -3.0), (30.0, 0.0, -39.9)))
    watch.check(1, measured((3.00199, -3.0)))


@pytest.mark.parametrize("force", [*itertools.permutations((30.0, 0.0, -40.01))])
def test_too_much_force_names_limit_value_and_time(force: tuple[float, float, float]) -> None:
    """The norm counts: 30 and 40 N make 50 N."""
    with pytest.raises(Tripped, match=r"tip force 50\.01 N at t = 1\.5 s \(tick 1500\) is over the limit of 50 N"):
        monitor().check(1500, measured(force=force))


@pytest.mark.parametrize("step", [0.0021, -0.0021])
def test_too_fast_a_joint_trips(step: float) -> None:
    watch = monitor()
    watch.check(0, measured())
    with pytest.raises(Tripped, match=r"joint velocity 2\.1 rad/s .* \(tick 1\) is over the limit of 2 rad/s"):
        watch.check(1, measured((0.0, step)))


def test_velocity_is_by_the_trials_period() -> None:
    """0.0039 rad in 2 ms are 1.95 rad/s."""
    watch = Monitor(Limits(joint_velocity=2.0), 2e-3)
    watch.check(0, measured())
    watch.check(1, measured((0.0039, 0.0)))
    with pytest.raises(Tripped, match=r"joint velocity 2\.05 rad/s at t = 0\.004 s \(tick 2\)"):
        watch.check(2, measured((0.008, 0.0)))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("where", ["joint", "force", "moment"])
def test_a_measurement_that_is_not_finite_trips(bad: float, where: str) -> None:
    reading = measured()
    (reading.joint_position if where == "joint" else reading.wrench)[5 if where == "moment" else 0] = bad
    with pytest.raises(Tripped, match="tick 3: the measurement is not finite"):
        monitor().check(3, reading)


def test_infinities_of_both_signs_do_not_cancel() -> None:
    with pytest.raises(Tripped):
        monitor().check(0, measured(force=(np.inf, -np.inf, 0.0)))
