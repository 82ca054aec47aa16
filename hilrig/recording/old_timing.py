"""timing.json from stamps in batches, which say no command's tick: until the rig stamps every tick (`timing.py`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hilrig.certificate.histogram import quantiles
from hilrig.messages.codec import Codec, definition, sizes_in


def summarise_batches(clock: str, payloads: Mapping[str, list[bytes]]) -> dict[str, Any]:
    """Return the timing of a trial from its timing messages, channel -> payloads.

    late: ticks whose period ran under an older command than it should have. lateness: due to woken, real time only.
    round_trip: measurement published to command in hand. compute: measurement in hand to torque known. Microseconds.
    """
    driver = _table("DriverTiming", payloads.get("driver_timing", []))
    controller = _table("ControllerTiming", payloads.get("controller_timing", []))
    ticks = driver["due"].size
    late = int(np.count_nonzero(driver["late"]))
    return {
        "clock": clock,
        "ticks": ticks,
        "late": late,
        "late_fraction": late / ticks if ticks else 0.0,
        "lateness_us": quantiles(driver["woke"] - driver["due"]) if clock == "realtime" else None,
        "round_trip_us": quantiles(driver["received"] - driver["published"]),
        "compute_us": quantiles(controller["computed"] - controller["received"]),
    }


def _table(name: str, payloads: list[bytes]) -> dict[str, np.ndarray]:
    fields = [field.name for field in definition(name).fields]
    rows = [Codec(definition(name), sizes_in(definition(name), payload)).unpack(payload) for payload in payloads]
    empty = np.zeros(0, dtype=np.int64)
    return {
        name: np.concatenate([np.atleast_1d(row[i]) for row in rows]) if rows else empty
        for i, name in enumerate(fields)
    }
