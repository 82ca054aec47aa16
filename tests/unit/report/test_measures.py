"""From a bag's channels to the signals that a metric sees, and from these to the phases."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from helpers.builders import record
from helpers.report_builders import PERIOD, trial_document, trial_entry

from hilrig.report.dataset import TrialSignals, align
from hilrig.report.measures import all_metrics, measure_trial, spans

PHASES = [{"name": "before", "start": 0.0, "end": 4 * PERIOD}, {"name": "after", "start": 4 * PERIOD, "end": 1.0}]
COMMON = np.array([1, 2, 4, 6, 7, 8])
"""The ticks that all of `channels` have"""


def column(ticks: np.ndarray, *offsets: float) -> np.ndarray:
    """Return values (N, k) that tell their tick and column: tick + offset."""
    return ticks[:, None] + np.array(offsets)


def channels() -> dict[str, dict[str, np.ndarray]]:
    """Return a bag's channels: each lacks other ticks, and no two fields have equal values."""
    truth, command, internals = (np.delete(np.arange(10), gap) for gap in ([3], [5], [0, 9]))
    time = truth * PERIOD
    return {
        "truth": {
            "tick": truth, "time": time, "position": column(truth, 0.1, 0.2),
            "velocity": np.stack([time**2, -3 * time**2], axis=1), "wrench": column(truth, *range(100, 700, 100)),
        },
        "state": {"tick": truth, "time": time, "wrench": column(truth, *range(1100, 1700, 100))},
        "command": {"tick": command, "time": command * PERIOD, "torque": column(command, 0.3, 0.4)},
        "internals": {
            "tick": internals, "time": internals * PERIOD, "gains": internals * 2.0,
            "position": column(internals, 10.1, 10.2), "velocity": column(internals, 20.1, 20.2),
            "force": column(internals, 30.1, 30.2), "reference_position": column(internals, 5.0, 6.0),
            "reference_velocity": column(internals, 50.1, 50.2),
            "reference_acceleration": column(internals, 60.1, 60.2), "reference_force": column(internals, 70.1, 70.2),
        },
        "driver_timing": driver_timing(),
    }  # fmt: skip


def driver_timing() -> dict[str, np.ndarray]:
    """Return stamps by which ticks 2 and 3 had an older command than that of two ticks before, and 8 overran."""
    tick = np.arange(10, dtype=np.uint64)
    due = 10**9 + 10**6 * np.arange(10)
    after = np.array([100, 100, 100, 100, 999_999, 100, 100, 100, 1_000_000, 100])
    return {
        "tick": tick, "due": due, "woke": due, "published": due + 50, "received": due - 100, "applied": due + after,
        "command": np.array([-1, -1, -1, 0, 2, 3, 4, 5, 6, 7]), "continued": np.zeros(10, dtype=np.int64),
    }  # fmt: skip


def aligned(*without: str) -> TrialSignals:
    """Align `channels`, but for those left out."""
    kept = {name: fields for name, fields in channels().items() if name not in without}
    signals = align(kept, {**trial_document("a", "quiet", 0, PHASES), "clock": "realtime", "actuation_delay": 2})
    assert signals is not None
    return signals


def test_channels_are_aligned_on_their_common_ticks() -> None:
    signals = aligned("state")
    assert signals.source == "truth"
    expected: dict[str, Any] = {
        "tick": COMMON, "time": COMMON * PERIOD, "position": column(COMMON, 0.1, 0.2),
        "force": column(COMMON, 100, 300), "torque": column(COMMON, 0.3, 0.4), "late": [0, 1, 1, 0, 0, 1],
        "reference_position": column(COMMON, 5.0, 6.0), "reference_velocity": column(COMMON, 50.1, 50.2),
        "reference_acceleration": column(COMMON, 60.1, 60.2), "reference_force": column(COMMON, 70.1, 70.2),
        "reference_step": [4.9, 5.8], "sigma": [1.0, 0.0], "inertia": [3.0, 6.0], "damping": [30.0, 60.0],
        "stiffness": [250.0, 0.0],
    }  # fmt: skip
    for name, values in expected.items():
        np.testing.assert_allclose(getattr(signals.record, name), values, rtol=1e-12, atol=1e-12, err_msg=name)
    assert (signals.record.axes, signals.record.phases, signals.record.period) == (("x", "z"), 2, PERIOD)
    assert list(signals.internals) == ["gains"]
    np.testing.assert_array_equal(signals.internals["gains"], 2.0 * COMMON[:, None])


def test_in_lockstep_no_tick_is_late() -> None:
    document = {**trial_document("a", "quiet", 0, PHASES), "clock": "lockstep", "actuation_delay": 2}
    signals = align(channels(), document)
    assert signals is not None
    assert not signals.record.late.any()


def test_acceleration_is_the_slope_over_time_across_a_gap() -> None:
    """v = t² has the slope 2t, which central differences give exactly, but not at the ends."""
    time = COMMON[1:-1] * PERIOD
    np.testing.assert_allclose(aligned().record.acceleration[1:-1], np.stack([2 * time, -6 * time], axis=1), rtol=1e-9)


