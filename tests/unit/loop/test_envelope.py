"""The envelope of commands: what a plant receives is within it, whatever is commanded, and the record says why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
from helpers.builders import arm, surface, trial
from helpers.in_memory import Nodes
from hilrig_drivers.two_link import TwoLink
from hypothesis import given
from hypothesis import strategies as st

from hilrig.core.errors import Tripped
from hilrig.core.interfaces import Capabilities, Robot, TrialStart
from hilrig.core.signals import Array, Command, Measurement, PlantDisturbance
from hilrig.experiment.limits import Limits
from hilrig.experiment.trial import PhaseSpec
from hilrig.kinds.actuation import Actuation
from hilrig.kinds.references.hold import Hold
from hilrig.loop.envelope import Limited, bound_torque, why_bounded

TICKS = 1000
TORQUE, RATE = np.array([5.0, 2.0]), np.array([400.0, 90.0])
LOW, HIGH, SPEED = np.array([-1.0, -0.5]), np.array([1.0, 2.0]), np.array([3.0, 8.0])
LIMITS = Limits(torque=(5.0, 2.0), torque_rate=(400.0, 90.0), position_rate=(3.0, 8.0), joint_margin=0.5)
REST = Command(np.array([0.1, 0.2]), np.array([0.3, 0.4]))
"""What the plant below is held by"""


@dataclass
class Receiving:
    """A plant that is not simulated, and keeps what it receives."""

    q: Array
    received: list[Command]

    stamp: float = np.nan
    fresh: bool = True

    def measure(self, disturbance: PlantDisturbance) -> Measurement:
        return Measurement(self.q.copy(), np.zeros(6), np.zeros(2), self.stamp, self.fresh)

    def advance(self, command: Command, disturbance: PlantDisturbance) -> None:
        self.received.append(command)

    def holding_command(self) -> Command:
        return REST

    def truth(self, disturbance: PlantDisturbance) -> None:
        return None

    def hold(self) -> None:
        pass

    def close(self) -> None:
        pass


@dataclass(frozen=True)
class ReceivingDriver:
    """Its driver: a position servo."""

    capabilities: ClassVar[Capabilities] = Capabilities(("realtime",), (), simulated=False)
    servo_gain: ClassVar[float] = 100.0
    surface_position: ClassVar[float] = 0.35
    robot: Robot
    received: list[Command]

    def connect(self, start: TrialStart) -> Receiving:
        return Receiving(start.joint_position, self.received)


def receiving(limits: Limits = LIMITS) -> tuple[Nodes, list[Command]]:
    """Return the nodes of a trial, and where the commands arrive."""
    robot = arm(joint_lower=tuple(LOW - 0.5), joint_upper=tuple(HIGH + 0.5))
    received: list[Command] = []
    phase = PhaseSpec("press", 0.0, TICKS * 1e-3, {"x": Hold(0.1)}, {"z": Hold(3.5)})
    subject = trial(ReceivingDriver(robot, received), limits=limits, clock="realtime", phases=(phase,))
    nodes = Nodes(subject, TICKS, {})
    nodes.driver.plant.q[:] = 0.3, 0.4  # type: ignore[attr-defined]
    return nodes, received


def give(nodes: Nodes, tick: int, torque: Any, position: Any) -> str:
    """Do a tick under this command; return why it ended the trial, empty if it did not."""
    nodes.driver.measure(tick)
    acting = nodes.heard_command.acting
    acting.torque[:], acting.position[:] = torque, position
    try:
        nodes.driver.advance()
    except Tripped as trip:
        return str(trip)
    return ""


def truth(asked: Array, last: Array, step: Array, low: Array, high: Array, bits: tuple[int, int]) -> tuple[Array, int]:
    """Return the value nearest to `asked` within `step` of `last`, then `low` to `high`, and what was changed."""
    near = np.clip(asked, last - step, last + step)
    found = np.clip(near, low, high)
    rate, size = bits
    return found, rate * bool((np.abs(asked - last) > step).any()) | size * bool((found != near).any())


def test_of_100_000_random_commands_none_outside_the_envelope_reaches_the_plant() -> None:
    """Jumps over eighteen decades, infinities and what is not a number; the record has each change and its reason."""
    random, (nodes, received) = np.random.default_rng(11), receiving()
    last, refused, changed = REST, 0, 0
    for k in range(100_000):
        if (tick := k % TICKS) == 0:
            nodes.driver._rows.changed[0] = 0  # type: ignore[union-attr]
        asked = random.standard_normal((2, 2)) * 10.0 ** random.uniform(-9, 9)
        if random.random() < 0.1:
            asked[random.integers(2), random.integers(2)] = random.choice([np.nan, np.inf, -np.inf])
        before, row = len(received), int(nodes.driver._rows.changed[0])  # type: ignore[union-attr]
        why = give(nodes, tick, *asked)
        if not np.isfinite(asked).all():
            refused += 1
            assert why.startswith(f"the command at t = {tick * 1e-3:.4g} s (tick {tick}) is not finite: torque [")
            assert len(received) == before
            continue
        assert (why, len(received)) == ("", before + 1)
        got = received[-1]
        torque, one = truth(asked[0], last.torque, RATE * 1e-3, -TORQUE, TORQUE, (Limited.TORQUE_RATE, Limited.TORQUE))
        position, other = truth(
            asked[1], last.position, SPEED * 1e-3, LOW, HIGH, (Limited.POSITION_RATE, Limited.POSITION)
        )
        np.testing.assert_array_equal(got, [torque, position])
        assert (np.abs(got.torque) <= TORQUE).all()
        assert ((got.position >= LOW) & (got.position <= HIGH)).all()
        limited = int(one | other)
        changed += bool(limited)
        assert nodes.driver._rows.changed[0] == row + bool(limited)  # type: ignore[union-attr]
        if limited:
            message = nodes.values("applied", nodes.batches["applied"].message(row))
            assert (message["tick"], message["limited"]) == (tick, limited)
            np.testing.assert_array_equal([message["torque"], message["position"]], got)
        last = got
    assert refused > 5_000
    assert changed > 10_000


numbers = st.one_of(st.floats(), st.floats(-10, 10))
pairs = st.tuples(numbers, numbers)


@given(commands=st.lists(st.tuples(pairs, pairs), min_size=1, max_size=30))
def test_what_is_received_is_finite_and_within_every_limit(commands: list[Any]) -> None:
    nodes, received = receiving()
    for tick, (torque, position) in enumerate(commands):
        give(nodes, tick, torque, position)
    torques = np.array([REST.torque, *(command.torque for command in received)])
    positions = np.array([REST.position, *(command.position for command in received)])
    assert np.isfinite(torques).all()
    assert (np.abs(torques) <= TORQUE).all()
    assert (np.abs(np.diff(torques, axis=0)) <= RATE * 1e-3 * (1 + 1e-12)).all()
    assert ((positions >= LOW) & (positions <= HIGH)).all()
    assert (np.abs(np.diff(positions, axis=0)) <= SPEED * 1e-3 * (1 + 1e-12)).all()


@given(asked=pairs, last=st.tuples(st.floats(-5, 5), st.floats(-2, 2)))
def test_a_torque_within_its_limits_is_kept(asked: tuple[float, float], last: tuple[float, float]) -> None:
    """And where nothing limits its rate, each joint's is the nearest within its limit."""
    torque, wanted = np.array(last), np.array(asked)
    bits = bound_torque(torque, wanted, np.array([-TORQUE, TORQUE, np.full(2, np.inf)]))
    if np.isfinite(wanted).all():
        np.testing.assert_array_equal(torque, np.clip(wanted, -TORQUE, TORQUE))
        assert bits == (Limited.TORQUE if (np.abs(wanted) > TORQUE).any() else 0)
    else:
        np.testing.assert_array_equal(torque, last)
        assert bits == Limited.NOT_FINITE


