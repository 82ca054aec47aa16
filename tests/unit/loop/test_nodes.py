from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pytest
from helpers.builders import PERIOD, STILL, arm, surface, trial
from helpers.drivers import DRIVERS
from helpers.in_memory import Nodes, Wire, pass_messages
from helpers.laws import SERVO
from hilrig_drivers.pybullet_arm import PybulletArm
from hilrig_drivers.two_link import TwoLink

from hilrig.core.compiler import kernel
from hilrig.core.errors import PluginError, Stopped, Tripped
from hilrig.core.interfaces import Law, Task, TrialStart
from hilrig.core.law_memory import memory_sizes
from hilrig.core.signals import Array, Command, Reference, State
from hilrig.experiment.trial import Limits, PhaseSpec, Trial, references
from hilrig.kinds.actuation import Actuation
from hilrig.kinds.controllers.tde_sliding_mode import TdeSlidingMode
from hilrig.kinds.disturbances.force_pulse import ForcePulse
from hilrig.kinds.disturbances.measurement_delay import MeasurementDelay
from hilrig.kinds.disturbances.sensor_bias import SensorBias
from hilrig.kinds.references.hold import Hold
from hilrig.kinds.references.sine import Sine
from hilrig.loop.control import filter_velocity
from hilrig.loop.ticks import do_ticks


class Noted(Wire):
    """Notes what passes."""

    def __init__(self, nodes: Nodes) -> None:
        super().__init__(nodes)
        self.measured: list[dict[str, Array]] = []
        self.torques: dict[int, Array] = {}

    def wait(self, tick: int) -> int:
        assert tick == len(self.measured)
        return tick

    def publish(self, tick: int) -> None:
        super().publish(tick)
        self.measured.append(self.nodes.values("state", self.nodes.message("state", tick)))
        self.torques[tick] = self.nodes.values("command", self.commands[tick])["torque"]


def ride(subject: Trial) -> Noted:
    """Run the whole trial and return its wire."""
    nodes = Nodes(subject)
    wire = Noted(nodes)
    assert do_ticks(nodes.driver, wire) == ("completed", "", subject.ticks)
    return wire


@dataclass(frozen=True)
class Wants:
    """A controller in plain Python that always wants the same torque, and may pass on what it is given."""

    torque: tuple[float, ...]
    hear: Callable[[State], None] = lambda state: None

    def start(self, task: Task, state: State) -> Law:
        def step(parameters: object, memory: object, state: State, reference: Reference) -> Array:
            self.hear(state)
            return np.array(self.torque)

        return Law(step, None, ())


@kernel
def same_torque(parameters: Array, memory: tuple[()], state: State, reference: Reference) -> Array:
    """Return the parameters."""
    return parameters.copy()


@dataclass(frozen=True)
class Compiled:
    """A controller that is a kernel and always wants the same torque."""

    torque: tuple[float, ...]

    def start(self, task: Task, state: State) -> Law:
        return Law(same_torque, np.array(self.torque), ())


@pytest.mark.parametrize("delay", [0, 1, 2])
def test_a_command_acts_after_the_delay(delay: int) -> None:
    """Applied torque at tick k is what was in effect up to k: the command of tick k - 1 - delay."""
    wire = ride(trial(TwoLink(arm(), surface()), TdeSlidingMode(), actuation_delay=delay))
    hold = wire.measured[0]["applied_torque"]
    for k in range(1, len(wire.measured)):
        source = k - 1 - delay
        expected = wire.torques[source] if source >= 0 else hold
        np.testing.assert_array_equal(wire.measured[k]["applied_torque"], expected)


def test_before_the_first_command_the_arm_is_held() -> None:
    wire = ride(trial(actuation_delay=3))
    for early in wire.measured[:4]:
        np.testing.assert_allclose(early["joint_position"], wire.measured[0]["joint_position"], atol=1e-12)


