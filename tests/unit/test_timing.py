from __future__ import annotations

import numpy as np
import pytest

from hilrig.recording.timing import quantiles, summarise

MICRO = 1000


def driver(ticks: int, wait: int, trip: int) -> dict[str, np.ndarray]:
    """Ticks of 1 ms that were woken `wait` us after due and had their command `trip` us after publishing."""
    due = np.arange(ticks) * 1000 * MICRO
    published = due + (wait + 5) * MICRO
    return {"due": due, "woke": due + wait * MICRO, "published": published, "received": published + trip * MICRO}


def controller(ticks: int, compute: int) -> dict[str, np.ndarray]:
    received = np.arange(ticks) * 1000 * MICRO
    return {"received": received, "computed": received + compute * MICRO}


def test_every_figure_is_from_its_own_stamps() -> None:
    timing = summarise("realtime", {"driver_timing": driver(4, 20, 150), "controller_timing": controller(3, 40)})
    assert (timing["clock"], timing["ticks"]) == ("realtime", 4)
    assert timing["lateness_us"] == {"p50": 20.0, "p99": 20.0, "p99.9": 20.0, "max": 20.0}
    assert timing["round_trip_us"]["p50"] == 150.0
    assert timing["compute_us"]["max"] == 40.0


def test_lockstep_has_no_lateness() -> None:
    stamps = {"driver_timing": driver(1, 20, 150), "controller_timing": controller(1, 40)}
    assert summarise("lockstep", stamps)["lateness_us"] is None


def test_nothing_recorded_is_said_to_be_nothing() -> None:
    timing = summarise("realtime", {"driver_timing": driver(0, 20, 150), "controller_timing": controller(0, 40)})
    assert (timing["ticks"], timing["late"], timing["late_fraction"]) == (0, 0, 0.0)
    assert timing["round_trip_us"] is None
    assert timing["compute_us"] is None


def test_quantiles_are_in_microseconds() -> None:
    found = quantiles(np.arange(1001) * MICRO)
    assert found == pytest.approx({"p50": 500.0, "p99": 990.0, "p99.9": 999.0, "max": 1000.0})
