"""compare: two runs, metric by metric."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hilrig.cli.application import RUN_HELP, AsJson, app, print_json, run_meant

FirstRun = Annotated[Path, typer.Argument(metavar="FIRST", help=RUN_HELP, show_default=False)]
SecondRun = Annotated[Path, typer.Argument(metavar="SECOND", help="Likewise.", show_default=False)]


@app.command()
def compare(first: FirstRun, second: SecondRun, as_json: AsJson = False) -> None:
    """Compare two runs, metric by metric.

    Shows every metric that both runs have, and how it changed from the first to the second.
    """
    from hilrig.report import compare_runs as compare_runs
    from hilrig.report import render

    table = compare_runs(run_meant(first), run_meant(second))
    if as_json:
        print_json({"notes": table.attrs.get("notes", []), "rows": table.to_dict("records")})
    else:
        typer.echo(render(table))
