"""The verbs, called as a user calls them."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from helpers.experiments import EXPERIMENTS, parameters
from helpers.real_rig import PROJECT, only_run
from typer.testing import CliRunner

from hilrig.cli.application import app
from hilrig.core.errors import HilrigError
from hilrig.study import load_study


def call(*arguments: str) -> str:
    """Run a verb in this process and return what it printed; errors are raised."""
    result = CliRunner().invoke(app, list(arguments), catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture(autouse=True)
def _verbs(monkeypatch, tmp_path: Path) -> None:
    import hilrig.cli.entry  # noqa: F401  (registers the verbs)

    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    "path", parameters(path for path in EXPERIMENTS.glob("**/*.yaml") if path.name != "reproduce.yaml")
)
def test_every_experiment_that_comes_with_hilrig_is_ready_to_run(path: Path) -> None:
    assert "ready to run" in call("check", str(path))


def test_a_warning_goes_to_stderr_and_changes_no_exit_code() -> None:
    too_large = "controllers.proposed.inertia_estimate=1 kg"
    result = CliRunner().invoke(app, ["check", str(PROJECT / "experiments" / "quickstart.yaml"), "--set", too_large])
    assert result.exit_code == 0
    assert "ready to run" in result.stdout
    assert "warning" not in result.stdout
    lines = result.stderr.splitlines()
    assert len(lines) == 2
    assert all(": warning: controller 'proposed': " in line for line in lines)
    assert "Mhat = 1 kg is above 0.27 kg" in lines[0]


def test_check_tells_programs_places_and_numbers() -> None:
    quickstart = str(PROJECT / "experiments" / "quickstart.yaml")
    result = CliRunner().invoke(app, ["check", quickstart, "--set", "actuation_delay=3", "--json"])
    document = json.loads(result.stdout)
    assert result.stderr == ""
    (warning,) = document["warnings"]
    assert (warning["line"], document["trials"]) == (27, 2)
    limits = {bound["name"]: bound["limit"] for bound in document["bounds"]["controllers"]["proposed"]["bounds"]}
    assert limits["delay bound (24), as derived, best kappa"] == pytest.approx(2.82e-3, rel=1e-3)


def test_the_study_of_the_paper_fits_its_experiments() -> None:
    loaded = load_study(PROJECT / "experiments" / "paper" / "reproduce.yaml")
    files = {path.name for path in (PROJECT / "experiments" / "paper").glob("*.yaml")}
    assert {*loaded.study.experiments, "reproduce.yaml"} == files
    assert {spec.figure for spec in loaded.study.figures} == {str(i) for i in range(4, 17)}
    judged = {part.experiment for claim in loaded.study.claims for part in claim.parts}
    assert len(judged) >= 6
    assert all(loaded.experiments[name].repeats >= 10 for name in judged)


@pytest.mark.needs_pybullet
def test_the_plan_lists_repeats_first() -> None:
    document = json.loads(call("plan", str(PROJECT / "experiments" / "handrail_comparison.yaml"), "--json"))
    ids = [trial["id"] for trial in document["trials"]]
    assert ids[:4] == ["proposed.noisy.0", "pd.noisy.0", "adaptive.noisy.0", "sliding_mode.noisy.0"]
    assert len(ids) == 12
    assert {tuple(trial["seed"]) for trial in document["trials"]} == {(7, 0), (7, 1), (7, 2)}


def test_kinds_shows_parameters_with_unit_and_bounds() -> None:
    assert "tde_sliding_mode" in call("kinds")
    shown = call("kinds", "controllers", "pd")
    assert "tau_g + J^T f" in shown
    assert "N/m" in shown


def test_the_schema_is_json_schema() -> None:
    document = json.loads(call("schema"))
    assert "controllers" in document["properties"]


def test_without_runs_list_says_how_to_make_one() -> None:
    assert "hilrig run EXPERIMENT" in call("list")


def test_an_unknown_run_is_named() -> None:
    with pytest.raises(HilrigError, match="there is no run 'nothing'"):
        call("show", "nothing")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "none.yaml"), "none.yaml"),
        (("check", "none.yaml"), "none.yaml"),
        (("run", "{quickstart}", "--set", "controllers.pd.stifness=3"), "did you mean 'stiffness'"),
        (("run", "{quickstart}", "--clock", "fast"), "lockstep"),
        (("run", "{quickstart}", "--jobs", "0"), "--jobs 0: the number of trials"),
        (("run", "{quickstart}", "--junit", "{quickstart}/x.xml"), "there is a file of that name"),
        (("run", "{quickstart}", "--junit", "/"), "is a directory"),
        (("run", "{quickstart}", "--clock", "realtime", "--jobs", "2"), "--jobs"),
        (("kinds", "controlers"), "did you mean 'controllers'"),
        (("report", "none"), "there is no run"),
        (("reproduce", "none.yaml"), "none.yaml"),
        (("reproduce", "{quickstart}"), "this is an experiment, not a study; to run it: hilrig run"),
        (("reproduce", "{quickstart}", "--set", "repeats=2"), "give --out"),
        (("reproduce", "{quickstart}", "--jobs", "0"), "must be at least 1"),
    ],
)
def test_a_wrong_call_is_one_message_and_exit_2(hilrig, tmp_path: Path, arguments, words: str) -> None:
    quickstart = str(PROJECT / "experiments" / "quickstart.yaml")
    done = hilrig(*(argument.format(quickstart=quickstart) for argument in arguments))
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert os.listdir(tmp_path) == []


TWO = "pd: {kind: pd}\n  softer: {kind: pd, stiffness: 500 N/m}"


def test_a_run_ends_with_its_report(hilrig, experiment, tmp_path: Path) -> None:
    done = hilrig("run", experiment(duration=0.3, controllers=TWO), "--in-process", "--repeats", "2")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    lines = done.stdout.splitlines()
    assert lines[0].startswith("run ")
    assert "(4 of 4 trials completed)" in lines[0]
    page = tmp_path / lines[1].removeprefix("report").strip()
    assert page.name == "index.html"
    text = page.read_text()
    assert "Does the rig work?" in text
    assert "http://" not in text.replace("http://www.w3.org", "")
    again = hilrig("report", lines[0].split()[1], "--out", "again")
    assert again.returncode == 0, again.stderr
    assert (tmp_path / "again" / "metrics.csv").read_text() == (page.parent / "metrics.csv").read_text()


def test_a_run_is_shown_and_compared(hilrig, experiment, tmp_path: Path) -> None:
    assert hilrig("run", experiment(duration=0.3, controllers=TWO), "--in-process", "--no-report").returncode == 0
    run = only_run(tmp_path)
    assert "pd.noisy.0" in hilrig("show", run).stdout
    compared = hilrig("compare", run.name, run)
    assert compared.returncode == 0, compared.stderr
    assert "force_rmse" in compared.stdout
    json.loads(hilrig("compare", run, run, "--json").stdout)


def test_two_jobs_run_all_trials(hilrig, experiment, tmp_path: Path) -> None:
    done = hilrig("run", experiment(duration=0.3, controllers=TWO), "--jobs", "2", "--no-report")
    assert done.returncode == 0, done.stderr
    outcomes = [json.loads(path.read_text()) for path in tmp_path.glob("runs/*/trials/*/outcome.json")]
    assert [outcome["outcome"] for outcome in outcomes] == ["completed"] * 2
