"""The tables and the page, made from a small document."""

from __future__ import annotations

from typing import Any

import pytest

from benchmarks.exchange import Sizes
from benchmarks.findings import compare
from benchmarks.measurands import Measurand, Settings
from benchmarks.page import grid, page
from benchmarks.run import FORM, _result
from benchmarks.tables import Table, figure, tables


@pytest.fixture
def document() -> dict[str, Any]:
    """What --json prints, small. Its form is a promise: change FORM with it."""
    samples = {
        "zenoh.back_to_back": {"rate_hz": 10_000.0, "round_trip_p50_us": 90.0, "round_trip_p99_us": 120.0},
        "lockstep": {
            "ticks": 20.0,
            "steps_per_s": 7000.0,
            "loop_steps_per_s": 8000.0,
            "round_trip_p50_us": 100.0,
            "round_trip_p99_us": 200.0,
        },
        "lockstep.exchange": {
            "ticks": 20.0,
            "steps_per_s": 7000.0,
            "loop_steps_per_s": 8000.0,
            "round_trip_p50_us": 100.0,
            "round_trip_p99_us": 200.0,
        },
        "realtime": {"ticks": 1000.0, "late": 2.0, "late_fraction": 0.002, "lateness_p50_us": 3.0},
    }
    listed = [Measurand(name, (), f"what {name} is", dict) for name in samples]
    machine = {
        "cpu": "a | b", "cores": 2, "memory_gib": 1.0, "virtual_machine": "none", "kernel": "6.1",
        "preemption": "PREEMPT", "python": "3.11", "zenoh": "1.10", "numba": "0.6", "hilrig": "0.1", "commit": None,
        "sched_fifo": True, "load_average": 0.0,
    }  # fmt: skip
    return {
        "form": FORM, "started": "2026-01-02T03:04:05+00:00", "wall_s": 1.0, "settings": Settings().__dict__,
        "machine": machine, "warnings": ["a warning"], "payload_bytes": Sizes(100, 68)._asdict(),
        "measurands": {item.name: _result(item, [samples, samples], "") for item in listed}
        | {"lcm.paced": {"what": "LCM", "note": "not installed", "quantities": {}}},
        "comparisons": compare([samples, samples]),
    }  # fmt: skip


def test_tables_show_medians_limits_and_what_is_missing(document: dict[str, Any]) -> None:
    shown = {table.title: table for table in tables(document)}
    assert all(len(set(table.columns)) == len(table.columns) for table in shown.values())
    assert all(len(row) == len(table.columns) for table in shown.values() for row in table.rows)
    (rate, _, overhead) = shown["Comparisons"].rows
    assert rate[1:] == ["0.8 (0.8 to 0.8)", "at least 0.75", "yes"]
    assert overhead[1:] == ["10 (10 to 10) us", "at most 40 us", "yes"]
    own, bare = shown["Round trips, back to back [us]"].rows
    assert (own[4], bare[4]) == ("1.11", "1")
    (late,) = shown["Lateness at a period of 1 ms [us]"].rows
    assert late[4] == "4 of 2000 (0.20%)"
    assert shown["Not measured, or not in every repeat"].rows == [["lcm.paced", "not installed"]]


def test_the_page_has_the_command_and_every_table(document: dict[str, Any]) -> None:
    text = page(document)
    assert "uv run --group bench python -m benchmarks --markdown docs/performance.md" in text
    assert "**Warning:** a warning." in text
    for table in tables(document):
        assert f"## {table.title}\n\n{grid(table)}" in text


def test_a_grid_is_markdown() -> None:
    assert grid(Table("t", ("", "n"), [["a|b", "1"]])) == "|  | n |\n| --- | ---: |\n| a\\|b | 1 |"


@pytest.mark.parametrize(("value", "text"), [(0.7512, "0.751"), (12.345, "12.3"), (12345.6, "12,346"), (0.0, "0")])
def test_figures_are_short(value: float, text: str) -> None:
    assert figure(value) == text
