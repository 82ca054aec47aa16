from __future__ import annotations

import numpy as np
import pytest

from hilrig.certificate.histogram import quantiles
from hilrig.messages.codec import Codec, definition
from hilrig.recording.old_timing import summarise_batches as summarise

MICRO = 1000


def payload(name: str, first: int, **columns: list[int]) -> bytes:
    form = definition(name)
    size = len(next(iter(columns.values())))
    values = [np.array(columns[field.name], dtype=np.int64) for field in form.fields[1:]]
    return Codec(form, {field.name: size for field in form.fields[1:]}).pack((first, *values))


def driver(first: int, late: list[int], wait: int, trip: int) -> bytes:
    """Ticks of 1 ms that were woken `wait` us after due and had their command `trip` us after publishing."""
    due = [(first + k) * 1000 * MICRO for k in range(len(late))]
    published = [d + wait * MICRO + 5 * MICRO for d in due]
    return payload(
        "DriverTiming", first, due=due, woke=[d + wait * MICRO for d in due], published=published,
        received=[p + trip * MICRO for p in published], late=late,
    )  # fmt: skip


def controller(first: int, compute: list[int]) -> bytes:
    received = [k * 1000 * MICRO for k in range(len(compute))]
    computed = [r + c * MICRO for r, c in zip(received, compute, strict=True)]
    return payload(
        "ControllerTiming", first, ticks=list(range(first, first + len(compute))), received=received, computed=computed,
        published=[c + 9 * MICRO for c in computed],
    )  # fmt: skip


def test_every_figure_is_from_its_own_stamps() -> None:
    batches = {
        "driver_timing": [driver(0, [0, 1, 3], 20, 150), driver(3, [0], 20, 150)],
        "controller_timing": [controller(0, [40, 40, 40])],
    }
    timing = summarise("realtime", batches)
    assert (timing["clock"], timing["ticks"], timing["late"], timing["late_fraction"]) == ("realtime", 4, 2, 0.5)
    assert timing["lateness_us"] == {"p50": 20.0, "p99": 20.0, "p99.9": 20.0, "max": 20.0}
    assert timing["round_trip_us"]["p50"] == 150.0
    assert timing["compute_us"]["max"] == 40.0


def test_lockstep_has_no_lateness() -> None:
    assert summarise("lockstep", {"driver_timing": [driver(0, [0], 20, 150)]})["lateness_us"] is None


def test_nothing_recorded_is_said_to_be_nothing() -> None:
    timing = summarise("realtime", {})
    assert (timing["ticks"], timing["late"], timing["late_fraction"]) == (0, 0, 0.0)
    assert timing["round_trip_us"] is None
    assert timing["compute_us"] is None


def test_quantiles_are_in_microseconds() -> None:
    found = quantiles(np.arange(1001) * MICRO)
    assert found == pytest.approx({"p50": 500.0, "p99": 990.0, "p99.9": 999.0, "max": 1000.0})
