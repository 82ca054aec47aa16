"""run: run an experiment and make its report."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from hilrig.cli.application import RUNS, ExperimentFile, Overrides, app
from hilrig.cli.experiments import echo_warnings, interruptible, judged, planned
from hilrig.cli.results import Junit, make_room, tell_results, tell_run
from hilrig.core.errors import ExperimentError

if TYPE_CHECKING:
    from hilrig.cli.progress import Display
    from hilrig.cli.watch.process import WatchedRun


@app.command()
def run(
    experiment: ExperimentFile,
    out: Annotated[Path, typer.Option(help="Folder for the run directory.")] = RUNS,
    clock: Annotated[
        Literal["lockstep", "realtime"] | None, typer.Option(help="Clock to use instead of the experiment's.")
    ] = None,
    in_process: Annotated[
        bool,
        typer.Option("--in-process", help="Run without the bus: each trial in one process beside this one."),
    ] = False,
    jobs: Annotated[int, typer.Option(help="Number of trials to run at the same time.")] = 1,
    repeats: Annotated[int | None, typer.Option(help="Number of repeats, instead of the experiment's.")] = None,
    override: Overrides = None,
    fail_fast: Annotated[
        bool,
        typer.Option(
            "--fail-fast",
            help="Start no more trials after one that did not complete, unless the experiment expects it.",
        ),
    ] = False,
    watch: Annotated[bool, typer.Option("--watch", help="Show the trials as 'hilrig watch' does.")] = False,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Make the report at the end.")] = True,
    junit: Junit = None,
) -> None:
    """Run an experiment and make its report.

    Also lists which expectations of the experiment were met. A real-time trial that did not keep its timing budget is
    invalid and is not compared. Ctrl-C ends the running trials cleanly.

    Exit code: 0 all trials completed or ended as expected, and all expectations were met; 1 a trial did not or was
    invalid, or an expectation was not met; 2 the experiment or the command line is wrong; 130 interrupted.
    """
    overrides = [*(override or [])]
    overrides += [f"clock={clock}"] if clock else []
    overrides += [f"repeats={repeats}"] if repeats is not None else []
    if jobs < 1:
        raise ExperimentError(f"--jobs {jobs}: the number of trials at a time must be at least 1")
    loaded, trials = planned(experiment, overrides)
    if jobs > 1 and loaded.clock == "realtime":
        raise ExperimentError(
            f"--jobs {jobs}: trials in real time must run one at a time, or they disturb each other's timing"
        )

    if watch and in_process:
        raise ExperimentError("--watch needs the bus, and --in-process runs without it; leave out one of the two")

    make_room(junit)
    assessment, warnings = judged(loaded, trials)
    echo_warnings(warnings)

    from hilrig.rig.execution import Options, execute

    stop = interruptible()
    options = Options(out, ["hilrig", *sys.argv[1:]], overrides, in_process, jobs, fail_fast, stop)
    with listener(len(trials), watch) as display, stop.trials():
        directory, outcomes = execute(loaded, trials, assessment, experiment, options, display)
    ended_well = tell_run(directory, loaded, trials, outcomes)
    drawn = report and any(outcome.completed for outcome in outcomes)
    met = tell_results(directory, None, drawn, junit) if drawn or junit or loaded.expect else True
    if stop.is_set():
        raise typer.Exit(130)
    if not ended_well or not met:
        raise typer.Exit(1)


def listener(trials: int, watch: bool) -> Display | WatchedRun:
    """Return the progress display of the trials: bars, or a watch process."""
    if watch:
        from hilrig.cli.watch.process import WatchedRun

        return WatchedRun()
    from hilrig.cli.progress import Display

    return Display(trials)