@pytest.mark.parametrize(
    ("name", "torque", "position"),
    [
        ("torque", (5.01, 0.2), (0.3, 0.4)),
        ("torque_rate", (0.6, 0.2), (0.3, 0.4)),
        ("position", (0.1, 0.2), (1.01, 0.4)),
        ("position_rate", (0.1, 0.2), (0.3, 0.41)),
    ],
)
def test_a_limit_on_commands_may_end_the_trial(name: str, torque: Any, position: Any) -> None:
    """It names the limit and the setting; the plant has not received the command."""
    free = {"torque_rate": None, "position_rate": None} | {name: getattr(LIMITS, name, None) for name in [name]}
    values = {key: value for key, value in free.items() if key != "position"}
    limits = Limits(**{"torque": (5.0, 2.0), "joint_margin": 0.5, "trip_on": (name,), **values})
    nodes, received = receiving(limits)
    why = give(nodes, 0, torque, position)
    word = {"position": "joint position", "position_rate": "joint position rate"}.get(name, name.replace("_", " "))
    assert why.startswith(f"the command at t = 0 s (tick 0) is beyond its limit of {word} (safety.trip_on: {name}): ")
    assert received == []


def test_all_that_is_beyond_its_limit_is_named() -> None:
    bits = int(Limited.TORQUE | Limited.POSITION_RATE)
    why = why_bounded(bits, 1500, 1e-3, Command(np.array([500.0, 0.0]), np.zeros(2)), Limits(trip_on=("torque",)))
    assert why == (
        "the command at t = 1.5 s (tick 1500) is beyond its limit of torque, joint position rate (safety.trip_on: "
        "torque): torque [500.   0.] N m, position [0. 0.] rad"
    )


