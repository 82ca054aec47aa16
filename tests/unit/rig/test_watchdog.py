"""The watchdogs: on the age of the command and of the sample, and on a loop that does not come round."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import pytest
from helpers.builders import PERIOD, trial
from helpers.patience import wait_for
from hypothesis import given
from hypothesis import strategies as st

from hilrig.core.errors import Tripped
from hilrig.experiment.trial import Limits
from hilrig.rig.watchdog import CommandAge, Watchdog

MS = 1_000_000
BEGAN = 5_000_000_000


def ages(**limits: Any) -> CommandAge:
    return CommandAge(replace(trial(), limits=replace(Limits(), **limits)))


def tripped_at(age: CommandAge, silent_from: int, ticks: int, fresh: bool = True) -> int | None:
    """Answer every tick at the next one until `silent_from`; return the tick at which the watchdog trips."""
    for tick in range(ticks):
        now = BEGAN + tick * MS
        try:
            age.begin(tick, 0, now)
            age.check(tick, min(tick, silent_from) - 1, now, fresh or tick < silent_from)
        except Tripped:
            return tick
    return None


@given(st.integers(0, 3000), st.floats(2e-3, 3.0))
def test_a_command_older_than_the_limit_trips_within_a_period(silent_from: int, limit: float) -> None:
    """However long the limit is, and whenever the controller falls silent."""
    found = tripped_at(ages(command_age=limit), silent_from, 7000)
    last = max(silent_from - 1, 0)
    assert found is not None
    assert limit < (found - last) * PERIOD + 1e-9
    assert (found - last - 1) * PERIOD <= limit + 1e-9


def test_a_controller_that_answers_never_trips() -> None:
    assert tripped_at(ages(), 10_000, 5000) is None


def test_the_limit_is_20_ms_or_five_periods_with_a_delay_of_one() -> None:
    assert (Limits().command_age_limit(1e-3, 1), Limits().command_age_limit(10e-3, 1)) == (0.02, 0.05)
    assert Limits().command_age_limit(10e-3, 6) == pytest.approx(0.1)
    assert Limits(command_age=0.5).sample_age_limit(1e-3, 1) == 0.5


def test_a_plant_without_new_samples_trips_by_name() -> None:
    age = ages(sample_age=0.03, command_age=1.0)
    assert tripped_at(age, 10, 9) is None
    for tick in range(9, 40):
        age.begin(tick, 0, BEGAN + tick * MS)
        age.check(tick, tick - 1, BEGAN + tick * MS, tick < 10)
    with pytest.raises(Tripped, match=r"no new sample for 0\.031 s at t = 0\.04 s \(tick 40\), over .* of 0\.03 s"):
        age.check(40, 39, BEGAN + 40 * MS, False)


def test_a_standstill_trips_and_says_how_long_it_was() -> None:
    age = ages()
    age.begin(0, 0, BEGAN)
    age.begin(21, 20, BEGAN + 21 * MS)
    with pytest.raises(
        Tripped, match=r"stood still for 5\.02 s before t = 5\.042 s \(tick 5042\): longer than .* 0\.02 s"
    ):
        age.begin(5042, 5020, BEGAN + 5042 * MS)


class Node:
    """A driver node that can be held, and whose plant may be at work."""

    def __init__(self) -> None:
        self.busy, self.held = False, 0

    def hold(self) -> None:
        self.held += 1


def test_a_loop_that_does_not_come_round_is_held_once_and_told() -> None:
    node: Any = Node()
    told: list[str] = []
    dog = Watchdog(node, 0.05, told.append)
    dog.start()
    for _ in range(20):
        dog.stroke(time.monotonic_ns())
        time.sleep(0.002)
    wait_for(lambda: bool(told))
    time.sleep(0.1)
    assert (node.held, told) == (1, [dog.why()])
    assert "did not come round for" in dog.why()


def test_a_plant_that_is_at_work_is_not_called_from_beside() -> None:
    node: Any = Node()
    node.busy = True
    dog = Watchdog(node, 0.01, lambda why: None)
    dog.start()
    time.sleep(0.2)
    assert node.held == 0
    node.busy = False
    wait_for(lambda: node.held == 1)


def test_a_watchdog_that_was_stopped_holds_nothing() -> None:
    node: Any = Node()
    dog = Watchdog(node, 0.01, lambda why: None)
    dog.start()
    dog.stop()
    time.sleep(0.2)
    assert node.held == 0
