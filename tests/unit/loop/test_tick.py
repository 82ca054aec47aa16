from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pytest
from helpers.builders import PERIOD, arm, surface, trial
from hilrig_drivers.pybullet_arm import PybulletArm
from hilrig_drivers.two_link import TwoLink

from hilrig.core.errors import PluginError, Stopped, Tripped
from hilrig.core.interfaces import Law, Task
from hilrig.core.signals import Array, Command, Measurement, Reference, State, Truth
from hilrig.experiment.trial import Limits, PhaseSpec, Trial, references
from hilrig.kinds.actuation import Actuation
from hilrig.kinds.controllers.tde_sliding_mode import TdeSlidingMode
from hilrig.kinds.disturbances.force_pulse import ForcePulse
from hilrig.kinds.disturbances.measurement_delay import MeasurementDelay
from hilrig.kinds.disturbances.sensor_bias import SensorBias
from hilrig.kinds.references.sine import Sine
from hilrig.loop.tick import (
    Answer,
    ControlSide,
    PlantSide,
    drive,
    filter_velocity,
    limit,
    memory_sizes,
    warm_up_control,
    warm_up_plant,
)


class Direct:
    """A wire within one process that notes what passes."""

    def __init__(self, trial: Trial, late: frozenset[int] = frozenset()) -> None:
        self.control, self.late = ControlSide(trial), late
        self.measured: list[Measurement] = []
        self.answers: dict[int, Answer] = {}
        self.wanted: list[int] = []

    def wait(self, tick: int) -> None:
        assert tick == len(self.measured)

    def publish(self, tick: int, measurement: Measurement, truth: Truth | None) -> None:
        assert truth is not None
        self.measured.append(measurement)
        self.answers[tick] = self.control.control(tick, measurement)

    def command(self, tick: int, wanted: int) -> Command | None:
        self.wanted.append(wanted)
        return self.answers[wanted].command if wanted in self.answers else None


def ride(subject: Trial) -> Direct:
    """Run the whole trial and return its wire."""
    side, wire = PlantSide(subject), Direct(subject)
    assert drive(side, wire) == ("completed", "", subject.ticks)
    return wire


@dataclass(frozen=True)
class Wants:
    """A controller that wants the same torque always."""

    torque: tuple[float, ...]

    def start(self, task: Task, state: State) -> Law:
        def step(parameters: object, memory: object, state: State, reference: Reference) -> Array:
            return np.array(self.torque)

        return Law(step, None, ())


@pytest.mark.parametrize("delay", [0, 1, 2])
def test_a_command_acts_after_the_delay(delay: int) -> None:
    """Applied torque at tick k is what was in effect up to k: the command of tick k - 1 - delay."""
    wire = ride(trial(TwoLink(arm(), surface()), TdeSlidingMode(), actuation_delay=delay))
    hold = wire.measured[0].applied_torque
    for k in range(1, len(wire.measured)):
        source = k - 1 - delay
        expected = wire.answers[source].command.torque if source >= 0 else hold
        np.testing.assert_array_equal(wire.measured[k].applied_torque, expected)


def test_before_the_first_command_the_arm_is_held() -> None:
    wire = ride(trial(actuation_delay=3))
    for early in wire.measured[:4]:
        np.testing.assert_allclose(early.joint_position, wire.measured[0].joint_position, atol=1e-12)


def test_the_same_trial_twice_gives_the_same_bits() -> None:
    for driver in (TwoLink(arm(), surface()), PybulletArm(arm(), surface())):
        first, second = (ride(trial(driver, TdeSlidingMode())) for _ in range(2))
        for a, b in zip(first.measured, second.measured, strict=True):
            np.testing.assert_array_equal(a.joint_position, b.joint_position)
            np.testing.assert_array_equal(a.wrench, b.wrench)
        assert not np.array_equal(first.measured[-1].joint_position, first.measured[0].joint_position)


def test_measurement_delay_gives_old_measurements() -> None:
    side = PlantSide(trial(disturbances=(MeasurementDelay(ticks=3),)))
    exact, seen = [], []
    for tick in range(10):
        measured, truth = side.measure(tick)
        assert truth is not None
        exact.append(truth.joint_position)
        seen.append(measured.joint_position)
        side.advance(tick, Command(np.array([5.0, 1.0]), np.zeros(2)))
    for tick in range(10):
        np.testing.assert_array_equal(seen[tick], exact[max(tick - 3, 0)])
    assert not np.array_equal(exact[9], exact[6])


