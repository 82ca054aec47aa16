"""The report's section on bounds: what it takes from the plan, and what it measures."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.report_builders import make_run

from hilrig.core.assessment import Assessment, Bound
from hilrig.experiment.plan.assessing import PlanAssessment
from hilrig.recording.run_directory import to_json
from hilrig.report import make_report
from hilrig.report.bounds_section import bounds_section
from hilrig.report.dataset import load_run

DELAY: Any = {"value": 1e-3, "must": "below", "unit": "s", "where": "phase 'before'", "recorded_as": "command_age"}
SMALL = Assessment(
    (
        Bound("delay, for comparison", limit=0.75e-3, warning="", basis="kappa = 0.08", **DELAY),
        Bound("delay", limit=2.8e-3, warning="the delay is too long", **DELAY),
        Bound("mass", 0.4, "below", 0.3, "kg", "the mass is too large"),
    ),
    ("the tides are not known",),
    "Bounds of the small one.",
)
TASK = Assessment((Bound("joint speed", np.inf, "below", 20.0, "rad/s", "it is too fast"),))


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run whose plan has bounds for one of its two controllers, and for the task."""
    run = make_run(tmp_path / "run", {"small": 1.0, "large": 3.0}, repeats=1, seconds=0.1)
    plan = json.loads((run / "plan.json").read_text())
    for trial in plan["trials"]:
        trial["actuation_delay"] = 1
    bounds = PlanAssessment({"small": SMALL}, TASK).document()
    (run / "plan.json").write_text(to_json({**plan, "bounds": bounds}))
    return run


def section_of(page: Path) -> str:
    text = page.read_text(encoding="utf-8")
    return text[text.index("<h2>Bounds</h2>") : text.index("<h2>Timing</h2>")]


def test_the_section_shows_values_limits_and_words(run: Path, tmp_path: Path) -> None:
    section = section_of(make_report(run, tmp_path / "out"))
    rows = re.findall(r"<tr><td>([^<]*)</td><td>([^<]*)</td><td>([^<]*) <small>(.*?)</small>", section)
    assert rows == [
        ("delay, for comparison", "1.00", "below 0.750", "ms"), ("delay", "1.00", "below 2.80", "ms"),
        ("mass", "0.400", "below 0.300", "kg"), ("joint speed", "∞", "below 20.0", "rad/s"),
    ]  # fmt: skip
    assert re.findall(r'"left (good|bad|)">([^<]*)<', section) == [
        ("", "not kept"), ("good", "kept"), ("bad", "✗ not kept"), ("bad", "✗ not kept"),
    ]  # fmt: skip
    assert re.findall("<h3>(.*)</h3>", section) == ["small", "Task"]
    assert "The tides are not known." in section
    assert '<p class="note">Bounds of the small one.</p>' in section
    assert "1.00 ms as planned, exact, since the plant waits in lockstep" in section
    assert "kappa = 0.08; phase" in section


def test_the_numbers_are_for_programs_too(run: Path, tmp_path: Path) -> None:
    make_report(run, tmp_path / "out")
    small, task = json.loads((tmp_path / "out" / "summary.json").read_text())["bounds"]["groups"]
    assert small["title"] == "small"
    assert small["delay"] == {"period": 1.0, "planned": 1.0, "p50": None, "p99": None, "max": None}
    assert [row["kept"] for row in small["rows"]] == [False, True, False]
    assert (task["title"], task["delay"], task["rows"][0]["value"]) == ("Task", None, None)


def test_a_plan_without_bounds_says_so(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", {"small": 1.0}, repeats=1, seconds=0.1)
    assert "Unknown: this run was planned by an older version of hilrig." in section_of(
        make_report(run, tmp_path / "out")
    )


def test_a_plan_with_bounds_in_the_form_of_an_older_hilrig_says_so(run: Path) -> None:
    plan = json.loads((run / "plan.json").read_text())
    (run / "plan.json").write_text(json.dumps({**plan, "bounds": {"estimators": {}, "flights": []}}))
    assert not bounds_section(load_run(run), {}).known


def test_measured_delays_are_held_against_the_bounds_on_them(run: Path) -> None:
    delays = [np.array([0.5e-3] * 50), np.array([1e-3] * 40 + [5e-3] * 10)]
    group = bounds_section(load_run(run), {"small": delays}).groups[0]
    assert group.delay is not None
    assert (group.delay.p50, group.delay.max) == pytest.approx((0.75, 5.0))
    remarks = [row.remark for row in group.rows]
    assert remarks[0] == "kappa = 0.08; phase 'before'; as measured, not kept in 50 % of the periods"
    assert remarks[1] == "phase 'before'; as measured, not kept in 10 % of the periods"
    assert "measured" not in remarks[2]