@pytest.mark.parametrize("driver", DRIVERS)
def test_the_same_trial_twice_gives_the_same_bits(driver: Any) -> None:
    first, second = (ride(trial(driver(arm(), surface()), TdeSlidingMode())) for _ in range(2))
    for a, b in zip(first.measured, second.measured, strict=True):
        np.testing.assert_array_equal(a["joint_position"], b["joint_position"])
        np.testing.assert_array_equal(a["wrench"], b["wrench"])
    assert not np.array_equal(first.measured[-1]["joint_position"], first.measured[0]["joint_position"])


def test_measurement_delay_gives_old_measurements() -> None:
    nodes = Nodes(trial(disturbances=(MeasurementDelay(ticks=3),)))
    exact, seen = [], []
    for tick in range(10):
        state, truth = nodes.measured(tick)
        exact.append(truth["joint_position"])
        seen.append(state["joint_position"])
        nodes.heard_command.acting.torque[:] = 5.0, 1.0
        nodes.driver.advance()
    for tick in range(10):
        np.testing.assert_array_equal(seen[tick], exact[max(tick - 3, 0)])
    assert not np.array_equal(exact[9], exact[6])


def test_disturbances_come_at_their_tick() -> None:
    """Beside an undisturbed twin; force and position are two ticks old when they are seen, the sensors' errors new."""
    late, pulse = MeasurementDelay(ticks=2), ForcePulse(4.0, "z", at=5e-3, duration=3e-3)
    nodes = Nodes(trial(disturbances=(late, pulse, SensorBias(force=0.5, joint=1e-3, at=4e-3))))
    twin = Nodes(trial(disturbances=(late,)))
    for tick in range(8):
        (seen, true), (plain, quiet) = nodes.measured(tick), twin.measured(tick)
        assert np.array_equal(true["joint_position"], quiet["joint_position"]) == (tick <= 5), tick
        if tick <= 5:
            assert true["wrench"][2] - quiet["wrench"][2] == pytest.approx(4.0 * (tick == 5)), tick
        pushed = 4.0 * (tick == 7) + 0.5 * (tick >= 4)
        assert seen["wrench"][2] - plain["wrench"][2] == pytest.approx(pushed), tick
        difference = seen["joint_position"] - plain["joint_position"]
        np.testing.assert_allclose(difference, 1e-3 * (tick >= 4), atol=1e-15)
        nodes.driver.advance()
        twin.driver.advance()


def test_the_law_is_given_the_reference_of_its_tick() -> None:
    swing = PhaseSpec("swing", 0.0, 0.2, {"x": Sine(0.1, 3.0)}, {"z": Sine(1.0, 2.0, 3.5)})
    subject = trial(phases=(swing,))
    nodes, wanted = Nodes(subject), references(subject)
    for tick in (0, 1, 150):
        _, internals = nodes.answered(nodes.state(tick, np.array([0.5, 1.1])))
        for name, signal in zip(wanted._fields, wanted, strict=True):
            np.testing.assert_array_equal(internals[f"reference_{name}"], signal[tick])


def test_sensor_errors_reach_the_controller_but_not_safety_or_truth() -> None:
    nodes = Nodes(trial(disturbances=(SensorBias(force=500.0, joint=(0.01, -0.02)),)))
    measured, truth = nodes.measured(0)
    np.testing.assert_allclose(measured["joint_position"] - truth["joint_position"], [0.01, -0.02])
    assert measured["wrench"][2] - truth["wrench"][2] == pytest.approx(500.0)


def test_a_limit_that_is_exceeded_trips_the_trial() -> None:
    """The arm starts 10 mm deep in a surface of 800 N/m, and may press with 5 N."""
    nodes = Nodes(trial(start_position=(0.1, 0.36), limits=Limits(tip_force=5.0)))
    with pytest.raises(Tripped, match=r"tip force 8 N .* limit of 5 N"):
        nodes.driver.measure(0)


def test_torque_is_limited_and_the_law_is_told() -> None:
    heard: list[State] = []
    strong = trial(TwoLink(arm(torque_limit=(3.0, 2.0)), surface()), Wants((10.0, -10.0), heard.append))
    nodes = Nodes(strong)
    for tick in range(2):
        command, _ = nodes.answered(nodes.state(tick, np.array([0.5, 1.1])))
        np.testing.assert_array_equal(command["torque"], [3.0, -2.0])
    np.testing.assert_array_equal(heard[-1].torque, [3.0, -2.0])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_torque_that_is_not_finite_trips(bad: float) -> None:
    nodes = Nodes(trial(controller=Wants((1.0, bad))))
    with pytest.raises(Tripped, match=r"tick 7: the torque of controller 'mine' is not finite"):
        nodes.answered(nodes.state(7, np.array([0.5, 1.1])))


