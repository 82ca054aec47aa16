"""Whole trials, many ticks at a call, against what a tick means, told plainly: the same messages, the same endings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from helpers.builders import arm, surface, trial
from helpers.drivers import DRIVERS
from helpers.in_memory import memory_of, pass_messages
from helpers.laws import EVERYTHING, SERVO, Numpy
from helpers.plain_loop import run_plainly
from helpers.whole_trials import Blocks, run_in_blocks
from hilrig_drivers.two_link import TwoLink

from hilrig.core.compiler import kernel
from hilrig.core.errors import PluginError
from hilrig.core.interfaces import Law, Task
from hilrig.core.signals import Array, Reference, State
from hilrig.experiment.trial import Limits, PhaseSpec, Trial
from hilrig.kinds.actuation import Actuation
from hilrig.kinds.controllers.adaptive import Adaptive
from hilrig.kinds.controllers.pd import Pd
from hilrig.kinds.controllers.sliding_mode import SlidingMode
from hilrig.kinds.controllers.tde_sliding_mode import TdeSlidingMode
from hilrig.kinds.disturbances.sensor_bias import SensorBias
from hilrig.kinds.references.hold import Hold
from hilrig.kinds.references.sine import Sine
from hilrig.loop.driver_node import DriverNode
from hilrig.loop.ticks import Ending


@dataclass(frozen=True)
class Closed:
    """A law whose kernel is a closure over the law's parameter."""

    gain: float

    def start(self, task: Task, state: State) -> Law:
        gain = self.gain

        @kernel
        def step(parameters: tuple[()], memory: tuple[()], state: State, reference: Reference) -> Array:
            return gain * (reference.position - state.position)

        return Law(step, (), ())


def compared(subject: Trial, block: int = 37) -> Ending:
    """Run a trial both ways, assert that all messages are the same, and return how it ended."""
    sizes = memory_of(subject)
    expected, (found, ending) = run_plainly(subject, sizes), run_in_blocks(subject, sizes, block)
    assert found == expected
    assert ending.ticks == len(expected.command)
    assert ending.outcome == ("tripped" if expected.reason else "completed")
    return ending


@pytest.mark.parametrize("law", [TdeSlidingMode(), Pd(), Adaptive(), SlidingMode(), Numpy()])
@pytest.mark.parametrize("delay", [0, 1, 3])
def test_every_law_gives_the_same_bits(law: Any, delay: int) -> None:
    assert compared(trial(controller=law, actuation_delay=delay)).ticks > 20


@pytest.mark.parametrize("actuation", [Actuation(), SERVO])
def test_the_same_bits_under_every_disturbance(actuation: Actuation) -> None:
    driver = TwoLink(arm(), surface(), actuation, (0.1, 0.05), (0.02, 0.01))
    swing = PhaseSpec("swing", 0.0, 0.2, {"x": Sine(0.1, 3.0)}, {"z": Hold(3.5)})
    compared(trial(driver, Numpy(), disturbances=EVERYTHING, phases=(swing,)))
    assert compared(trial(controller=Pd(), disturbances=EVERYTHING)).outcome == "completed"


def test_blocks_of_any_length_are_one_trial() -> None:
    for block in (1, 199, 1000):
        assert compared(trial(), block) == ("completed", "", 200)


@pytest.mark.parametrize("limits", [Limits(tip_force=1.0), Limits(joint_velocity=0.02)])
def test_it_trips_at_the_same_tick_for_the_same_reason(limits: Limits) -> None:
    ending = compared(trial(controller=Pd(), limits=limits, start_position=(0.1, 0.345)))
    assert ending.outcome == "tripped"
    assert 1 < ending.ticks < 200


def test_it_trips_at_the_first_tick_alike() -> None:
    ending = compared(trial(controller=Pd(), limits=Limits(tip_force=1.0), start_position=(0.1, 0.36)))
    assert ending == ("tripped", "tip force 8 N at t = 0 s (tick 0) is over the limit of 1 N", 0)


def test_a_sensors_error_is_no_speed() -> None:
    """Safety looks at the plant: a bias of 0.1 rad in a tick would be 100 rad/s."""
    biased = trial(controller=Pd(), disturbances=(SensorBias(joint=0.1),), limits=Limits(joint_velocity=50.0))
    assert compared(biased).outcome == "completed"


def test_a_torque_that_is_not_finite_ends_it_alike() -> None:
    ending = compared(trial(controller=Numpy("nan")))
    assert "tick 59: the torque of controller 'mine' is not finite: [nan nan]" in ending.reason


def test_a_plant_that_leaves_the_numbers_trips_alike() -> None:
    """A huge torque takes every number of the plant beyond what a float holds within one period."""
    ending = compared(trial(TwoLink(arm(torque_limit=(np.inf, np.inf)), surface()), Numpy("huge")))
    assert "the measurement is not finite" in ending.reason


def test_a_torque_is_limited_alike() -> None:
    weak = TwoLink(arm(torque_limit=(0.3, 0.05)), surface())
    assert compared(trial(weak, Numpy(gain=3000.0))).outcome == "completed"


def test_a_closure_is_not_taken_for_another() -> None:
    """Two laws of one source with different values in their closures: each keeps its own."""
    for gain in (10.0, 20.0):
        assert compared(trial(controller=Closed(gain))).outcome == "completed"


def test_what_was_done_before_a_fault_is_there() -> None:
    subject = trial(controller=Numpy("shape"))
    blocks = Blocks(subject, memory_of(subject))
    blocks.start()
    with pytest.raises(PluginError, match=r"an array of shape \(1,\); the robot needs one of shape \(2,\)"):
        blocks.do(200)
    assert (len(blocks.passed.state), len(blocks.passed.internals)) == (60, 59)


@pytest.mark.parametrize("memory", ["strided", "transposed"])
def test_a_memory_that_does_not_lie_in_one_piece_is_recorded_all_the_same(memory: Any) -> None:
    assert compared(trial(controller=Numpy(memory=memory), limits=Limits(joint_margin=None))).outcome == "completed"


@pytest.mark.parametrize("driver", DRIVERS)
def test_a_physics_engine_offers_no_kernels_and_a_compiled_plant_does(driver: Any) -> None:
    node = DriverNode(trial(driver(arm(), surface())))
    node.connect()
    assert node.compiled == (driver is TwoLink)
    node.release()


def test_blocks_and_single_ticks_give_the_same_messages() -> None:
    subject = trial(controller=TdeSlidingMode(), disturbances=EVERYTHING)
    sizes = memory_of(subject)
    assert run_in_blocks(subject, sizes, 50)[0] == pass_messages(subject, sizes=sizes)
