"""Whether a trial kept its timing budget."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hilrig.recording.certificate.table import Stamps


class Budget(NamedTuple):
    """What a trial in real time may take."""

    late_fraction: float
    """Largest share of late ticks, 0 to 1"""
    command_age_p99: float
    """Largest 99th percentile of the age of the command in effect, s"""


def broken(budget: Budget, ticks: int, late: int, ages: Stamps) -> list[str]:
    """Return why a trial in real time is outside its budget, a line for each reason; empty if it is within.

    `ages` are the ages of the commands in effect, (K,) ns.
    """
    if ticks == 0:
        return ["no tick left a stamp: nothing shows that the loop kept its period"]
    reasons = []
    if late / ticks > budget.late_fraction:
        value, limit = _told_apart(100 * late / ticks, 100 * budget.late_fraction)
        reasons.append(f"late ticks {value} %, at most {limit} %")
    if ages.size == 0:
        return [*reasons, "no command took effect: its age is not known"]
    age = float(np.percentile(ages, 99)) / 1e6
    if age > 1e3 * budget.command_age_p99:
        value, limit = _told_apart(age, 1e3 * budget.command_age_p99)
        reasons.append(f"command age p99 {value} ms, at most {limit} ms")
    return reasons


def _told_apart(value: float, limit: float) -> tuple[str, str]:
    """Return both with three digits, or as many as show that the value is above the limit."""
    for digits in range(3, 18):
        if float(f"{value:.{digits}g}") > float(f"{limit:.{digits}g}"):
            return f"{value:.{digits}g}", f"{limit:.{digits}g}"
    return repr(value), repr(limit)
