"""The bridge without a process: who has the robot, what reaches it, and when it is held. Time is a number here."""

from __future__ import annotations

import ast
import math
import struct
from pathlib import Path
from typing import Any

import pytest
import vermin
from hilrig_drivers import bridge
from hilrig_drivers.bridge import (
    ALIVE,
    ATTACH,
    DETACH,
    END,
    FOLLOWING,
    HELD,
    HOLD,
    MOVE,
    REFUSED,
    TRIPPED,
    UNHELD,
    Bridge,
    Order,
    Sample,
    pack_order,
    pack_sample,
    unpack_order,
    unpack_sample,
    why_beyond,
)
from hypothesis import given
from hypothesis import strategies as st

AGE = 0.1
NUMBERS = st.floats(allow_nan=True, allow_infinity=True)
WORDS32 = st.integers(0, 2**32 - 1)


class Arm:
    """Two joints that note what they are told."""

    joints, period = 2, 0.01
    lowest, highest, fastest = (-2.0, -1.0), (2.0, 1.0), (1.0, 2.0)

    def __init__(self) -> None:
        self.told: list[object] = []
        self.why = ""
        self.broken = False

    def move(self, q: list[float]) -> None:
        self.told.append(tuple(q))
        if self.broken:
            raise OSError("unplugged")

    def hold(self) -> None:
        self.told.append("hold")
        if self.broken:
            raise OSError("unplugged")

    def trouble(self) -> str:
        return self.why


class Talk:
    """A bridge, and a driver that talks to it at a time of its choice."""

    def __init__(self) -> None:
        self.arm = Arm()
        self.bridge = Bridge(self.arm, AGE, AGE)
        self.now, self.number = 100.0, 0
        self.see()

    def see(self, q: tuple[float, float] = (0.0, 0.0)) -> None:
        self.bridge.sample((self.now, q, [0.0] * 6, [0.0, 0.0]), self.now)

    def say(self, what: int, position=(0.0, 0.0), session: int = 7, answers: int | None = None) -> Sample | None:
        self.number += 1
        newest = self.bridge.number if answers is None else answers
        order = Order(session, self.number, newest, what, len(position), tuple(position))
        answer = self.bridge.take(unpack_order(pack_order(order)), self.now)
        return unpack_sample(answer) if answer else None

    def pass_(self, seconds: float) -> None:
        self.now += seconds
        self.bridge.look(self.now)


@pytest.fixture
def talk() -> Talk:
    talk = Talk()
    talk.say(ATTACH)
    return talk


def test_a_move_is_followed_and_a_hold_ends_it(talk: Talk) -> None:
    talk.say(MOVE, (0.005, 0.01))
    assert talk.bridge.state == FOLLOWING
    answer = talk.say(HOLD)
    assert answer is not None
    assert (answer.state, answer.done) == (HELD, talk.number)
    talk.say(HOLD)
    assert talk.arm.told == [(0.005, 0.01), "hold"]


@pytest.mark.parametrize("step", [AGE / 7, AGE / 2, AGE * 0.99])
def test_without_orders_it_holds_when_the_age_is_over_and_not_before(talk: Talk, step: float) -> None:
    talk.say(MOVE)
    talk.pass_(step)
    assert talk.bridge.state == FOLLOWING
    assert talk.bridge.due(talk.now) <= max(AGE - step, 0) + 1e-3
    talk.see()
    talk.pass_(AGE - step + 1e-6)
    assert talk.bridge.state == TRIPPED
    assert talk.bridge.text.startswith("no order for 0.1 s")
    assert talk.arm.told[-1] == "hold"
    # It stays held, whatever is said in this session; a new one has it again.
    assert talk.say(MOVE) is None
    answer = talk.say(HOLD)
    assert answer is not None
    assert answer.state == TRIPPED
    assert talk.arm.told[-1] == "hold"
    assert talk.bridge.state == TRIPPED
    talk.pass_(2 * AGE)
    other = talk.say(ATTACH, session=8)
    assert other is not None
    assert (other.session, other.state, other.text) == (8, HELD, "")


def test_an_order_that_was_on_its_way_for_long_does_not_count(talk: Talk) -> None:
    old = talk.bridge.number
    talk.say(MOVE)
    for _ in range(12):
        talk.pass_(0.01)
        talk.see()
        talk.say(MOVE, answers=old)
    assert talk.bridge.state == TRIPPED
    assert talk.bridge.text.startswith("no order for")
    assert talk.bridge.refused >= 1


