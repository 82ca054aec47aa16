"""The watch process of `hilrig run --watch`, which shows the run on its terminal."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import TracebackType

from rich.text import Text

from hilrig.cli.terminal import errors, outcome_line
from hilrig.experiment.trial import Trial
from hilrig.rig.outcome import Outcome
from hilrig.rig.processes import ChildProcess

END_TIMEOUT_S = 3.0
"""How long the watch process may take to end by itself, and again after SIGTERM"""


class WatchedRun:
    """Leaves the terminal to the watch process while the trials run, then prints how they ended."""

    def __init__(self) -> None:
        self._watcher: ChildProcess | None = None
        self._lines: list[Text] = []

    def opened(self, run: Path) -> None:
        """Start the watch process. It shares the terminal; Ctrl-C there applies to the run."""
        command = [sys.executable, "-P", "-m", "hilrig", "watch", str(run), "--keep-on"]
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=sys.stderr)
        self._watcher = ChildProcess("the watch process", process)

    def started(self, trial: Trial) -> None:
        """The watcher shows it."""

    def doing(self, trial: Trial, words: str) -> None:
        """The watcher shows the ticks only."""

    def progressed(self, trial: Trial, tick: int) -> None:
        """The watcher shows it."""

    def ended(self, trial: Trial, outcome: Outcome) -> None:
        """Keep the line on how a trial ended until the terminal is free."""
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

    def _see_out(self, watcher: ChildProcess) -> None:
        """Wait for the watcher, which ends with the run; end it if it does not."""
        watcher.end(END_TIMEOUT_S, END_TIMEOUT_S)
        code = watcher.exit_code
        if code is None or code < 0:
            # It could not restore the terminal itself.
            errors.set_alt_screen(False)
            errors.show_cursor()
        if code != 0:
            errors.print(f"{watcher.how_it_ended()}; the run itself is not affected")
