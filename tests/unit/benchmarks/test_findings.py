"""Comparisons, and their spread over the repeats."""

from __future__ import annotations

from typing import Any

import pytest

from benchmarks.findings import COMPARISONS, compare
from benchmarks.measurands import names
from benchmarks.spread import spread


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


def test_spread_is_of_the_repeats() -> None:
    found = spread([3.0, 1.0, 10.0, 2.0])
    assert (found.median, found.lowest, found.highest, found.values) == (2.5, 1.0, 10.0, (3.0, 1.0, 10.0, 2.0))
    with pytest.raises(ValueError, match="one value or more"):
        spread([])
