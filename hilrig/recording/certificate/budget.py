"""Whether a trial kept its timing budget."""

from __future__ import annotations

from hilrig.experiment.timing_budget import TimingBudget
from hilrig.recording.certificate.durations import Terms
from hilrig.recording.certificate.histogram import quantiles
from hilrig.recording.certificate.table import Stamps


def violations(budget: TimingBudget, terms: Terms, ticks: int, late: int, ages: Stamps) -> list[str]:
    """Return the reasons why a real-time trial is outside its budget, one line each; empty if it is within.

    `ages` are the ages of the commands in effect, (K,) ns.
    """
    if ticks == 0:
        return ["no tick was stamped: nothing shows that the loop kept its period"]
    reasons = []
    if late / ticks > budget.late_fraction:
        value, limit = _told_apart(100 * late / ticks, 100 * budget.late_fraction)
        reasons.append(f"late ticks {value} %, at most {limit} %")
    if ages.size == 0:
        return [*reasons, "no command took effect: its age is not known"]
    age_ms = quantiles(ages)["p99"] / 1e6
    limit_ms = 1e3 * budget.command_age_limit(terms.period, terms.actuation_delay)
    if age_ms > limit_ms:
        value, limit = _told_apart(age_ms, limit_ms)
        reasons.append(f"command age p99 {value} ms, at most {limit} ms")
    return reasons


def _told_apart(value: float, limit: float) -> tuple[str, str]:
    """Return both with three digits, or as many as needed to show that the value is above the limit."""
    for digits in range(3, 18):
        if float(f"{value:.{digits}g}") > float(f"{limit:.{digits}g}"):
            return f"{value:.{digits}g}", f"{limit:.{digits}g}"
    return repr(value), repr(limit)