@pytest.mark.parametrize("controller", [Wants, Compiled])
@pytest.mark.parametrize("torque", [(1.0,), (1.0, 2.0, 3.0)])
def test_a_torque_for_another_number_of_joints_is_refused(controller: Any, torque: tuple[float, ...]) -> None:
    nodes = Nodes(trial(controller=controller(torque)))
    with pytest.raises(PluginError, match="controller 'mine': step returned an array"):
        nodes.answered(nodes.state(0, np.array([0.5, 1.1])))


def test_the_state_is_the_robots_kinematics_and_the_force_along_its_axes() -> None:
    heard: list[State] = []
    nodes = Nodes(trial(controller=Wants((0.0, 0.0), heard.append)))
    q, wrench, torque = np.array([0.5, 1.1]), np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), np.array([0.3, 0.4])
    nodes.answered(nodes.state(0, q, wrench, torque))
    np.testing.assert_array_equal(heard[-1].force, [1.0, 3.0])
    np.testing.assert_array_equal(heard[-1].torque, [0.3, 0.4])
    np.testing.assert_array_equal(heard[-1].velocity, [0.0, 0.0])
    nodes.answered(nodes.state(1, q + 1e-3, wrench, torque))
    smoothing = 1 - np.exp(-2 * np.pi * 60.0 * PERIOD)
    np.testing.assert_allclose(heard[-1].joint_velocity, smoothing * 1e-3 / PERIOD)
    np.testing.assert_allclose(heard[-1].velocity, arm().kinematics(q + 1e-3, heard[-1].joint_velocity).velocity)


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
    nodes = Nodes(trial(TwoLink(arm(), surface(), Actuation("position_servo", k_ref=15.0)), Wants((3.0, -1.5))))
    q = np.array([0.5, 1.1])
    command, _ = nodes.answered(nodes.state(0, q))
    np.testing.assert_allclose(command["position"], q + np.array([0.2, -0.1]))


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
def test_a_trial_that_ends_early_tells_why_and_releases_the_plant_once(end: Exception, outcome: str) -> None:
    class Ends(Wire):
        def wait(self, tick: int) -> int:
            if tick == 3:
                raise end
            return tick

    closed: list[bool] = []
    nodes = Nodes(trial())
    nodes.driver.plant.close = lambda: closed.append(True)
    assert do_ticks(nodes.driver, Ends(nodes)) == (outcome, "too fast", 3)
    nodes.driver.release()
    assert closed == [True]


@pytest.mark.needs_pybullet
def test_a_driver_that_measures_another_number_of_joints_is_refused() -> None:
    nodes = Nodes(trial(PybulletArm(arm(), surface())))
    measure = nodes.driver.plant.measure
    nodes.driver.plant.measure = lambda now: measure(now)._replace(joint_position=np.zeros(3))
    message = r"driver PybulletArm: measure returned joint_position as an array of shape \(3,\)"
    with pytest.raises(PluginError, match=message):
        nodes.driver.measure(0)
    nodes.driver.release()


def test_a_missed_tick_is_not_taken_for_speed() -> None:
    """Real time can skip ticks: the joints' steady motion keeps its rate, and the law hears how long it was."""
    heard: list[State] = []
    nodes = Nodes(trial(controller=Wants((0.0, 0.0), heard.append)))
    rate = np.array([0.3, -0.2])
    start = np.array([0.9, 1.8])
    ticks = [*range(100), *range(112, 130)]
    for tick in ticks:
        nodes.answered(nodes.state(tick, start + rate * tick * PERIOD))
    np.testing.assert_allclose(heard[99].joint_velocity, rate, rtol=1e-3)
    for state in heard[100:]:
        np.testing.assert_allclose(state.joint_velocity, rate, rtol=1e-3)
    assert heard[99].elapsed == PERIOD
    assert heard[100].elapsed == pytest.approx(13 * PERIOD)


