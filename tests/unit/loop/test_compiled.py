"""The compiled loop against the loop itself: the same bits, tick by tick, and the same endings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pytest
from helpers.builders import arm, surface, trial
from hilrig_drivers.pybullet_arm import PybulletArm
from hilrig_drivers.two_link import TwoLink

from hilrig.core.compiler import kernel
from hilrig.core.errors import PluginError
from hilrig.core.interfaces import Law, Task
from hilrig.core.signals import Array, Measurement, Reference, State, Truth
from hilrig.experiment.trial import Limits, PhaseSpec, Trial
from hilrig.kinds.actuation import Actuation
from hilrig.kinds.controllers.adaptive import Adaptive
from hilrig.kinds.controllers.pd import Pd
from hilrig.kinds.controllers.sliding_mode import SlidingMode
from hilrig.kinds.controllers.tde_sliding_mode import TdeSlidingMode
from hilrig.kinds.disturbances.force_sine import ForceSine
from hilrig.kinds.disturbances.friction_step import FrictionStep
from hilrig.kinds.disturbances.measurement_delay import MeasurementDelay
from hilrig.kinds.disturbances.sensor_bias import SensorBias
from hilrig.kinds.disturbances.sensor_noise import SensorNoise
from hilrig.kinds.disturbances.surface_motion import SurfaceMotion
from hilrig.kinds.references.hold import Hold
from hilrig.kinds.references.sine import Sine
from hilrig.loop.compiled.trial import CompiledTrial, can_compile
from hilrig.loop.tick import Ending, PlantSide, do_ticks
from tests.unit.loop.test_tick import Direct

SERVO = Actuation("position_servo", stiffness=60.0)
EVERYTHING = (
    SensorNoise(force=0.05, joint=2e-5), MeasurementDelay(ticks=3, at=0.05, until=0.15), ForceSine(0.5, 9.0, "x"),
    SurfaceMotion(0.002, 5.0), FrictionStep(2.0, at=0.1),
)  # fmt: skip


class Kept(NamedTuple):
    """What the law below remembers."""

    sums: Array
    """(2, 2): not one-dimensional, as a user's memory may be"""


@dataclass(frozen=True)
class Numpy:
    """A law in plain Python that keeps the states it was given: they must not change later."""

    fault: str = ""
    gain: float = 300.0
    memory: Array | None = None

    def start(self, task: Task, state: State) -> Law:
        given: list[State] = []
        heard: list[Reference] = []

        def step(parameters: object, memory: Kept, state: State, reference: Reference) -> Any:
            given.append(state)
            heard.append(reference)
            memory.sums[:] += np.outer(state.position, given[0].position)
            force = self.gain * (reference.position - state.position) - 20.0 * state.velocity + reference.force
            earlier = max(len(given) - 9, 0)
            force += 100.0 * heard[earlier].velocity
            torque = state.jacobian.T @ force + given[earlier].torque * 0.1
            if self.fault and len(given) == 60:
                return {"shape": torque[:1], "nan": torque * np.nan, "huge": torque * 1e300}[self.fault]
            return torque

        return Law(step, None, Kept(np.zeros((2, 2)) if self.memory is None else self.memory))


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


class Witness(Direct):
    """Notes the truth, too."""

    def __init__(self, trial: Trial) -> None:
        super().__init__(trial)
        self.truths: list[Truth] = []

    def publish(self, tick: int, measurement: Measurement, truth: Truth | None) -> None:
        assert truth is not None
        self.truths.append(truth)
        super().publish(tick, measurement, truth)


def compared(subject: Trial, block: int = 37) -> tuple[Ending, Ending]:
    """Run a trial both ways, assert that all signals are the same bits, and return both endings."""
    slow = PlantSide(subject), Witness(subject)
    expected = do_ticks(*slow, 0, subject.ticks)
    plant, wire = PlantSide(subject), Direct(subject)
    do_ticks(plant, wire, 0, 1)
    assert can_compile(plant, wire.control)
    fast, ending, tick = CompiledTrial(plant, wire.control, wire.answers[0]), None, 1
    while ending is None:
        ending = fast.do(block)
        track = fast.recent.track
        assert fast.recent.first == tick
        for row in range(fast.recent.written("state")):
            at = (np.uint64(tick + row), np.float64((tick + row) * subject.period))
            for got, wanted in zip(track.plant.state, (*at, *slow[1].measured[tick + row]), strict=True):
                same(got[row], wanted)
            for got, wanted in zip(track.plant.truth, (*at, *slow[1].truths[tick + row]), strict=True):
                same(got[row], np.asarray(wanted))
        for row in range(fast.recent.written("command")):
            at = (np.uint64(tick + row), np.float64((tick + row) * subject.period))
            answer = slow[1].answers[tick + row]
            own = (*at, *(getattr(answer.state, name) for name in ("position", "velocity", "force")))
            for got, wanted in zip(track.control.command, (*at, *answer.command), strict=True):
                same(got[row], wanted)
            for got, wanted in zip(track.control.internals[:-1], (*own, *answer.reference), strict=True):
                same(got[row], wanted)
        tick += fast.recent.written("command")
    if ending.outcome == "completed":
        internals = fast.recent.track.control.internals.memory[: fast.recent.written("internals")]
        same(np.concatenate([np.zeros(0), *(part.ravel() for part in slow[1].control.law.memory)]), internals[-1])
        assert tick == subject.ticks
    return ending, expected


