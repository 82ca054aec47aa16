"""The terminal output of a run: progress on stderr, results on stdout."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:  # without them a table is printed sooner
    from hilrig.report.expectations import Expected
    from hilrig.rig.outcome import Outcome

AS_IT_IS: dict[str, Any] = {"highlight": False, "markup": False, "emoji": False}
"""The output contains names and reasons from the user: brackets in them are not markup, colons not emoji"""
errors = Console(stderr=True, soft_wrap=True, **AS_IT_IS)
STYLES = {"completed": "green", "tripped": "red", "failed": "red", "timed_out": "red", "aborted": "yellow"}


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
    """Print on stdout which expectations are met: the value seen and the limit, one line each, never folded."""
    rows = [("met" if item.met else "not met", item.subject, item.seen, item.limit, item.basis) for item in expected]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    console = Console(soft_wrap=True, **AS_IT_IS)
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
    Console(width=width, **AS_IT_IS).print(table)
