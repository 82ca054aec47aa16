"""The screen of a watched run: lines of text for the terminal's width and height."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rich.console import Console, ConsoleOptions, RenderResult
from rich.text import Text

from hilrig.cli.terminal import STYLES
from hilrig.cli.watch import formatting
from hilrig.cli.watch.history import KEPT
from hilrig.cli.watch.scene import Scene
from hilrig.cli.watch.strip import nice_limit, strip
from hilrig.rig.view import View

HEAD = 6
"""Lines above the axes"""
LABEL = 13
"""Characters at the left of a chart"""
LEAST_WIDTH = 40


@dataclass(frozen=True)
class Screen:
    """The current state of a run, ready to be printed; it adapts to the available space."""

    scene: Scene
    now: float

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        width, height = options.max_width, options.height or console.height
        lines = [*head(self.scene, self.now, width), *axes(self.scene, width, height - HEAD)]
        for line in lines[:height]:
            line.no_wrap, line.overflow = True, "ellipsis"
            line.truncate(width, overflow="ellipsis")
        yield Text("\n").join(lines[:height])


def head(scene: Scene, now: float, width: int) -> list[Text]:
    """Return the HEAD lines on the run and the trial."""
    run, trial, history = scene.run, scene.trial, scene.history
    lines = [Text(run.question, style="bold")]
    if trial is None:
        return [*lines, Text(f"{run.path}   between two trials"), *(Text() for _ in range(HEAD - 2))]
    title = Text(f"trial {trial.number} of {len(run.trials)}  ")
    title.append(trial.name, style="bold cyan")
    if scene.others:
        title.append(f"   ({scene.others} more beside it)", style="dim")
    for outcome, count in scene.ended.items():
        title.append(f"   {count} {outcome.replace('_', ' ')}", style=STYLES.get(outcome, "default"))
    view = history.last
    if view is None:
        rest = [bar(0.0, width), Text(formatting.state(history, now), style="yellow"), Text()]
        return [*lines, title, *rest, rule(width, "")]
    total = trial.ticks * trial.period
    count = Text(
        f"{view.time:.2f} of {total:g} s   tick {view.tick} of {trial.ticks}   {formatting.pace(trial, history)}"
    )
    told, colour = formatting.late(trial, view)
    timing = Text(told, style=colour)
    timing.append("   ".join(["", *filter(None, [formatting.lateness(trial, history)])]), style="default")
    phase = f"phase {trial.phase_at(view.time)}, the last {history.span:.1f} s"
    return [
        *lines,
        title,
        bar(view.time / total, width),
        count,
        timing,
        rule(width, phase, formatting.state(history, now)),
    ]


def bar(share: float, width: int) -> Text:
    """Return a progress bar over the full width, with `share` (0 to 1) of it done."""
    done = round(min(max(share, 0.0), 1.0) * width)
    line = Text("━" * done, style="cyan")
    line.append("─" * (width - done), style="bright_black")
    return line


def rule(width: int, right: str, left: str = "") -> Text:
    """Return a line with news on the left and words on the right."""
    line = Text(left, style="yellow")
    line.append(f"{right:>{width - len(left)}}" if width > len(left) else "", style="dim")
    return line


def axes(scene: Scene, width: int, height: int) -> list[Text]:
    """Return the lines on the axes, at most `height`: numbers first, charts in the remaining space."""
    trial, view = scene.trial, scene.history.last
    if trial is None or view is None:
        return []
    room = height // len(trial.axes) - 3
    lines: list[Text] = []
    for i in range(len(trial.axes)):
        lines += numbers(scene, i, view)
        if room >= 2 and width >= LEAST_WIDTH:
            lines += charts(scene, i, width, room)
        lines.append(Text())
    return lines


def numbers(scene: Scene, i: int, view: View) -> list[Text]:
    """Return two lines: the controlled quantity of axis `i` with its error, and the rest."""
    trial = scene.trial
    assert trial is not None
    presses = trial.axes[i] in trial.force_axes
    shown = formatting.force if presses else formatting.length
    desired, actual = (view.reference_force, view.force) if presses else (view.reference_position, view.position)
    first = Text(f"{trial.axes[i]:3}", style="bold")
    first.append(f"{'force' if presses else 'position':9}", style="bold")
    first.append(f" desired {shown(desired[i])}   actual ", style="default")
    first.append(shown(actual[i]), style="bold")
    first.append(f"   error {formatting.error(view.error[i], presses)}")
    other = f"position {formatting.length(view.position[i])}" if presses else f"force {formatting.force(view.force[i])}"
    second = Text(f"{'':12} {other}   auxiliary error {view.auxiliary_error[i]:8.3f} N", style="default")
    return [first, second]


def charts(scene: Scene, i: int, width: int, room: int) -> list[Text]:
    """Return the strip charts of error and auxiliary error of axis `i`, `room` lines in all."""
    trial, history = scene.trial, scene.history
    assert trial is not None
    of_force = trial.axes[i] in trial.force_axes
    error, auxiliary = history.error(i) * (1.0 if of_force else 1e3), history.auxiliary_error(i)
    limit, most = nice_limit(float(np.max(np.abs(error)))), nice_limit(float(np.max(auxiliary)))
    upper = max(room * 3 // 5, 1)
    wide = width - LABEL
    unit = "N" if of_force else "mm"
    return [
        *labelled("error", f"±{limit:g} {unit}", strip(error, -limit, limit, wide, upper, KEPT), "cyan"),
        *labelled("aux. error", f"{most:g} N", strip(auxiliary, 0.0, most, wide, room - upper, KEPT), "magenta"),
    ]


def labelled(name: str, scale: str, rows: list[str], colour: str) -> list[Text]:
    """Return a chart's lines with its name and its scale at the left."""
    labels = [name, scale] if len(rows) > 1 else [f"{name[:3]} {scale}"]
    lines = []
    for k, row in enumerate(rows):
        line = Text(f"{labels[k] if k < len(labels) else '':<{LABEL}}"[:LABEL], style="dim")
        line.append(row, style=colour)
        lines.append(line)
    return lines
