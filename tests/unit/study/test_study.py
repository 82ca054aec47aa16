"""A study made again: what its file may say, what its figures show, and that the same study makes the same files."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from helpers.report_builders import make_run
from matplotlib.figure import Figure

from hilrig.core.errors import ExperimentError
from hilrig.recording.run_directory import read_json
from hilrig.report.dataset import load_run, read_signals
from hilrig.study import load_study, make_reproduction
from hilrig.study.drawing import draw_figure
from hilrig.study.model import FigureSpec
from hilrig.study.reuse import match

EXPERIMENT = """\
hilrig: 1
name: tiny
question: Which of two?
driver:
  kind: two_link
  robot: {kind: planar_2r, lengths: [0.345 m, 0.2 m], masses: [1.8 kg, 1.1 kg]}
  surface: {position: 0.35 m, stiffness: 800 N/m}
task:
  force_axes: [z]
  impedance: {inertia: [3, 6], damping: [30, 60], stiffness: [250, 0]}
phases:
  - {name: before, duration: 0.1 s, position: {kind: hold, value: 0.1}, force: {kind: hold, value: 3.5 N}}
  - {name: after, duration: 0.1 s, position: {kind: hold, value: 0.1}, force: {kind: hold, value: 3.5 N}}
repeats: 10
conditions:
  quiet: []
controllers:
  small: {kind: pd}
  large: {kind: tde_sliding_mode}
"""

STUDY = """\
hilrig: 1
title: A tiny study
out: out
experiments: [tiny.yaml]
figures:
  - {figure: "4", title: Place, experiment: tiny, condition: quiet, controllers: [small], quantity: position, axis: x}
  - {figure: "5", title: Estimate, experiment: tiny, condition: quiet, controllers: [large], quantity: memory.estimate}
claims:
  - claim: Small is better | always.
    where: V
    reason: By eye.
    parts:
      - {experiment: tiny, condition: quiet, controller: small, metric: position_rmse, axis: x, phase: after,
         less_than: {controller: large}}
      - {experiment: tiny, condition: quiet, controller: large, metric: memory_peak.estimate, axis: x, below: 2}
  - claim: It works on the robot.
    where: VI
    undecided: Needs the robot.
"""

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write a study and its experiment, with a text replaced; return the study's path."""

    def write(old: str = "", new: str = "", text: str = STUDY) -> Path:
        assert old in text
        (tmp_path / "tiny.yaml").write_text(EXPERIMENT)
        path = tmp_path / "study.yaml"
        path.write_text(text.replace(old, new, 1) if old else text)
        return path

    return write


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("title:", "titel:", (":2:1:", "unknown key 'titel'", "did you mean 'title'")),
        ("[tiny.yaml]", "[tine.yaml]", (":4:15:", "there is no file 'tine.yaml'", "did you mean 'tiny.yaml'")),
        ("[tiny.yaml]", "[tiny.yaml, tiny.yaml]", (":4:26:", "the experiment 'tiny' is listed twice")),
        ("[tiny.yaml]", "[]", ("there are no experiments",)),
        ("experiment: tiny", "experiment: tyny", (":6:45:", "no experiment 'tyny'", "did you mean 'tiny'")),
        ("condition: quiet", "condition: quite", ("no condition 'quite'", "did you mean 'quiet'")),
        ("[small]", "[smal]", ("no controller 'smal'", "did you mean 'small'")),
        ("[small]", "[]", ("there are no controllers",)),
        ("quantity: position", "quantity: positon", ("no quantity 'positon'", "did you mean 'position'")),
        ("memory.estimate}", "memory.estimat}", ("no field 'estimat'", "did you mean 'estimate'")),
        ("position, axis: x}", "position, axis: z}", ("no axis 'z'", "known: x")),
        ("[small], quantity: position, axis: x", "[small, large], quantity: position", ("'axis' is missing",)),
        ("axis: x}", "axis: x, zoom: [2 s, 1 s]}", ("ends before it begins",)),
        ("axis: x}", "axis: x, zoom: [2 N, 1 s]}", ("'2 N' is a force",)),
        ('figure: "5"', 'figure: "4"', ("figure '4' is defined twice",)),
        ('figure: "4"', 'figure: "../4"', ("is not a figure number",)),
        ("metric: position_rmse", "metric: position_rms", ("no metric 'position_rms'", "'position_rmse'")),
        ("memory_peak.estimate", "memory_peak.estimat", ("no field 'estimat'", "did you mean 'estimate'")),
        ("memory_peak.estimate, axis: x", "memory_peak.estimate", ("'axis' is missing",)),
        ("phase: after", "phase: afer", ("no phase 'afer'", "did you mean 'after'")),
        ("{controller: large}", "{controller: larg}", ("no controller 'larg'", "did you mean 'large'")),
        ("{controller: large}", "{controller: small}", ("compares a value with itself",)),
        ("less_than: {controller: large}", "below: 2 N", ("'2 N' is a force", "length")),
        ("below: 2", "below: 2, above: 1", ("'below' and 'above' are both given",)),
        (", below: 2", "", ("nothing is claimed", "less_than")),
        ("    undecided: Needs the robot.\n", "", ("a claim needs either 'parts'",)),
        ("    reason: By eye.\n", "    undecided: Why?\n", ("either 'parts'",)),
    ],
)
def test_what_is_wrong_is_named_with_its_place(write: Write, old: str, new: str, words: tuple[str, ...]) -> None:
    with pytest.raises(ExperimentError) as caught:
        load_study(write(old, new))
    message = str(caught.value)
    assert re.match(r".*study\.yaml:\d+:\d+: ", message)
    for word in words:
        assert word in message