@kernel
def scribbles(parameters: tuple[()], memory: tuple[()], state: State, reference: Reference) -> Array:
    """Overwrite everything that is given."""
    for part in (state.joint_position, state.joint_velocity, state.position, state.velocity, state.force, state.torque):
        part[:] = 7.0
    for part in (reference.position, reference.velocity, reference.acceleration, reference.force):
        part[:] = -7.0
    state.jacobian[:] = 7.0
    return np.array([0.3, -0.2])


@dataclass(frozen=True)
class Scribbles:
    """A law that overwrites what it is given, as a kernel or in plain Python, and its task."""

    compiled: bool

    def start(self, task: Task, state: State) -> Law:
        task.torque_limit[:] = 0.0
        state.joint_position[:] = 7.0
        return Law(scribbles if self.compiled else scribbles.py_func, (), ())


@pytest.mark.parametrize("law", [Scribbles(True), Scribbles(False)])
def test_a_law_that_overwrites_what_it_is_given_changes_nothing_for_others(law: Scribbles) -> None:
    """Neither the record, nor the velocity filter, nor the references of the trial."""
    swing = PhaseSpec("swing", 0.0, 0.2, {"x": Sine(0.1, 3.0)}, {"z": Hold(3.5)})
    quiet, loud = (
        pass_messages(trial(controller=controller, phases=(swing,))) for controller in (Wants((0.3, -0.2)), law)
    )
    assert loud == quiet
    assert len(quiet.command) == 200


class InPython:
    """A robot, a plant or a driver as if it offered no kernels, with `instead` for some of what it has."""

    def __init__(self, whole: Any, **instead: Any) -> None:
        self._whole = whole
        vars(self).update(instead)

    def __getattr__(self, name: str) -> Any:
        if name == "kernels":
            raise AttributeError(name)
        return getattr(self._whole, name)


class Late:
    """A function of arrays that works with the arrays of its last call; it copies, keeps or overwrites them."""

    def __init__(self, does: Callable[..., Any], manner: str) -> None:
        self._does, self._manner = does, manner
        self._before: tuple[Array, ...] = ()

    def __call__(self, *given: Array) -> Any:
        kept = given if self._manner == "keeps" else tuple(array.copy() for array in given)
        done = self._does(*(self._before or kept))
        self._before = kept
        if self._manner == "overwrites":
            for array in given:
                array[:] = 1.0
        return done


def slow_plant(driver: TwoLink, manner: str) -> Any:
    """Return the driver with a plant in plain Python that applies each command one period late."""

    def connect(start: TrialStart) -> Any:
        plant = driver.connect(start)
        late = Late(lambda *command: plant.advance(Command(*command), STILL), manner)
        return InPython(plant, advance=lambda command, now: late(*command))

    return InPython(driver, connect=connect)


def slow_robot(driver: TwoLink, manner: str) -> Any:
    """Return the driver with a robot in plain Python that gives the kinematics one tick late."""
    late = Late(driver.robot.kinematics, manner)
    return InPython(driver, robot=InPython(driver.robot, kinematics=late))


@pytest.mark.parametrize("manner", ["keeps", "overwrites"])
@pytest.mark.parametrize("actuation", [Actuation(), SERVO], ids=["torque", "position"])
@pytest.mark.parametrize("slow", [slow_plant, slow_robot])
def test_a_plain_plant_or_robot_may_do_as_it_likes_with_what_it_is_given(
    slow: Callable[[TwoLink, str], Any], actuation: Actuation, manner: str
) -> None:
    """The messages are those of one that copies, also while the arm is held until the first command acts."""
    swing = PhaseSpec("swing", 0.0, 0.2, {"x": Sine(0.1, 3.0)}, {"z": Hold(3.5)})
    polite, other = (
        pass_messages(trial(slow(TwoLink(arm(), surface(), actuation), how), phases=(swing,), actuation_delay=3))
        for how in ("copies", manner)
    )
    assert other == polite
    assert len(polite.command) == 200
