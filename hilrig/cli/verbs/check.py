"""check: whether an experiment file is valid."""

from __future__ import annotations

import typer

from hilrig.cli.application import AsJson, ExperimentFile, Overrides, app, print_json
from hilrig.cli.experiments import echo_warnings, judged, planned
from hilrig.core.compiler import interpret


@app.command()
def check(experiment: ExperimentFile, override: Overrides = None, as_json: AsJson = False) -> None:
    """Check an experiment file without running it.

    Lists every mistake with line, column, what is allowed and the nearest valid name. Warns of bounds that the
    experiment does not keep. Exit code: 0 the experiment can be run, with or without warnings; 2 it cannot.
    """
    interpret()
    loaded, trials = planned(experiment, override or [])
    found, warnings = judged(loaded, trials)
    if as_json:
        listed = [{**(item.place._asdict() if item.place else {}), "message": item.message} for item in warnings]
        print_json({"name": loaded.name, "trials": len(trials), "warnings": listed, "bounds": found.document()})
        return
    echo_warnings(warnings)
    duration, names = sum(trial.ticks * trial.period for trial in trials), ", ".join(loaded.controllers)
    count = f"{len(trials)} trial{'s' * (len(trials) != 1)}"
    typer.echo(f"{experiment}: ready to run")
    typer.echo(f"  {count} ({names}), {duration:g} s in all, period {loaded.period * 1e3:g} ms, {loaded.clock}")
