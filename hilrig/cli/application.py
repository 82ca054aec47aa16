"""The program and the code that its verbs share: arguments, output, finding a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from hilrig import __version__
from hilrig.core.errors import RunDirectoryError, nearest

RUNS = Path("runs")

app = typer.Typer(
    name="hilrig",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Hardware-in-the-loop experiments for robot force-position control.\n\n"
    "An experiment is one YAML file, a run of it is one directory, and its report is one page.\n\n"
    "Start here:  hilrig run experiments/quickstart.yaml",
)

ExperimentFile = Annotated[
    Path, typer.Argument(metavar="EXPERIMENT", help="The experiment's YAML file.", show_default=False)
]
RUN_HELP = "A run directory, or its name below runs/."
RunArgument = Annotated[Path, typer.Argument(metavar="RUN", help=RUN_HELP, show_default=False)]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a value of the file, e.g. --set controllers.pd.damping='80 N*s/m'. May be repeated.",
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
    """Options of the program itself, given before the verb."""


def run_meant(run: Path) -> Path:
    """Return the run directory for `run`: a path, or a name below runs/."""
    from hilrig.recording import run_directory

    if run.exists() or len(run.parts) > 1:
        return run_directory.find_run(run)
    known = [path.name for path in run_directory.list_runs(RUNS)]
    if run.name not in known:
        raise RunDirectoryError(f"there is no run '{run}'{nearest(run.name, known)}; see: hilrig list")
    return RUNS / run


def print_json(document: Any) -> None:
    """Print a document as JSON."""
    from hilrig.recording.run_directory import to_json

    typer.echo(to_json(document))
