"""The paired difference of two runs, from tables of metrics that are known beforehand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers.report_builders import make_run, metric_table

from hilrig.core.errors import RunDirectoryError
from hilrig.report import compare_runs, render


def run(path: Path, table: pd.DataFrame | str, seed: int = 7) -> Path:
    """Write a run whose metrics.csv is `table`."""
    made = make_run(path, {"only": 1.0}, repeats=1, seconds=0.01, seed=seed)
    (made / "metrics.csv").write_text(table if isinstance(table, str) else table.to_csv(index=False))
    return made


A = metric_table({"only": [1.0, 2.0, 3.0, 9.0]})
B = metric_table({"only": [2.0, 4.0, 6.0]})[::-1]
"""The repeats in another order: they are matched by number"""


def test_repeats_are_compared_in_pairs(tmp_path: Path) -> None:
    """b - a is 1, 2, 3: mean 2, deviation 1, n = 3: half-width 4.3027 / sqrt(3). The fourth repeat is in a only."""
    table = compare_runs(run(tmp_path / "a", A), run(tmp_path / "b", B))
    (row,) = table.to_dict("records")
    assert (row["a"], row["b"], row["difference"], row["relative"], row["repeats"]) == (2.0, 4.0, 2.0, 1.0, 3)
    assert (row["low"], row["high"]) == pytest.approx((2 - 2.4841, 2 + 2.4841), abs=1e-3)
    assert "values that only one run has, left out: 1" in table.attrs["notes"]


def test_runs_with_different_seeds_are_not_paired(tmp_path: Path) -> None:
    table = compare_runs(run(tmp_path / "a", A, seed=7), run(tmp_path / "b", B, seed=8))
    assert (table["low"][0], table["high"][0]) == (-np.inf, np.inf)
    assert table["difference"][0] == 2.0
    assert any("different seeds" in note for note in table.attrs["notes"])


def test_each_controller_condition_phase_metric_and_axis_has_a_row(tmp_path: Path) -> None:
    cells = [{}, *({key: "other"} for key in ("controller", "condition", "phase", "metric", "axis"))]
    a = pd.concat([A.assign(**cell) for cell in cells])
    b = pd.concat([A.assign(value=A["value"] + k, **cell) for k, cell in enumerate(cells)])
    table = compare_runs(run(tmp_path / "a", a), run(tmp_path / "b", b))
    assert list(table["difference"]) == list(range(len(cells))), "in the order of the first run"
    assert set(table["repeats"]) == {4}


@pytest.mark.parametrize(
    ("change", "marked"), [([1.0, 1.1, 1.2], True), ([-1.0, -1.1, -1.2], True), ([1, -1, 0], False)]
)
def test_a_difference_beyond_its_spread_is_marked(tmp_path: Path, change: list[float], marked: bool) -> None:
    a, b = metric_table({"only": [5.0] * 3}), metric_table({"only": [5.0 + value for value in change]})
    line = render(compare_runs(run(tmp_path / "a", a), run(tmp_path / "b", b))).splitlines()[1]
    assert "position_rmse x [m]" in line
    assert line.endswith("*") == marked


def test_long_names_keep_the_columns_in_line(tmp_path: Path) -> None:
    a, b = (frame.assign(phase="a_phase_with_a_long_name", controller="a_controller_with_one") for frame in (A, B))
    head, *lines = render(compare_runs(run(tmp_path / "a", a), run(tmp_path / "b", b))).splitlines()
    rows = [line for line in lines if line.startswith("a_controller")]
    assert rows
    assert {line.index("position_rmse") for line in rows if "position_rmse" in line} == {head.index("metric")}


def test_a_name_made_of_digits_stays_a_string(tmp_path: Path) -> None:
    a, b = A.assign(controller="007"), B.assign(controller="007")
    assert compare_runs(run(tmp_path / "a", a), run(tmp_path / "b", b))["controller"][0] == "007"


def test_infinite_in_both_runs_is_no_difference(tmp_path: Path) -> None:
    never = metric_table({"only": [np.inf] * 3})
    line = render(compare_runs(run(tmp_path / "a", never), run(tmp_path / "b", never))).splitlines()[1]
    assert line.split()[-3:] == ["inf", "inf", "–"]


def test_runs_with_nothing_in_common(tmp_path: Path) -> None:
    with pytest.raises(RunDirectoryError, match="in common"):
        compare_runs(run(tmp_path / "a", A), run(tmp_path / "b", A.assign(controller="other")))


@pytest.mark.parametrize(
    "garbage",
    [
        "",
        "\0\0\0",
        "some words",
        A.drop(columns="axis").to_csv(index=False),
        A.assign(value="high").to_csv(index=False),
    ],
)
def test_a_table_that_is_garbage(tmp_path: Path, garbage: str) -> None:
    with pytest.raises(RunDirectoryError, match=r"metrics\.csv"):
        compare_runs(run(tmp_path / "a", garbage), run(tmp_path / "b", A))


def test_a_run_without_a_table_is_measured(tmp_path: Path) -> None:
    """x error: size * 0.01 cos 3t. The tripped trial is left out."""
    a = make_run(tmp_path / "a", {"only": 1.0}, seconds=0.1, failed=("only.quiet.2",))
    b = make_run(tmp_path / "b", {"only": 2.0}, seconds=0.1)
    row = compare_runs(a, b).set_index(["phase", "metric", "axis"]).loc[("all", "position_rmse", "x")]
    expected = 0.01 * np.sqrt(np.mean(np.cos(3e-3 * np.arange(100)) ** 2))
    assert (row["a"], row["difference"], row["repeats"]) == (pytest.approx(expected), pytest.approx(expected), 2)
