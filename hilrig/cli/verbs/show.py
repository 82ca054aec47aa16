"""show: how the trials of a run ended."""

from __future__ import annotations

import typer

from hilrig.cli.application import AsJson, RunArgument, app, print_json, run_meant


@app.command()
def show(run: RunArgument, as_json: AsJson = False) -> None:
    """Show how the trials of a run ended.

    For each trial: outcome and reason, number of ticks, speed, and messages lost.
    """
    from hilrig.recording.run_directory import ending, messages_lost, read_manifest, read_outcome, read_plan, reason_of

    path = run_meant(run)
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
            reason_of(item),
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
