"""The watcher of `hilrig run --watch`: a process of its own on the run's terminal."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import TracebackType

from rich.text import Text

from hilrig.cli.terminal import errors, outcome_line
from hilrig.experiment.trial import Trial
from hilrig.rig.outcome import Outcome

PATIENCE = 3.0
"""s that the watcher is given to end by itself, and again when it was told to"""


class WatchedRun:
    """Leaves the terminal to a watcher while the trials go on; tells how they ended when it is gone."""

    def __init__(self) -> None:
        self._watcher: subprocess.Popen[bytes] | None = None
        self._lines: list[Text] = []

    def opened(self, run: Path) -> None:
        """Start the watcher of this run. It shares the terminal; Ctrl-C there is meant for the run."""
        command = [sys.executable, "-P", "-m", "hilrig", "watch", str(run), "--keep-on"]
        self._watcher = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=sys.stderr)

    def started(self, trial: Trial) -> None:
        """The watcher shows it."""

    def progressed(self, trial: Trial, tick: int) -> None:
        """The watcher shows it."""

    def ended(self, trial: Trial, outcome: Outcome) -> None:
        """Keep the line on a trial's end until the terminal is free."""
        if errors.is_terminal or not outcome.completed:
            self._lines.append(outcome_line(outcome))

    def __enter__(self) -> WatchedRun:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._watcher is not None:
            self._see_out(self._watcher)
        for line in self._lines:
            errors.print(line)

    def _see_out(self, watcher: subprocess.Popen[bytes]) -> None:
        """Wait for the watcher, which ends with the run; end it if it does not."""
        for end in (watcher.terminate, watcher.kill):
            try:
                watcher.wait(PATIENCE)
                break
            except subprocess.TimeoutExpired:
                end()
        else:
            watcher.wait()
        if watcher.returncode < 0:
            # It could not give the terminal back itself.
            errors.set_alt_screen(False)
            errors.show_cursor()
        if watcher.returncode:
            errors.print(f"the watcher ended with exit code {watcher.returncode}; the run was not touched by it")
