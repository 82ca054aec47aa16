"""plan: the trials of an experiment."""

from __future__ import annotations

from hilrig.cli.application import AsJson, ExperimentFile, Overrides, app, print_json
from hilrig.cli.experiments import planned
from hilrig.core.compiler import interpret


@app.command()
def plan(experiment: ExperimentFile, override: Overrides = None, as_json: AsJson = False) -> None:
    """List the trials of an experiment, in running order."""
    interpret()
    loaded, trials = planned(experiment, override or [])
    if as_json:
        print_json({"experiment": loaded.to_document(), "trials": [trial.to_document() for trial in trials]})
        return
    from hilrig.cli.terminal import print_table

    rows = [
        [
            trial.id,
            trial.controller_name,
            trial.condition_name,
            str(trial.repeat),
            f"{trial.ticks * trial.period:g}",
            str(trial.seed),
        ]
        for trial in trials
    ]
    columns = {
        "trial": "",
        "controller": "",
        "condition": "",
        "repeat": "right",
        "duration [s]": "right",
        "seed": "",
    }
    print_table("", columns, rows)
