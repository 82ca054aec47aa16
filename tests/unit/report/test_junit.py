"""JUnit XML, read back and held against what CI systems ask for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from helpers.report_builders import SIZES, make_run, trial_entry
from hypothesis import given
from hypothesis import strategies as st

from hilrig.report import junit_xml, measure_run
from hilrig.report.dataset import RunData
from hilrig.report.expectations import Expected

ALLOWED = {
    "testsuites": (set(), {"name", "time", "tests", "failures", "disabled", "errors"}, {"testsuite"}),
    "testsuite": (
        {"name", "tests"},
        {"failures", "errors", "skipped", "time", "timestamp", "hostname", "id", "package", "disabled", "group"},
        {"testcase"},
    ),
    "testcase": ({"name", "classname"}, {"time", "status", "assertions", "group"}, {"failure"}),
    "failure": (set(), {"type", "message"}, set()),
}
"""Jenkins' junit-10.xsd: element -> attributes it must have, may have, children (of those that are used here)"""

MET = Expected("force_rmse of a, phase all", "below 1 N", "0.5 N", "quiet, z: repeat 0", True, 0, 0.5, None, None)


def run_of(*outcomes: dict) -> RunData:
    trials = tuple(replace(trial_entry("a", repeat=i), outcome=outcome) for i, outcome in enumerate(outcomes))
    return RunData(Path("run"), {}, {"name": "demo"}, trials, "", {})


def keeps_the_schema(element: ET.Element) -> bool:
    must, may, children = ALLOWED[element.tag]
    inner = all(child.tag in children and keeps_the_schema(child) for child in element)
    return inner and must <= set(element.keys()) <= must | may


@pytest.fixture
def suite(tmp_path: Path) -> ET.Element:
    """A run with a trial that tripped and expectations of either kind, met and not."""
    expect = tuple(
        {"metric": "position_rmse", "controller": "small", "phase": "all", **limit}
        for limit in ({"below": 0.1}, {"below": 1e-6}, {"minus": "large", "below": 0.0})
    )
    run = make_run(tmp_path / "run", SIZES, repeats=2, seconds=0.2, failed=("large.quiet.1",), expect=expect)
    measured = measure_run(run)
    root = ET.fromstring(junit_xml(measured.data, measured.expected))
    assert root.tag == "testsuites"
    assert keeps_the_schema(root)
    (found,) = root
    return found


def test_every_trial_and_every_expectation_is_a_test_case(suite: ET.Element) -> None:
    assert (suite.get("name"), suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("run", "7", "3", "0")
    assert [(case.get("classname"), case.get("name"), len(case)) for case in suite] == [
        ("run.trials", "small.quiet.0", 0),
        ("run.trials", "large.quiet.0", 0),
        ("run.trials", "small.quiet.1", 0),
        ("run.trials", "large.quiet.1", 1),
        ("run.expect", "position_rmse of small, phase all: below 0.1 m", 0),
        ("run.expect", "position_rmse of small, phase all: below 1e-06 m", 1),
        ("run.expect", "position_rmse of small minus large, phase all: below 0 m", 1),
    ]
    assert suite.get("time") == "4.000"


def test_a_failure_says_why(suite: ET.Element) -> None:
    tripped, value, difference = (failure.get("message") or "" for failure in suite.iter("failure"))
    assert tripped == "tripped: force above 200 N at t = 0.5 s"
    assert value.startswith("expected below 1e-06 m, got 0.00")
    assert "1 repeat, too few to judge a difference" in difference
    assert [failure.text for failure in suite.iter("failure")] == [tripped, value, difference]


def test_a_trial_that_was_not_run_is_a_failure() -> None:
    root = ET.fromstring(junit_xml(run_of({"outcome": "not run", "reason": "the run ended before"}), [MET]))
    assert [failure.get("message") for failure in root.iter("failure")] == ["not run: the run ended before"]
    assert root[0].get("failures") == "1"


@given(st.text(st.characters(), min_size=1))
def test_a_reason_may_hold_any_character(reason: str) -> None:
    text = junit_xml(run_of({"outcome": "failed", "reason": reason}), []).encode("utf-8")
    failure = next(ET.fromstring(text).iter("failure"))
    message = failure.get("message", "").removeprefix("failed: ")
    assert len(message) == len(reason)
    assert all(c == d for c, d in zip(message, reason, strict=True) if d.isprintable())


@pytest.mark.parametrize(("condition", "failures"), [(None, 0), ("quiet", 0), ("rough", 1)])
def test_a_trial_that_trips_as_expected_is_no_failure(condition: str | None, failures: int) -> None:
    data = run_of({"outcome": "tripped", "reason": "force above 200 N"}, {"outcome": "completed"})
    expect = [{"controller": "a", "outcome": "tripped", "condition": condition}]
    root = ET.fromstring(junit_xml(replace(data, experiment={"expect": expect}), []))
    assert root[0].get("failures") == str(failures)
    assert [len(case) for case in root[0]] == [failures, 0]


def test_only_the_expected_end_is_no_failure() -> None:
    data = replace(run_of({"outcome": "failed"}), experiment={"expect": [{"controller": "a", "outcome": "tripped"}]})
    assert ET.fromstring(junit_xml(data, []))[0].get("failures") == "1"
