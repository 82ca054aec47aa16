"""The cost of time stamps: one trial that is stamped in every other block of ticks, compared block by block.

Two identical trials differ by about ten percent, because their memory layout and the other load on the host differ. A
block and its neighbours, 0.1 s apart in the same processes, do not.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.trials import TrialCall, run_trial
from hilrig.core.errors import RigError
from hilrig.recording.bag import read_bag

RIG = "benchmarks.alternating_rig"


def costs(ticks: NDArray[np.int64], woke: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the fraction of the rate that stamps cost, for each block without stamps between two blocks with stamps.

    Let u be the time of a tick without stamps, and s that of a tick with them in the blocks before and after: the cost
    is 1 - u / s. `ticks` are the stamped ones, ascending, and `woke` (ns) is when each began, both (N,).
    """
    first = np.flatnonzero(np.diff(ticks, prepend=-2) > 1)
    last = np.append(first[1:], ticks.size) - 1
    # The last block of a trial may be cut short, even to a single tick, so it is not meaningful.
    whole = last - first >= last[:1] - first[:1]
    first, last = first[whole], last[whole]
    stamped = (woke[last] - woke[first]) / (last - first)
    around = (stamped[:-1] + stamped[1:]) / 2
    # From the last stamped tick to the next: one tick with stamps, and all those without.
    between, count = woke[first[1:]] - woke[last[:-1]], ticks[first[1:]] - ticks[last[:-1]] - 1
    return 1.0 - (between - around) / count / around


def certificate_cost(call: TrialCall) -> dict[str, float]:
    """Run the trial on `RIG`; return the median of `costs` and the number of blocks behind it.

    Raises RigError if driver and controller did not stamp the same ticks, or if there are too few blocks.
    """
    found: list[NDArray[np.float64]] = []

    def read(trial: Path) -> None:
        bag = read_bag(trial / "bag.mcap", ("driver_timing", "controller_timing"))
        ticks, answered = (bag[channel]["tick"].astype(np.int64) for channel in ("driver_timing", "controller_timing"))
        if not np.array_equal(ticks, answered):
            raise RigError(f"driver and controller stamped different ticks: {ticks.size} and {answered.size} of them")
        found.append(costs(ticks, bag["driver_timing"]["woke"].astype(np.int64)))

    run_trial(call, read)
    if not found[0].size:
        raise RigError("the trial has no block of ticks without stamps between two blocks with them")
    return {"certificate_cost": float(np.median(found[0])), "blocks": float(found[0].size)}
