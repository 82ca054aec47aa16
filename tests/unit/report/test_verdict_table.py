"""The verdict in words and as tables, from a table of metrics: every number is known beforehand."""

from __future__ import annotations

import pandas as pd
import pytest
from helpers.report_builders import metric_table

from hilrig.report.comparison import summarise_metrics, verdicts
from hilrig.report.verdict_table import VerdictTable, answer_question, verdict_tables

NAMES = ("a", "b")

METRICS = pd.concat([
    # The phase is won by another controller than the whole trial.
    metric_table({"a": [2e-3, 2.2e-3, 2.4e-3], "b": [1e-3, 1.1e-3, 1.2e-3]}, phase="press"),
    metric_table({"a": [1e-3, 2e-3, 1e-3], "b": [2e-3, 1e-3, 1.5e-3]}, phase="release"),
    metric_table({"a": [1e-3, 1.01e-3, 1.02e-3], "b": [3e-3, 3.02e-3, 3.04e-3]}),
    metric_table({"a": [0.5, 0.6, 0.7], "b": [0.2, 0.25, 0.3]}, "force_rmse", "z", "N"),
    metric_table({"a": [1.0, 2.0, 1.0], "b": [2.0, 1.0, 1.5]}, "effort", "", "N m"),
    metric_table({"a": [1e-3, 2e-3, 1e-3], "b": [2e-3, 1e-3, 1.5e-3]}, condition="rough"),
    metric_table({"a": [0.1, 0.2, 0.3]}, "late_fraction", "", "", condition="rough"),
])  # fmt: skip


def tables() -> list[VerdictTable]:
    return verdict_tables(summarise_metrics(METRICS), verdicts(METRICS), NAMES)


def test_a_table_for_each_condition_and_phase() -> None:
    found = [(table.condition, table.phase, [(row.metric, row.axis) for row in table.rows]) for table in tables()]
    assert found == [
        ("quiet", "press", [("position_rmse", "x")]),
        ("quiet", "release", [("position_rmse", "x")]),
        ("quiet", "all", [("position_rmse", "x"), ("force_rmse", "z"), ("effort", "")]),
        ("rough", "all", [("position_rmse", "x"), ("late_fraction", "")]),
    ]


@pytest.mark.parametrize(
    ("place", "unit", "means", "deviations", "best"),
    [
        ((0, 0), "mm", [2.2, 1.1], [0.2, 0.1], [False, True]),
        ((2, 0), "mm", [1.01, 3.02], [0.01, 0.02], [True, False]),
        ((2, 1), "N", [0.6, 0.25], [0.1, 0.05], [False, True]),
        ((2, 2), "N m", [4 / 3, 1.5], [3**-0.5, 0.5], [False, False]),
    ],
)
def test_a_row_has_mean_deviation_and_mark_of_each_controller(
    place: tuple[int, int], unit: str, means: list[float], deviations: list[float], best: list[bool]
) -> None:
    row = tables()[place[0]].rows[place[1]]
    assert row.unit == unit
    assert [entry.mean for entry in row.entries] == pytest.approx(means)
    assert [entry.sd for entry in row.entries] == pytest.approx(deviations)
    assert [entry.best for entry in row.entries] == best


def test_a_row_gives_the_basis_of_its_mark() -> None:
    assert [row.basis for row in tables()[2].rows] == ["paired, n = 3", "paired, n = 3", "within the spread"]


def test_a_controller_without_a_value_has_an_empty_cell() -> None:
    row = tables()[3].rows[1]
    assert (row.entries[0].mean, row.entries[1].mean, row.entries[1].sd) == (pytest.approx(0.2), None, None)


def test_the_answer_is_about_the_whole_trial() -> None:
    assert answer_question(verdicts(METRICS), summarise_metrics(METRICS), NAMES) == [
        "Condition quiet: b has the lowest force RMSE z (0.25 N); a has the lowest position RMSE x (1.01 mm).",
        "Condition rough: no verdict on position RMSE x (within the spread).",
        "Of the 7 rows of the tables, a is marked best in 1, b in 2, and none in 4.",
    ]


def test_a_single_controller_is_not_compared() -> None:
    alone = METRICS[METRICS["controller"] == "a"]
    (sentence,) = answer_question(verdicts(alone), summarise_metrics(alone), ("a",))
    assert "nothing to compare" in sentence


def test_a_single_phase_is_not_shown_twice() -> None:
    once = METRICS[METRICS["phase"] != "release"]
    spans = [(t.condition, t.phase) for t in verdict_tables(summarise_metrics(once), verdicts(once), NAMES)]
    assert spans == [("quiet", "all"), ("rough", "all")]
    assert answer_question(verdicts(once), summarise_metrics(once), NAMES)[-1].startswith("Of the 5 rows")


def test_without_a_mark_nothing_is_counted() -> None:
    rough = METRICS[METRICS["condition"] == "rough"]
    sentence = answer_question(verdicts(rough), summarise_metrics(rough), NAMES)[-1]
    assert sentence == "No controller is marked best in any of the 2 rows of the tables."