def test_orders_that_answer_a_sample_which_never_was(talk: Talk) -> None:
    talk.say(MOVE, answers=10**6)
    talk.say(MOVE, answers=0)
    assert (talk.bridge.state, talk.bridge.refused, talk.arm.told) == (HELD, 2, [])


def test_without_samples_it_holds_and_names_them(talk: Talk) -> None:
    talk.say(MOVE)
    talk.pass_(AGE + 1e-6)
    assert talk.bridge.text.startswith("no sample of the robot for")


@pytest.mark.parametrize(
    ("position", "words"),
    [
        ((math.nan, 0.0), "joint 1 was asked for nan"),
        ((0.0, math.inf), "joint 2 was asked for inf"),
        ((0.0, 1.1), "joint 2 was asked for 1.1 rad, beyond -1 to 1 rad"),
        ((0.5, 0.0), "joint 1 was asked for a step of 0.5 rad in 0.01 s, over 1 rad/s"),
    ],
)
def test_what_is_beyond_the_limits_holds_it(talk: Talk, position: tuple[float, float], words: str) -> None:
    talk.say(MOVE)
    talk.say(MOVE, position)
    assert (talk.bridge.state, talk.bridge.text) == (TRIPPED, words)
    assert talk.arm.told == [(0.0, 0.0), "hold"]


@given(
    asked=st.lists(NUMBERS, min_size=2, max_size=2), last=st.lists(st.floats(-1, 1), min_size=2, max_size=2),
    elapsed=st.floats(1e-3, 0.1),
)  # fmt: skip
def test_the_envelope_lets_through_what_is_within_and_nothing_else(
    asked: list[float], last: list[float], elapsed: float
) -> None:
    inside = all(
        math.isfinite(q)
        and low - 1e-9 <= q <= high + 1e-9
        and last[j] - rate * elapsed - 1e-9 <= q <= last[j] + rate * elapsed + 1e-9
        for j, (q, low, high, rate) in enumerate(zip(asked, Arm.lowest, Arm.highest, Arm.fastest, strict=True))
    )
    why = why_beyond(asked, last, elapsed, Arm.lowest, Arm.highest, Arm.fastest)
    steps = [abs(q - last[j]) - Arm.fastest[j] * elapsed for j, q in enumerate(asked)]
    edge = any(abs(excess) < 1e-8 for excess in steps)
    assert edge or (why == "") == inside


def test_other_programs_are_refused_until_the_driver_is_gone(talk: Talk) -> None:
    answer = talk.say(ATTACH, session=8)
    assert answer is not None
    assert (answer.session, answer.state, answer.text) == (8, REFUSED, "another program has the robot")
    assert talk.say(MOVE, (0.001, 0.0), session=8) is None
    for _ in range(20):  # it says now and then that it is there, while the robot is held
        talk.pass_(AGE / 2)
        talk.say(ALIVE)
    answer = talk.say(ATTACH, session=8)
    assert answer is not None
    assert answer.state == REFUSED
    talk.pass_(1.1 * AGE)
    answer = talk.say(ATTACH, session=8)
    assert answer is not None
    assert answer.state == HELD
    assert talk.arm.told == []


def test_that_somebody_is_there_does_not_let_the_robot_follow(talk: Talk) -> None:
    talk.say(MOVE)
    for _ in range(12):
        talk.pass_(0.01)
        talk.see()
        talk.say(ALIVE)
    assert talk.bridge.state == TRIPPED


@given(st.binary(max_size=200))
def test_whatever_comes_is_counted_and_does_nothing(data: bytes) -> None:
    talk = Talk()
    talk.say(ATTACH)
    before = talk.bridge.refused
    assert talk.bridge.take(unpack_order(data), talk.now) == b""
    assert (talk.bridge.refused, talk.bridge.state, talk.arm.told) == (before + 1, HELD, [])


@given(WORDS32, WORDS32, st.integers(0, 9), st.lists(NUMBERS, min_size=1, max_size=7))
def test_an_order_and_a_sample_pass_the_wire(number: int, answers: int, what: int, values: list[float]) -> None:
    order = Order(2**63, number, answers, what, len(values), tuple(values))
    assert repr(unpack_order(pack_order(order))) == repr(order)
    assert unpack_order(pack_order(order) + b"x") is None
    assert unpack_order(pack_order(order)[:-1]) is None
    n = len(values)
    sample = Sample(9, number, answers, what, 3, 4, n, 0.5, tuple(values), (1.0,) * 6, (2.0,) * n, "why")
    assert repr(unpack_sample(pack_sample(sample))) == repr(sample)
    assert unpack_sample(pack_sample(sample)[:-1]) is None


