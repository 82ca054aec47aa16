"""The rule by which a controller is called best."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from helpers.report_builders import metric_table
from hypothesis import given
from hypothesis import strategies as st

from hilrig.report.comparison import interval, summarise_metrics, verdict, verdicts
from hilrig.report.curves import Curve, limits, thin
from hilrig.report.style import Style

LOOK = Style("#000000", "-")


def judged(**values: list[float]) -> tuple[str | None, str | None, str]:
    found = verdict(pd.DataFrame(values))
    return found.best, found.lowest, found.basis


def test_a_clear_paired_difference_is_marked() -> None:
    """The repeats differ much more than the controllers; the pairs do not."""
    assert judged(a=[1.0, 5.0, 9.0], b=[1.5, 5.6, 9.4]) == ("a", "a", "paired, n = 3")


def test_a_difference_within_the_spread_is_not() -> None:
    assert judged(a=[1.0, 2.0, 1.0], b=[2.0, 1.0, 1.5]) == (None, "a", "within the spread")


def test_best_must_beat_every_other() -> None:
    assert judged(a=[1.0, 1.1, 1.0], b=[5.0, 5.1, 5.2], c=[1.3, 0.9, 1.1])[0] is None


def test_too_few_repeats_mark_no_controller() -> None:
    assert judged(a=[1.0], b=[9.0]) == (None, "a", "only 1 repeat")
    assert judged(a=[1.0, 1.1], b=[9.0, 9.2]) == (None, "a", "only 2 repeats")


def test_identical_repeats_are_named() -> None:
    assert judged(a=[1.0, 1.0], b=[2.0, 2.0]) == ("a", "a", "2 identical repeats")


def test_equal_values_are_a_tie() -> None:
    assert judged(a=[0.0, 0.0, 0.0], b=[0.0, 0.0, 0.0]) == (None, None, "tie")


@pytest.mark.parametrize(("share", "best"), [(1e-12, None), (1e-3, "a")])
def test_a_difference_within_rounding_is_none(share: float, best: str | None) -> None:
    assert judged(a=[1.0, 1.1, 1.2], b=[value * (1 + share) for value in (1.0, 1.1, 1.2)])[0] == best


def test_only_common_repeats_are_paired() -> None:
    nan = np.nan
    assert judged(a=[1.0, 1.0, 1.1], b=[nan, nan, 5.0]) == (None, "a", "only 1 repeat")
    assert judged(a=[1.0, nan, nan], b=[nan, 2.0, 2.1]) == (None, "a", "no common repeat")
    assert judged(a=[1.0, 1.1, 1.2], b=[nan, nan, nan]) == (None, None, "one controller")


def test_never_settled_loses_to_settled() -> None:
    assert judged(a=[1.0, 1.1, 1.2], b=[np.inf] * 3)[0] == "a"
    assert judged(a=[1.0, 1.1, 1.2], b=[np.inf, 0.9, np.inf])[0] is None


@given(st.permutations(["a", "b", "c"]))
def test_the_order_of_controllers_does_not_matter(order: list[str]) -> None:
    values = {"a": [1.0, 1.1, 1.2], "b": [2.0, 2.2, 2.1], "c": [3.0, 3.1, 3.3]}
    assert verdict(pd.DataFrame({name: values[name] for name in order})).best == "a"


def test_a_summary_counts_the_repeats_that_have_a_value() -> None:
    """Of 1, 2, 3 the deviation is 1; the standard error would be 0.577."""
    found = summarise_metrics(metric_table({"a": [1.0, 2.0, 3.0], "b": [4.0, np.nan, 4.0], "c": [5.0]}))
    assert list(found["controller"]) == ["a", "b", "c"]
    assert list(found["mean"]) == [2.0, 4.0, 5.0]
    assert list(found["sd"]) == pytest.approx([1.0, 0.0, np.nan], nan_ok=True)
    assert list(found["repeats"]) == [3, 2, 1]


def test_each_cell_is_judged_by_itself_in_the_order_of_the_table() -> None:
    lower, higher = [1.0, 5.0, 9.0], [1.5, 5.6, 9.4]
    cells = [("press", "z", lower, higher), ("all", "z", higher, lower), ("all", "x", lower, [0.5, 5.1, 9.1])]
    tables = [metric_table({"a": a, "b": b}, axis=axis, phase=phase) for phase, axis, a, b in cells]
    found = verdicts(pd.concat(tables))
    assert {key: value.best for key, value in found.items()} == {
        ("quiet", "press", "position_rmse", "z"): "a",
        ("quiet", "all", "position_rmse", "z"): "b",
        ("quiet", "all", "position_rmse", "x"): None,
    }
    assert [key[1] + key[3] for key in found] == ["pressz", "allz", "allx"]


def test_repeats_are_paired_by_number_not_by_position() -> None:
    a, b = metric_table({"a": [1.0, 5.0, 9.0]}), metric_table({"b": [1.5, 5.6, 9.4]})
    (found,) = verdicts(pd.concat([a, b[::-1]])).values()
    assert found.best == "a"


def test_interval_of_a_known_sample() -> None:
    """Mean 2, deviation 1, n = 3: half-width 4.3027 / sqrt(3)."""
    low, high = interval(np.array([1.0, 2.0, 3.0]))
    assert (low, high) == pytest.approx((2 - 2.4841, 2 + 2.4841), abs=1e-3)
    assert interval(np.array([1.0])) == (-np.inf, np.inf)


@given(st.integers(1, 20_000), st.integers(0, 2**32 - 1))
def test_thinning_keeps_the_extremes_and_the_ends(size: int, seed: int) -> None:
    values = np.random.default_rng(seed).standard_normal(size)
    time, kept = thin(np.arange(size) * 1.0, values)
    assert (kept.min(), kept.max(), kept[0], kept[-1]) == (values.min(), values.max(), values[0], values[-1])
    assert np.all(np.diff(time) > 0)
    assert kept.size <= 2000


def curve(name: str, *values: float) -> Curve:
    return Curve(name, np.arange(len(values)) * 1.0, np.array(values), LOOK)


def test_limits_cover_all_data_of_all_controllers() -> None:
    bounds = limits([curve("a", -1.0, 1.0), curve("b", -15.0, 12.0)], "N")
    assert bounds.low < -15.0
    assert bounds.high > 12.0
    assert bounds.notes == ()


def test_whatever_is_cut_off_has_a_note() -> None:
    bounds = limits([curve("a", -1.0, 1.0), curve("b", 0.0, 500.0)], "N")
    assert bounds.high < 500.0
    assert "b goes off the axis" in bounds.notes[0]
    assert "500 N" in bounds.notes[0]
    assert "not finite" in limits([curve("a", 0.0, np.nan)], "N").notes[0]
