"""The report's section on bounds: what it takes from the plan, and what it measures."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from helpers.report_builders import make_run

from hilrig.report import make_report
from hilrig.report.bounds_section import bounds_section
from hilrig.report.dataset import load_run


def check(bound: str, value: float | None, must: str, limit: float, kept: bool, unit: str = "s") -> dict:
    kappa = 0.08 if bound.startswith("delay") else None
    return {
        "bound": bound, "value": value, "must": must, "limit": limit, "unit": unit, "where": "phase 'before'",
        "kappa": kappa, "kept": kept, "margin": 0.75,
    }  # fmt: skip


CHECKS = [
    check("delay_derived", 1e-3, "below", 0.75e-3, False),
    check("delay_best", 1e-3, "below", 2.8e-3, True),
    check("inertia_upper", 0.4, "below", 0.3, False, "kg"),
]
FLIGHT = {
    "axis": "z", "phase": "before", "force": 3.5, "speed": None, "time_constant": None,
    "joints": check("joint_speed", None, "below", 20.0, False, "rad/s"),
}  # fmt: skip
BOUNDS = {"estimators": {"small": {"checks": CHECKS, "unknown": ["the tides"]}}, "flights": [FLIGHT]}


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run whose plan has bounds for one of its two controllers."""
    run = make_run(tmp_path / "run", {"small": 1.0, "large": 3.0}, repeats=1, seconds=0.1)
    plan = json.loads((run / "plan.json").read_text())
    for trial in plan["trials"]:
        trial["actuation_delay"] = 1
    (run / "plan.json").write_text(json.dumps({**plan, "bounds": BOUNDS}))
    return run


def section_of(page: Path) -> str:
    text = page.read_text(encoding="utf-8")
    return text[text.index("<h2>Bounds</h2>") : text.index("<h2>Timing</h2>")]


def test_the_section_shows_values_limits_and_words(run: Path, tmp_path: Path) -> None:
    section = section_of(make_report(run, tmp_path / "out"))
    rows = re.findall(r"<tr><td>([^<]*)</td><td>([^<]*)</td><td>([^<]*) <small>(.*?)</small>", section)
    assert ("Mhat, upper edge", "0.400", "below 0.300", "kg") in rows
    assert ("delay bound (24), as derived (kappa)", "1.00", "below 0.750", "ms") in rows
    assert re.findall(r'"left (good|bad)">([^<]*)<', section) == [
        ("bad", "✗ violated"), ("good", "kept"), ("bad", "✗ violated"), ("bad", "✗ violated"),
    ]  # fmt: skip
    assert "Not known: the tides." in section
    assert "exact, since the plant waits in lockstep" in section
    assert "unbounded" in section
    assert "<h3>large</h3>" not in section


def test_the_numbers_are_for_programs_too(run: Path, tmp_path: Path) -> None:
    make_report(run, tmp_path / "out")
    bounds = json.loads((tmp_path / "out" / "summary.json").read_text())["bounds"]
    (group,) = bounds["groups"]
    assert (group["controller"], group["period"], group["delay_set"], group["measured"]) == ("small", 1.0, 1.0, None)
    assert [row["kept"] for row in group["rows"]] == [False, True, False]
    assert bounds["flights"][0]["axis"] == "z"


def test_a_plan_without_bounds_says_so(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", {"small": 1.0}, repeats=1, seconds=0.1)
    assert "Not known: the plan of this run" in section_of(make_report(run, tmp_path / "out"))


def test_measured_delays_are_told_in_milliseconds_and_against_both_bounds(run: Path) -> None:
    delays = [np.array([0.5e-3] * 50), np.array([1e-3] * 40 + [5e-3] * 10)]
    (group,) = bounds_section(load_run(run), {"small": delays}).groups
    assert group.measured is not None
    assert (group.measured.p50, group.measured.max) == pytest.approx((0.75, 5.0))
    assert (group.measured.over, group.measured.over_paper) == pytest.approx((0.1, 0.5))
