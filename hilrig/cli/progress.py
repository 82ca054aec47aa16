"""The progress of a run on the terminal: one bar per trial in progress."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.text import Text

from hilrig.cli.terminal import errors, outcome_line

if TYPE_CHECKING:
    from hilrig.experiment.trial import Trial
    from hilrig.rig.outcome import Outcome


class _Clocks(ProgressColumn):
    """Simulated time, speed relative to real time, and remaining time."""

    def render(self, task: Task) -> Text:
        """Return the column for one trial."""
        total, done = task.total or 0.0, task.completed
        if words := task.fields.get("doing"):
            return Text(words, style="dim")
        since = task.fields.get("since")
        if not since or not done:
            return Text(f"0 / {total:g} s   starting", style="dim")
        wall = max((task.finished_time or task.get_time() - since), 1e-9)
        speed = done / wall
        left = (total - done) / speed if speed > 0 else 0.0
        return Text(f"{done:5.1f} / {total:g} s  {speed:5.2f} x real time  {left:4.0f} s left")


class Display:
    """Shows the progress of trials: bars on a terminal, elsewhere one line per trial that did not complete."""

    def __init__(self, trials: int) -> None:
        self._count, self._number = trials, 0
        self._bars = Progress(
            TextColumn("{task.description}", markup=False), BarColumn(bar_width=24), _Clocks(),
            console=errors, transient=True, disable=not errors.is_terminal,
        )  # fmt: skip
        self._tasks: dict[str, Any] = {}

    def opened(self, run: Path) -> None:
        """Do nothing: there is nothing to show yet."""

    def started(self, trial: Trial) -> None:
        """Show a trial's bar."""
        self._number += 1
        label = f"[{self._number}/{self._count}] {trial.id}"
        total = trial.ticks * trial.period
        self._tasks[trial.id] = self._bars.add_task(label, total=total, since=None, doing="")

    def doing(self, trial: Trial, words: str) -> None:
        """Show what the plant does instead of the time."""
        self._bars.update(self._tasks[trial.id], doing=words)

    def progressed(self, trial: Trial, tick: int) -> None:
        """Move a trial's bar."""
        task = self._tasks[trial.id]
        if self._bars.tasks and self._field(task, "since") is None:
            self._bars.update(task, since=self._bars.get_time())
        self._bars.update(task, completed=tick * trial.period)

    def _field(self, task: Any, name: str) -> Any:
        return next((item.fields[name] for item in self._bars.tasks if item.id == task), None)

    def ended(self, trial: Trial, outcome: Outcome) -> None:
        """Replace a trial's bar by one line; without a terminal, print the line only if it did not complete."""
        self._bars.remove_task(self._tasks.pop(trial.id))
        if errors.is_terminal or not outcome.completed:
            self._bars.console.print(outcome_line(outcome))

    def __enter__(self) -> Display:
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bars.stop()