def test_limits_are_in_the_metrics_unit(write: Write) -> None:
    loaded = load_study(write("less_than: {controller: large}", "below: 15 mm"))
    assert loaded.study.claims[0].parts[0].below == pytest.approx(0.015)


def run_of_tiny(path: Path, failed: tuple[str, ...] = (), expect: tuple[dict, ...] = ()) -> Path:
    """Write a run of the tiny experiment with made-up signals; `large` has errors three times as large."""
    run = make_run(path, {"small": 1.0, "large": 3.0}, repeats=10, seconds=0.2, failed=failed, expect=expect)
    (run / "experiment.yaml").write_text(EXPERIMENT)
    manifest = {**read_json(run / "manifest.json"), "name": "tiny", "overrides": []}
    (run / "manifest.json").write_text(json.dumps(manifest))
    plan = read_json(run / "plan.json")
    for trial in plan["trials"]:
        trial["controller"] = {"kind": "tde_sliding_mode"}
    (run / "plan.json").write_text(json.dumps(plan))
    return run


def made(study: Path, run: Path, out: Path) -> dict[str, bytes]:
    """Make the reproduction and return its files."""
    make_reproduction(load_study(study), {"tiny": run}, out, "hilrig reproduce study.yaml")
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in out.rglob("*") if path.is_file()}


def test_the_same_study_makes_the_same_files(write: Write, tmp_path: Path) -> None:
    study = write()
    first = made(study, run_of_tiny(tmp_path / "one"), tmp_path / "a")
    second = made(study, run_of_tiny(tmp_path / "other" / "two"), tmp_path / "b")
    assert first == second
    assert set(first) == {
        "index.html", "README.md", "claims.csv", "metrics.csv", "summary.json",
        "figures/fig04.svg", "figures/fig04.png", "figures/fig05.svg", "figures/fig05.png",
    }  # fmt: skip
    for name, content in first.items():
        for secret in (str(tmp_path).encode(), f"{datetime.now(UTC).year}-".encode(), b"abc123"):
            assert secret not in content, name


