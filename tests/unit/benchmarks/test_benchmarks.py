from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.cyclictest import quantities as cyclictest_quantities
from benchmarks.cyclictest import read_histogram, read_summary
from benchmarks.exchange import TRANSPORTS, Sizes
from benchmarks.findings import COMPARISONS, compare
from benchmarks.machine import Processor, read_processor_time, warnings
from benchmarks.measurands import Measurand, Settings, measurands, names
from benchmarks.page import grid, page
from benchmarks.run import FORM, _result, run_rounds
from benchmarks.statistics import quantiles, spread
from benchmarks.tables import Table, figure, tables
from benchmarks.trials import payload_sizes, quantities
from hilrig.core.errors import RigError

# Recorded from cyclictest 2.4 with --histogram=8; the empty lines of the histogram are left out.
RECORDED = """# /dev/cpu_dma_latency set to 0us
# Histogram
000000 000000
000004 000600
000005 000390
000007 000008
# Total: 000000998
# Min Latencies: 00004
# Avg Latencies: 00005
# Max Latencies: 01377
# Histogram Overflows: 00002
# Histogram Overflow at cycle number:
# Thread 0: 00012 00345
"""


@given(st.lists(st.integers(0, 10**9), min_size=1, max_size=50))
def test_quantiles_are_of_the_sorted_times(times: list[int]) -> None:
    found = quantiles(times, "x")
    ordered = sorted(times)
    place = 0.99 * (len(ordered) - 1)
    below, above = ordered[math.floor(place)], ordered[math.ceil(place)]
    assert found["x_max_us"] == ordered[-1] / 1e3
    assert found["x_p99_us"] == pytest.approx((below + (place - math.floor(place)) * (above - below)) / 1e3)
    assert found["x_p50_us"] == pytest.approx(float(np.median(times)) / 1e3)


def test_spread_is_of_the_repeats() -> None:
    found = spread([3.0, 1.0, 10.0, 2.0])
    assert (found.median, found.lowest, found.highest, found.values) == (2.5, 1.0, 10.0, (3.0, 1.0, 10.0, 2.0))
    with pytest.raises(ValueError, match="one value or more"):
        spread([])


def test_cyclictest_is_read_with_its_overflows() -> None:
    histogram, summary = read_histogram(RECORDED), read_summary(RECORDED)
    assert histogram == {4: 600, 5: 390, 7: 8}
    assert summary == {"max": 1377, "overflows": 2}
    assert cyclictest_quantities(histogram, summary) == {
        "wakeups": 1000.0, "over_1ms": 2.0, "over_1ms_fraction": 0.002,
        "lateness_p50_us": 4.0, "lateness_p99_us": 5.0, "lateness_max_us": 1377.0,
    }  # fmt: skip


@given(st.dictionaries(st.integers(0, 3000), st.integers(1, 50), min_size=1, max_size=20))
def test_cyclictest_quantiles_are_those_of_the_wake_ups(histogram: dict[int, int]) -> None:
    each = np.repeat(sorted(histogram), [histogram[value] for value in sorted(histogram)])
    found = cyclictest_quantities(histogram, {"max": int(each[-1]), "overflows": 0})
    assert found["lateness_p50_us"] == np.percentile(each, 50, method="inverted_cdf")
    assert found["lateness_p99_us"] == np.percentile(each, 99, method="inverted_cdf")
    assert found["over_1ms"] == np.count_nonzero(each >= 1000)


def test_cyclictest_that_says_nothing_is_an_error() -> None:
    with pytest.raises(RigError, match="no 'Max Latencies'"):
        read_summary("# Histogram\n")
    with pytest.raises(RigError, match="no wake-up"):
        cyclictest_quantities({}, {"max": 0, "overflows": 0})


def test_a_trials_quantities_leave_out_what_it_did_not_measure() -> None:
    table = {"p50": 5.0, "p99": 9.0, "p99.9": 10.0, "max": 11.0}
    timing = {"ticks": 100, "late": 3, "late_fraction": 0.03, "lateness_us": None, "round_trip_us": table}
    assert quantities({"ticks": 100, "wall_s": 0.5}, timing) == {
        "ticks": 100.0, "steps_per_s": 200.0, "late": 3.0, "late_fraction": 0.03,
        "round_trip_p50_us": 5.0, "round_trip_p99_us": 9.0, "round_trip_max_us": 11.0,
    }  # fmt: skip


def test_the_payloads_are_those_of_two_joints() -> None:
    """CDR: 4 bytes of header; number and time; a sequence is a length, padding to 8, and its float64."""

    def sequences(*lengths: int) -> int:
        return sum(8 + 8 * length for length in lengths)

    assert payload_sizes() == (4 + 16 + sequences(2, 6, 2), 4 + 16 + sequences(2, 2))


