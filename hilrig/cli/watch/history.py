"""The latest views of a trial, and values derived from them."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from hilrig.rig.view import INTERVAL_S, View

if TYPE_CHECKING:  # importing signals loads numba, which a watcher does not need
    from hilrig.core.signals import Array

KEPT = round(10.0 / INTERVAL_S)
"""Number of views kept: those of the last ten seconds"""


@dataclass
class History:
    """The views of one trial seen so far."""

    views: deque[View] = field(default_factory=lambda: deque(maxlen=KEPT))
    heard: float = 0.0
    """When the last view came in, s of a monotonic clock"""

    def add(self, view: View, now: float) -> None:
        """Add a view; ignore it if it is not newer than the last."""
        if not self.views or view.tick > self.views[-1].tick:
            self.views.append(view)
            self.heard = now

    @property
    def last(self) -> View | None:
        """The newest view, if any."""
        return self.views[-1] if self.views else None

    @property
    def speed(self) -> float | None:
        """Trial time over wall time, over the kept views; None before there are two."""
        if len(self.views) < 2:
            return None
        first, last = self.views[0], self.views[-1]
        return (last.time - first.time) / max(last.elapsed - first.elapsed, 1e-9)

    @property
    def span(self) -> float:
        """Trial time that the kept views span, s."""
        return self.views[-1].time - self.views[0].time if self.views else 0.0

    @property
    def lateness(self) -> float:
        """The latest wake-up in the kept views, s."""
        return max((view.lateness for view in self.views), default=0.0)

    def error(self, axis: int) -> Array:
        """Return the error of an axis in each kept view, (N,) m or N."""
        return np.array([view.error[axis] for view in self.views])

    def auxiliary_error(self, axis: int) -> Array:
        """Return the auxiliary error of an axis in each kept view, (N,) N."""
        return np.array([view.auxiliary_error[axis] for view in self.views])