def test_without_truth_the_measurement_is_used() -> None:
    signals = aligned("truth", "driver_timing")
    assert signals.source == "measurement"
    np.testing.assert_allclose(signals.record.position, column(COMMON, 10.1, 10.2))
    np.testing.assert_allclose(signals.record.velocity, column(COMMON, 20.1, 20.2))
    np.testing.assert_allclose(signals.record.force, column(COMMON, 1100, 1300))
    np.testing.assert_allclose(signals.record.reference_step, [-5.1, -4.2])
    assert not signals.record.late.any()


def test_a_bag_with_too_little_gives_no_signals() -> None:
    document = trial_document("a", "quiet", 0, PHASES)
    bag = channels()
    assert align({}, document) is None
    assert align({name: bag[name] for name in ("truth", "internals")}, document) is None
    for ticks, enough in ((2, True), (1, False)):
        short = {name: values[:ticks] for name, values in bag["internals"].items()}
        assert (align({**bag, "internals": short}, document) is not None) == enough


def test_each_tick_is_in_one_phase() -> None:
    tick = np.array([0.0, 1, 3, 4, 5, 7, 9])
    desired = np.stack([tick**2, tick], axis=1)
    whole = record(7, tick=tick, time=tick * PERIOD, phases=2, reference_position=desired, reference_step=np.ones(2))
    never = {"name": "never", "start": 2.0, "end": 3.0}
    before, after, everything = spans(whole, [*PHASES, never])
    assert [name for name, _ in (before, after, everything)] == ["before", "after", "all"]
    assert [list(part.tick) for _, part in (before, after, everything)] == [[0, 1, 3], [4, 5, 7, 9], list(tick)]
    assert [part.phases for _, part in (before, after, everything)] == [1, 1, 2]
    np.testing.assert_array_equal(before[1].reference_step, [1, 1])
    np.testing.assert_array_equal(after[1].reference_step, [4**2 - 3**2, 4 - 3])
    np.testing.assert_array_equal(after[1].reference_position, desired[3:])


def test_a_phase_is_measured_with_its_own_step_of_the_reference() -> None:
    """The reference jumps by 1 m, 2 % of which is 20 mm; the error is 30 mm at tick 5 and 15 mm from tick 6 on."""
    jump = np.r_[np.zeros(4), np.ones(6)]
    error = np.r_[np.zeros(4), 0.5, 0.03, np.full(4, 0.015)]
    desired, position = (np.stack([x, np.zeros(10)], axis=1) for x in (jump, jump - error))
    whole = record(10, phases=2, reference_position=desired, position=position)
    trial = trial_entry("a", "rough", 3, phases=tuple(PHASES))
    head = ("a.rough.3", "a", "rough", 3)
    settling = {"settling_time": all_metrics()["settling_time"]}
    assert measure_trial(trial, TrialSignals(whole, {}, "truth"), settling, {}) == [
        (*head, "before", "settling_time", "x", 0.0, "s"),
        (*head, "after", "settling_time", "x", pytest.approx(2 * PERIOD), "s"),
    ]


class Theirs:
    """A metric of a stranger's package."""

    unit = "N"

    def __init__(self, measure: Callable[[Any], Any]) -> None:
        self.measure = measure


def overwrite(found: Any) -> dict[str, float]:
    found.force[:] = 0.0
    return {"": 0.0}


@pytest.mark.parametrize(
    ("measure", "words"),
    [
        (lambda found: found.missing, "AttributeError: 'PhaseRecord' object has no attribute 'missing'"),
        (lambda found: 1.0, "measure returned a float; it must return a dict: axis -> value"),
        (lambda found: {"x": "high"}, "could not convert string to float: 'high'"),
        (overwrite, "assignment destination is read-only"),
        (lambda found: sys.exit(3), "sys.exit(3) was called"),
    ],
)
def test_a_metric_that_fails_is_left_out_and_named_and_the_others_are_measured(measure: Any, words: str) -> None:
    trial, signals = trial_entry("a", "rough", 0), TrialSignals(record(10), {}, "truth")
    metrics: Any = {"theirs": Theirs(measure), **all_metrics()}
    failed: dict[str, str] = {}
    rows = measure_trial(trial, signals, metrics, failed)
    assert rows == measure_trial(trial, signals, all_metrics(), {})
    assert list(failed) == ["theirs"]
    assert words in failed["theirs"]
    assert "test_measures.py" in failed["theirs"], "it names the file"


def test_repeated_samples_are_left_out() -> None:
    """Ticks 4 and 7 saw the sample of the tick before once more: no metric counts it, and nothing differentiates it."""
    bag = channels()
    del bag["truth"], bag["driver_timing"]
    bag["state"]["fresh"] = (~np.isin(bag["state"]["tick"], (4, 7))).astype(np.uint64)
    signals = align(bag, trial_document("a", "quiet", 0, PHASES))
    assert signals is not None
    np.testing.assert_array_equal(signals.record.tick, [1, 2, 6, 8])
    np.testing.assert_allclose(signals.record.force, column(np.array([1, 2, 6, 8]), 1100, 1300))
    np.testing.assert_allclose(signals.record.acceleration[0], [1 / PERIOD] * 2)
