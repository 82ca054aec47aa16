"""The command line: the verbs, thin. What takes long to import is imported by the verb that needs it."""

from __future__ import annotations

import json
import signal
import sys
import threading
import traceback
from pathlib import Path
from typing import Annotated, Any

import typer

from hilrig import __version__
from hilrig.errors import ExperimentError, HilrigError, RigError, nearest

RUNS = Path("runs")
REPORTS = Path("reports")
GROUPS = ("controllers", "drivers", "robots", "references", "disturbances", "metrics")

app = typer.Typer(
    name="hilrig",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Hardware-in-the-loop experiments for robot force-position control.\n\n"
    "An experiment is one YAML file; a run of it is one directory; a report is one page.\n\n"
    "Start here:  hilrig run experiments/quickstart.yaml",
)

ExperimentFile = Annotated[
    Path, typer.Argument(metavar="EXPERIMENT", help="The experiment's YAML file.", show_default=False)
]
RunArgument = Annotated[
    Path, typer.Argument(metavar="RUN", help="A run directory, or its name below runs/.", show_default=False)
]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a value, e.g. --set controllers.pd.damping='80 N*s/m'. May be repeated.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, for programs.")]


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"hilrig {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> None:
    """Options that every verb has."""


@app.command()
def check(experiment: ExperimentFile, override: Overrides = None) -> None:
    """Say whether an experiment can be run as written, and everything that is wrong if not. Starts nothing."""
    loaded, trials = _planned(experiment, override or [])
    duration = sum(trial.ticks * trial.period for trial in trials)
    names = ", ".join(loaded.controllers)
    typer.echo(f"{experiment}: ready to run")
    typer.echo(
        f"  {len(trials)} trials ({names}), {duration:g} s in all, period {loaded.period * 1e3:g} ms, {loaded.clock}"
    )


@app.command()
def plan(experiment: ExperimentFile, override: Overrides = None, as_json: AsJson = False) -> None:
    """List the trials of an experiment in the order in which they are run."""
    loaded, trials = _planned(experiment, override or [])
    if as_json:
        _print_json({"experiment": loaded.to_document(), "trials": [trial.to_document() for trial in trials]})
        return
    from hilrig.terminal import print_table

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
        str | None, typer.Option(help="lockstep or realtime, instead of what the experiment says.")
    ] = None,
    in_process: Annotated[
        bool, typer.Option("--in-process", help="Without the bus: all in this process, the same bits.")
    ] = False,
    jobs: Annotated[int, typer.Option(min=1, help="Trials at a time.")] = 1,
    repeats: Annotated[int | None, typer.Option(min=1, help="Repeats, instead of what the experiment says.")] = None,
    override: Overrides = None,
    fail_fast: Annotated[
        bool, typer.Option("--fail-fast", help="Begin no further trial after one that did not complete.")
    ] = False,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Make the report at the end.")] = True,
) -> None:
    """Run all trials of an experiment and make the report.

    Ctrl-C ends the trial in flight cleanly.

    Exit code: 0 all trials completed, 1 one did not, 2 the experiment or the call is wrong, 130 interrupted.
    """
    overrides = [*(override or [])]
    overrides += [f"clock={clock}"] if clock else []
    overrides += [f"repeats={repeats}"] if repeats else []
    loaded, trials = _planned(experiment, overrides)
    if in_process and jobs > 1:
        raise ExperimentError("--jobs: trials in one process run one at a time; leave out --in-process or --jobs")
    if jobs > 1 and loaded.clock == "realtime":
        raise ExperimentError("--jobs: trials in real time run one at a time, or they would disturb each other's clock")

    from hilrig.rig.execution import Options, execute
    from hilrig.terminal import Display

    options = Options(out, ["hilrig", *sys.argv[1:]], overrides, in_process, jobs, fail_fast, _interruptible())
    with Display(len(trials)) as display:
        directory, outcomes = execute(loaded, trials, experiment, options, display)
    completed = sum(outcome.completed for outcome in outcomes)
    typer.echo(f"run      {directory}  ({completed} of {len(trials)} trials completed)")
    if report and completed:
        from hilrig.report import make_report

        typer.echo(f"report   {make_report(directory)}")
    if options.stop.is_set():
        raise typer.Exit(130)
    if completed < len(trials):
        raise typer.Exit(1)


def _interruptible() -> threading.Event:
    """Return an event that Ctrl-C or SIGTERM sets; a second Ctrl-C ends the program at once."""
    stop = threading.Event()

    def interrupt(_number: int, _frame: Any) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, interrupt)
    return stop


@app.command("report")
def report_command(
    run: RunArgument,
    out: Annotated[
        Path | None, typer.Option(help="Directory for the report; default reports/<run>.", show_default=False)
    ] = None,
) -> None:
    """Make the report of a run again, from its directory alone."""
    from hilrig.report import make_report

    typer.echo(f"report   {make_report(_find(run), out)}")


@app.command()
def compare(first: RunArgument, second: RunArgument, as_json: AsJson = False) -> None:
    """Compare two runs: every metric that both have, and how it changed from the first to the second."""
    from hilrig.report import compare as compare_runs
    from hilrig.report import render

    table = compare_runs(_find(first), _find(second))
    if as_json:
        _print_json({"notes": table.attrs.get("notes", []), "rows": table.to_dict("records")})
    else:
        typer.echo(render(table))


