"""Follows a run from trial to trial: joins the bus of the running trial and asks its logger for views."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field
from types import TracebackType

from hilrig.cli.watch.history import History
from hilrig.cli.watch.planned import PlannedRun, PlannedTrial
from hilrig.cli.watch.scene import Scene
from hilrig.rig.bus import Bus
from hilrig.rig.cores import pin
from hilrig.rig.live import LiveRun, LiveTrial, read_live
from hilrig.rig.view import ASKING, CHANNEL, GRANT_S, WATCHER, read_view

ASK = GRANT_S / 4
"""s between two requests for views"""
LOOK = 0.2
"""s between two checks of live.json"""


@dataclass
class Ear:
    """The watcher's connection to one trial's bus."""

    trial: PlannedTrial
    bus: Bus
    history: History = field(default_factory=History)

    def __post_init__(self) -> None:
        self._views = self.bus.inbox(CHANNEL, ["logger"], complete=False)
        self._asking = self.bus.outbox(ASKING, blocking=False)
        self._next = 0.0

    def listen(self, now: float) -> None:
        """Add the views that have arrived, and request more."""
        while (payload := self._views.poll()) is not None:
            self.history.add(read_view(payload, len(self.trial.axes)), now)
        if now >= self._next:
            self._next = now + ASK
            self._asking.put(b"?")


class Follower:
    """The state of a run as a watcher sees it."""

    def __init__(self, run: PlannedRun, live: LiveRun) -> None:
        self._run, self._live = run, live
        self._cores = os.sched_getaffinity(0)
        self._ear: Ear | None = None
        self._ended = run.ended()
        self._next_look = 0.0
        self.over: str | None = None
        """How the run ended, once it has: "" if by itself, "killed" if its program is gone"""

    def look(self) -> Scene:
        """Return the current scene."""
        now = time.monotonic()
        if now >= self._next_look:
            self._next_look = now + LOOK
            self._look_for_trials()
        if self._ear is None:
            return Scene(self._run, None, History(), self._ended)
        self._ear.listen(now)
        others = max(len(self._live.trials) - 1, 0)
        return Scene(self._run, self._ear.trial, self._ear.history, self._ended, others)

    def _look_for_trials(self) -> None:
        live = read_live(self._run.path)
        if live is None or not live.alive:
            self.over = "" if live is None else "killed"
            return
        self._live = live
        going_on = {trial.id: trial for trial in live.trials}
        if self._ear is not None and self._ear.trial.id in going_on:
            return
        self.leave()
        self._ended = self._run.ended()
        for trial in live.trials[:1]:
            self._join(trial)

    def _join(self, trial: LiveTrial) -> None:
        # Before opening the bus: its threads inherit the cores that the process has then.
        os.sched_setaffinity(0, self._cores)
        pin(list(trial.cores))
        self._ear = Ear(self._run.trials[trial.id], Bus(trial.id, WATCHER, [], [trial.endpoint], epoch=trial.epoch))

    def leave(self) -> None:
        """Leave the bus, if on it."""
        if self._ear is not None:
            self._ear.bus.close()
            self._ear = None

    def __enter__(self) -> Follower:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.leave()
