"""Expectations: met or not, by which value, and in which words."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from helpers.report_builders import metric_table, trial_entry
from hypothesis import given
from hypothesis import strategies as st

from hilrig.experiment.expecting import ended_early, ends_as_expected
from hilrig.report.comparison import verdict
from hilrig.report.dataset import TrialEntry
from hilrig.report.expectations import Expected, judge_expectations
from hilrig.report.measures import METRIC_COLUMNS

VALUES = [2.0, 1.0, 3.0]
EXPECTED = {"metric": "position_rmse", "controller": "a", "phase": "all", "axis": None, "condition": None}


def judged(metrics: pd.DataFrame | None = None, outcomes: tuple[Any, ...] = (), **changes: Any) -> Expected:
    """Judge one expectation of controller a, by default on its three values."""
    metrics = metric_table({"a": VALUES}) if metrics is None else metrics
    (found,) = judge_expectations([{**EXPECTED, "below": None, "above": None, **changes}], metrics, outcomes)
    return found


@pytest.mark.parametrize(
    ("below", "above", "met", "worst"),
    [
        (3.5, None, True, 3.0),
        (2.5, None, False, 3.0),
        (3.0, None, False, 3.0),
        (None, 0.5, True, 1.0),
        (None, 1.5, False, 1.0),
        (None, 1.0, False, 1.0),
        (3.5, 0.9, True, 1.0),
        (3.1, 0.5, True, 3.0),
        (2.9, 1.5, False, 1.0),
    ],
)
def test_every_repeat_must_keep_the_limits(below: float | None, above: float | None, met: bool, worst: float) -> None:
    found = judged(below=below, above=above)
    assert (found.met, found.value, found.low, found.high) == (met, worst, None, None)
    assert found.basis == f"quiet, x: repeat {VALUES.index(worst)}, worst of 3"


def test_an_undefined_value_keeps_no_limit() -> None:
    found = judged(metric_table({"a": [1.0, math.nan, 9.0]}), below=5.0)
    assert not found.met
    assert found.value is not None
    assert math.isnan(found.value)


@pytest.mark.parametrize(
    ("key", "value"),
    [("metric", "position_peak"), ("controller", "b"), ("phase", "press"), ("axis", "y"), ("condition", "rough")],
)
def test_only_what_is_named_counts(key: str, value: str) -> None:
    good = metric_table({"a": [1.0]})
    bad = good.assign(value=9.0, **{key: value})
    both = pd.concat([good, bad])
    assert judged(both, below=5.0, **{key: good[key][0]}) == judged(good, below=5.0, **{key: good[key][0]})
    assert judged(both, below=5.0, **{key: value}).value == 9.0


@pytest.mark.parametrize("key", ["axis", "condition"])
def test_every_axis_and_condition_counts_where_none_is_named(key: str) -> None:
    good = metric_table({"a": [1.0]})
    found = judged(pd.concat([good, good.assign(value=9.0, **{key: "other"})]), below=5.0)
    assert (found.met, found.value) == (False, 9.0)


def test_a_trial_that_did_not_complete_is_not_met() -> None:
    tripped = (trial_entry("a"), trial_entry("a", repeat=1, outcome="tripped"))
    assert judged(outcomes=tripped, below=5.0).missing == 1
    assert not judged(outcomes=tripped, below=5.0).met
    assert judged(outcomes=tripped[:1], below=5.0).met


def test_only_trials_it_speaks_of_are_missed() -> None:
    others = (trial_entry("b", outcome="tripped"), trial_entry("a", "rough", outcome="damaged"))
    assert judged(outcomes=others, below=5.0, condition="quiet").met
    assert judged(outcomes=others, below=5.0).missing == 1


def test_what_was_never_measured_is_not_met() -> None:
    nothing = pd.DataFrame(columns=list(METRIC_COLUMNS))
    found = judged(nothing, (trial_entry("a", outcome="aborted"),), below=5.0)
    assert (found.met, found.value, found.missing) == (False, None, 1)
    assert (found.seen, found.basis) == ("nothing", "1 trial not completed")


def test_a_metric_that_has_no_value_there_says_so() -> None:
    found = judged(metric_table({"b": VALUES}), (trial_entry("a"),), below=5.0)
    assert (found.met, found.seen, found.basis) == (False, "nothing", "the metric has no value here")


def test_an_expectation_in_words() -> None:
    found = judged(below=0.25, above=0.1, axis="x", condition="quiet")
    assert found.subject == "position_rmse of a, phase all, x, quiet"
    assert found.limit == "below 0.25 m and above 0.1 m"
    assert found.seen == "3 m"
    assert difference(VALUES, VALUES, above=-1e-3).subject == "position_rmse of a minus b, phase all"


@pytest.mark.parametrize(
    ("value", "text"), [(0.50001, "0.50001 m"), (0.49996, "0.49996 m"), (0.5, "0.5 m"), (0.41239, "0.4124 m")]
)
def test_a_value_is_shown_on_its_side_of_the_limit(value: float, text: str) -> None:
    assert judged(metric_table({"a": [value]}), below=0.5).seen == text


def difference(a: list[float], b: list[float], outcomes: tuple[Any, ...] = (), **changes: Any) -> Expected:
    """Judge the difference of a's values to b's."""
    return judged(metric_table({"a": a, "b": b}), outcomes, minus="b", **changes)


HALF = 4.302652729911275 / math.sqrt(3)
"""Half-width of the 95 % t interval for three values with standard deviation 1: t(0.975, 2) / √3"""


@pytest.mark.parametrize(
    ("below", "above", "met"),
    [
        (-2 + HALF + 1e-6, None, True),
        (-2 + HALF - 1e-6, None, False),
        (None, -2 - HALF - 1e-6, True),
        (None, -2 - HALF + 1e-6, False),
        (1.0, -5.0, True),
        (1.0, -4.0, False),
    ],
)
def test_the_whole_interval_must_keep_the_limits(below: float | None, above: float | None, met: bool) -> None:
    """Differences -1, -2, -3: mean -2, deviation 1. The repeats themselves differ much more."""
    found = difference([10.0, 50.0, 90.0], [11.0, 52.0, 93.0], below=below, above=above)
    assert found.met == met
    assert (found.value, found.low, found.high) == pytest.approx((-2, -2 - HALF, -2 + HALF))
    assert found.basis.startswith("quiet, x: paired, n = 3, 95 % confidence interval -4.484")


def test_pairs_are_made_by_the_number_of_the_repeat() -> None:
    """Row by row the differences would be -8.3, -0.4 and 7.4."""
    a, b = metric_table({"a": [1.0, 5.0, 9.0]}), metric_table({"b": [1.6, 5.4, 9.3]})
    assert judged(pd.concat([a, b[::-1]]), minus="b", below=0.0).met


@given(st.lists(st.tuples(*[st.sampled_from([0.5, 1.0, 1.0 + 1e-12, 1.1, 2.0, math.inf])] * 2), min_size=1, max_size=6))
def test_below_zero_is_met_where_the_verdict_table_marks_the_controller(pairs: list[tuple[float, float]]) -> None:
    a, b = (list(values) for values in zip(*pairs, strict=True))
    marked = verdict(pd.DataFrame({"a": a, "b": b})).best
    assert difference(a, b, below=0.0).met == (marked == "a")
    assert difference(b, a, below=0.0).met == (marked == "b")


def test_identical_repeats_are_their_difference() -> None:
    """There is no spread, so two will do; one is no repeat."""
    found = difference([1.0, 1.0], [3.0, 3.0], below=-1.9)
    assert (found.met, found.value, found.low, found.high) == (True, -2.0, -2.0, -2.0)
    assert found.basis == "quiet, x: 2 identical repeats"
    assert not difference([1.0, 1.0], [3.0, 3.0], below=-2.0).met


@pytest.mark.parametrize(
    ("a", "b", "words"),
    [
        ([1.0], [9.0], "only 1 repeat, too few to judge a difference (3 are needed)"),
        ([1.0, 1.1], [9.0, 9.2], "only 2 repeats, too few to judge a difference (3 are needed)"),
        ([1.0], [math.nan], "undefined in a repeat"),
        ([math.inf, 1.0, 1.1], [math.inf, 2.0, 2.1], "undefined in a repeat"),
        ([math.inf] * 3, [math.inf] * 3, "undefined in a repeat"),
        ([1.0, 1.1, 1.2], [math.nan, 5.0, 5.0], "undefined in a repeat"),
        ([1.0, 1.1, 1.2], [math.inf, 5.0, 5.0], "95 % confidence interval -inf to inf m"),
        ([1.0], [], "no common repeat, too few"),
        ([], [1.0], "no common repeat, too few"),
    ],
)
def test_a_difference_that_cannot_be_judged_is_not_met_and_says_why(a: list[float], b: list[float], words: str) -> None:
    for limit in ({"below": 1e9}, {"above": -1e9}, {"below": 1e9, "above": -1e9}):
        found = difference(a, b, **limit)
        assert not found.met
        assert words in found.basis


def test_always_settled_is_below_never_settled() -> None:
    assert difference([1.0, 1.1, 1.2], [math.inf] * 3, below=0.0).met
    assert not difference([1.0, 1.1, 1.2], [math.inf] * 3, above=0.0).met


def test_a_missing_trial_of_either_controller_is_not_met() -> None:
    a, b = [1.0, 1.1, 1.2, 1.0], [5.0, 5.1, 5.3]
    trials = tuple(trial_entry(name, repeat=i) for name in "ab" for i in range(3))
    assert difference(a[:3], b, trials, below=0.0).met
    for name in "ab":
        found = difference(a, b, (*trials, trial_entry(name, repeat=3, outcome="failed")), below=0.0)
        assert (found.met, found.missing) == (False, 1)
        assert found.value == pytest.approx(-4.0333, abs=1e-4), "the mean of the three pairs that there are"
        assert found.basis.endswith("; 1 trial not completed")
    assert difference(a[:3], b, (*trials, trial_entry("c", outcome="failed")), below=0.0).met


@pytest.mark.parametrize("key", ["axis", "condition"])
def test_the_difference_must_hold_on_every_axis_and_under_every_condition(key: str) -> None:
    good = metric_table({"a": [1.0, 1.1, 1.2], "b": [5.0, 5.1, 5.3]})
    bad = metric_table({"a": [7.0, 7.1, 7.2], "b": [5.0, 5.1, 5.3]}).assign(**{key: "other"})
    both = pd.concat([good, bad])
    found = judged(both, minus="b", below=0.0)
    assert not found.met
    assert found.value == pytest.approx(1.9667, abs=1e-4)
    assert "other" in found.basis
    assert judged(both, minus="b", below=0.0, **{key: good[key][0]}).met


def test_values_are_plain_numbers() -> None:
    """As JSON needs them."""
    found = difference([1.0, 1.1, 1.2], [5.0, 5.1, 5.3], below=0.0)
    assert not any(isinstance(value, np.generic) for value in (found.value, found.low, found.high, found.met))


TRIP = "tip force 201 N at t = 0.3 s (tick 300) is over the limit of 200 N"


def ended(*outcomes: str, condition: str = "quiet") -> tuple[TrialEntry, ...]:
    """Return trials of controller a that ended so, one a repeat; a trip has a reason with its time, as the rig's."""
    reasons = {
        "tripped": "tip force 201 N at t = 0.3 s (tick 300) is over the limit of 200 N",
        "failed": "/tmp/x broke",
    }
    return tuple(
        replace(trial, outcome={**trial.outcome, "reason": reasons.get(outcome, ""), "ticks": 400})
        for i, outcome in enumerate(outcomes)
        if (trial := trial_entry("a", condition, i, outcome))
    )


