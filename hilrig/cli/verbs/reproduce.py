"""reproduce: a complete study, from its experiments to its judged claims."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hilrig.cli.application import RUNS, Overrides, app, run_meant
from hilrig.cli.experiments import interruptible
from hilrig.cli.results import tell_run
from hilrig.core.errors import ExperimentError

if TYPE_CHECKING:
    from hilrig.experiment.trial import Trial
    from hilrig.study import Loaded


@app.command()
def reproduce(
    study: Annotated[Path, typer.Argument(metavar="STUDY", help="The study's YAML file.", show_default=False)],
    out: Annotated[
        Path | None, typer.Option(help="Folder for the result. Default: the study's own.", show_default=False)
    ] = None,
    runs: Annotated[Path, typer.Option(help="Folder for the run directories.")] = RUNS,
    jobs: Annotated[int, typer.Option(help="Number of trials to run at the same time.")] = 1,
    reuse: Annotated[
        list[Path] | None,
        typer.Option("--from", metavar="RUN", help="Use this run instead of making a new one. May be repeated."),
    ] = None,
    override: Overrides = None,
) -> None:
    """Run a complete study and judge its claims.

    Runs the study's experiments, draws its figures, and judges its claims and the expectations of its experiments. The
    result contains no dates and no paths: the same study gives the same files. --set changes every experiment, so the
    result needs its own folder (--out).

    Exit code: 0 all trials completed or ended as expected, and all expectations were met, whatever became of the
    claims; 1 a trial did not, or an expectation was not met; 2 the study or the command line is wrong; 130 interrupted.
    """
    from hilrig.study import load_study, make_reproduction
    from hilrig.study.pages import shown_path
    from hilrig.study.reuse import match

    overrides = override or []
    if jobs < 1:
        raise ExperimentError(f"--jobs {jobs}: the number of trials at a time must be at least 1")
    if overrides and out is None:
        raise ExperimentError("--set changes the study, so the result needs its own folder; give --out")
    loaded = load_study(study, overrides)
    there = match(loaded, [run_meant(run) for run in reuse or []], overrides)
    made = _run_all(loaded, there, runs, jobs, overrides)
    folder = out or Path(loaded.study.out)
    changes = [word for text in overrides for word in ("--set", text)]
    command = shlex.join(["hilrig", "reproduce", shown_path(study), *changes])
    found = make_reproduction(loaded, made, folder, command, overrides, jobs)
    for result in ("reproduced", "not reproduced", "cannot tell"):
        typer.echo(f"{result:15} {sum(item.result == result for item in found.judged)} of {len(found.judged)} claims")
    unmet = [(name, item) for name, items in found.expected.items() for item in items if not item.met]
    typer.echo(f"{'met':15} {found.expectations - len(unmet)} of {found.expectations} expectations")
    for name, item in unmet:
        typer.echo(f"{'not met':15} {name}: {item.subject}: {item.limit}, seen {item.seen} ({item.basis})")
    typer.echo(f"result   {folder / 'index.html'}")
    if unmet or not found.ended_well:
        raise typer.Exit(1)


def _run_all(loaded: Loaded, there: dict[str, Path], out: Path, jobs: int, overrides: list[str]) -> dict[str, Path]:
    """Run every experiment that has no run yet; return one run per experiment, by name."""
    from hilrig.cli.progress import Display
    from hilrig.experiment.plan import plan
    from hilrig.experiment.plan.assessing import assess
    from hilrig.rig.execution import Options, execute

    # All plans first: mistakes must show before anything is started.
    planned: dict[str, tuple[Trial, ...]] = {
        name: plan(experiment) for name, experiment in loaded.experiments.items() if name not in there
    }
    made = dict(there)
    assessed = {name: assess(loaded.experiments[name], trials) for name, trials in planned.items()}
    stop = interruptible()
    for name, trials in planned.items():
        experiment = loaded.experiments[name]
        options = Options(out, ["hilrig", *sys.argv[1:]], overrides, in_process=True, jobs=jobs, stop=stop)
        with Display(len(trials)) as display, stop.trials():
            made[name], outcomes = execute(experiment, trials, assessed[name], loaded.sources[name], options, display)
        if stop.is_set():
            raise typer.Exit(130)
        tell_run(made[name], experiment, trials, outcomes)
    return made
