"""The certificate's parts against closed cases: the table, durations, late ticks, causes, the budget, histograms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from helpers.loop_simulation import Loop, Stall
from hypothesis import given
from hypothesis import strategies as st

from hilrig.experiment.timing_budget import TimingBudget
from hilrig.recording.certificate.attribution import attribute
from hilrig.recording.certificate.budget import violations
from hilrig.recording.certificate.causes import CAUSES, CONTROLLER, TRANSPORT, any_between
from hilrig.recording.certificate.durations import Terms, command_age, durations, late_ticks
from hilrig.recording.certificate.histogram import histogram, lower_edges, quantiles_us, tail
from hilrig.recording.certificate.late import is_late
from hilrig.recording.certificate.table import join, resume_times
from hilrig.recording.certificate.waits import who_made_wait
from hilrig.recording.timing import certify

MICRO = 1000
MS = 1_000_000
REALTIME, LOCKSTEP = Terms("realtime", 1e-3, 1), Terms("lockstep", 1e-3, 1)


def driver(*ticks: int, **changes: list[int]) -> dict[str, Any]:
    """Ticks due every ms from 10 ms on: woke 10 us later, applied at 40 us, published at 50 us; commands in time."""
    tick = np.array(ticks, dtype=np.int64)
    due = 10 * MS + tick * MS
    columns = {
        "tick": tick.astype(np.uint64), "time": tick * 1e-3, "due": due, "woke": due + 10 * MICRO, "command": tick - 1,
        "received": np.where(tick > 0, due - 700 * MICRO, 0), "applied": due + 40 * MICRO,
        "published": due + 50 * MICRO, "continued": 0 * tick,
    }  # fmt: skip
    return {**columns, **{name: np.array(values) for name, values in changes.items()}}


def controller(*ticks: int) -> dict[str, Any]:
    """Measurements received 100 us after due, computed at 200 us, the command published at 220 us."""
    tick = np.array(ticks, dtype=np.int64)
    due = 10 * MS + tick * MS
    return {
        "tick": tick.astype(np.uint64), "time": tick * 1e-3, "waiting": due - 700 * MICRO,
        "received": due + 100 * MICRO, "computed": due + 200 * MICRO, "published": due + 220 * MICRO,
        "continued": 0 * tick,
    }  # fmt: skip


def test_every_duration_is_from_its_own_stamps() -> None:
    found = durations(join(driver(*range(5)), controller(*range(5))), REALTIME)
    expected = {
        "lateness": [10] * 5, "state_transport": [50] * 5, "compute": [100] * 5, "command_transport": [80] * 4,
        "round_trip": [250] * 4, "command_age": [1030] * 4,
    }  # fmt: skip
    assert set(found) == set(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], np.array(values) * MICRO, err_msg=name)


def test_two_clocks_say_nothing_between_them() -> None:
    found = durations(join(driver(*range(5)), controller(*range(5)), one_clock=False), REALTIME)
    assert found["state_transport"] is found["command_transport"] is None
    assert found["round_trip"] is not None
    assert found["round_trip"].size == 4


def test_lockstep_has_no_lateness() -> None:
    assert durations(join(driver(0, 1), controller(0, 1)), LOCKSTEP)["lateness"] is None


def test_rows_are_joined_by_tick_whatever_is_missing() -> None:
    """Ticks 2 and 3 are missing at the driver, 1 and 4 at the controller; rows come in any order."""
    table = join(driver(5, 4, 0, 1), controller(5, 0, 3, 2))
    np.testing.assert_array_equal(table.driver.tick, [0, 1, 4, 5])
    np.testing.assert_array_equal(table.answered, [True, False, False, True])
    np.testing.assert_array_equal(table.answers.tick, [0, 2, 3, 5])
    # Commands 0, 3 and 4 took effect, at ticks 1, 4 and 5; those that answer ticks 1 and 5 never did.
    np.testing.assert_array_equal(table.effective > 0, [True, False, True, False])
    assert table.returned[0] == 11 * MS - 700 * MICRO
    assert command_age(table).size == 2, "the command of tick 3 is known, the waking of tick 3 is not"


def test_nothing_at_all() -> None:
    for driver_rows, controller_rows in ((None, None), (driver(), controller()), (None, controller(0, 1))):
        table = join(driver_rows, controller_rows)
        assert late_ticks(table, REALTIME).size == 0
        assert command_age(table).size == 0


@pytest.mark.parametrize(("terms", "late"), [(REALTIME, [0, 0, 1, 1, 0]), (LOCKSTEP, [0] * 5)])
def test_late_is_an_older_command_or_an_effect_a_period_after_due(terms: Terms, late: list[int]) -> None:
    due = 10 * MS + np.arange(5) * MS
    applied = due + np.array([40, 999, 40, 1000, 40]) * MICRO
    table = join(driver(*range(5), command=[-1, 0, 0, 2, 3], applied=list(applied)), None)
    np.testing.assert_array_equal(late_ticks(table, terms), np.array(late, dtype=bool))


@pytest.mark.parametrize(
    ("command", "applied", "late"),
    [
        (4, 0, False),  # in time: tick 5, delay 1
        (3, 0, True),  # the command is one tick too old
        (4, 1_000_000, True),  # applied a whole period after the tick was due
        (4, 999_999, False),
        (3, 2_000_000, True),
    ],
)
def test_a_tick_is_late_by_its_command_or_by_when_it_was_applied(command: int, applied: int, late: bool) -> None:
    """With ticks as the wire has them, unsigned."""
    due = 7_000_000_000
    stamps = (np.array([value]) for value in (command, due, due + applied))
    assert is_late(np.array([5], np.uint64), *stamps, delay=1, period_ns=MS).tolist() == [late]


def test_a_period_that_no_float_holds_is_a_whole_number_of_nanoseconds() -> None:
    """0.52 ms as a float, a billion times, is a little less than 520 us."""
    assert Terms("realtime", 0.52e-3, 1).period_ns == 520_000


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_the_first_ticks_have_no_command_and_are_not_late(delay: int) -> None:
    commands = np.maximum(np.arange(6) - delay, -1)
    assert not late_ticks(join(driver(*range(6), command=list(commands)), None), Terms("realtime", 1e-3, delay)).any()


def test_the_age_of_a_command_that_is_held_grows() -> None:
    """At ticks 2 and 3 the command of tick 0 is still in effect."""
    ages = command_age(join(driver(*range(5), command=[-1, 0, 0, 0, 3]), None))
    np.testing.assert_array_equal(ages, np.array([1030, 2030, 3030, 1030]) * MICRO)


def moved(columns: dict[str, Any], tick: int, **later: int) -> dict[str, Any]:
    """Move stamps of one tick by so many us, in place; return the columns, whose rows are the ticks from 0 on."""
    for name, us in later.items():
        columns[name][tick] += us * MICRO
    return columns


def causes(own: dict[str, Any], other: dict[str, Any], one_clock: bool = True) -> dict[int, str]:
    """Return the late ticks with their causes."""
    table = join(own, other, one_clock)
    found = attribute(table, REALTIME)
    return {int(tick): CAUSES[cause] for tick, cause in zip(table.driver.tick, found.cause, strict=True) if cause >= 0}


@pytest.mark.parametrize(("held", "cause"), [(740, "controller"), (741, "unknown")])
def test_the_cause_is_the_excess_without_which_the_command_would_have_been_in_time(held: int, cause: str) -> None:
    """The state of tick 5 is held, and the law takes 800 us longer; its command is needed 1040 us after tick 5 is due.

    Without the law's part it comes in 300 us after that plus what the state was held: at 740 us just in time.
    """
    own = moved(driver(*range(20), command=[tick - 1 - (tick == 6) for tick in range(20)]), 7, received=700)
    other = moved(controller(*range(20)), 5, received=held, computed=held + 800, published=held + 800)
    moved(other, 6, waiting=1470, received=700, computed=700, published=700)
    assert causes(own, other) == {6: cause}


def test_a_command_that_came_in_late_was_on_its_way_until_then() -> None:
    """The law takes 600 us longer over tick 5, and its command 900 us longer to come in; tick 6 is lost."""
    own = moved(driver(*range(20), command=[tick - 1 - (tick in (6, 7)) for tick in range(20)]), 7, received=500)
    other = moved(controller(*range(20)), 5, computed=600, published=600)
    lost = {name: np.delete(values, 6) for name, values in other.items()}
    assert causes(own, lost) == {6: "transport", 7: "transport"}


@pytest.mark.parametrize("one_clock", [True, False])
def test_a_record_without_the_answer_blames_nobody(one_clock: bool) -> None:
    """From tick 14 on the controller's rows are missing; that the driver publishes later proves nothing."""
    own = driver(*range(20), command=[min(tick - 1, 13) for tick in range(20)])
    own["published"][15:] += 500 * MICRO
    assert causes(own, controller(*range(14)), one_clock) == dict.fromkeys(range(15, 20), "unknown")


