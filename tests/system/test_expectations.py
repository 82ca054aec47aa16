"""Expectations as a user and a CI system see them: the list, the exit code, the JUnit file."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

from helpers.real_rig import only_run

TWO = "pd: {kind: pd}\n  softer: {kind: pd, stiffness: 500 N/m}"
MET = """expect:
  - {metric: force_rmse, controller: pd, below: 100 N}
  - {metric: force_rmse, controller: pd, minus: softer, above: -100 N, below: 100 N}
"""
WEAK = "safety: {tip_force: 0.01 N}"
UNMET = MET + "  - {metric: force_rmse, controller: pd, below: 1 mN}\n"


def test_met_and_unmet_are_listed_and_one_unmet_is_exit_1(hilrig, experiment, tmp_path: Path) -> None:
    file = experiment(duration=0.2, controllers=TWO, more="repeats: 3\n" + UNMET)
    done = hilrig("run", file, "--in-process", "--no-report", "--junit", "ci/hilrig.xml")
    assert (done.returncode, done.stderr) == (1, "")
    ran, head, *lines = done.stdout.splitlines()
    assert ran.endswith("(6 of 6 trials completed)")
    assert head == "expected 2 of 3 met"
    assert [line.split("force_rmse")[0].strip() for line in lines] == ["met", "met", "not met"]
    # Aligned, not folded, and without colours: one column begins at one place.
    assert len({line.index("force_rmse") for line in lines}) == 1
    assert {line.index(limit) for line, limit in zip(lines, ("below", "below", "below"), strict=True)} == {
        lines[0].index("below")
    }
    assert "\x1b" not in done.stdout
    assert "below 100 N and above -100 N" in lines[1]
    assert "noisy, z: paired, n = 3, 95 % confidence interval" in lines[1]
    assert "below 0.001 N" in lines[2]
    # Measured without a page.
    assert (only_run(tmp_path) / "metrics.csv").exists()
    assert not (tmp_path / "reports").exists()
    (suite,) = ET.parse(tmp_path / "ci" / "hilrig.xml").getroot()
    assert (suite.get("name"), suite.get("tests"), suite.get("failures")) == ("small", "9", "1")
    # The report says the same of the same run, and has done what it was asked for.
    again = hilrig("report", only_run(tmp_path).name, "--junit", "again.xml")
    assert again.returncode == 0, again.stderr
    assert again.stdout.splitlines()[1:] == [head, *lines]
    assert (tmp_path / "again.xml").read_text() == (tmp_path / "ci" / "hilrig.xml").read_text()


def test_all_met_is_exit_0_with_the_report_before_the_list(hilrig, experiment) -> None:
    done = hilrig("run", experiment(duration=0.2, controllers=TWO, more="repeats: 3\n" + MET), "--in-process")
    assert done.returncode == 0, done.stderr
    assert [line.split()[0] for line in done.stdout.splitlines()] == ["run", "report", "expected", "met", "met"]


def test_too_few_repeats_are_not_met_and_say_so(hilrig, experiment) -> None:
    done = hilrig("run", experiment(duration=0.2, controllers=TWO, more=MET), "--in-process", "--no-report")
    assert done.returncode == 1
    assert "expected 1 of 2 met" in done.stdout
    assert "1 repeat, too few to judge a difference (3 are needed)" in done.stdout


def test_without_a_completed_trial_nothing_is_met(hilrig, experiment, tmp_path: Path) -> None:
    file = experiment(duration=0.2, controllers=TWO, safety=WEAK, more=MET)
    done = hilrig("run", file, "--in-process", "--junit", "x.xml")
    assert done.returncode == 1
    assert "expected 0 of 2 met" in done.stdout
    assert "2 trials not completed" in done.stdout
    (suite,) = ET.parse(tmp_path / "x.xml").getroot()
    assert [case.find("failure") is not None for case in suite] == [True] * 4
    assert "tripped: " in (suite[0][0].get("message") or "")


TRIPS = "repeats: 2\nexpect:\n  - {controller: pd, outcome: tripped}\n"
BOTH = TRIPS + "  - {controller: softer, outcome: tripped, condition: noisy}\n"


def test_trials_that_trip_as_expected_are_exit_0_and_no_failure(hilrig, experiment, tmp_path: Path) -> None:
    """--fail-fast goes on after them, too."""
    file = experiment(duration=0.2, controllers=TWO, safety=WEAK, more=BOTH)
    done = hilrig("run", file, "--in-process", "--fail-fast", "--junit", "x.xml")
    assert done.returncode == 0, done.stderr
    ran, head, *lines = done.stdout.splitlines()
    assert ran.endswith("(0 of 4 trials completed, 4 tripped as expected)")
    assert head == "expected 2 of 2 met"
    assert "outcome of pd " in lines[0]
    assert "noisy: repeat 0, first of 2, tip force" in lines[0]
    assert " at t = " in lines[0]
    (suite,) = ET.parse(tmp_path / "x.xml").getroot()
    assert (suite.get("tests"), suite.get("failures")) == ("6", "0")


def test_a_trip_that_nobody_expects_is_exit_1_beside_one_that_is_expected(hilrig, experiment) -> None:
    file = experiment(duration=0.2, controllers=TWO, safety=WEAK, more=TRIPS)
    done = hilrig("run", file, "--in-process", "--no-report")
    assert done.returncode == 1
    assert "(0 of 4 trials completed, 2 tripped as expected)" in done.stdout
    assert "expected 1 of 1 met" in done.stdout


def test_a_trial_that_completes_instead_is_exit_1(hilrig, experiment) -> None:
    more = "expect: [{controller: pd, outcome: tripped}]"
    done = hilrig("run", experiment(duration=0.2, more=more), "--in-process", "--no-report")
    assert done.returncode == 1
    assert "(1 of 1 trials completed)" in done.stdout
    assert "not met  outcome of pd  completed  tripped  (noisy: repeat 0, completed at t = 0.2 s)" in done.stdout