def test_disturbances_come_at_their_tick() -> None:
    """Beside an undisturbed twin; force and position are two ticks old when they are seen, the sensors' errors new."""
    late, pulse = MeasurementDelay(ticks=2), ForcePulse(4.0, "z", at=5e-3, duration=3e-3)
    side = PlantSide(trial(disturbances=(late, pulse, SensorBias(force=0.5, joint=1e-3, at=4e-3))))
    twin = PlantSide(trial(disturbances=(late,)))
    for tick in range(8):
        (seen, true), (plain, quiet) = side.measure(tick), twin.measure(tick)
        assert true is not None
        assert quiet is not None
        assert np.array_equal(true.joint_position, quiet.joint_position) == (tick <= 5), tick
        if tick <= 5:
            assert true.wrench[2] - quiet.wrench[2] == pytest.approx(4.0 * (tick == 5)), tick
        assert seen.wrench[2] - plain.wrench[2] == pytest.approx(4.0 * (tick == 7) + 0.5 * (tick >= 4)), tick
        np.testing.assert_allclose(seen.joint_position - plain.joint_position, 1e-3 * (tick >= 4), atol=1e-15)
        side.advance(tick, None)
        twin.advance(tick, None)


def test_the_law_is_given_the_reference_of_its_tick() -> None:
    swing = PhaseSpec("swing", 0.0, 0.2, {"x": Sine(0.1, 3.0)}, {"z": Sine(1.0, 2.0, 3.5)})
    subject = trial(phases=(swing,))
    control, measurement = ControlSide(subject), PlantSide(subject).measure(0)[0]
    for tick in (0, 1, 150):
        for given, wanted in zip(control.control(tick, measurement).reference, references(subject), strict=True):
            np.testing.assert_array_equal(given, wanted[tick])


def test_sensor_errors_reach_the_controller_but_not_safety_or_truth() -> None:
    biased = trial(disturbances=(SensorBias(force=500.0, joint=(0.01, -0.02)),))
    side = PlantSide(biased)
    measured, truth = side.measure(0)
    assert truth is not None
    np.testing.assert_allclose(measured.joint_position - truth.joint_position, [0.01, -0.02])
    assert measured.wrench[2] - truth.wrench[2] == pytest.approx(500.0)


def test_a_limit_that_is_exceeded_trips_the_trial() -> None:
    """The arm starts 10 mm deep in a surface of 800 N/m, and may press with 5 N."""
    side = PlantSide(trial(start_position=(0.1, 0.36), limits=Limits(tip_force=5.0)))
    with pytest.raises(Tripped, match=r"tip force 8 N .* limit of 5 N"):
        side.measure(0)


def test_torque_is_limited_and_the_law_is_told() -> None:
    strong = trial(TwoLink(arm(torque_limit=(3.0, 2.0)), surface()), Wants((10.0, -10.0)))
    control, side = ControlSide(strong), PlantSide(strong)
    measurement, _ = side.measure(0)
    np.testing.assert_array_equal(control.control(0, measurement).command.torque, [3.0, -2.0])
    np.testing.assert_array_equal(control.control(1, measurement).state.torque, [3.0, -2.0])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_torque_that_is_not_finite_trips(bad: float) -> None:
    subject = trial(controller=Wants((1.0, bad)))
    measurement, _ = PlantSide(subject).measure(0)
    with pytest.raises(Tripped, match=r"tick 7: the torque of controller 'mine' is not finite"):
        ControlSide(subject).control(7, measurement)


@pytest.mark.parametrize("torque", [(1.0,), (1.0, 2.0, 3.0)])
def test_a_torque_for_another_number_of_joints_is_refused(torque: tuple[float, ...]) -> None:
    subject = trial(controller=Wants(torque))
    measurement, _ = PlantSide(subject).measure(0)
    with pytest.raises(PluginError, match="controller 'mine': step returned an array"):
        ControlSide(subject).control(0, measurement)


def test_the_state_is_the_robots_kinematics_and_the_force_along_its_axes() -> None:
    subject = trial()
    control, side = ControlSide(subject), PlantSide(subject)
    q = np.array([0.5, 1.1])
    first = Measurement(q, np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), np.array([0.3, 0.4]))
    state = control.control(0, first).state
    np.testing.assert_array_equal(state.force, [1.0, 3.0])
    np.testing.assert_array_equal(state.torque, [0.3, 0.4])
    np.testing.assert_array_equal(state.velocity, [0.0, 0.0])
    moved = control.control(1, first._replace(joint_position=q + 1e-3)).state
    smoothing = 1 - np.exp(-2 * np.pi * 60.0 * PERIOD)
    np.testing.assert_allclose(moved.joint_velocity, smoothing * 1e-3 / PERIOD)
    np.testing.assert_allclose(moved.velocity, arm().kinematics(q + 1e-3, moved.joint_velocity).velocity)
    side.close()