def test_a_wait_is_handed_on_to_the_next_measurement() -> None:
    """The state of tick 5 is held. That of tick 6 waits for 50 us, the least that counts, and delays that of tick 7."""
    other = moved(controller(*range(10)), 5, received=800, computed=800, published=800)
    moved(other, 6, waiting=800, received=50, computed=50, published=50)
    moved(other, 7, waiting=50)
    expected = np.full(10, CONTROLLER)
    expected[6:8] = TRANSPORT
    np.testing.assert_array_equal(who_made_wait(join(driver(*range(10)), other), REALTIME), expected)


def test_between_is_after_the_start_and_up_to_the_end() -> None:
    start, end = np.array([9, 10, 10, 20, 11]), np.array([10, 19, 20, 25, 19])
    np.testing.assert_array_equal(any_between(np.array([10, 20]), start, end), [True, False, True, False, False])


def test_a_process_that_was_never_stopped_was_never_resumed() -> None:
    for continued, times in (([0, 0, 0], []), ([0, 7, 7], [7]), ([9, 0, 7], [7, 9])):
        table = join(driver(0, 1, 2, continued=continued), None)
        np.testing.assert_array_equal(resume_times(table.driver), times)


BUDGET = TimingBudget()
"""The default: 0.5 % late ticks, and with a delay of 1 a command age of 1.25 ms"""