def same(got: Array, wanted: Array) -> None:
    np.testing.assert_array_equal(np.ascontiguousarray(got).view(np.uint64), wanted.view(np.uint64))


@pytest.mark.parametrize("law", [TdeSlidingMode(), Pd(), Adaptive(), SlidingMode(), Numpy()])
@pytest.mark.parametrize("delay", [0, 1, 3])
def test_every_law_gives_the_same_bits(law: Any, delay: int) -> None:
    ending, expected = compared(trial(controller=law, actuation_delay=delay))
    assert ending == expected
    assert ending.ticks > 20


@pytest.mark.parametrize("actuation", [Actuation(), SERVO])
def test_the_same_bits_under_every_disturbance(actuation: Actuation) -> None:
    driver = TwoLink(arm(), surface(), actuation, (0.1, 0.05), (0.02, 0.01))
    swing = PhaseSpec("swing", 0.0, 0.2, {"x": Sine(0.1, 3.0)}, {"z": Hold(3.5)})
    ending, expected = compared(trial(driver, Numpy(), disturbances=EVERYTHING, phases=(swing,)))
    assert ending == expected
    assert compared(trial(controller=Pd(), disturbances=EVERYTHING))[0].outcome == "completed"


def test_blocks_of_any_length_are_one_trial() -> None:
    for block in (1, 199, 1000):
        assert compared(trial(), block)[0] == ("completed", "", 200)


@pytest.mark.parametrize("limits", [Limits(tip_force=1.0), Limits(joint_velocity=0.02)])
def test_it_trips_at_the_same_tick_for_the_same_reason(limits: Limits) -> None:
    ending, expected = compared(trial(controller=Pd(), limits=limits, start_position=(0.1, 0.345)))
    assert ending == expected
    assert ending.outcome == "tripped"
    assert 1 < ending.ticks < 200


def test_a_sensors_error_is_no_speed() -> None:
    """Safety looks at the plant: a bias of 0.1 rad in a tick would be 100 rad/s."""
    biased = trial(controller=Pd(), disturbances=(SensorBias(joint=0.1),), limits=Limits(joint_velocity=50.0))
    assert compared(biased)[0].outcome == "completed"


def test_a_torque_that_is_not_finite_ends_it_alike() -> None:
    ending, expected = compared(trial(controller=Numpy("nan")))
    assert ending == expected
    assert "tick 59: the torque of controller 'mine' is not finite: [nan nan]" in ending.reason


def test_a_plant_that_leaves_the_numbers_trips_alike() -> None:
    """A huge torque takes every number of the plant beyond what a float holds within one period."""
    ending, expected = compared(trial(TwoLink(arm(torque_limit=(np.inf, np.inf)), surface()), Numpy("huge")))
    assert ending == expected
    assert "the measurement is not finite" in ending.reason


def test_a_torque_is_limited_alike() -> None:
    weak = TwoLink(arm(torque_limit=(0.3, 0.05)), surface())
    assert compared(trial(weak, Numpy(gain=3000.0)))[0].outcome == "completed"


def test_a_closure_is_not_taken_for_another() -> None:
    """Two laws of one source with different values in their closures: each keeps its own."""
    for gain in (10.0, 20.0):
        assert compared(trial(controller=Closed(gain)))[0].outcome == "completed"


def test_what_was_done_before_a_fault_is_there() -> None:
    subject = trial(controller=Numpy("shape"))
    plant, wire = PlantSide(subject), Direct(subject)
    do_ticks(plant, wire, 0, 1)
    fast = CompiledTrial(plant, wire.control, wire.answers[0])
    with pytest.raises(PluginError, match=r"step returned an array \(1,\); the robot takes torques \(2,\)"):
        fast.do(200)
    assert (fast.recent.written("state"), fast.recent.written("internals")) == (59, 58)


def test_a_physics_engine_is_not_compiled() -> None:
    subject = trial(PybulletArm(arm(), surface()))
    plant, wire = PlantSide(subject), Direct(subject)
    do_ticks(plant, wire, 0, 1)
    assert not can_compile(plant, wire.control)
    plant.close()


def test_a_memory_that_does_not_lie_in_one_piece_is_not_compiled() -> None:
    subject = trial(controller=Numpy(memory=np.zeros((2, 4))[:, ::2]))
    plant, wire = PlantSide(subject), Direct(subject)
    do_ticks(plant, wire, 0, 1)
    assert not can_compile(plant, wire.control)
