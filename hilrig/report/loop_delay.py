"""How old the measurement behind a command was: set and exact in lockstep, measured in real time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hilrig.signals import Array


def loop_delays(timing: Mapping[str, np.ndarray], actuation_delay: int) -> Array:
    """Return the loop delay of every period, (K,) s, from the driver's timing: measurement begun to command in hand.

    The command in effect from tick k is that of tick k - actuation_delay - late. Periods before the first command, and
    those whose measurement's stamps are not in the record, are left out.
    """
    tick, woke, received = timing["tick"].astype(np.int64), timing["woke"], timing["received"]
    measured = tick - actuation_delay - timing["late"]
    place = np.minimum(np.searchsorted(tick, measured), tick.size - 1)
    known = (measured >= 0) & (tick[place] == measured)
    return np.asarray((received[known] - woke[place[known]]) / 1e9, dtype=np.float64)
