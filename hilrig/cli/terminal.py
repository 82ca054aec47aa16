"""What a person sees of a run: progress on the terminal's stderr, results on stdout."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.table import Table
from rich.text import Text

from hilrig.experiment.trial import Trial
from hilrig.report.expectations import Expected
from hilrig.rig.outcome import Outcome

errors = Console(stderr=True, highlight=False, soft_wrap=True)
STYLES = {"completed": "green", "tripped": "red", "failed": "red", "timed_out": "red", "aborted": "yellow"}


class _Clocks(ProgressColumn):
    """Simulated time, speed against real time, and time left."""

    def render(self, task: Task) -> Text:
        """Return the column for one trial."""
        total, done = task.total or 0.0, task.completed
        since = task.fields.get("since")
        if not since or not done:
            return Text(f"0 / {total:g} s   starting", style="dim")
        wall = max((task.finished_time or task.get_time() - since), 1e-9)
        speed = done / wall
        left = (total - done) / speed if speed > 0 else 0.0
        return Text(f"{done:5.1f} / {total:g} s  {speed:5.2f} x real time  {left:4.0f} s left")


class Display:
    """Shows trials as they go on: bars on a terminal, elsewhere only what went wrong."""

    def __init__(self, trials: int) -> None:
        self._count, self._number = trials, 0
        self._bars = Progress(
            TextColumn("{task.description}"), BarColumn(bar_width=24), _Clocks(), console=errors, transient=True,
            disable=not errors.is_terminal,
        )  # fmt: skip
        self._tasks: dict[str, Any] = {}

    def opened(self, run: Path) -> None:
        """There is nothing to show yet."""

    def started(self, trial: Trial) -> None:
        """Show a trial's bar."""
        self._number += 1
        label = f"[{self._number}/{self._count}] {trial.id}"
        self._tasks[trial.id] = self._bars.add_task(label, total=trial.ticks * trial.period, since=None)

    def progressed(self, trial: Trial, tick: int) -> None:
        """Move a trial's bar."""
        task = self._tasks[trial.id]
        if self._bars.tasks and self._field(task, "since") is None:
            self._bars.update(task, since=self._bars.get_time())
        self._bars.update(task, completed=tick * trial.period)

    def _field(self, task: Any, name: str) -> Any:
        return next((item.fields[name] for item in self._bars.tasks if item.id == task), None)

    def ended(self, trial: Trial, outcome: Outcome) -> None:
        """Replace a trial's bar by one line; without a terminal, only if it is bad news."""
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


def outcome_line(outcome: Outcome) -> Text:
    """Return one line on how a trial ended."""
    line = Text(f"{outcome.outcome:10}", style=STYLES[outcome.outcome])
    line.append(f" {outcome.trial}", style="default")
    if outcome.completed:
        line.append(f"  {outcome.ticks} ticks in {outcome.wall_s:.1f} s, {outcome.speed:.2f} x real time", style="dim")
    else:
        line.append(f"  {outcome.reason}", style="default")
    return line


def print_expectations(expected: Sequence[Expected]) -> None:
    """Print on stdout which expectations are met: the value seen and the limit, a line each, never folded."""
    rows = [("met" if item.met else "not met", item.subject, item.seen, item.limit, item.basis) for item in expected]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    console = Console(highlight=False, soft_wrap=True)
    console.print(Text(f"expected {sum(item.met for item in expected)} of {len(expected)} met"))
    for item, (word, *cells) in zip(expected, rows, strict=True):
        line = Text(f"  {word:{widths[0]}}", style="green" if item.met else "red")
        subject, seen, limit, basis = cells
        line.append(f"  {subject:{widths[1]}}  {seen:>{widths[2]}}  {limit:{widths[3]}}", style="default")
        line.append(f"  ({basis})", style="dim")
        console.print(line)


def print_table(title: str, columns: dict[str, str], rows: list[list[str]]) -> None:
    """Print a table on stdout; `columns` gives each heading its justification ("left" or "right")."""
    table = Table(title=title or None, title_justify="left", box=None, pad_edge=False, header_style="bold")
    for heading, justify in columns.items():
        table.add_column(heading, justify="right" if justify == "right" else "left", overflow="fold")
    for row in rows:
        table.add_row(*row)
    # A pipe has no width: nothing must be folded or cut there.
    width = None if sys.stdout.isatty() else 200
    Console(highlight=False, width=width).print(table)
