"""The ticks at which a fault happens, and for how long: shared by the kinds that are faults."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array
from hilrig.kinds.disturbances._window import TOLERANCE, window

Ticks = NDArray[np.int64]
Duration = float | tuple[float, ...]
"""One time for all, or [least, most]: each is drawn uniformly between the two"""


@dataclass(frozen=True, kw_only=True)
class FaultTimes:
    """At given times, at `count` random ticks, at each tick with `probability`, or at every tick of `within`."""

    at: Annotated[float | tuple[float, ...] | None, Parameter("s", "when: one time, or a list of times", 0.0)] = None
    count: Annotated[int | None, Parameter("", "number of random ticks", 1, 5_000_000)] = None
    probability: Annotated[float | None, Parameter("", "at each tick with this probability", 0.0, 1.0)] = None
    within: Annotated[
        tuple[float, float] | None, Parameter("s", "only from the first time until before the second", 0.0)
    ] = None
    distance: Annotated[float | None, Parameter("s", "shortest time between two of 'count'", 0.0)] = None

    def __post_init__(self) -> None:
        """Raise ValueError unless the ticks are given in exactly one way."""
        ways = [name for name in ("at", "count", "probability") if getattr(self, name) is not None]
        if len(ways) > 1:
            raise ValueError(f"'{ways[0]}' and '{ways[1]}' are two ways to say when; give one")
        if not ways and self.within is None:
            raise ValueError("say when: give 'at', 'count' or 'probability', or 'within' alone for every tick there")
        if self.at is not None and self.within is not None:
            raise ValueError("'within' is for random ticks; 'at' says exactly when")
        if self.distance is not None and self.count is None:
            raise ValueError("'distance' is for 'count'")

    def ticks(self, time: Array, random: np.random.Generator) -> Ticks:
        """Return the ticks, ascending. Raises ValueError if they are outside the trial, or do not fit into it."""
        if self.at is not None:
            return _ticks_at(np.atleast_1d(np.array(self.at)), time)
        inside = self._inside(time)
        if self.count is not None:
            spacing = (
                1 if self.distance is None else max(1, int(np.ceil((self.distance - TOLERANCE) / (time[1] - time[0]))))
            )
            return inside[spread(self.count, inside.size, spacing, random)]
        return inside[random.random(inside.size) < (1.0 if self.probability is None else self.probability)]

    def _inside(self, time: Array) -> Ticks:
        if self.within is None:
            return np.arange(time.size)
        begin, end = self.within
        if end <= begin:
            raise ValueError(f"within: it would end ({end:g} s) before it begins ({begin:g} s)")
        found = np.flatnonzero(window(time, begin, end))
        if found.size == 0:
            raise ValueError(f"within: [{begin:g} s, {end:g} s] contains no tick; the last one is at {time[-1]:g} s")
        return found


def _ticks_at(times: Array, time: Array) -> Ticks:
    """Return the first tick at or after each of `times`, ascending."""
    ticks = np.sort(np.searchsorted(time, times - TOLERANCE))
    if ticks[-1] >= time.size:
        raise ValueError(f"at: {times.max():g} s is after the last tick, at {time[-1]:g} s")
    if (repeated := ticks[1:][np.diff(ticks) == 0]).size:
        raise ValueError(f"at: two times fall on the tick at {time[repeated[0]]:g} s")
    return ticks


def spread(count: int, size: int, spacing: int, random: np.random.Generator) -> Ticks:
    """Return `count` whole numbers below `size`, ascending, with neighbours at least `spacing` apart.

    Every such choice is equally likely: `count` numbers below size - (count - 1) (spacing - 1) are drawn, and the gaps
    are added back. Raises ValueError if they do not fit.
    """
    room = size - (count - 1) * (spacing - 1)
    if room < count:
        most = (size - 1) // spacing + 1
        apart = f", {spacing} ticks apart," if spacing > 1 else ""
        raise ValueError(f"count: {count} faults{apart} do not fit into {size} ticks; at most {most} do")
    return np.sort(random.choice(room, count, replace=False)) + np.arange(count) * (spacing - 1)


def check_duration(duration: Duration) -> None:
    """Raise ValueError unless it is one time, or two in ascending order."""
    if isinstance(duration, tuple) and (len(duration) != 2 or duration[0] > duration[1]):
        raise ValueError(f"duration: {list(duration)} is not allowed; give one time, or [least, most]")


def drawn(duration: Duration, size: int, random: np.random.Generator) -> Array:
    """Return `size` durations, s."""
    least, most = duration if isinstance(duration, tuple) else (duration, duration)
    return random.uniform(least, most, size)
