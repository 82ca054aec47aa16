"""Expectations: met or not, and by which value."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd
import pytest
from report_builders import metric_table, trial_entry

from hilrig.report.expectations import Expected, judge
from hilrig.report.measures import COLUMNS

VALUES = [2.0, 1.0, 3.0]
EXPECTED = {"metric": "position_rmse", "controller": "a", "phase": "all", "axis": None, "condition": None}


def judged(metrics: pd.DataFrame | None = None, outcomes: tuple[Any, ...] = (), **changes: Any) -> Expected:
    """Judge one expectation of controller a, by default on its three values."""
    metrics = metric_table({"a": VALUES}) if metrics is None else metrics
    (found,) = judge([{**EXPECTED, "below": None, "above": None, **changes}], metrics, outcomes)
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
    assert (found.met, found.worst) == (met, worst)


def test_an_undefined_value_keeps_no_limit() -> None:
    found = judged(metric_table({"a": [1.0, math.nan, 9.0]}), below=5.0)
    assert not found.met
    assert found.worst is not None
    assert math.isnan(found.worst)


@pytest.mark.parametrize(
    ("key", "value"),
    [("metric", "position_peak"), ("controller", "b"), ("phase", "press"), ("axis", "y"), ("condition", "rough")],
)
def test_only_what_is_named_counts(key: str, value: str) -> None:
    good = metric_table({"a": [1.0]})
    bad = good.assign(value=9.0, **{key: value})
    both = pd.concat([good, bad])
    assert judged(both, below=5.0, **{key: good[key][0]}) == judged(good, below=5.0, **{key: good[key][0]})
    assert judged(both, below=5.0, **{key: value}).worst == 9.0


@pytest.mark.parametrize("key", ["axis", "condition"])
def test_every_axis_and_condition_counts_where_none_is_named(key: str) -> None:
    good = metric_table({"a": [1.0]})
    found = judged(pd.concat([good, good.assign(value=9.0, **{key: "other"})]), below=5.0)
    assert (found.met, found.worst) == (False, 9.0)


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
    nothing = pd.DataFrame(columns=list(COLUMNS))
    found = judged(nothing, (trial_entry("a", outcome="aborted"),), below=5.0)
    assert (found.met, found.worst, found.missing) == (False, None, 1)


def test_an_expectation_in_words() -> None:
    text = judged(below=0.25, above=0.1, axis="x", condition="quiet").text
    assert text == "position_rmse of a, phase all, x, quiet: below 0.25 m and above 0.1 m"
