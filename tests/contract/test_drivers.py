"""What every simulated driver keeps to. (A real one is held to it by its own tests: here nothing moves.)"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from helpers.builders import PERIOD, STILL, example, surface, torque_command, true_state

from hilrig.core.interfaces import Driver, Plant, TrialStart
from hilrig.core.signals import Command, DisturbanceSchedule, PlantDisturbance
from hilrig.kinds.actuation import Actuation
from hilrig.kinds.registry import dump, kinds, load, restore

SIMULATED = [kind for kind in kinds("drivers") if load("drivers", kind).capabilities.simulated]
SERVO = Actuation("position_servo", stiffness=60.0)
Begun = Callable[..., Plant]


def driver(kind: str, **known: Any) -> Driver:
    plain = {"surface": surface(friction=0.3), "coulomb": (0.05, 0.05), "viscous": (0.02, 0.02)}
    return example(load("drivers", kind), **{**plain, **known})


@pytest.fixture(params=SIMULATED)
def kind(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def start() -> Iterator[Begun]:
    """Begin plants 5 mm deep in the surface, and close them after the test."""
    begun: list[Plant] = []

    def begin(subject: Driver) -> Plant:
        q = subject.robot.inverse_kinematics(np.array([0.1, subject.surface_position + 0.005]))
        begun.append(subject.begin(TrialStart(PERIOD, q)))
        begun[-1].measure(STILL)
        return begun[-1]

    yield begin
    for plant in begun:
        plant.close()


def test_there_is_a_simulated_driver() -> None:
    assert SIMULATED


def test_abilities_are_of_the_known_words(kind: str) -> None:
    capabilities = load("drivers", kind).capabilities
    assert set(capabilities.clocks) <= {"lockstep", "realtime"}
    assert capabilities.clocks
    assert set(capabilities.disturbances) <= {name for name in DisturbanceSchedule._fields if name.startswith("plant_")}


def test_measuring_changes_nothing(kind: str, start: Begun) -> None:
    plant = start(driver(kind))
    plant.advance(torque_command((1.0, -1.0)), STILL)
    first, true, second = plant.measure(STILL), true_state(plant), plant.measure(STILL)
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a, b)
    for a, b in zip(true, true_state(plant), strict=True):
        np.testing.assert_array_equal(a, b)


def test_what_was_measured_stays_as_it_was(kind: str, start: Begun) -> None:
    """A measurement is handed on and kept: the plant must not write into it later."""
    plant = start(driver(kind))
    seen, true = plant.measure(STILL), true_state(plant)
    copies = [np.copy(part) for part in (*seen, *true)]
    for _ in range(5):
        plant.advance(torque_command((3.0, 1.0)), STILL)
    for part, copy in zip((*seen, *true), copies, strict=True):
        np.testing.assert_array_equal(part, copy)


@pytest.mark.parametrize("actuation", [Actuation(), SERVO], ids=["torque", "servo"])
def test_hold_keeps_the_arm_still(kind: str, start: Begun, actuation: Actuation) -> None:
    plant = start(driver(kind, actuation=actuation))
    hold, before = plant.hold(), plant.measure(STILL)
    for _ in range(100):
        plant.advance(hold, STILL)
    np.testing.assert_allclose(plant.measure(STILL).joint_position, before.joint_position, atol=1e-6)
    np.testing.assert_allclose(plant.measure(STILL).applied_torque, before.applied_torque, atol=1e-4)


@pytest.mark.parametrize("actuation", [Actuation(), SERVO], ids=["torque", "servo"])
def test_commands_are_not_written_to(kind: str, start: Begun, actuation: Actuation) -> None:
    plant = start(driver(kind, actuation=actuation))
    command = Command(np.array([1.0, 2.0]), np.array([0.3, 0.4]))
    plant.advance(command, STILL)
    np.testing.assert_array_equal(command.torque, [1.0, 2.0])
    np.testing.assert_array_equal(command.position, [0.3, 0.4])


@pytest.mark.parametrize(
    ("actuation", "expected"), [(Actuation(), (1.5, -0.5)), (SERVO, (6.0, -3.0))], ids=["torque", "servo"]
)
def test_applied_torque_is_what_the_motors_gave(
    kind: str, start: Begun, actuation: Actuation, expected: tuple[float, float]
) -> None:
    """A servo of 60 N m/rad is 0.1 and -0.05 rad from where it is told to be, at rest, in a period of one step."""
    plant = start(driver(kind, actuation=actuation, substep=PERIOD))
    q = plant.measure(STILL).joint_position
    plant.advance(torque_command((1.5, -0.5), q + np.array([0.1, -0.05])), STILL)
    np.testing.assert_allclose(plant.measure(STILL).applied_torque, expected, rtol=1e-12)


PUSHED = STILL._replace(tip_force=np.array([2.0, 3.0]), surface_offset=-0.002)


@pytest.mark.parametrize("nudge", [STILL, PUSHED], ids=["still", "pushed"])
def test_the_truth_agrees_with_the_measurement(kind: str, start: Begun, nudge: PlantDisturbance) -> None:
    subject = driver(kind)
    plant = start(subject)
    for _ in range(20):
        plant.advance(torque_command((4.0, 0.5)), nudge)
        seen, true = plant.measure(nudge), true_state(plant, nudge)
        np.testing.assert_array_equal(seen.joint_position, true.joint_position)
        np.testing.assert_array_equal(seen.wrench, true.wrench)
        at = subject.robot.kinematics(true.joint_position, true.joint_velocity)
        np.testing.assert_allclose(true.position, at.position, atol=1e-12)
        np.testing.assert_allclose(true.velocity, at.velocity, atol=1e-12)
    assert true.surface_position == pytest.approx(subject.surface_position + nudge.surface_offset)
    assert seen.wrench.shape == (6,)
    assert np.abs(true.joint_velocity).max() > 1e-3, "it moved"


def disturbed(name: str) -> PlantDisturbance:
    """Return a nudge in which only the plant input `name` is not neutral."""
    field = name.removeprefix("plant_")
    value = {"tip_force": np.array([2.0, 3.0]), "surface_offset": -0.002, "surface_velocity": -0.05}.get(field, 3.0)
    return STILL._replace(**{field: value})


def pushed(subject: Driver, plant: Plant, nudge: PlantDisturbance) -> np.ndarray:
    """Return how far the tip comes (x, z) in a push of 4 N along the surface under a disturbance, m."""
    hold, start = plant.hold().torque, true_state(plant)
    push = subject.robot.kinematics(start.joint_position, np.zeros(2)).jacobian[0] * 4.0
    for _ in range(60):
        plant.advance(torque_command(hold + push), nudge)
    return true_state(plant).position - start.position


def test_every_declared_disturbance_moves_the_arm_its_way(kind: str, start: Begun) -> None:
    """Tip force and surface push the arm away, so does a stiffer surface; more friction leaves it less far along x."""
    subject = driver(kind)
    plain = pushed(subject, start(subject), STILL)
    assert plain[0] > 1e-3, "there is a way along the surface to rub"
    for name in subject.capabilities.disturbances:
        nudge = disturbed(name)
        moved = pushed(subject, start(subject), nudge) - plain
        against = nudge.tip_force if name == "plant_tip_force" else np.array([0.0, 1.0])
        if name.endswith("friction_scale"):
            against = np.array([1.0, 0.0])
        assert moved @ against < -1e-5, f"{name} moves it by {moved} m"


def test_the_same_commands_give_the_same_bits(kind: str, start: Begun) -> None:
    subject = driver(kind)
    once, again = (pushed(subject, start(subject), STILL) for _ in range(2))
    np.testing.assert_array_equal(once, again)


def test_an_external_force_is_felt_by_the_sensor(kind: str, start: Begun) -> None:
    plant = start(driver(kind))
    difference = plant.measure(disturbed("plant_tip_force")).wrench - plant.measure(STILL).wrench
    np.testing.assert_allclose(difference, [2.0, 0.0, 3.0, 0.0, 0.0, 0.0], atol=1e-12)


def test_servo_gain_is_that_of_its_actuation(kind: str) -> None:
    assert driver(kind, actuation=Actuation()).servo_gain is None
    assert driver(kind, actuation=SERVO).servo_gain == SERVO.k_ref


def test_it_survives_being_written_down(kind: str) -> None:
    """Its processes are started from the document in the plan."""
    subject = driver(kind)
    assert restore("drivers", dump(subject)) == subject