def test_the_velocity_filter_has_its_cutoff() -> None:
    """A slow ramp is followed exactly; a sine at the cut-off comes out 3 dB down, as far as a sampled filter can be."""
    period, cutoff = 1e-4, 60.0
    smoothing, velocity = 1 - np.exp(-2 * np.pi * cutoff * period), np.zeros(1)
    t = np.arange(5000) * period
    q, seen = np.sin(2 * np.pi * cutoff * t) / (2 * np.pi * cutoff), []
    for now, last in zip(q[1:], q[:-1], strict=True):
        filter_velocity(velocity, np.array([now]), np.array([last]), period, smoothing)
        seen.append(velocity[0])
    assert np.max(seen[2500:]) == pytest.approx(np.sqrt(0.5), rel=0.02)
    for k in range(5000):
        filter_velocity(velocity, np.array([k * period]), np.array([(k - 1) * period]), period, smoothing)
    assert velocity[0] == pytest.approx(1.0, abs=1e-9)


def test_position_servos_are_commanded_by_equation_26() -> None:
    servo = trial(TwoLink(arm(), surface(), Actuation("position_servo", k_ref=15.0)), Wants((3.0, -1.5)))
    measurement, _ = PlantSide(servo).measure(0)
    command = ControlSide(servo).control(0, measurement).command
    np.testing.assert_allclose(command.position, measurement.joint_position + np.array([0.2, -0.1]))


def test_limit_keeps_what_is_within() -> None:
    torque = np.zeros(3)
    assert limit(torque, np.array([-5.0, 1.0, 5.0]), np.array([2.0, 2.0, 9.0]))
    np.testing.assert_array_equal(torque, [-2.0, 1.0, 5.0])
    for value in (np.nan, np.inf, -np.inf):
        assert not limit(torque[:2], np.array([0.5, value]), np.ones(2))
    np.testing.assert_array_equal(torque, [-2.0, 1.0, 5.0])


def test_warm_up_tells_the_laws_memory_and_leaves_the_trial_alone() -> None:
    subject = trial(controller=TdeSlidingMode())
    before = ride(subject).measured[-1].joint_position
    warm_up_plant(subject)
    sizes = warm_up_control(subject)
    assert sizes["alpha_1"] == 1
    assert sizes["estimate"] == 2
    np.testing.assert_array_equal(ride(subject).measured[-1].joint_position, before)


class Memory(NamedTuple):
    past: Any


class Taken(NamedTuple):
    reference_force: Any


@pytest.mark.parametrize(
    "memory",
    [Memory(np.zeros(2, np.float32)), Memory(np.zeros(0)), Memory(0.0), (np.zeros(2),), Taken(np.zeros(2))],
    ids=["float32", "empty", "number", "no names", "a name of the record's own"],
)
def test_a_memory_that_cannot_be_recorded_is_refused(memory: object) -> None:
    with pytest.raises(PluginError, match=r"controller 'mine': .*memory"):
        memory_sizes(memory, "mine")


def test_a_law_need_not_remember() -> None:
    assert memory_sizes((), "mine") == {}


@pytest.mark.parametrize(("end", "outcome"), [(Tripped("too fast"), "tripped"), (Stopped("too fast"), "aborted")])
def test_a_trial_that_ends_early_tells_why_and_releases_the_plant(end: Exception, outcome: str) -> None:
    class Ends(Direct):
        def wait(self, tick: int) -> None:
            if tick == 3:
                raise end

    closed: list[bool] = []
    side = PlantSide(trial())
    side.close = lambda: closed.append(True)
    assert drive(side, Ends(side.trial)) == (outcome, "too fast", 3)
    assert closed == [True]


def test_a_missed_tick_is_not_taken_for_speed() -> None:
    """Real time can skip ticks: the joints' steady motion keeps its rate, and the law hears how long it was."""
    heard: list[State] = []

    @dataclass(frozen=True)
    class Listens:
        def start(self, task: Task, state: State) -> Law:
            def step(parameters: object, memory: object, state: State, reference: Reference) -> Array:
                heard.append(state)
                return np.zeros(2)

            return Law(step, None, ())

    side = ControlSide(trial(TwoLink(arm(), surface()), Listens()))
    rate = np.array([0.3, -0.2])
    start = np.array([0.9, 1.8])
    ticks = [*range(100), *range(112, 130)]
    for tick in ticks:
        side.control(tick, Measurement(start + rate * tick * PERIOD, np.zeros(6), np.zeros(2)))
    np.testing.assert_allclose(heard[99].joint_velocity, rate, rtol=1e-3)
    for state in heard[100:]:
        np.testing.assert_allclose(state.joint_velocity, rate, rtol=1e-3)
    assert heard[99].elapsed == PERIOD
    assert heard[100].elapsed == pytest.approx(13 * PERIOD)
