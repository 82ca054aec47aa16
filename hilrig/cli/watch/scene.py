"""The state of a run to be shown."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from hilrig.cli.watch.history import History
from hilrig.cli.watch.planned import PlannedRun, PlannedTrial


@dataclass(frozen=True)
class Scene:
    """The state to be shown at one moment."""

    run: PlannedRun
    trial: PlannedTrial | None
    """None between two trials"""
    history: History
    ended: Counter[str]
    """Trials that have ended, by outcome"""
    others: int = 0
    """Number of other running trials"""