@pytest.mark.parametrize(
    ("ticks", "late", "age", "reasons"),
    [
        (1000, 5, 1.25, []),
        (1000, 6, 1.25, ["late ticks 0.6 %, at most 0.5 %"]),
        (1000, 0, 1.26, ["command age p99 1.26 ms, at most 1.25 ms"]),
        (100_000, 501, 2.0, ["late ticks 0.501 %, at most 0.5 %", "command age p99 2 ms, at most 1.25 ms"]),
        (10_000_000, 50_001, 1.0, ["late ticks 0.50001 %, at most 0.5 %"]),
        (0, 0, 1.0, ["no tick was stamped: nothing shows that the loop kept its period"]),
    ],
)
def test_a_reason_names_value_and_limit(ticks: int, late: int, age: float, reasons: list[str]) -> None:
    assert violations(BUDGET, REALTIME, ticks, late, np.full(100, round(age * MS))) == reasons


def test_a_loop_without_any_command_kept_no_budget() -> None:
    assert violations(BUDGET, REALTIME, 10, 0, np.zeros(0, dtype=np.int64)) == [
        "no command took effect: its age is not known"
    ]


@given(st.lists(st.integers(-(2**50), 2**50), min_size=1, max_size=50))
def test_every_value_is_in_one_bin_no_wider_than_a_64th(values: list[int]) -> None:
    """By the bin's definition: keep seven significant bits of the magnitude, in whole numbers of any size."""
    for value, edge in zip(values, lower_edges(np.array(values)).tolist(), strict=True):
        width = 1 << max(abs(value).bit_length() - 7, 0)
        inner = abs(value) // width * width
        assert edge == (inner if value >= 0 else -(inner + width - 1))
        assert edge <= value < edge + width
        assert width == 1 or 64 * width <= inner
    bins = histogram(np.array(values))
    assert sum(count for _, count in bins) == len(values)
    assert [edge for edge, _ in bins] == sorted({edge for edge, _ in bins})


@given(st.lists(st.integers(-1000, 10_000_000), min_size=1, max_size=50))
def test_the_tail_is_exact_at_the_edges(values: list[int]) -> None:
    edges, shares = tail(histogram(np.array(values)))
    for edge, share in zip(edges, shares, strict=True):
        assert share == pytest.approx(sum(value >= edge for value in values) / len(values))


def test_quantiles_are_of_the_values_and_in_microseconds() -> None:
    assert quantiles_us(np.arange(1001) * MICRO) == {"p50": 500.0, "p99": 990.0, "p99.9": 999.0, "max": 1000.0}
    assert quantiles_us(np.zeros(0, dtype=np.int64)) is None


