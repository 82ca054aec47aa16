"""watch: a run in progress."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Annotated

import typer

from hilrig.cli.application import RUNS, app, run_meant


@app.command()
def watch(
    run: Annotated[
        Path | None,
        typer.Argument(
            metavar="RUN",
            help="A run directory, or its name below runs/. Default: the newest run in progress.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the run directories.")] = RUNS,
    keep_on: Annotated[bool, typer.Option("--keep-on", hidden=True)] = False,
) -> None:
    """Watch a run in progress.

    Shows position, force, errors and late ticks, trial by trial. It runs at the lowest priority and talks only to the
    logger, so it cannot delay the loop: start it and stop it (Ctrl-C) at any time. Without a terminal it prints a line
    every two seconds.
    """
    if keep_on:
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    from rich.console import Console

    from hilrig.cli.watch.finding import newest_live_run
    from hilrig.cli.watch.showing import watch_run

    watch_run(newest_live_run(out) if run is None else run_meant(run), Console())
