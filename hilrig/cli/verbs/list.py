"""list: the runs there are."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from hilrig.cli.application import RUNS, AsJson, app, print_json
from hilrig.core.errors import RunDirectoryError


@app.command("list")
def list_command(
    out: Annotated[Path, typer.Option(help="Folder of the run directories.")] = RUNS, as_json: AsJson = False
) -> None:
    """List the runs, oldest first."""
    from hilrig.recording.run_directory import list_runs

    rows = [_row(path) for path in list_runs(out)]
    if as_json:
        print_json(rows)
    elif not rows:
        typer.echo(f"there are no runs in {out}/; make one with: hilrig run EXPERIMENT")
    else:
        from hilrig.cli.terminal import print_table

        print_table("", dict.fromkeys(rows[0], ""), [list(row.values()) for row in rows])


def _row(run: Path) -> dict[str, Any]:
    """Return the row of `list` for one run. A damaged run does not hide the others."""
    from hilrig.recording.run_directory import ending, read_manifest, read_outcome, read_plan

    try:
        manifest = read_manifest(run)
        outcomes = [ending(read_outcome(run, trial["id"])) for trial in read_plan(run)["trials"]]
    except RunDirectoryError as error:
        return {"run": run.name, "experiment": str(error), "completed": "?", "clock": "?"}
    done = f"{outcomes.count('completed')}/{len(outcomes)}"
    return {"run": run.name, "experiment": manifest["name"], "completed": done, "clock": manifest["clock"]}
