"""Claims: reproduced, not reproduced, or one cannot tell."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from helpers.report_builders import metric_table, trial_entry
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from hilrig.study.claims import LEAST_CLAIM_PAIRS, Result, all_of, difference, judge_claim, paired, relative
from hilrig.study.evidence import Evidence, judge_claims
from hilrig.study.model import Claim, EqualsWithin, LessThan, Part

BELOW = (-math.inf, 1.0)
numbers = st.lists(st.floats(-1e3, 1e3), min_size=LEAST_CLAIM_PAIRS, max_size=30).map(np.array)
edges = st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)).map(sorted).map(tuple)


def spread(mean: float, half: float) -> np.ndarray:
    """Return ten numbers whose 95 % confidence interval is mean ± half: t(0.975, 9) = 2.262157."""
    sd = half * math.sqrt(10) / 2.2621571628
    signs = np.array([1.0, -1.0] * 5)
    return mean + signs * sd / math.sqrt(10 / 9)


@pytest.mark.parametrize(
    ("mean", "half", "claimed", "result"),
    [
        (0.5, 0.4, BELOW, "reproduced"),
        (0.5, 0.6, BELOW, "cannot tell"),
        (1.5, 0.6, BELOW, "cannot tell"),
        (1.5, 0.4, BELOW, "not reproduced"),
        (1.5, 0.4, (1.0, math.inf), "reproduced"),
        (0.5, 0.4, (1.0, math.inf), "not reproduced"),
        (0.0, 0.1, (-0.2, 0.2), "reproduced"),
        (0.15, 0.1, (-0.2, 0.2), "cannot tell"),
        (-0.4, 0.1, (-0.2, 0.2), "not reproduced"),
        (0.0, 0.5, (-0.2, 0.2), "cannot tell"),
    ],
)
def test_the_side_of_the_interval_decides(
    mean: float, half: float, claimed: tuple[float, float], result: Result
) -> None:
    found = judge_claim(spread(mean, half), claimed)
    assert found.result == result
    assert (found.low, found.high) == pytest.approx((mean - half, mean + half), abs=1e-9)


@given(numbers, edges)
def test_the_interval_agrees_with_another_library(values: np.ndarray, claimed: tuple[float, float]) -> None:
    found = judge_claim(values, claimed)
    error = float(stats.sem(values))
    low, high = stats.t.interval(0.95, values.size - 1, loc=np.mean(values), scale=error) if error else (values[0],) * 2
    assert (found.low, found.high) == pytest.approx((low, high), rel=1e-6, abs=1e-9)


@given(numbers, st.floats(-1e3, 1e3))
def test_a_claim_and_its_opposite_are_never_both_reproduced(values: np.ndarray, limit: float) -> None:
    below, above = judge_claim(values, (-math.inf, limit)).result, judge_claim(values, (limit, math.inf)).result
    assert {below, above} in (
        {"cannot tell"},
        {"reproduced", "not reproduced"},
        {"not reproduced"},  # the point that is the limit itself
    )
    if {below, above} == {"not reproduced"}:
        assert np.all(values == limit)


@given(st.lists(st.floats(-1e3, 1e3), max_size=LEAST_CLAIM_PAIRS - 1).map(np.array), edges)
def test_too_few_repeats_cannot_tell(values: np.ndarray, claimed: tuple[float, float]) -> None:
    found = judge_claim(values, claimed)
    assert (found.result, found.pairs) == ("cannot tell", values.size)
    assert found.reason


def test_identical_repeats_are_known_exactly() -> None:
    assert judge_claim(np.full(LEAST_CLAIM_PAIRS, 0.999), BELOW).result == "reproduced"
    assert judge_claim(np.full(LEAST_CLAIM_PAIRS, 1.0), BELOW).result == "not reproduced"
    assert judge_claim(np.full(LEAST_CLAIM_PAIRS, 0.5), BELOW).reason == "the same in every repeat"


@pytest.mark.parametrize(
    ("odd", "claimed", "result"),
    [
        ([-math.inf] * 10, BELOW, "reproduced"),
        ([math.inf] * 10, BELOW, "not reproduced"),
        ([math.inf] * 10, (-0.2, 0.2), "not reproduced"),
        ([math.inf] * 9 + [0.0], BELOW, "cannot tell"),
        ([math.nan] * 10, BELOW, "cannot tell"),
        ([math.inf] * 9, BELOW, "cannot tell"),
    ],
)
def test_what_is_not_finite(odd: list[float], claimed: tuple[float, float], result: Result) -> None:
    assert judge_claim(np.array(odd), claimed).result == result


@pytest.mark.parametrize(
    ("results", "result"),
    [
        (["reproduced", "reproduced"], "reproduced"),
        (["reproduced", "cannot tell"], "cannot tell"),
        (["cannot tell", "not reproduced"], "not reproduced"),
        ([], "cannot tell"),
    ],
)
def test_all_parts_must_hold(results: list[Result], result: Result) -> None:
    assert all_of(results) == result


def test_pairs_are_of_one_repeat() -> None:
    mine, others = paired({0: 1.0, 1: 2.0, 3: 4.0}, {3: 40.0, 1: 20.0, 2: 30.0})
    assert (mine.tolist(), others.tolist()) == ([2.0, 4.0], [20.0, 40.0])
    assert difference(mine, others, 0.1).tolist() == pytest.approx([0.0, 0.0])
    assert relative(mine, others).tolist() == pytest.approx([-0.9, -0.9])


PART: dict[str, Any] = {
    "experiment": "one", "condition": "quiet", "controller": "a", "metric": "position_rmse", "axis": "x",
}  # fmt: skip
NEAR = [1.0 + 0.01 * i for i in range(10)]
FAR = [2.0 + 0.01 * i for i in range(10)]


def evidence(table: pd.DataFrame, trials: tuple[Any, ...] = (), **way: Any) -> Evidence:
    """Judge one part on the table of the one experiment."""
    claim = Claim("It is so.", "V", (Part(**{**PART, **way}),))
    (judged,) = judge_claims(
        [claim], {"one": table, "two": table.assign(value=table["value"] / 2)}, {"one": trials, "two": trials}
    )
    (found,) = judged.evidence
    assert judged.result == found.judgement.result
    return found


@pytest.mark.parametrize(
    ("way", "result"),
    [
        ({"below": 1.2}, "reproduced"),
        ({"below": 1.0}, "not reproduced"),
        ({"above": 1.0}, "reproduced"),
        ({"less_than": LessThan("b")}, "reproduced"),
        ({"less_than": LessThan("b", times=0.5)}, "not reproduced"),
        ({"controller": "b", "less_than": LessThan("a")}, "not reproduced"),
        ({"less_than": LessThan(experiment="two")}, "not reproduced"),
        ({"controller": "b", "equals_within": EqualsWithin(1.2, "a")}, "reproduced"),
        ({"controller": "b", "equals_within": EqualsWithin(0.5, "a")}, "not reproduced"),
    ],
)
def test_every_way_of_judging(way: dict[str, Any], result: Result) -> None:
    assert evidence(metric_table({"a": NEAR, "b": FAR}), **way).judgement.result == result


def test_differences_are_of_pairs() -> None:
    """Each repeat is 0.1 better, far less than the repeats differ from each other: only pairs can tell."""
    base = [float(i) for i in range(10)]
    table = metric_table({"a": base, "b": [value + 0.1 + 1e-3 * (-1) ** i for i, value in enumerate(base)]})
    assert evidence(table, less_than=LessThan("b")).judgement.result == "reproduced"
    assert evidence(table, controller="b", less_than=LessThan("a")).judgement.result == "not reproduced"


def test_the_numbers_in_words() -> None:
    found = evidence(metric_table({"a": [0.001] * 10, "b": [0.003] * 10}), less_than=LessThan("b"))
    assert found.values == "1.00 mm vs 3.00 mm"
    assert found.number == "−2.00 mm"
    assert found.measured == "position RMSE x, a (one, quiet, whole trial), minus that of b"
    found = evidence(metric_table({"a": NEAR}), below=1.5)
    assert (found.number, found.claimed) == ("1045 mm [1023, 1067]", "below 1500 mm")


def test_missing_trials_are_named() -> None:
    trials = tuple(trial_entry("b", repeat=i, outcome="tripped" if i else "completed") for i in range(10))
    found = evidence(metric_table({"a": NEAR, "b": FAR[:1]}), trials, less_than=LessThan("b"))
    assert found.judgement.result == "cannot tell"
    assert "9 of 10 trials of b did not complete (tripped)" in found.judgement.reason


def test_an_axis_without_the_metric_is_named() -> None:
    found = evidence(metric_table({"a": NEAR}), axis="", below=1.5)
    assert found.judgement.reason == "nothing was measured; position_rmse has no axis '' (it has: 'x')"


def test_a_claim_that_no_trial_decides() -> None:
    (judged,) = judge_claims([Claim("It works on the real robot.", "VI", undecided="Needs the robot.")], {}, {})
    assert (judged.result, judged.evidence) == ("cannot tell", ())
