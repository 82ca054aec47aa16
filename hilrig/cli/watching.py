"""The verb that shows a run while it goes on: watch."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Annotated

import typer

from hilrig.cli.application import RUNS, app, find_run


@app.command()
def watch(
    run: Annotated[
        Path | None,
        typer.Argument(
            metavar="RUN",
            help="A run directory, or its name below runs/; default: the newest that is going on.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Where run directories are.")] = RUNS,
    keep_on: Annotated[bool, typer.Option("--keep-on", hidden=True)] = False,
) -> None:
    """Show a run while it goes on: position, force, errors, late ticks, trial by trial.

    A process of its own at the lowest priority: it asks the trial's logger and cannot hold up the loop. Start it and
    leave it (Ctrl-C) at any time. On a terminal it is a screen, elsewhere a line every two seconds.
    """
    if keep_on:
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    from rich.console import Console

    from hilrig.cli.watch.finding import newest_live_run
    from hilrig.cli.watch.showing import watch_run

    watch_run(newest_live_run(out) if run is None else find_run(run), Console())