def test_an_order_is_done_once(talk: Talk) -> None:
    order = pack_order(Order(7, talk.number + 1, talk.bridge.number, MOVE, 2, (0.001, 0.0)))
    for _ in range(3):
        talk.bridge.take(unpack_order(order), talk.now)
    assert talk.arm.told == [(0.001, 0.0)]
    assert talk.bridge.refused == 2


def test_where_all_samples_were_answered_it_is_the_samples_that_are_missing() -> None:
    talk = Talk()
    talk.bridge.sample_age = 10 * AGE
    talk.say(ATTACH)
    talk.say(MOVE)
    talk.pass_(AGE + 1e-6)
    assert talk.bridge.text.startswith("no sample of the robot for 0.1 s")


def test_the_robots_own_trouble_holds_it_and_refuses_it(talk: Talk) -> None:
    talk.say(MOVE)
    talk.arm.why = "the runstop is pressed"
    talk.pass_(0.01)
    assert (talk.bridge.state, talk.bridge.text) == (TRIPPED, "the runstop is pressed")
    talk.say(DETACH)
    answer = talk.say(ATTACH, session=8)
    assert answer is not None
    assert (answer.state, answer.text) == (REFUSED, "the runstop is pressed")


def test_a_hold_that_fails_is_tried_again_and_told(talk: Talk) -> None:
    talk.say(MOVE)
    talk.arm.broken = True
    answer = talk.say(HOLD)
    assert answer is not None
    assert (answer.state, answer.text) == (UNHELD, "hold raised OSError: unplugged: look at the arm")
    assert talk.bridge.rest() == answer.text
    talk.pass_(0.05)
    talk.arm.broken = False
    talk.pass_(0.05)
    talk.pass_(0.05)
    assert talk.arm.told == [(0.0, 0.0), *["hold"] * 4]
    assert talk.bridge.rest() == ""


def test_a_move_that_fails_holds_it(talk: Talk) -> None:
    talk.arm.broken = True
    talk.say(MOVE)
    assert talk.bridge.state == TRIPPED
    assert "unplugged" in talk.bridge.text
    assert talk.arm.told == [(0.0, 0.0), "hold"], "it may have begun to move"


@pytest.mark.parametrize(
    "sample",
    [
        (0.0, (math.nan, 0.0), [0.0] * 6, [0.0, 0.0]),
        (0.0, (0.0,), [0.0] * 6, [0.0, 0.0]),
        (0.0, (0.0, "x"), [0.0] * 6, [0.0, 0.0]),
        (0.0, (0.0, 0.0), [0.0] * 6),
        (None, (0.0, 0.0), [0.0] * 6, [0.0, 0.0]),
        "sample",
        7,
    ],
)
def test_a_sample_that_is_none(talk: Talk, sample: Any) -> None:
    talk.say(MOVE)
    number = talk.bridge.number
    talk.bridge.sample(sample, talk.now)
    assert talk.bridge.state == TRIPPED
    assert talk.bridge.number == number


def test_the_end_is_told_and_refuses_others(talk: Talk) -> None:
    talk.say(END)
    assert talk.bridge.ending
    assert not talk.bridge.attached(talk.now)
    answer = talk.say(ATTACH, session=8)
    assert answer is not None
    assert (answer.state, answer.text) == (REFUSED, "the bridge is about to end")


def test_the_tables_of_bytes_in_the_guide() -> None:
    """The sizes that docs/drivers.md states."""
    guide = (Path(__file__).parents[3] / "docs" / "drivers.md").read_text()
    order, sample = struct.calcsize(bridge._ORDER), struct.calcsize(bridge._SAMPLE)
    assert f"| order, {order} + 8 n bytes |" in guide
    assert f"| sample, {sample} + 8 (2 n + 6) + {bridge.TEXT} bytes |" in guide


def test_it_runs_on_python_3_8() -> None:
    """The robot's machine has an old interpreter. vermin names what is too new, in the grammar and in the library."""
    source = Path(bridge.__file__).read_text()
    ast.parse(source, feature_version=(3, 8))
    _, newest = vermin.detect(source)
    assert newest <= (3, 8)