@app.command("list")
def list_command(
    out: Annotated[Path, typer.Option(help="Where run directories are.")] = RUNS, as_json: AsJson = False
) -> None:
    """List the runs, oldest first."""
    from hilrig.recording.run_directory import list_runs, read_json, read_outcome

    rows: list[dict[str, Any]] = []
    for path in list_runs(out):
        manifest, planned = read_json(path / "manifest.json"), read_json(path / "plan.json")
        outcomes = [read_outcome(path, trial["id"])["outcome"] for trial in planned["trials"]]
        done = f"{outcomes.count('completed')}/{len(outcomes)}"
        rows.append({"run": path.name, "experiment": manifest["name"], "completed": done, "clock": manifest["clock"]})
    if as_json:
        _print_json(rows)
    elif not rows:
        typer.echo(f"no runs below {out}/; make one with: hilrig run EXPERIMENT")
    else:
        from hilrig.terminal import print_table

        print_table("", dict.fromkeys(rows[0], ""), [list(row.values()) for row in rows])


@app.command()
def show(run: RunArgument, as_json: AsJson = False) -> None:
    """Show how the trials of a run ended: outcome, timing, messages lost, where it came from."""
    from hilrig.recording.run_directory import read_json, read_outcome

    path = _find(run)
    manifest, planned = read_json(path / "manifest.json"), read_json(path / "plan.json")
    outcomes = [read_outcome(path, trial["id"]) for trial in planned["trials"]]
    if as_json:
        _print_json({"manifest": manifest, "outcomes": outcomes})
        return
    from hilrig.terminal import print_table

    typer.echo(f"{path}\n  {manifest['question']}\n  {manifest['command']}\n  commit {manifest['commit'] or 'unknown'}")
    rows = [
        [
            item["trial"],
            item["outcome"],
            str(item["ticks"]),
            f"{item.get('speed', 0):.2f}",
            _lost(item),
            item["reason"],
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


def _lost(outcome: dict[str, Any]) -> str:
    lost = [account["lost"] for account in outcome["channels"].values()]
    return "?" if None in lost or not lost else str(sum(lost))


@app.command()
def kinds(
    group: Annotated[str | None, typer.Argument(help=f"One of {', '.join(GROUPS)}.", show_default=False)] = None,
    kind: Annotated[str | None, typer.Argument(help="A kind of the group, or ./file.py.", show_default=False)] = None,
) -> None:
    """List all kinds of plug-in, or show one with its equation, parameters, units and bounds."""
    from hilrig import plugins

    if group is None:
        for name in GROUPS:
            typer.echo(f"{name:13} {', '.join(plugins.kinds(name))}")
        return
    if group not in GROUPS:
        raise ExperimentError(f"there is no group '{group}'{nearest(group, GROUPS)}; groups are {', '.join(GROUPS)}")
    for name in [kind] if kind else plugins.kinds(group):
        _show_kind(group, name, brief=kind is None)


def _show_kind(group: str, kind: str, brief: bool) -> None:
    import inspect

    from hilrig import plugins
    from hilrig.schema import describe
    from hilrig.terminal import print_table

    text = inspect.getdoc(plugins.load(group, kind, Path.cwd())) or ""
    if brief:
        typer.echo(f"{kind:20} {text.splitlines()[0] if text else ''}")
        return
    typer.echo(f"{text}\n")
    rows = [
        [row.name, row.unit, row.default, f"{row.low:g}", f"{row.high:g}", row.scale, row.meaning]
        for row in describe(group, kind)
    ]
    columns = {
        "parameter": "",
        "unit": "",
        "default": "",
        "lowest": "right",
        "highest": "right",
        "scale": "",
        "meaning": "",
    }
    print_table("", columns, rows)


@app.command()
def schema() -> None:
    """Print the JSON Schema of experiment files, with which an editor completes and checks them."""
    from hilrig.experiment import schema as experiment_schema

    _print_json(experiment_schema())


def _planned(path: Path, overrides: list[str]) -> tuple[Any, Any]:
    from hilrig.experiment import load
    from hilrig.plan import plan as plan_trials

    loaded = load(path, overrides)
    return loaded, plan_trials(loaded)


def _find(run: Path) -> Path:
    """Return the run directory that was meant: a path, or a name below runs/."""
    from hilrig.errors import RunDirectoryError
    from hilrig.recording.run_directory import find_run, list_runs

    if run.exists() or len(run.parts) > 1:
        return find_run(run)
    known = [path.name for path in list_runs(RUNS)]
    if run.name not in known:
        raise RunDirectoryError(f"there is no run '{run}'{nearest(run.name, known)}; see: hilrig list")
    return RUNS / run


def _print_json(document: Any) -> None:
    typer.echo(json.dumps(document, indent=2))


def main() -> None:
    """Run the program: one readable message per error, and the exit codes of the design."""
    try:
        app()
    except HilrigError as error:
        if "--debug" in sys.argv:
            traceback.print_exc()
        typer.echo(f"{error}", err=True)
        sys.exit(1 if isinstance(error, RigError) else 2)
    except KeyboardInterrupt:
        sys.exit(130)