def outcome_of(trials: tuple[TrialEntry, ...], outcome: str, condition: str | None = None) -> Expected:
    (found,) = judge_expectations(
        [{"controller": "a", "outcome": outcome, "condition": condition}], metric_table({}), trials
    )
    return found


@pytest.mark.parametrize(
    ("outcomes", "wanted", "met", "seen", "basis"),
    [
        (("tripped",), "tripped", True, "tripped", f"quiet: repeat 0, {TRIP}"),
        (("tripped",) * 3, "tripped", True, "tripped", f"quiet: repeat 0, first of 3, {TRIP}"),
        (("completed",), "completed", True, "completed", "quiet: repeat 0, completed at t = 0.4 s"),
        (("tripped", "completed", "tripped"), "tripped", False, "2 tripped, 1 completed",
         "quiet: repeat 1, first of 3, completed at t = 0.4 s"),
        (("completed", "tripped"), "completed", False, "1 completed, 1 tripped",
         f"quiet: repeat 1, first of 2, {TRIP}"),
        (("failed",), "tripped", False, "failed", "quiet: repeat 0, see its log at t = 0.4 s"),
        (("damaged",), "completed", False, "damaged", "quiet: repeat 0, damaged at t = 0.4 s"),
        ((), "tripped", False, "nothing", "there is no such trial"),
    ],
)  # fmt: skip
def test_an_outcome_is_that_of_every_trial(
    outcomes: tuple[str, ...], wanted: str, met: bool, seen: str, basis: str
) -> None:
    found = outcome_of(ended(*outcomes), wanted)
    assert (found.met, found.seen, found.basis) == (met, seen, basis)
    assert (found.subject, found.limit, found.missing, found.value) == ("outcome of a", wanted, 0, None)


