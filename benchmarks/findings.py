"""Comparisons of runs that were close together in time, repeat by repeat, with hilrig's own limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.measurands import Sample
from benchmarks.spread import Spread, spread

Round = Mapping[str, Sample]
"""measurand -> its sample in one repeat"""


@dataclass(frozen=True)
class Comparison:
    """One number, computed from the samples of one repeat."""

    name: str
    what: str
    unit: str
    value: Callable[[Round], float]
    """Raises KeyError if the repeat lacks a sample that it needs"""
    low: float | None = None
    """The median must not be less"""
    high: float | None = None
    """The median must not be more"""


def ratio(upper: tuple[str, str], lower: tuple[str, str]) -> Callable[[Round], float]:
    """Return upper / lower, each a (measurand, quantity). A ratio to zero raises KeyError."""

    def value(samples: Round) -> float:
        above, below = samples[upper[0]][upper[1]], samples[lower[0]][lower[1]]
        if below == 0:
            raise KeyError(lower)
        return above / below

    return value


def _excess(kind: str) -> Callable[[Round], float]:
    """Return the fraction of late ticks beyond twice cyclictest's fraction of wake-ups over 1 ms late."""
    loop, cyclictest = f"realtime{kind}", f"cyclictest{kind}"
    return lambda r: r[loop]["late_fraction"] - 2.0 * r[cyclictest]["over_1ms_fraction"]


PERIOD_US = 1000.0
COMPARISONS = (
    Comparison(
        "lockstep_to_bare", "lockstep steps/s, relative to the bare zenoh pair's round trips/s", "",
        ratio(("lockstep", "loop_steps_per_s"), ("zenoh.back_to_back", "rate_hz")), low=0.75,
    ),
    Comparison(
        "exchange_to_bare", "the same with each command awaited (actuation_delay 0)", "",
        ratio(("lockstep.exchange", "loop_steps_per_s"), ("zenoh.back_to_back", "rate_hz")),
    ),
    Comparison(
        "overhead_us", "hilrig's round trip minus the bare one's, p50", "us",
        lambda r: r["lockstep.exchange"]["round_trip_p50_us"] - r["zenoh.back_to_back"]["round_trip_p50_us"], high=40.0,
    ),
    Comparison(
        "paced_overhead_us", "hilrig's round trip in real time minus the bare paced one's, p50", "us",
        lambda r: r["realtime"]["round_trip_p50_us"] - r["zenoh.paced"]["round_trip_p50_us"],
    ),
    Comparison(
        "in_process_to_lockstep", "in-process steps/s, relative to lockstep steps/s over the bus", "",
        ratio(("in_process", "loop_steps_per_s"), ("lockstep", "loop_steps_per_s")),
    ),
    Comparison(
        "lateness_p50_to_cyclictest", "lateness p50, relative to cyclictest's", "",
        ratio(("realtime", "lateness_p50_us"), ("cyclictest", "lateness_p50_us")), high=1.5,
    ),
    Comparison(
        "lateness_p99_to_cyclictest", "lateness p99, relative to cyclictest's", "",
        ratio(("realtime", "lateness_p99_us"), ("cyclictest", "lateness_p99_us")), high=1.5,
    ),
    Comparison(
        "command_age_p50_off_us", "command age p50, distance from one period", "us",
        lambda r: abs(r["realtime"]["command_age_p50_us"] - PERIOD_US), high=20.0,
    ),
    Comparison(
        "command_age_p99_us", "command age p99", "us",
        lambda r: r["realtime"]["command_age_p99_us"], high=1.25 * PERIOD_US,
    ),
    Comparison(
        "late_excess", "late ticks beyond twice cyclictest's share of wake-ups over 1 ms", "%",
        lambda r: 100.0 * _excess("")(r), high=0.1,
    ),
    Comparison(
        "late_loaded", "late ticks under full load", "%",
        lambda r: 100.0 * r["realtime.loaded"]["late_fraction"], high=1.0,
    ),
    Comparison(
        "watched_lockstep", "lockstep steps/s with hilrig watch, relative to without", "",
        ratio(("lockstep.watched", "loop_steps_per_s"), ("lockstep", "loop_steps_per_s")),
    ),
    Comparison(
        "watched_lateness_p99", "lateness p99 with hilrig watch, relative to without", "",
        ratio(("realtime.watched", "lateness_p99_us"), ("realtime", "lateness_p99_us")),
    ),
    Comparison(
        "certificate_cost", "share of the lockstep rate that the certificate costs", "%",
        lambda r: 100.0 * r["lockstep.alternating"]["certificate_cost"],
        high=5.0,
    ),
)  # fmt: skip


def compare(rounds: Sequence[Round]) -> dict[str, dict[str, Any]]:
    """Return each comparison possible in at least one repeat: name -> what, unit, limits, spread over the repeats, met.

    `met` judges the median; it is None if there is no limit.
    """
    found = {}
    for comparison in COMPARISONS:
        values = [value for samples in rounds if (value := _value(comparison, samples)) is not None]
        if values:
            over = spread(values)
            found[comparison.name] = {
                "what": comparison.what, "unit": comparison.unit, "low": comparison.low, "high": comparison.high,
                "met": met(comparison, over), **document(over),
            }  # fmt: skip
    return found


def _value(comparison: Comparison, samples: Round) -> float | None:
    try:
        return comparison.value(samples)
    except KeyError:
        return None


def met(comparison: Comparison, over: Spread) -> bool | None:
    """Return whether the median is within the comparison's limits; None if it has none."""
    if comparison.low is None and comparison.high is None:
        return None
    enough = comparison.low is None or over.median >= comparison.low
    return enough and (comparison.high is None or over.median <= comparison.high)


def document(over: Spread) -> dict[str, Any]:
    """Return a spread as plain data."""
    return {"median": over.median, "lowest": over.lowest, "highest": over.highest, "values": list(over.values)}