@given(st.data())
def test_a_record_with_holes_says_less_and_breaks_nothing(data: st.DataObject) -> None:
    """Whatever rows are lost, ticks that remain are late or not as before; those between them count as left out."""
    own, other = HOLED
    whole = late_ticks(join(own, other), REALTIME)
    kept = [np.array(data.draw(st.lists(st.booleans(), min_size=n, max_size=n)), dtype=bool)
            for n in (own["tick"].size, other["tick"].size)]  # fmt: skip
    cut = [{name: values[rows] for name, values in columns.items()} for columns, rows in zip(HOLED, kept, strict=True)]
    found = certify(REALTIME, BUDGET, {"driver_timing": cut[0], "controller_timing": cut[1]})
    ticks = cut[0]["tick"].astype(int)
    missed = ticks[-1] - ticks[0] + 1 - ticks.size if ticks.size else 0
    assert found["missed"] == missed
    assert found["late"] == np.count_nonzero(whole[kept[0]]) + missed == sum(found["late_by"].values())
    assert found["ticks"] == ticks.size + missed


HOLED = Loop(
    [Stall("driver_publish", 8, 2 * MS), Stall("state_loss", 20, 0), Stall("controller_stop", 30, 3 * MS)], 40
).run().columns()  # fmt: skip


def test_ticks_that_were_left_out_are_late_through_the_driver() -> None:
    """Ticks 3 to 7 were overdue; tick 8 waits for the measurement of 7, which was never made."""
    ticks = [0, 1, 2, 8, 9, 10]
    own = driver(*ticks, command=[-1, 0, 1, 2, 8, 9])
    found = certify(REALTIME, BUDGET, {"driver_timing": own, "controller_timing": controller(*ticks)})
    assert (found["ticks"], found["missed"], found["late"]) == (11, 5, 6)
    assert found["late_by"] == {"driver": 6, "transport": 0, "controller": 0, "unknown": 0}
    assert found["late_fraction"] == 6 / 11


def silent_from(tick: int, ticks: int = 30) -> dict[str, Any]:
    """Return the stamps of a driver that gets no command after the one of `tick` - 1."""
    return driver(*range(ticks), command=[min(k - 1, tick - 1) for k in range(ticks)])


@pytest.mark.parametrize(("complete", "cause"), [(False, "controller"), (None, "unknown"), (True, "transport")])
def test_a_controller_that_answers_no_more_is_the_cause_if_its_record_breaks_off(
    complete: bool | None, cause: str
) -> None:
    """Killed, it leaves no count; if it left in order and was waiting, nothing had reached it."""
    channels = {"driver_timing": silent_from(10), "controller_timing": controller(*range(10))}
    found = certify(REALTIME, BUDGET, channels, answered_to_the_end=complete)
    assert found["late"] == 19
    assert found["late_by"] == {**dict.fromkeys(("driver", "transport", "controller", "unknown"), 0), cause: 19}


def test_a_law_that_hangs_is_the_cause_though_its_process_left_in_order() -> None:
    """It was ended by a signal, and noted the measurement that it had not finished."""
    other = controller(*range(11))
    for name in ("computed", "published"):
        other[name][-1] = 10 * MS + 40 * MS
    found = certify(
        REALTIME, BUDGET, {"driver_timing": silent_from(10), "controller_timing": other}, answered_to_the_end=True
    )
    assert found["late_by"]["controller"] == found["late"] == 19


def test_the_samples_of_a_plant_are_counted_and_their_jitter_is_told() -> None:
    """At 1 ms: new samples at ticks 0, 1, 3, 4; the one of tick 3 came 300 us late, and the one of tick 2 was lost."""
    times = np.array([0, 1000, 1000, 3300, 4000]) * MICRO + 5 * MS
    own = driver(*range(5), sampled=times.tolist(), fresh=[1, 1, 0, 1, 1])
    found = certify(REALTIME, BUDGET, {"driver_timing": own})["samples"]
    assert (found["fresh"], found["repeated"]) == (4, 1)
    assert found["jitter_us"]["max"] == 300.0
    assert sum(count for _, count in found["jitter_histogram"]) == 3


def test_a_simulated_plant_has_no_samples_of_its_own() -> None:
    own = driver(*range(5), sampled=[0] * 5, fresh=[1] * 5)
    assert certify(REALTIME, BUDGET, {"driver_timing": own})["samples"] is None