def test_an_outcome_speaks_of_its_controller_and_condition_alone() -> None:
    other = (trial_entry("b", outcome="completed"),)
    trials = (*ended("tripped"), *ended("completed", condition="rough"), *other)
    assert outcome_of(trials, "tripped", "quiet").met
    assert outcome_of(trials, "tripped", "quiet").subject == "outcome of a, quiet"
    assert not outcome_of(trials, "tripped", "rough").met
    assert not outcome_of(trials, "tripped").met


def test_a_trial_ends_as_expected_only_where_an_expectation_says_so() -> None:
    metric = {"controller": "a", "metric": "force_rmse", "outcome": None, "condition": None, "below": 1.0}
    rough = {"controller": "a", "outcome": "tripped", "condition": "rough"}
    assert ends_as_expected([metric, rough], "a", "rough", "tripped")
    for case in (("b", "rough", "tripped"), ("a", "quiet", "tripped"), ("a", "rough", "completed")):
        assert not ends_as_expected([metric, rough], *case)
    assert ends_as_expected([{**rough, "condition": None}], "a", "quiet", "tripped")
    assert not ends_as_expected([metric], "a", "quiet", "completed"), "a metric says nothing of the end"


def test_only_trials_that_did_not_complete_are_told_beside_those_that_did() -> None:
    assert ended_early(["tripped", "completed", "tripped"]) == ", 2 tripped as expected"
    assert ended_early(["completed"]) == ""