def test_the_files_say_what_was_found(write: Write, tmp_path: Path) -> None:
    files = made(write(), run_of_tiny(tmp_path / "run"), tmp_path / "out")
    result = json.loads(files["summary.json"])
    assert result["results"] == {"reproduced": 1, "not reproduced": 0, "cannot tell": 1}
    claims = pd.read_csv(tmp_path / "out" / "claims.csv")
    assert claims["result"].tolist()[:2] == ["reproduced", "reproduced"]
    # The errors are 10 mm cos 3t and 30 mm cos 3t: of the whole difference two thirds of the larger.
    assert claims["mean"][0] == pytest.approx(-2 / 3 * claims["against"][0])
    # The made-up estimate is k / N at tick k.
    assert claims["mean"][1] == pytest.approx(1.0)
    metrics = pd.read_csv(tmp_path / "out" / "metrics.csv", keep_default_na=False)
    assert set(metrics["experiment"]) == {"tiny"}
    assert "memory_peak.estimate" in set(metrics["metric"])
    page, readme = files["index.html"].decode(), files["README.md"].decode()
    for text in (page, readme):
        for words in ("hilrig reproduce study.yaml", "hilrig run tiny.yaml", "Needs the robot.", "By eye."):
            assert words in text
    assert "Small is better \\| always." in readme
    assert "<script" not in page
    targets = re.findall(r"""(?:src|href|url)\s*[=(]\s*["']?([^"')\s>]+)""", page)
    assert all(target.startswith(("data:", "#")) for target in targets)


def test_trials_that_did_not_complete_are_listed(write: Write, tmp_path: Path) -> None:
    run = run_of_tiny(tmp_path / "run", failed=("large.quiet.3",))
    files = made(write(), run, tmp_path / "out")
    assert json.loads(files["summary.json"])["claims"][0]["result"] == "cannot tell"
    for name in ("index.html", "README.md"):
        assert "force above 200 N at t = 0.5 s" in files[name].decode()
        assert "1 of 10 trials of large did not complete (tripped)" in files[name].decode()


LARGE = tuple(f"large.quiet.{i}" for i in range(10))
TRIPS = {"controller": "large", "outcome": "tripped"}
SMALL = {"controller": "small", "metric": "position_rmse", "phase": "all", "below": 1e-6}


def test_expectations_have_a_table_of_their_own(write: Write, tmp_path: Path) -> None:
    run = run_of_tiny(tmp_path / "run", LARGE, (TRIPS, SMALL))
    files = made(write(), run, tmp_path / "out")
    summary = json.loads(files["summary.json"])
    assert [(item["experiment"], item["met"]) for item in summary["expectations"]] == [("tiny", True), ("tiny", False)]
    assert all(trial["as_expected"] for trial in summary["experiments"][0]["not_completed"])
    basis = "quiet: repeat 0, first of 10, force above 200 N at t = 0.5 s"
    page, readme = files["index.html"].decode(), files["README.md"].decode()
    row = (
        r"<td>tiny</td><td.*?>outcome of large</td><td.*?>tripped</td><td>tripped</td><td.*?>met</td><td.*?>(.*?)</td>"
    )
    assert re.findall(row, page) == [basis]
    assert f"| tiny | outcome of large | tripped | tripped | met | {basis} |" in readme
    assert "| position\\_rmse of small, phase all | below 1e-06 m | 0." in readme
    for text in (page, readme):
        assert "1 of 2 are met" in text
        assert "tripped, as expected" in text
        assert "10 of 20, 10 tripped as expected" in text


@pytest.mark.parametrize(
    ("failed", "expect", "ended_well", "met"),
    [
        ((), (), True, []),
        (LARGE, (TRIPS,), True, [True]),
        (LARGE, (), False, []),
        (LARGE[:1], (TRIPS,), True, [False]),
        ((*LARGE, "small.quiet.0"), (TRIPS,), False, [True]),
    ],
)
def test_trials_end_well_if_they_complete_or_end_as_expected(
    write: Write, tmp_path: Path, failed: tuple[str, ...], expect: tuple[dict, ...], ended_well: bool, met: list[bool]
) -> None:
    run = run_of_tiny(tmp_path / "run", failed, expect)
    found = make_reproduction(load_study(write()), {"tiny": run}, tmp_path / "out", "")
    assert found.ended_well == ended_well
    assert [item.met for item in found.expected["tiny"]] == met


