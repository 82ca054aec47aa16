"""The rule for a late tick, defined only here and used by the certificate, the live view, the metric and `doctor`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hilrig.recording.certificate.table import Flags, Stamps


def is_late(
    tick: NDArray[np.integer], command: Stamps, due: Stamps, applied: Stamps, delay: int, period_ns: int
) -> Flags:
    """Return which ticks of a real-time loop were late, (N,).

    Tick k is late if the command in effect at it, that of tick `command`, is older than the command of tick k - `delay`
    (in ticks), or if it was applied a whole period or more after the tick was due. -1 stands for the holding command,
    in effect before the first one. `due` and `applied` are in ns.
    """
    return (command < tick.astype(np.int64) - delay) | overran(due, applied, period_ns)


def overran(due: Stamps, applied: Stamps, period_ns: int) -> Flags:
    """Return at which ticks the command was applied a whole period or more after the tick was due, (N,)."""
    return applied - due >= period_ns
