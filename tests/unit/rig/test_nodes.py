"""The halves as the bus has them against the halves of the loop: the same messages, byte for byte."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pytest
from helpers.builders import arm, surface, trial
from hilrig_drivers.pybullet_arm import PybulletArm
from hilrig_drivers.two_link import TwoLink

from hilrig.core import compiler as kernels
from hilrig.core.compiler import kernel
from hilrig.core.errors import PluginError, Tripped
from hilrig.core.interfaces import Law, Task
from hilrig.core.signals import Array, Reference, State
from hilrig.experiment.trial import Limits, PhaseSpec, Trial
from hilrig.kinds.controllers.adaptive import Adaptive
from hilrig.kinds.controllers.pd import Pd
from hilrig.kinds.controllers.sliding_mode import SlidingMode
from hilrig.kinds.controllers.tde_sliding_mode import TdeSlidingMode
from hilrig.kinds.disturbances.sensor_noise import SensorNoise
from hilrig.kinds.references.hold import Hold
from hilrig.kinds.references.sine import Sine
from hilrig.loop.tick import ControlSide, PlantSide
from hilrig.loop.tick import warm_up_control as memory_of
from hilrig.recording.messages.layouts import layouts
from hilrig.recording.messages.record_batch import RecordBatch
from hilrig.rig.nodes import ControllerNode, DriverNode, warm_up_control, warm_up_plant
from tests.unit.loop.test_compiled import EVERYTHING, SERVO, Numpy

LAWS = [TdeSlidingMode(), Pd(), Adaptive(), SlidingMode(), Numpy()]
GAPS = frozenset({1, 2, 17, 40, 41, 42, 43, 120, 199})
"""Ticks that the controller misses"""


@dataclass
class Passed:
    """The messages of a trial by channel, and why it ended before its end."""

    state: list[bytes] = field(default_factory=list)
    truth: list[bytes] = field(default_factory=list)
    command: list[bytes] = field(default_factory=list)
    internals: list[bytes] = field(default_factory=list)
    reason: str = ""


def by_sides(subject: Trial, missed: frozenset[int]) -> Passed:
    """Run a trial with the halves of the loop, and make messages of what passes."""
    plant, control = PlantSide(subject), ControlSide(subject)
    codecs, passed, commands = codecs_of(subject), Passed(), {}

    def say(channel: str, tick: int, *values: Any) -> None:
        getattr(passed, channel).append(codecs[channel].pack((tick, tick * subject.period, *values)))

    try:
        for tick in range(subject.ticks):
            measurement, truth = plant.measure(tick)
            assert truth is not None
            say("state", tick, *measurement)
            say("truth", tick, *truth)
            if tick not in missed:
                answer = control.control(tick, measurement)
                seen, memory = answer.state, (part.ravel() for part in answer.memory)
                say("command", tick, *answer.command)
                say("internals", tick, seen.position, seen.velocity, seen.force, *answer.reference, *memory)
                commands[tick] = answer.command
            plant.advance(tick, newest(commands, tick - subject.actuation_delay))
    except Tripped as trip:
        passed.reason = str(trip)
    finally:
        plant.close()
    return passed


def by_halves(subject: Trial, missed: frozenset[int], rows: int = 7) -> Passed:
    """Run a trial with the halves of the bus, on batches of so many rows."""
    codecs, passed, commands = codecs_of(subject), Passed(), {}
    batches = {name: RecordBatch(codecs[name], rows) for name in ("state", "truth")}
    answers = {name: RecordBatch(codecs[name], rows + 1) for name in ("command", "internals")}
    plant, control = DriverNode(subject, codecs, batches, rows), ControllerNode(subject, codecs, answers, rows + 1)
    try:
        for tick in range(subject.ticks):
            plant.measure(tick)
            for name, batch in batches.items():
                getattr(passed, name).append(batch.message(tick % rows))
            if tick not in missed:
                row = control.answer(passed.state[-1])
                assert row == len(passed.command) % (rows + 1)
                for name, batch in answers.items():
                    getattr(passed, name).append(batch.message(row))
                commands[tick] = passed.command[-1]
            plant.advance(tick, newest(commands, tick - subject.actuation_delay))
    except Tripped as trip:
        passed.reason = str(trip)
    finally:
        plant.close()
    assert plant.truthful == bool(passed.truth)
    return passed


def newest(commands: dict[int, Any], wanted: int) -> Any:
    """Return the newest command that is not newer than `wanted`; None if there is none."""
    return next((commands[tick] for tick in reversed(commands) if tick <= wanted), None)


def codecs_of(subject: Trial) -> Any:
    robot = subject.driver.robot
    return layouts(robot.joints, len(subject.axes), memory_of(subject))


def compared(subject: Trial, missed: frozenset[int] = frozenset(), rows: int = 7) -> Passed:
    """Run a trial both ways, assert that the messages are the same, and return them."""
    expected, found = by_sides(subject, missed), by_halves(subject, missed, rows)
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
def test_the_sheets_may_have_any_number_of_rows(rows: int) -> None:
    assert len(compared(trial(controller=Pd()), rows=rows).command) == 200


@pytest.mark.parametrize("law", [Pd(), Numpy()])
def test_with_a_physics_engine_one_half_is_compiled(law: Any) -> None:
    assert len(compared(trial(PybulletArm(arm(), surface()), law)).command) == 200


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


class Counted(NamedTuple):
    """What the law below remembers."""

    count: Array


@kernel
def faulty_step(parameters: tuple[float, ...], memory: tuple[Array, ...], state: State, reference: Reference) -> Array:
    """Damp what moves, and at the 60th call do what the parameter says."""
    memory[0][0] += 1.0
    torque = -1.0 * state.joint_velocity
    if memory[0][0] == 60.0:
        if parameters[0] == 1.0:
            raise ValueError("no idea")
        torque *= np.nan
    return torque


@dataclass(frozen=True)
class Compiled:
    """A law whose kernel goes wrong at the 60th call."""

    fault: str

    def start(self, task: Task, state: State) -> Law:
        return Law(faulty_step, (float(self.fault == "raises"),), Counted(np.zeros(1)))


def test_a_law_that_raises_in_a_kernel_raises_here() -> None:
    with pytest.raises(ValueError, match="no idea"):
        by_halves(trial(controller=Compiled("raises")), frozenset())


def test_a_torque_of_another_shape_is_refused_alike() -> None:
    for run in (by_sides, by_halves):
        with pytest.raises(PluginError, match=r"step returned an array \(1,\); the robot takes torques \(2,\)"):
            run(trial(controller=Numpy("shape")), frozenset())


def calls(monkeypatch: pytest.MonkeyPatch, cls: type, name: str) -> list[int]:
    """Count the calls of a method of a class."""
    count, plain = [0], getattr(cls, name)

    def counted(self: Any, *values: Any) -> Any:
        count[0] += 1
        return plain(self, *values)

    monkeypatch.setattr(cls, name, counted)
    return count


@pytest.mark.parametrize(
    ("driver", "law", "measured", "answered"),
    [
        (TwoLink(arm(), surface()), Pd(), 1, 1), (TwoLink(arm(), surface()), Numpy(), 1, 200),
        (PybulletArm(arm(), surface()), Pd(), 200, 1),
    ],
)  # fmt: skip
def test_kernels_do_all_but_the_first_tick(
    monkeypatch: pytest.MonkeyPatch, driver: Any, law: Any, measured: int, answered: int
) -> None:
    """Where they are offered. What is compared above would be the same without them."""
    subject = trial(driver, law)
    codecs_of(subject)
    plant, control = calls(monkeypatch, PlantSide, "measure"), calls(monkeypatch, ControlSide, "control")
    monkeypatch.setattr("tests.unit.rig.test_nodes.memory_of", lambda subject: SIZES[type(law)])
    by_halves(subject, frozenset())
    assert (plant, control) == ([measured], [answered])


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
    warm_up_plant(subject, layouts(2, 2, {}))
    warm_up_control(subject)
    before = [kernel.signatures for kernel in made]
    assert sum(map(len, before)) > 0
    by_halves(subject, frozenset())
    assert [kernel.signatures for kernel in made] == before


SIZES = {Pd: memory_of(trial(controller=Pd())), Numpy: memory_of(trial(controller=Numpy()))}


@pytest.mark.parametrize("law", LAWS)
def test_to_warm_up_leaves_no_trace_in_the_trial(law: Any) -> None:
    subject = trial(controller=law, disturbances=(SensorNoise(force=0.05, joint=2e-5),))
    before = by_halves(subject, frozenset())
    warm_up_plant(subject, layouts(2, 2, {}))
    assert warm_up_control(subject) == memory_of(subject)
    assert by_halves(subject, frozenset()) == before


@pytest.mark.parametrize("ticks", [1, 2])
def test_a_trial_may_be_as_short_as_one_tick(ticks: int) -> None:
    phase = PhaseSpec("press", 0.0, ticks * 1e-3, {"x": Hold(0.1)}, {"z": Hold(3.5)})
    subject = trial(controller=Pd(), phases=(phase,))
    assert subject.ticks == ticks
    warm_up_plant(subject, layouts(2, 2, {}))
    warm_up_control(subject)
    assert len(compared(subject).command) == ticks


def test_a_trial_that_trips_at_once_warms_up_all_the_same() -> None:
    subject = trial(controller=Pd(), limits=Limits(tip_force=1.0), start_position=(0.1, 0.36))
    warm_up_plant(subject, layouts(2, 2, {}))