def test_comparisons_are_taken_within_each_repeat() -> None:
    rounds = [
        {"lockstep": {"loop_steps_per_s": 8.0}, "zenoh.back_to_back": {"rate_hz": 10.0}},
        {"lockstep": {"loop_steps_per_s": 35.0}, "zenoh.back_to_back": {"rate_hz": 50.0}},
        {"lockstep": {"loop_steps_per_s": 9.0}},
        {"lockstep": {"loop_steps_per_s": 9.0}, "zenoh.back_to_back": {"rate_hz": 10.0}},
    ]
    found = compare(rounds)
    assert list(found) == ["lockstep_to_bare"]
    assert found["lockstep_to_bare"]["values"] == pytest.approx([0.8, 0.7, 0.9])
    assert found["lockstep_to_bare"]["median"] == pytest.approx(0.8)
    assert found["lockstep_to_bare"]["met"] is True
    assert compare(rounds[1:2])["lockstep_to_bare"]["met"] is False


def test_late_ticks_are_held_against_cyclictest() -> None:
    def late(fraction: float, over: float) -> Any:
        rounds = [{"realtime": {"late_fraction": fraction}, "cyclictest": {"over_1ms_fraction": over}}]
        return compare(rounds)["late_excess"]

    assert late(0.005, 0.002)["met"] is True  # 2 * 0.2 % + 0.1 %
    assert late(0.0052, 0.002)["met"] is False


def test_a_ratio_to_nothing_is_left_out() -> None:
    zero = {"realtime": {"lateness_p50_us": 1.0}, "cyclictest": {"lateness_p50_us": 0.0}}
    assert compare([zero]) == {}


def test_comparisons_name_what_there_is() -> None:
    """Every measurand that a comparison asks for exists; a misspelt one would never show."""

    class Asked(dict[str, Any]):
        def __missing__(self, key: str) -> Any:
            asked.add(key)
            return Quantities()

    class Quantities(dict[str, float]):
        def __missing__(self, key: str) -> float:
            return 1.0

    asked: set[str] = set()
    for comparison in COMPARISONS:
        comparison.value(Asked())
    assert asked <= set(names())
    assert {"realtime", "cyclictest", "lockstep", "zenoh.back_to_back"} <= asked


def test_names_and_measurands_agree() -> None:
    everything = measurands(Settings(), Sizes(1, 1), fifo=False)
    groups = {group for item in everything for group in item.groups}
    assert {item.name for item in everything} | groups == set(names())
    assert [item.name for item in measurands(Settings(), Sizes(1, 1), False, ["certificate"])] == [
        "lockstep.alternating",
    ]  # fmt: skip
    assert [item.name for item in measurands(Settings(), Sizes(1, 1), False, ["lcm.paced"])] == ["lcm.paced"]


def test_rounds_turn_about_and_note_what_fails() -> None:
    called: list[str] = []

    def measuring(name: str, fails_at: int = 0) -> Measurand:
        def measure() -> dict[str, float]:
            called.append(name)
            if called.count(name) == fails_at:
                raise RigError("it broke")
            return {"x": float(called.count(name))}

        return Measurand(name, (), name, measure)

    absent = Measurand("c", (), "c", lambda: {"x": 0.0}, lambda: "not installed")
    listed = [measuring("a"), measuring("b", fails_at=2), absent]
    rounds, notes = run_rounds(listed, 3, lambda line: None)
    assert called == ["a", "b", "b", "a", "a", "b"]
    assert [sorted(samples) for samples in rounds] == [["a", "b"], ["a"], ["a", "b"]]
    assert notes == {"b": "failed in repeat 2: it broke", "c": "not installed"}
    assert _result(listed[1], rounds, notes["b"])["quantities"]["x"]["values"] == [1.0, 3.0]


def test_busy_machines_are_told() -> None:
    line = "cpu  100 0 100 700 0 0 0 100 0 0"
    assert read_processor_time(line) == (1000, 100)
    assert warnings(0.1, Processor(0, 0), Processor(1000, 5)) == []
    (busy,) = warnings(2.5, Processor(0, 0), Processor(1000, 5))
    assert "load average 2.50" in busy
    (stolen,) = warnings(0.1, Processor(1000, 10), Processor(2000, 30))
    assert "2.0% of the processor time" in stolen


@pytest.fixture
def document() -> dict[str, Any]:
    """What `hilrig bench --json` prints, small. Its form is a promise: change FORM with it."""
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
    assert "hilrig bench --markdown docs/performance.md" in text
    assert "**Warning:** a warning." in text
    for table in tables(document):
        assert f"## {table.title}\n\n{grid(table)}" in text


def test_a_grid_is_markdown() -> None:
    assert grid(Table("t", ("", "n"), [["a|b", "1"]])) == "|  | n |\n| --- | ---: |\n| a\\|b | 1 |"


@pytest.mark.parametrize(("value", "text"), [(0.7512, "0.751"), (12.345, "12.3"), (12345.6, "12,346"), (0.0, "0")])
def test_figures_are_short(value: float, text: str) -> None:
    assert figure(value) == text


def test_every_transport_has_its_script() -> None:
    from benchmarks.exchange import SCRIPT

    assert all(SCRIPT.with_name(f"{transport.script}.py").is_file() for transport in TRANSPORTS)
    assert all(transport.install for transport in TRANSPORTS if transport.module)
