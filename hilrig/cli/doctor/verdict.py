"""Whether a machine is fit for a loop with a given period: the rule and the numbers that it uses. No I/O."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hilrig.experiment.timing_budget import TimingBudget
from hilrig.recording.certificate.histogram import quantiles_us
from hilrig.recording.certificate.late import is_late
from hilrig.rig.setup import Report

READY_LATE, USABLE_LATE = 0.001, TimingBudget.late_fraction
"""Fractions of late ticks; the second is the default budget of an experiment"""


@dataclass(frozen=True)
class ProbeStamps:
    """The time stamps of a probe of N ticks, CLOCK_MONOTONIC in ns, arrays (N,)."""

    period: int
    """ns"""
    due: NDArray[np.int64]
    woke: NDArray[np.int64]
    published: NDArray[np.int64]
    received: NDArray[np.int64]
    """When the answer arrived; 0 if it did not"""


class Probe(NamedTuple):
    """The result of a probe."""

    ticks: int
    period: float
    """s"""
    late: int
    """Ticks whose answer had not arrived by the next tick, or that began a period or more after they were due"""
    lateness_us: dict[str, float]
    """Percentiles of woke - due"""
    round_trip_us: dict[str, float]
    """Percentiles of received - published; empty if no answer came"""
    unanswered: int
    steal: float
    """Fraction of the cores' time that the hypervisor took; 0 without a hypervisor"""
    setup: dict[str, Report]
    """The real-time settings that were applied: process -> report"""


class Readiness(NamedTuple):
    """Whether a machine is fit, and why."""

    word: Literal["ready", "usable with late ticks", "not ready"]
    because: tuple[str, ...]
    """What prevents a better verdict; empty if the machine is ready"""


def summarise_probe(stamps: ProbeStamps, steal: float, setup: dict[str, Report]) -> Probe:
    """Return the result of a probe, computed from its stamps."""
    lateness = stamps.woke - stamps.due
    answered = stamps.received > 0
    trips = (stamps.received - stamps.published)[answered]
    # With an actuation delay of one, the answer to tick k takes effect when tick k + 1 wakes, if it has arrived by
    # then.
    tick, due, woke = np.arange(1, lateness.size), stamps.due[1:], stamps.woke[1:]
    in_time = answered[:-1] & (stamps.received[:-1] <= woke)
    late = is_late(tick, np.where(in_time, tick - 1, -1), due, applied=woke, delay=1, period_ns=stamps.period)
    return Probe(
        ticks=lateness.size, period=stamps.period * 1e-9, late=int(np.count_nonzero(late)),
        lateness_us=quantiles_us(lateness) or {}, round_trip_us=quantiles_us(trips) or {},
        unanswered=int(np.sum(~answered)), steal=steal, setup=setup,
    )  # fmt: skip


def judge_probe(probe: Probe) -> Readiness:
    """Return the verdict for the probe's period l.

    **ready**: at most 0.1 % of the ticks late, p99 of lateness at most l/10, p99 of the round trip at most l/2, and
    SCHED_FIFO applied, because without it any other process may make the loop late, however quiet the machine is now.
    **usable with late ticks**: at most 0.5 % late (an experiment's default budget), p99 of lateness at most l/4 and of
    the round trip at most l. **not ready**: worse. The probe has no control law; the time that a law takes comes on
    top.
    """
    short_of_ready = _beyond(probe, READY_LATE, 10, 2)
    refused = [report["scheduler"]["reason"] for report in probe.setup.values() if report["scheduler"]["reason"]]
    if refused:
        short_of_ready.append("SCHED_FIFO was refused: any other process may run before the loop")
    if not short_of_ready:
        return Readiness("ready", ())
    short_of_usable = _beyond(probe, USABLE_LATE, 4, 1)
    if not short_of_usable:
        return Readiness("usable with late ticks", tuple(short_of_ready))
    return Readiness("not ready", tuple(short_of_usable))


def _beyond(probe: Probe, late: float, lateness: int, trip: int) -> list[str]:
    """Return which limits are exceeded: the fraction of late ticks, and fractions 1/n of the period."""
    found: list[str] = []
    period = probe.period * 1e6
    if (fraction := probe.late / probe.ticks) > late:
        found.append(f"{fraction:.2%} of the ticks were late, more than {late:.1%}")
    if (value := probe.lateness_us["p99"]) > period / lateness:
        found.append(f"the lateness was {value:.0f} us at p99, more than {period / lateness:.0f} us")
    value = probe.round_trip_us.get("p99")
    if value is None:
        found.append("no answer came over the bus")
    elif value > period / trip:
        found.append(f"the round trip over the bus took {value:.0f} us at p99, more than {period / trip:.0f} us")
    return found
