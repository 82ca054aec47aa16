"""The certificate in the report, from simulated loops: what was late, why, and what is compared."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree as ET

import pandas as pd
import pytest
from helpers.loop_simulation import MS, Loop, Stall
from helpers.report_builders import SIZES, in_real_time, make_run

from hilrig.recording.run_directory import ending, read_outcome, reason_of
from hilrig.report import junit_xml, make_report, measure_run

TICKS = 1000
SETUP = {
    "driver": {
        "scheduling": {"wanted": "SCHED_FIFO 80", "applied": "SCHED_FIFO 80", "reason": ""},
        "cpu_dma_latency": {"wanted": 0, "applied": None, "reason": "/dev/cpu_dma_latency: permission denied"},
    }
}


def loop(*stalls: Stall, seed: int = 0) -> Loop:
    return Loop(list(stalls), TICKS, seed=seed).run()


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, dict]:
    """Two controllers, two repeats; one loop had eight late ticks through its controller, one three by the bus."""
    folder = tmp_path_factory.mktemp("timing")
    expect = (
        {"metric": "position_rmse", "controller": "small", "phase": "all", "below": 1.0},
        {"outcome": "completed", "controller": "small"},
    )
    run = make_run(folder / "run", SIZES, repeats=2, expect=expect)
    slow = [Stall("controller_compute", tick, int(2.4 * MS)) for tick in (100, 300, 500, 700)]
    lost = [Stall("state_loss", tick, 0) for tick in (200, 400, 600)]
    loops = {"small.quiet.0": loop(*slow), "small.quiet.1": loop(seed=1), "large.quiet.0": loop(*lost, seed=2),
             "large.quiet.1": loop(seed=3)}  # fmt: skip
    page = make_report(in_real_time(run, loops, SETUP), folder / "out")
    return folder, page.read_text(encoding="utf-8"), json.loads((folder / "out" / "summary.json").read_text())


def test_late_ticks_are_listed_by_cause(reported: tuple[Path, str, dict]) -> None:
    _, page, summary = reported
    rows = {row["trial"]: row for row in summary["timing"]["rows"]}
    slow, lost = rows["small.quiet.0"], rows["large.quiet.0"]
    assert slow["late"] == slow["late_by"]["controller"] == 8
    assert (lost["late"], lost["late_by"]["transport"]) == (3, 3)
    assert rows["small.quiet.1"]["late"] == 0
    assert [(rows[name]["ending"], rows[name]["valid"]) for name in ("small.quiet.0", "large.quiet.0")] == [
        ("invalid", False), ("completed", True),
    ]  # fmt: skip
    section = page[page.index("<h2>Timing</h2>") :]
    cells = re.findall(r"<tr><td>large\.quiet\.0</td>(.*?)</tr>", section, re.DOTALL)[0]
    assert re.findall(r">([^<>\n]+)</td>", cells) == [
        "completed",
        "1000",
        "3",
        "0",
        "0.300",
        "0",
        "3",
        "0",
        "0",
        "0",
        "kept",
    ]


def test_an_invalid_trial_is_listed_at_the_top_and_left_out(reported: tuple[Path, str, dict]) -> None:
    folder, page, summary = reported
    late = next(row["late_fraction"] for row in summary["timing"]["rows"] if row["trial"] == "small.quiet.0")
    assert "3 of 4 trials completed, 1 invalid" in page
    top = page[: page.index("<h2>Verdict</h2>")]
    assert f"outside its timing budget: late ticks {100 * late:g} %, at most 0.5 %" in top
    assert "small.quiet.0" not in set(pd.read_csv(folder / "out" / "metrics.csv")["trial"])
    assert {o["trial"]: o["outcome"] for o in summary["outcomes"]}["small.quiet.0"] == "completed"
    metric, outcome = summary["expectations"]
    assert (metric["met"], metric["missing"]) == (False, 1)
    assert metric["basis"].endswith("1 trial invalid (timing)")
    assert (outcome["met"], outcome["seen"]) == (False, "1 invalid, 1 completed")


def test_an_invalid_trial_is_a_failure_for_ci(reported: tuple[Path, str, dict]) -> None:
    measured = measure_run(reported[0] / "run")
    (suite,) = ET.fromstring(junit_xml(measured.data, measured.expected))
    failed = [(case.get("name"), case[0].get("type")) for case in suite if len(case)]
    assert failed[0] == ("small.quiet.0", "invalid")
    assert [name for name, _ in failed if name and name.startswith("large")] == []


def test_what_was_refused_is_shown_with_its_reason(reported: tuple[Path, str, dict]) -> None:
    _, page, summary = reported
    assert [(row["setting"], row["refused"], row["trials"]) for row in summary["timing"]["setup"]] == [
        ("scheduling", False, "all"), ("cpu_dma_latency", True, "all"),
    ]  # fmt: skip
    assert "permission denied" in page


def test_the_figures_are_there(reported: tuple[Path, str, dict]) -> None:
    folder, page, _ = reported
    assert 'id="lateness_quiet"' in page
    assert 'id="timing_tail"' in page
    assert (folder / "out" / "figures" / "certificate_timing_tail.svg").is_file()


def test_late_fraction_is_a_metric_of_the_compared_trials(reported: tuple[Path, str, dict]) -> None:
    table = pd.read_csv(reported[0] / "out" / "metrics.csv")
    found = table[(table["metric"] == "late_fraction") & (table["phase"] == "all")].set_index("trial")["value"]
    assert found.to_dict() == {"large.quiet.0": 0.003, "small.quiet.1": 0.0, "large.quiet.1": 0.0}


def test_two_hosts_have_no_transport_times(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", {"small": 1.0}, repeats=1)
    there = Loop([Stall("controller_compute", 300, 2 * MS)], TICKS, offset=10**15).run()
    page = make_report(in_real_time(run, {"small.quiet.0": there}, one_clock=False), tmp_path / "out").read_text()
    timing = json.loads((run / "trials" / "small.quiet.0" / "timing.json").read_text())
    assert timing["state_transport_us"] is timing["command_transport_us"] is None
    assert timing["late_by"]["controller"] == timing["late"] > 0
    assert "the two transport times cannot be separated" in page


def test_all_trials_invalid(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", {"small": 1.0}, repeats=1)
    slow = [Stall("driver_publish", tick, 3 * MS) for tick in range(100, 900, 100)]
    page = make_report(in_real_time(run, {"small.quiet.0": loop(*slow)}), tmp_path / "out").read_text()
    assert "No trial completed within its timing budget, so there is nothing to compare." in page


def test_a_compiled_loop_has_no_times_of_single_ticks(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", {"small": 1.0}, repeats=1)
    path = run / "trials" / "small.quiet.0" / "timing.json"
    path.write_text(json.dumps({"clock": "lockstep", "ticks": 0, "late": 0, "round_trip_us": None, "compute_us": None}))
    page = make_report(run, tmp_path / "out").read_text()
    assert "Every trial: no times of individual ticks." in page


@pytest.mark.parametrize(
    ("outcome", "because", "word"),
    [("completed", ["x"], "invalid"), ("completed", [], "completed"), ("tripped", ["x"], "invalid"),
     ("tripped", [], "tripped"), ("failed", ["x"], "failed"), ("aborted", ["x"], "aborted")],
)  # fmt: skip
def test_only_a_trial_that_ran_to_an_end_can_be_invalid(outcome: str, because: list[str], word: str) -> None:
    assert ending({"outcome": outcome, "invalid_because": because}) == word


def test_the_reason_has_both(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", {"small": 1.0}, repeats=1, failed=("small.quiet.0",))
    path = run / "trials" / "small.quiet.0" / "timing.json"
    path.write_text(json.dumps({"invalid_because": ["late ticks 2 %, at most 0.5 %", "command age p99 3 ms"]}))
    assert reason_of(read_outcome(run, "small.quiet.0")) == (
        "tripped: force above 200 N at t = 0.5 s; outside its timing budget: late ticks 2 %, at most 0.5 %; "
        "command age p99 3 ms"
    )
