"""What the time stamps cost: one trial that takes them in every other block of ticks, compared block by block.

Two trials of the same thing differ by some ten percent: by where their memory lies, by what the host does meanwhile. A
block and its neighbours, 0.1 s apart in one process, do not.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.trials import TrialCall, run_trial
from hilrig.core.errors import RigError
from hilrig.experiment.rig_settings import BLOCK
from hilrig.recording.bag import read_bag

ALTERNATING = ("--set", "rig.certificate_alternates=true")


def costs(ticks: NDArray[np.int64], woke: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the fraction of the rate that stamps cost, by block without them that lies between two with them.

    With u the time of a tick without stamps and s with them, in the blocks before and after: 1 - u / s. `ticks` are
    those that were stamped, rising, and `woke` (ns) when each began, both (N,).
    """
    first = np.flatnonzero(np.diff(ticks, prepend=-2) > 1)
    last = np.append(first[1:], ticks.size) - 1
    # What is left of the last block of a trial says as little as a block of one tick.
    whole = ticks[last] - ticks[first] == BLOCK - 1
    first, last = first[whole], last[whole]
    stamped = (woke[last] - woke[first]) / (BLOCK - 1)
    # From the last stamped tick to the next: one tick with stamps, and all those without.
    between = woke[first[1:]] - woke[last[:-1]]
    around = (stamped[:-1] + stamped[1:]) / 2
    return 1.0 - (between - around) / BLOCK / around


def certificate_cost(call: TrialCall) -> dict[str, float]:
    """Run the trial; return the median of `costs` and the number of blocks. Raises RigError if it has too few."""
    found: list[NDArray[np.float64]] = []

    def read(trial: Path) -> None:
        timing = read_bag(trial / "bag.mcap", ("driver_timing",))["driver_timing"]
        found.append(costs(timing["tick"].astype(np.int64), timing["woke"].astype(np.int64)))

    run_trial(call, read)
    if not found[0].size:
        raise RigError(f"the trial is too short to compare blocks of {BLOCK} ticks")
    return {"certificate_cost": float(np.median(found[0])), "blocks": float(found[0].size)}
