"""The verbs that take an experiment: check, plan, run."""

from __future__ import annotations

import signal
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from hilrig.cli.application import RUNS, AsJson, ExperimentFile, Overrides, app, print_json
from hilrig.cli.results import Junit, make_room, tell_results, tell_run
from hilrig.core.errors import ExperimentError

if TYPE_CHECKING:
    from hilrig.cli.terminal import Display
    from hilrig.cli.watch.process import WatchedRun
    from hilrig.core.errors import Problem
    from hilrig.experiment import Experiment
    from hilrig.experiment.plan.margins import Margins
    from hilrig.experiment.trial import Trial


@app.command()
def check(experiment: ExperimentFile, override: Overrides = None, as_json: AsJson = False) -> None:
    """Check an experiment file; starts nothing.

    Says everything that is wrong, each with line, column, what is allowed and the nearest right name. Warns of bounds
    of the paper that the experiment does not keep; a warning does not change the exit code.
    """
    loaded, trials = planned(experiment, override or [])
    found, warnings = judged(loaded, trials)
    if as_json:
        listed = [{**(item.place._asdict() if item.place else {}), "message": item.message} for item in warnings]
        print_json({"name": loaded.name, "trials": len(trials), "warnings": listed, "bounds": found.document()})
        return
    echo_warnings(warnings)
    duration = sum(trial.ticks * trial.period for trial in trials)
    names = ", ".join(loaded.controllers)
    typer.echo(f"{experiment}: ready to run")
    typer.echo(
        f"  {len(trials)} trials ({names}), {duration:g} s in all, period {loaded.period * 1e3:g} ms, {loaded.clock}"
    )


@app.command()
def plan(experiment: ExperimentFile, override: Overrides = None, as_json: AsJson = False) -> None:
    """List the trials that an experiment makes, in their order."""
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


@app.command()
def run(
    experiment: ExperimentFile,
    out: Annotated[Path, typer.Option(help="Where run directories are made.")] = RUNS,
    clock: Annotated[
        Literal["lockstep", "realtime"] | None, typer.Option(help="The clock, instead of what the experiment says.")
    ] = None,
    in_process: Annotated[
        bool,
        typer.Option(
            "--in-process", help="Without the bus: all in this process, with --jobs a process for each trial."
        ),
    ] = False,
    jobs: Annotated[int, typer.Option(help="Trials at a time.")] = 1,
    repeats: Annotated[int | None, typer.Option(help="Repeats, instead of what the experiment says.")] = None,
    override: Overrides = None,
    fail_fast: Annotated[
        bool,
        typer.Option(
            "--fail-fast", help="Start no further trial after one that did not complete, unless that was expected."
        ),
    ] = False,
    watch: Annotated[bool, typer.Option("--watch", help="Show the trials as `hilrig watch` does.")] = False,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Make the report at the end.")] = True,
    junit: Junit = None,
) -> None:
    """Run an experiment, make its report, and list which of its expectations are met.

    Ctrl-C ends the trials in flight cleanly.

    A trial in real time that was outside its timing budget is invalid, and is not compared.

    Exit code: 0 all trials completed or ended as expected, and all expectations are met; 1 a trial did not, or is
    invalid, or an expectation is not met; 2 the experiment or the call is wrong; 130 interrupted.
    """
    overrides = [*(override or [])]
    overrides += [f"clock={clock}"] if clock else []
    overrides += [f"repeats={repeats}"] if repeats is not None else []
    if jobs < 1:
        raise ExperimentError(f"--jobs: {jobs} trials at a time; 1 is the least")
    loaded, trials = planned(experiment, overrides)
    if jobs > 1 and loaded.clock == "realtime":
        raise ExperimentError("--jobs: trials in real time run one at a time, or they would disturb each other's clock")

    if watch and in_process:
        raise ExperimentError("--watch: with --in-process there is no bus to watch; leave out one of the two")

    make_room(junit)
    echo_warnings(judged(loaded, trials)[1])

    from hilrig.rig.execution import Options, execute

    options = Options(out, ["hilrig", *sys.argv[1:]], overrides, in_process, jobs, fail_fast, interruptible())
    with listener(len(trials), watch) as display:
        directory, outcomes = execute(loaded, trials, experiment, options, display)
    ended_well = tell_run(directory, loaded, trials, outcomes)
    drawn = report and any(outcome.completed for outcome in outcomes)
    met = tell_results(directory, None, drawn, junit) if drawn or junit or loaded.expect else True
    if options.stop.is_set():
        raise typer.Exit(130)
    if not ended_well or not met:
        raise typer.Exit(1)


def listener(trials: int, watch: bool) -> Display | WatchedRun:
    """Return who shows how the trials go on: bars, or a watcher."""
    if watch:
        from hilrig.cli.watch.process import WatchedRun

        return WatchedRun()
    from hilrig.cli.terminal import Display

    return Display(trials)


def interruptible() -> threading.Event:
    """Return an event that Ctrl-C or SIGTERM sets; a second Ctrl-C ends the program at once."""
    stop = threading.Event()

    def interrupt(_number: int, _frame: Any) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, interrupt)
    return stop


def planned(path: Path, overrides: list[str]) -> tuple[Experiment, tuple[Trial, ...]]:
    """Return the experiment in the file, with overrides, and its trials. Raises ExperimentError."""
    from hilrig.experiment import load
    from hilrig.experiment.plan import plan as plan_trials

    loaded = load(path, overrides)
    return loaded, plan_trials(loaded)


def judged(experiment: Experiment, trials: tuple[Trial, ...]) -> tuple[Margins, list[Problem]]:
    """Return how far the trials keep the paper's bounds, and what to warn of."""
    from hilrig.experiment.plan.margins import margins
    from hilrig.experiment.plan.warnings import warnings

    found = margins(trials)
    return found, warnings(experiment, found)


def echo_warnings(warnings: list[Problem]) -> None:
    """Print warnings on stderr, one a line."""
    for warning in warnings:
        typer.echo(str(warning._replace(message=f"warning: {warning.message}")), err=True)
