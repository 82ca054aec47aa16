"""Shows a run until it ends: on a terminal as a screen that is redrawn, elsewhere as plain lines."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.live import Live

from hilrig.cli.watch import formatting
from hilrig.cli.watch.finding import going_on, gone
from hilrig.cli.watch.following import Follower
from hilrig.cli.watch.planned import planned_run
from hilrig.cli.watch.scene import Scene
from hilrig.cli.watch.screen import Screen
from hilrig.core.errors import RunDirectoryError
from hilrig.rig.processes import CHILD_ENVIRONMENT

FRAME = 0.2
"""s between two screens"""
POLL = 0.05
"""s between two checks of the bus"""
LINE_INTERVAL_S = 2.0
"""s between two plain lines"""
LAST = 19
"""Niceness: everything else on a core has priority"""


def watch_run(path: Path, console: Console) -> None:
    """Show the run in `path` until it ends. Raises RunDirectoryError if it cannot be watched, or was killed."""
    os.nice(LAST)
    os.environ.update(CHILD_ENVIRONMENT)  # also one thread per pool for the bus; set before it is loaded
    live = going_on(path)
    with Follower(planned_run(path), live) as follower:
        if console.is_terminal and console.encoding.lower().startswith("utf"):
            Show(console, follower).until_the_end()
        else:
            print_lines(console, follower)
        if follower.over:
            raise RunDirectoryError(gone(path, live))


class Show:
    """The screen; it restores the terminal when it is suspended (Ctrl-Z), told to end, or ends with an error."""

    def __init__(self, console: Console, follower: Follower) -> None:
        self._console, self._follower = console, follower
        self._suspended = self._told = False

    def until_the_end(self) -> None:
        """Draw the screen until the run ends."""
        signal.signal(signal.SIGTSTP, self._suspend)
        signal.signal(signal.SIGTERM, self._end)
        while self._follower.over is None and not self._told:
            self._draw()
            if self._suspended:
                self._suspended = False
                os.kill(os.getpid(), signal.SIGSTOP)

    def _draw(self) -> None:
        """Draw the screen until something ends it."""
        with Live(console=self._console, screen=True, auto_refresh=False) as screen:
            drawn = 0.0
            while self._follower.over is None and not self._told and not self._suspended:
                scene, now = self._follower.look(), time.monotonic()
                if now - drawn >= FRAME:
                    drawn = now
                    screen.update(Screen(scene, now), refresh=True)
                time.sleep(POLL)

    def _suspend(self, _number: int, _frame: Any) -> None:
        self._suspended = True

    def _end(self, _number: int, _frame: Any) -> None:
        self._told = True


def print_lines(console: Console, follower: Follower) -> None:
    """Print a line on the trial at intervals."""
    due = 0.0
    while follower.over is None:
        scene, now = follower.look(), time.monotonic()
        if now >= due and scene.history.last is not None:
            due = now + LINE_INTERVAL_S
            console.print(line(scene, now), markup=False, highlight=False, soft_wrap=True)
        time.sleep(POLL)


def line(scene: Scene, now: float) -> str:
    """Return the state of a trial in one line."""
    trial, view = scene.trial, scene.history.last
    assert trial is not None
    assert view is not None
    parts = [
        f"[{trial.number}/{len(scene.run.trials)}] {trial.id}  {view.time:.1f} of {trial.ticks * trial.period:g} s"
    ]
    parts += [
        formatting.pace(trial, scene.history),
        formatting.late(trial, view)[0],
        formatting.lateness(trial, scene.history),
    ]
    for i, axis in enumerate(trial.axes):
        error = formatting.error(view.error[i], axis in trial.force_axes).strip()
        parts.append(f"{axis} error {error}, auxiliary {view.auxiliary_error[i]:.3f} N")
    return "  ".join(filter(None, [*parts, formatting.state(scene.history, now)]))