def test_an_experiment_in_place_of_a_study_is_named_in_one_line(write: Write) -> None:
    path = write().parent / "tiny.yaml"
    with pytest.raises(ExperimentError) as caught:
        load_study(path)
    assert str(caught.value) == f"{path}: this is an experiment, not a study; to run it: hilrig run {path}"


def panel(tmp_path: Path, **changes: Any) -> Figure:
    """Draw one figure of a run of one second; the phases are before and after 0.5 s."""
    run = load_run(make_run(tmp_path / "run", {"small": 1.0, "large": 3.0}, repeats=1))
    pairs: dict[str, Any] = {trial.controller: (trial, read_signals(trial)) for trial in run.trials}
    plain: dict[str, Any] = {
        "figure": "4", "title": "", "experiment": "tiny", "condition": "quiet", "controllers": ("small",),
        "quantity": "position", "axis": "x",
    }  # fmt: skip
    spec = FigureSpec(**{**plain, **changes})
    figure, _ = draw_figure(spec, {name: pairs[name] for name in spec.controllers}, run.controllers)
    return figure


@pytest.mark.parametrize(
    ("changes", "label", "legend"),
    [
        ({}, "position x [m]", ["reference", "small"]),
        (
            {"quantity": "position_error", "controllers": ("small", "large")},
            "position error x [mm]",
            ["small", "large"],
        ),
        ({"quantity": "force", "axis": "z"}, "force z [N]", ["reference", "small"]),
        ({"quantity": "force_error", "axis": None}, "force error [N]", ["small"]),
        ({"quantity": "auxiliary_error", "axis": None}, "auxiliary error [N]", ["x", "z"]),
        ({"quantity": "memory.gains", "axis": None}, "gains [SI, not stated]", ["1", "2", "3"]),
        ({"quantity": "memory.gains", "axis": "2"}, "gains 2 [SI, not stated]", ["small"]),
    ],
)
def test_a_figure_is_one_panel_with_its_labels(
    tmp_path: Path, changes: dict[str, Any], label: str, legend: list[str]
) -> None:
    figure = panel(tmp_path, **changes)
    (axes,) = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [s]", label)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == legend
    assert axes.get_xlim() == (0.0, 1.0)


def test_the_limits_hide_nothing(tmp_path: Path) -> None:
    axes = panel(tmp_path, quantity="force_error", axis="z", controllers=("small", "large")).axes[0]
    low, high = axes.get_ylim()
    drawn = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in axes.lines[:2]])
    assert low < drawn.min() < drawn.max() == pytest.approx(3.5, abs=0.2)
    assert drawn.max() < high


def test_a_zoom_is_a_second_panel(tmp_path: Path) -> None:
    figure = panel(tmp_path, zoom=(0.4, 0.6))
    assert [axes.get_xlim() for axes in figure.axes] == [(0.0, 1.0), (0.4, 0.6)]
    assert figure.get_size_inches()[0] == 3.5


def test_a_run_is_reused_only_for_its_own_experiment(write: Write, tmp_path: Path) -> None:
    loaded, run = load_study(write()), run_of_tiny(tmp_path / "run")
    assert match(loaded, [run], []) == {"tiny": run}
    with pytest.raises(ExperimentError, match="is already a run of 'tiny'"):
        match(loaded, [run, run], [])
    with pytest.raises(ExperimentError, match=r"was: none|other overrides \(none, now: repeats=2\)"):
        match(loaded, [run], ["repeats=2"])
    (tmp_path / "tiny.yaml").write_text(EXPERIMENT + "seed: 3\n")
    with pytest.raises(ExperimentError, match=r"tiny\.yaml has changed since"):
        match(loaded, [run], [])
    with pytest.raises(ExperimentError, match="is a run of 'other', which is not part"):
        match(loaded, [make_run(tmp_path / "other", {"small": 1.0}, repeats=1, seconds=0.01)], [])