def test_a_simulated_plant_receives_what_is_within_too() -> None:
    """500 N m, by whoever sends it: its joints take 200 at most."""
    nodes = Nodes(trial(TwoLink(arm(), surface(), Actuation("torque"))))
    give(nodes, 0, (500.0, -0.5), (0.0, 0.0))
    np.testing.assert_array_equal(nodes.driver.arrays.applied.torque, [200.0, -0.5])


@pytest.mark.parametrize("end", ["lowest", "highest"])
def test_a_joint_beyond_its_range_ends_the_trial(end: str) -> None:
    nodes, received = receiving()
    q, limit = (-1.01, -1.0) if end == "lowest" else (1.01, 1.0)
    nodes.driver.plant.q[0] = limit  # type: ignore[attr-defined]
    assert give(nodes, 0, REST.torque, REST.position) == ""
    nodes.driver.plant.q[0] = q  # type: ignore[attr-defined]
    with pytest.raises(Tripped) as trip:
        nodes.driver.measure(1)
    assert str(trip.value) == f"joint 1 is at {q:g} rad at t = 0.001 s (tick 1), outside its range of -1 to 1 rad"
    assert len(received) == 1


def test_a_tip_beyond_the_workspace_ends_the_trial() -> None:
    """Where the tip is known: the arm starts at x = 0.1 m."""
    within = Nodes(trial(limits=Limits(workspace={"x": (0.0, 0.11)})))
    within.driver.measure(0)
    nodes = Nodes(trial(limits=Limits(workspace={"x": (0.101, 0.2)})))
    with pytest.raises(
        Tripped, match=r"the tip is at 0\.1 m along axis 1 at t = 0 s \(tick 0\), outside 0\.101 to 0\.2 m"
    ):
        nodes.driver.measure(0)


@pytest.mark.parametrize("stamped", [False, True])
@pytest.mark.parametrize(("step", "trips"), [(0.0039, False), (0.0041, True)])
def test_a_velocity_is_that_between_two_fresh_samples(stamped: bool, step: float, trips: bool) -> None:
    """One was lost, so a joint has two periods for its step: 2 rad/s are 4 mrad."""
    nodes, _ = receiving(Limits(joint_velocity=2.0))
    plant: Any = nodes.driver.plant
    for tick, (moved, fresh) in enumerate([(0.0, True), (0.0, False), (step, True)]):
        plant.q[0], plant.fresh = 0.3 + moved, fresh
        plant.stamp = 70.0 + (tick - (not fresh)) * 1e-3 if stamped else np.nan
        if tick == 2 and trips:
            with pytest.raises(Tripped, match=r"joint velocity 2\.05 rad/s"):
                nodes.driver.measure(tick)
        else:
            assert give(nodes, tick, REST.torque, REST.position) == ""
