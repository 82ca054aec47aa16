"""How old the measurement behind a command was: set and exact in lockstep, measured in real time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hilrig.signals import Array


def loop_delays(timing: Mapping[str, np.ndarray]) -> Array:
    """Return the loop delay of every period, (K,) s, from the driver's timing: measurement begun to command applied.

    `timing` names the command in effect from each tick on by the tick that it answers. Periods before the first
    command, and those whose measurement's stamps are not in the record, are left out.
    """
    tick, woke, applied = timing["tick"].astype(np.int64), timing["woke"], timing["applied"]
    measured = timing["command"]
    place = np.minimum(np.searchsorted(tick, measured), tick.size - 1)
    known = (measured >= 0) & (tick[place] == measured)
    return np.asarray((applied[known] - woke[place[known]]) / 1e9, dtype=np.float64)
