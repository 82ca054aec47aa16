"""From time stamps to what a trial's timing was: timing.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

QUANTILES = {"p50": 50.0, "p99": 99.0, "p99.9": 99.9, "max": 100.0}


def summarise(clock: str, stamps: Mapping[str, Mapping[str, np.ndarray]]) -> dict[str, Any]:
    """Return the timing of a trial from its time stamps, channel -> field -> (N,).

    late: ticks whose period ran under an older command than it should have. lateness: due to woken, real time only.
    round_trip: measurement published to command in hand. compute: measurement in hand to torque known. Microseconds.
    """
    driver, controller = stamps["driver_timing"], stamps["controller_timing"]
    ticks, late = driver["due"].size, 0
    return {
        "clock": clock,
        "ticks": ticks,
        "late": late,
        "late_fraction": late / ticks if ticks else 0.0,
        "lateness_us": quantiles(driver["woke"] - driver["due"]) if clock == "realtime" else None,
        "round_trip_us": quantiles(driver["received"] - driver["published"]),
        "compute_us": quantiles(controller["computed"] - controller["received"]),
    }


def quantiles(nanoseconds: np.ndarray) -> dict[str, float] | None:
    """Return p50, p99, p99.9 and max in microseconds, or None if there is nothing to tell."""
    if nanoseconds.size == 0:
        return None
    values = np.percentile(nanoseconds, list(QUANTILES.values())) / 1e3
    return dict(zip(QUANTILES, (round(float(value), 1) for value in values), strict=True))
