"""The verbs that take a run: report, compare, list, show."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from hilrig.cli.application import RUNS, AsJson, RunArgument, app, find_run, print_json
from hilrig.cli.results import Junit, make_room, tell_results
from hilrig.core.errors import RunDirectoryError


@app.command("report")
def report_command(
    run: RunArgument,
    out: Annotated[
        Path | None, typer.Option(help="Directory for the report; default reports/<run>.", show_default=False)
    ] = None,
    junit: Junit = None,
) -> None:
    """Make a run's report again, from its directory alone, and list what was expected.

    Exit code: 0 the report is made, whatever it says; 2 there is no such run, or nothing to report.
    """
    path = find_run(run)
    make_room(junit)
    tell_results(path, out, report=True, junit=junit)


@app.command()
def compare(first: RunArgument, second: RunArgument, as_json: AsJson = False) -> None:
    """Compare two runs, metric by metric.

    Shows every metric that both have, and how it changed from the first to the second.
    """
    from hilrig.report import compare as compare_runs
    from hilrig.report import render

    table = compare_runs(find_run(first), find_run(second))
    if as_json:
        print_json({"notes": table.attrs.get("notes", []), "rows": table.to_dict("records")})
    else:
        typer.echo(render(table))


@app.command("list")
def list_command(
    out: Annotated[Path, typer.Option(help="Where run directories are.")] = RUNS, as_json: AsJson = False
) -> None:
    """List the runs, oldest first."""
    from hilrig.recording.run_directory import list_runs

    rows = [_row(path) for path in list_runs(out)]
    if as_json:
        print_json(rows)
    elif not rows:
        typer.echo(f"no runs below {out}/; make one with: hilrig run EXPERIMENT")
    else:
        from hilrig.cli.terminal import print_table

        print_table("", dict.fromkeys(rows[0], ""), [list(row.values()) for row in rows])


def _row(run: Path) -> dict[str, Any]:
    """Return what `list` tells of one run; a damaged one must not hide the others."""
    from hilrig.recording.run_directory import ending, read_manifest, read_outcome, read_plan

    try:
        manifest = read_manifest(run)
        outcomes = [ending(read_outcome(run, trial["id"])) for trial in read_plan(run)["trials"]]
    except RunDirectoryError as error:
        return {"run": run.name, "experiment": str(error), "completed": "?", "clock": "?"}
    done = f"{outcomes.count('completed')}/{len(outcomes)}"
    return {"run": run.name, "experiment": manifest["name"], "completed": done, "clock": manifest["clock"]}


@app.command()
def show(run: RunArgument, as_json: AsJson = False) -> None:
    """Show how the trials of a run ended.

    Outcome and reason, speed, messages lost, and where the run came from.
    """
    from hilrig.recording.run_directory import ending, messages_lost, read_manifest, read_outcome, read_plan, reason

    path = find_run(run)
    manifest, planned = read_manifest(path), read_plan(path)
    outcomes = [read_outcome(path, trial["id"]) for trial in planned["trials"]]
    if as_json:
        print_json({"manifest": manifest, "outcomes": outcomes})
        return
    from hilrig.cli.terminal import print_table

    typer.echo(f"{path}\n  {manifest['question']}\n  {manifest['command']}\n  commit {manifest['commit'] or 'unknown'}")
    rows = [
        [
            item["trial"],
            ending(item),
            str(item["ticks"]),
            f"{item.get('speed', 0):.2f}",
            "?" if (lost := messages_lost(item)) is None else str(lost),
            reason(item),
        ]
        for item in outcomes
    ]
    columns = {
        "trial": "",
        "outcome": "",
        "ticks": "right",
        "x real time": "right",
        "lost": "right",
        "reason": "",
    }
    print_table("", columns, rows)
