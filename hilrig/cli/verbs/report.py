"""report: the report of a run, from its directory only."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hilrig.cli.application import RunArgument, app, run_meant
from hilrig.cli.results import Junit, make_room, tell_results


@app.command("report")
def report_command(
    run: RunArgument,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the report. Default: reports/<run>.", show_default=False)
    ] = None,
    junit: Junit = None,
) -> None:
    """Rebuild the report of a run from its directory.

    Also lists which expectations of the experiment were met. Exit code: 0 the report was written, whatever it says; 2
    there is no such run, or nothing to report.
    """
    path = run_meant(run)
    make_room(junit)
    tell_results(path, out, report=True, junit=junit)
