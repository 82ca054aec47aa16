"""The report, from synthetic run directories: every number on the page is known beforehand."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers.report_builders import SIZES, make_run, signals

from hilrig.core.errors import RunDirectoryError
from hilrig.report import make_report
from hilrig.report.page import number


def report(run: Path, tmp_path: Path) -> tuple[str, dict]:
    page = make_report(run, tmp_path / "out")
    return page.read_text(encoding="utf-8"), json.loads((tmp_path / "out" / "summary.json").read_text())


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, dict]:
    """A run of two controllers, one trial of which tripped, and its report."""
    folder = tmp_path_factory.mktemp("report")
    expect = tuple(
        {"metric": "position_rmse", "controller": name, "phase": "after", "below": below}
        for name, below in (("small", 0.1), ("small", 1e-6), ("large", 0.2))
    )
    expect += ({**expect[0], "minus": "large", "below": 0.0},)
    run = make_run(folder / "run", SIZES, repeats=4, failed=("large.quiet.2",), expect=expect)
    return folder, *report(run, folder)


def test_the_page_is_self_contained(reported: tuple[Path, str, dict]) -> None:
    _, page, _ = reported
    found = re.findall(r"""(?:src|href|url)\s*[=(]\s*["']?([^"')\s>]+)""", page)
    assert found
    assert all(target.startswith(("data:", "#")) for target in found)
    assert "<script" not in page
    assert "@import" not in page


def test_the_page_has_the_question_and_the_provenance(reported: tuple[Path, str, dict]) -> None:
    _, page, _ = reported
    for words in (
        "Which controller keeps 3.5 N?", "abc123", "uncommitted changes", "hilrig run experiments/x.yaml", "repeats=3",
        "95 % confidence interval", "RMSE_i", "lower is better",
    ):  # fmt: skip
        assert words in page
    assert "&lt;b&gt;Which&lt;/b&gt;" in page, "the experiment's text is escaped"


def test_the_page_answers(reported: tuple[Path, str, dict]) -> None:
    """RMSE of 10 mm cos 3t over [0, 1 s]: 6.9045 mm, and three times that."""
    _, page, summary = reported
    assert "small has the lowest position RMSE x (6.9 mm)" in page
    row = page.index("position RMSE x", page.index("whole trial"))
    cells = re.findall(r"<td(.*?)>([\d.]+)", page[row : page.index("</tr>", row)])
    assert cells[:2] == [(' class="best"', "6.905"), ("", "20.71")]
    (judged,) = [v for v in summary["verdicts"] if (v["phase"], v["metric"]) == ("all", "position_rmse")]
    assert judged["best"] == "small"


def test_the_page_says_which_expectations_are_met(reported: tuple[Path, str, dict]) -> None:
    """RMS of 10 mm cos 3t over [0.5 s, 1 s]: 10 mm √(1/2 + (sin 6 − sin 3) / 6) = 6.56 mm, less half a sample."""
    _, page, summary = reported
    assert [item["met"] for item in summary["expectations"]] == [True, False, False, False]
    row = r">position_rmse of ([\w ]+), phase after</td>" + r"<td.*?>(.*?)</td>" * 4
    assert re.findall(row, page) == [
        ("small", "below 0.1 m", "0.006549 m", "met", "quiet, x: repeat 0, worst of 4"),
        ("small", "below 1e-06 m", "0.006549 m", "not met", "quiet, x: repeat 0, worst of 4"),
        ("large", "below 0.2 m", "0.01965 m", "not met", "quiet, x: repeat 0, worst of 3; 1 trial not completed"),
        ("small minus large", "below 0 m", "-0.0131 m", "not met",
         "quiet, x: 3 identical repeats; 1 trial not completed"),
    ]  # fmt: skip
    assert "1 of 4 met" in page
    rms = 0.01 * np.sqrt(np.mean(np.cos(3 * np.arange(0.5, 1.0, 1e-3)) ** 2))
    difference = summary["expectations"][3]
    assert difference["low"] == difference["high"] == difference["value"] == pytest.approx(-2 * rms)


def test_a_failed_trial_is_listed_and_left_out(reported: tuple[Path, str, dict]) -> None:
    folder, page, summary = reported
    assert "force above 200 N at t = 0.5 s" in page
    table = pd.read_csv(folder / "out" / "metrics.csv")
    assert "large.quiet.2" not in set(table["trial"])
    assert {o["trial"]: o["outcome"] for o in summary["outcomes"]}["large.quiet.2"] == "tripped"


@pytest.mark.parametrize(
    ("phase", "ticks"), [("before", slice(0, 500)), ("after", slice(500, 1000)), ("all", slice(None))]
)
def test_metrics_agree_with_the_signals(reported: tuple[Path, str, dict], phase: str, ticks: slice) -> None:
    """e_aux = M_d (x'' - x_d'') + B_d (x' - x_d') + K_d (x - x_d) along x, where no force acts; F_e - F_d along z."""
    folder, _, _ = reported
    s = signals(1000, SIZES["large"], 0)
    along_x = {name: values[:, 0] for name, values in s.items() if values.ndim == 2}
    slope = np.gradient(along_x["velocity"], s["time"])
    auxiliary = 3.0 * (slope - along_x["reference_acceleration"])
    auxiliary += 30.0 * (along_x["velocity"] - along_x["reference_velocity"])
    auxiliary += 250.0 * (along_x["position"] - along_x["reference_position"])
    expected = {
        ("position_rmse", "x"): 0.03 * np.cos(3 * s["time"]), ("force_rmse", "z"): s["force"] - 3.5,
        ("auxiliary_error_rmse", "x"): auxiliary, ("auxiliary_error_rmse", "z"): s["force"] - 3.5,
    }  # fmt: skip
    found = pd.read_csv(folder / "run" / "metrics.csv").set_index(["trial", "phase", "metric", "axis"])["value"]
    for cell, values in expected.items():
        rmse = np.sqrt(np.mean(values[ticks] ** 2))
        assert found["large.quiet.0", phase, *cell] == pytest.approx(rmse, rel=1e-9), cell


def test_the_settling_time_is_measured_in_each_phase(reported: tuple[Path, str, dict]) -> None:
    """The band is 5 mm. 10 mm |cos 3t| enters it at t = 0.3491 s, 30 mm |cos 3t| at 0.4678 s; both leave it again."""
    folder, _, _ = reported
    table = pd.read_csv(folder / "run" / "metrics.csv").set_index(["metric", "repeat", "controller", "phase"])
    found = table["value"].sort_index()["settling_time", 0]
    assert found["small", "before"] == pytest.approx(0.350)
    assert found["large", "before"] == pytest.approx(0.468)
    assert found["small", "after"] == math.inf
    assert len(found) == 4, "none of the whole trial"


def test_every_figure_is_saved_as_svg_and_png(reported: tuple[Path, str, dict]) -> None:
    folder, _, _ = reported
    files = {path.name for path in (folder / "out" / "figures").iterdir()}
    stems = (
        "position_x", "position_error_x", "force_z", "force_error_z", "auxiliary_error_x", "auxiliary_error_z",
        "effort", "internals_small",
    )  # fmt: skip
    assert {f"quiet_{stem}.{ending}" for stem in stems for ending in ("svg", "png")} <= files


def test_the_same_run_makes_the_same_page(reported: tuple[Path, str, dict]) -> None:
    folder, page, _ = reported
    assert make_report(folder / "run", folder / "again").read_text(encoding="utf-8") == page


def test_a_plant_without_truth_is_reported_as_measured(tmp_path: Path) -> None:
    page, _ = report(make_run(tmp_path / "run", SIZES, repeats=1, truth=False), tmp_path)
    assert "as measured by the sensors" in page


def test_all_trials_failed(tmp_path: Path) -> None:
    page, summary = report(make_run(tmp_path / "run", {"small": 1.0}, repeats=1, failed=("small.quiet.0",)), tmp_path)
    assert "No trial completed" in page
    assert summary["verdicts"] == []


def test_a_damaged_trial_is_left_out_and_the_metrics_in_the_run_stay(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", {"small": 1.0}, repeats=2, seconds=0.05)
    bag = run / "trials" / "small.quiet.1" / "bag.mcap"
    bag.write_bytes(bag.read_bytes()[:-1])
    (run / "metrics.csv").write_text("of when it was whole")
    page, _ = report(run, tmp_path)
    assert "1 of 2 trials completed" in page
    assert "bag.mcap has since been cut" in page
    assert set(pd.read_csv(tmp_path / "out" / "metrics.csv")["trial"]) == {"small.quiet.0"}
    assert (run / "metrics.csv").read_text() == "of when it was whole"


def test_not_a_run(tmp_path: Path) -> None:
    with pytest.raises(RunDirectoryError):
        make_report(tmp_path)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (9.994, "9.99"), (9.999, "10.0"), (0.09999, "0.100"), (0.0123456, "0.0123"), (999.9, "1000"), (-0.5, "−0.500"),
        (123456.0, "123456"), (999999.9, "1.00e6"), (-1.234e-7, "−1.23e−7"), (1e-5, "0.0000100"), (0.0, "0"),
        (math.inf, "∞"), (-math.inf, "−∞"), (math.nan, "–"), (None, "–"),
    ],
)  # fmt: skip
def test_a_number_has_three_digits(value: float | None, text: str) -> None:
    assert number(value) == text


def test_a_trial_that_trips_as_expected_is_marked_so_and_left_out(tmp_path: Path) -> None:
    expect = ({"controller": "large", "outcome": "tripped"},)
    run = make_run(tmp_path / "run", SIZES, repeats=1, failed=("large.quiet.0",), expect=expect)
    page, summary = report(run, tmp_path)
    assert "1 of 2 trials completed, 1 tripped as expected" in page
    assert '<td class="left good">tripped, as expected</td>' in page
    assert [item["met"] for item in summary["expectations"]] == [True]
    assert set(pd.read_csv(tmp_path / "out" / "metrics.csv")["controller"]) == {"small"}
