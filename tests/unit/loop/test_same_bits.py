"""The nodes of the loop against what a tick means, told plainly: the same messages, byte for byte."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from helpers.builders import arm, surface, trial
from helpers.in_memory import memory_of, pass_messages
from helpers.laws import EVERYTHING, SERVO, Compiled, Numpy
from helpers.plain_loop import Passed, run_plainly
from hilrig_drivers.pybullet_arm import PybulletArm
from hilrig_drivers.two_link import TwoLink

from hilrig.core import compiler as kernels
from hilrig.core.errors import PluginError
from hilrig.experiment.trial import Limits, PhaseSpec, Trial
from hilrig.kinds.controllers.adaptive import Adaptive
from hilrig.kinds.controllers.pd import Pd
from hilrig.kinds.controllers.sliding_mode import SlidingMode
from hilrig.kinds.controllers.tde_sliding_mode import TdeSlidingMode
from hilrig.kinds.disturbances.sensor_noise import SensorNoise
from hilrig.kinds.references.hold import Hold
from hilrig.kinds.references.sine import Sine
from hilrig.rig.warm_up import warm_up_controller, warm_up_driver

LAWS = [TdeSlidingMode(), Pd(), Adaptive(), SlidingMode(), Numpy()]
GAPS = frozenset({1, 2, 17, 40, 41, 42, 43, 120, 199})
"""Ticks that the controller misses"""
FREE = Limits(joint_margin=None)
"""The law in NumPy may turn the joints as far as it likes"""


def compared(subject: Trial, missed: frozenset[int] = frozenset(), rows: int = 7) -> Passed:
    """Run a trial both ways, assert that the messages are the same, and return them."""
    sizes = memory_of(subject)
    expected, found = run_plainly(subject, sizes, missed), pass_messages(subject, missed, rows, sizes)
    for channel in ("state", "truth", "command", "internals"):
        assert getattr(found, channel) == getattr(expected, channel), channel
    assert found.reason == expected.reason
    return found


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("delay", [0, 1, 3])
def test_every_law_gives_the_same_messages(law: Any, delay: int) -> None:
    assert len(compared(trial(controller=law, actuation_delay=delay)).command) > 20


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("delay", [1, 3])
def test_a_controller_that_misses_ticks_answers_alike(law: Any, delay: int) -> None:
    """Its velocity filter and its law hear of the time that passed; the plant goes on under the last command."""
    found = compared(trial(controller=law, actuation_delay=delay), GAPS)
    assert len(found.state) - len(found.command) == sum(tick < len(found.state) for tick in GAPS)


def test_a_controller_that_misses_the_first_ticks_answers_alike() -> None:
    compared(trial(controller=Pd()), frozenset({0, 1, 2}))


@pytest.mark.parametrize("missed", [frozenset(), GAPS])
@pytest.mark.parametrize("law", [Numpy(), TdeSlidingMode()])
def test_the_same_messages_under_every_disturbance(law: Any, missed: frozenset[int]) -> None:
    driver = TwoLink(arm(), surface(), SERVO, (0.1, 0.05), (0.02, 0.01))
    swing = PhaseSpec("swing", 0.0, 0.2, {"x": Sine(0.1, 3.0)}, {"z": Hold(3.5)})
    compared(trial(driver, law, disturbances=EVERYTHING, phases=(swing,)), missed)


@pytest.mark.parametrize("rows", [2, 200, 1000])
def test_the_batches_may_have_any_number_of_rows(rows: int) -> None:
    assert len(compared(trial(controller=Pd()), rows=rows).command) == 200


@pytest.mark.needs_pybullet
@pytest.mark.parametrize("law", [Pd(), Numpy()])
def test_with_a_physics_engine_one_node_is_compiled(law: Any) -> None:
    assert len(compared(trial(PybulletArm(arm(), surface()), law, limits=FREE)).command) == 200


@pytest.mark.parametrize("limits", [Limits(tip_force=1.0), Limits(joint_velocity=0.02)])
def test_it_trips_at_the_same_tick_for_the_same_reason(limits: Limits) -> None:
    found = compared(trial(controller=Pd(), limits=limits, start_position=(0.1, 0.345)))
    assert 1 < len(found.state) == len(found.command) < 200
    assert "is over the limit of" in found.reason


def test_it_trips_in_the_first_tick_alike() -> None:
    found = compared(trial(controller=Pd(), limits=Limits(tip_force=1.0), start_position=(0.1, 0.36)))
    assert (found.state, found.command) == ([], [])
    assert found.reason == "tip force 8 N at t = 0 s (tick 0) is over the limit of 1 N"


def test_a_torque_that_is_not_finite_ends_it_alike() -> None:
    """In plain Python and compiled: the state is there, its command is not."""
    found = compared(trial(controller=Numpy("nan")))
    assert found.reason == "tick 59: the torque of controller 'mine' is not finite: [nan nan]"
    assert (len(found.state), len(found.command)) == (60, 59)
    found = compared(trial(controller=Compiled("nan")))
    assert found.reason == "tick 59: the torque of controller 'mine' is not finite: [nan nan]"
    assert (len(found.state), len(found.command)) == (60, 59)


def test_a_plant_that_leaves_the_numbers_trips_alike() -> None:
    found = compared(trial(TwoLink(arm(torque_limit=(np.inf, np.inf)), surface()), Numpy("huge")))
    assert "the measurement is not finite" in found.reason


def test_a_law_that_raises_in_a_kernel_raises_here() -> None:
    with pytest.raises(ValueError, match="no idea"):
        pass_messages(trial(controller=Compiled("raises")))


def test_a_torque_of_another_shape_is_refused_alike() -> None:
    subject = trial(controller=Numpy("shape"))
    for run in (run_plainly, pass_messages):
        with pytest.raises(PluginError, match=r"an array of shape \(1,\); the robot needs one of shape \(2,\)"):
            run(subject, sizes=memory_of(subject))


@pytest.mark.parametrize("law", [TdeSlidingMode(), Pd()])
def test_after_the_warm_up_nothing_is_loaded_or_compiled(monkeypatch: pytest.MonkeyPatch, law: Any) -> None:
    """It takes some 30 ms in each process, which would be the first thirty ticks of a trial in real time."""
    made: list[Any] = []

    def noted(*given: Any, **options: Any) -> Any:
        made.append(compiled(*given, **options))
        return made[-1]

    compiled = kernels._compiled  # pyright: ignore[reportPrivateUsage]
    kernels._composed.cache_clear()  # pyright: ignore[reportPrivateUsage]
    monkeypatch.setattr(kernels, "_compiled", noted)
    subject = trial(controller=law, disturbances=EVERYTHING)
    warm_up_driver(subject)
    warm_up_controller(subject)
    before = [kernel.signatures for kernel in made]
    assert sum(map(len, before)) > 0
    pass_messages(subject)
    assert [kernel.signatures for kernel in made] == before


@pytest.mark.parametrize("law", LAWS)
def test_to_warm_up_leaves_no_trace_in_the_trial(law: Any) -> None:
    subject = trial(controller=law, disturbances=(SensorNoise(force=0.05, joint=2e-5),))
    before = pass_messages(subject)
    warm_up_driver(subject)
    assert warm_up_controller(subject) == memory_of(subject)
    assert pass_messages(subject) == before


@pytest.mark.parametrize("ticks", [1, 2])
def test_a_trial_may_be_as_short_as_one_tick(ticks: int) -> None:
    phase = PhaseSpec("press", 0.0, ticks * 1e-3, {"x": Hold(0.1)}, {"z": Hold(3.5)})
    subject = trial(controller=Pd(), phases=(phase,))
    assert subject.ticks == ticks
    warm_up_driver(subject)
    warm_up_controller(subject)
    assert len(compared(subject).command) == ticks


def test_a_trial_that_trips_at_once_warms_up_all_the_same() -> None:
    subject = trial(controller=Pd(), limits=Limits(tip_force=1.0), start_position=(0.1, 0.36))
    warm_up_driver(subject)
