"""What there is to show of a run."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from hilrig.cli.watch.history import History
from hilrig.cli.watch.planned import PlannedRun, PlannedTrial


@dataclass(frozen=True)
class Scene:
    """What there is to show at a moment."""

    run: PlannedRun
    trial: PlannedTrial | None
    """None between two trials"""
    history: History
    ended: Counter[str]
    """Trials that have ended, by outcome"""
    others: int = 0
    """Trials that go on beside this one"""
