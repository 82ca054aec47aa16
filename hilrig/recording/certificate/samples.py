"""The samples of a plant that has a clock of its own: how many were new, and how evenly they came."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hilrig.recording.certificate.table import StampColumns, Stamps


class Sampling(NamedTuple):
    """The samples at the stamped ticks of a trial."""

    fresh: int
    """Ticks with a new sample"""
    repeated: int
    """Ticks at which the plant had none, and the last one was reported again"""
    jitter: Stamps
    """|time from one sample to the next - the ticks between them times the period|, (S,) ns"""


def sampling(driver: StampColumns | None, period_ns: int) -> Sampling | None:
    """Return the samples; None if the plant says nothing of them. A simulated one has a sample at every tick."""
    if driver is None or "sampled" not in driver:
        return None
    known = np.asarray(driver["sampled"]).astype(np.int64) != 0
    if not np.any(known):
        return None
    new = known & (np.asarray(driver["fresh"]) != 0)
    taken, tick = (np.asarray(driver[name]).astype(np.int64)[new] for name in ("sampled", "tick"))
    jitter = np.abs(np.diff(taken) - np.diff(tick) * period_ns)
    return Sampling(int(np.count_nonzero(new)), int(np.count_nonzero(~new)), jitter)
