"""The timing certificate of a trial as stored in timing.json, computed from the trial's time stamps."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hilrig.experiment.timing_budget import TimingBudget
from hilrig.recording.certificate.attribution import attribute
from hilrig.recording.certificate.budget import violations
from hilrig.recording.certificate.durations import Terms, durations
from hilrig.recording.certificate.histogram import histogram, quantiles_us
from hilrig.recording.certificate.samples import sampling
from hilrig.recording.certificate.table import StampColumns, join, left_out
from hilrig.recording.run_directory import read_json, write_json

Setup = Mapping[str, Mapping[str, Mapping[str, Any]]]
"""process -> setting -> {"wanted", "applied", "reason"}"""

DURATIONS = ("lateness", "state_transport", "compute", "command_transport", "command_age", "round_trip")
"""In the order of timing.json"""


def terms_of(document: Mapping[str, Any]) -> Terms:
    """Return what the loop of a trial is configured to do, from the trial's document in the plan."""
    return Terms(document.get("clock", "lockstep"), document["period"], document.get("actuation_delay", 1))


def certify(
    terms: Terms,
    budget: TimingBudget,
    channels: Mapping[str, StampColumns],
    setup: Setup | None = None,
    one_clock: bool = True,
    refused: Mapping[str, Mapping[str, int]] | None = None,
    answered_to_the_end: bool | None = None,
) -> dict[str, Any]:
    """Return the certificate of a trial as plain data, from "driver_timing" and "controller_timing".

    A channel may be missing or empty. missed: ticks that were overdue by a period and left out; they are late, through
    the driver. late_by: late ticks by cause. samples: of a plant with a clock of its own, null for a simulated one.
    <duration>_us: p50, p99, p99.9 and max in microseconds; null if it is not known. histograms: [lower edge in ns,
    count] of every bin that is not empty (`certificate/histogram.py`). budget: the limits that applied. valid: whether
    a trial in real time kept its budget, with invalid_because; null in lockstep, which has no budget. refused: messages
    that were not of this trial, not of its form, or out of order, by channel and reason; none of them had an effect.
    """
    table = join(channels.get("driver_timing"), channels.get("controller_timing"), one_clock)
    found = attribute(table, terms, answered_to_the_end)
    missed = left_out(table.driver) if terms.realtime else 0
    ticks, late = found.late.size + missed, int(np.count_nonzero(found.late)) + missed
    causes = found.counts()
    causes["driver"] += missed
    samples = sampling(channels.get("driver_timing"), terms.period_ns)
    values = {name: values for name, values in durations(table, terms).items() if values is not None}
    reasons = violations(budget, terms, ticks, late, values["command_age"]) if terms.realtime else []
    return {
        "clock": terms.clock,
        "ticks": ticks,
        "late": late,
        "late_fraction": late / ticks if ticks else 0.0,
        "missed": missed,
        "late_by": causes,
        **{f"{name}_us": quantiles_us(values[name]) if name in values else None for name in DURATIONS},
        "histograms": {name: histogram(values[name]) for name in DURATIONS if name in values and values[name].size},
        "samples": samples
        and {
            "fresh": samples.fresh,
            "repeated": samples.repeated,
            "jitter_us": quantiles_us(samples.jitter),
            "jitter_histogram": histogram(samples.jitter),
        },
        "setup": {process: dict(settings) for process, settings in (setup or {}).items()},
        "budget": {
            "late_fraction": budget.late_fraction,
            "command_age_p99": budget.command_age_limit(terms.period, terms.actuation_delay),
        },
        "valid": not reasons if terms.realtime else None,
        "invalid_because": reasons,
        "one_clock": one_clock,
        "refused": {channel: dict(reasons) for channel, reasons in (refused or {}).items() if any(reasons.values())},
    }


def add_refused(path: Path, channel: str, counts: Mapping[str, int]) -> None:
    """Add what was refused on a channel to a trial's timing.json, if there is one: reason -> number of messages."""
    if path.is_file() and any(counts.values()):
        document = read_json(path)
        write_json(path, {**document, "refused": {**document.get("refused", {}), channel: dict(counts)}})
