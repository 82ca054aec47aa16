"""The command line: python -m benchmarks. Slow imports are done by the command that needs them."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hilrig.cli.application import AsJson, print_json
from hilrig.cli.entry import main
from hilrig.core.errors import ExperimentError, RunDirectoryError, nearest

if TYPE_CHECKING:
    from benchmarks.measurands import Settings

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback(invoke_without_command=True)
def measure(
    context: typer.Context,
    quick: Annotated[bool, typer.Option("--quick", help="One short repeat: about two minutes, no spread.")] = False,
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Measure one part: bus, lockstep, realtime, load, unprivileged, watch, certificate; or one "
            "measurand, by the name that the progress shows. May be repeated.",
        ),
    ] = None,
    repeats: Annotated[int | None, typer.Option(help="Repeats; default 5, with --quick 1.", show_default=False)] = None,
    as_json: AsJson = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", dir_okay=False, show_default=False, help="Also write the JSON to this file."),
    ] = None,
    markdown: Annotated[
        Path | None,
        typer.Option(metavar="FILE", dir_okay=False, show_default=False, help="Write the page on performance."),
    ] = None,
    source: Annotated[
        Path | None,
        typer.Option(
            "--from", metavar="FILE", exists=True, dir_okay=False, show_default=False,
            help="Show a file written by --out instead of measuring.",
        ),
    ] = None,
) -> None:  # fmt: skip
    """Compare hilrig's loop with a bare exchange, other transports and cyclictest, on this machine.

    One interleaved run of about twelve minutes. Leave the machine alone while it runs.

    Exit code: 0 measured, whatever the figures; 2 the command line is wrong.
    """
    if context.invoked_subcommand is not None:
        return
    if repeats is not None and repeats < 1:
        raise ExperimentError(f"--repeats: must be 1 or more, got {repeats}")
    for option, path in (("--out", out), ("--markdown", markdown)):
        if path is not None and not path.absolute().parent.is_dir():
            raise ExperimentError(f"{option} {path}: there is no folder {path.absolute().parent}")
    found = _read(source) if source else _measure(_settings(quick, repeats), only or [])
    _write(found, out, markdown)
    if as_json:
        print_json(found)
    else:
        _show(found)


@app.command()
def holds(
    trials: Annotated[int, typer.Option(min=6, help="Trials, of six ways to fail.")] = 200,
    out: Annotated[Path | None, typer.Option(help="Keep the run in this folder.", show_default=False)] = None,
    as_json: AsJson = False,
) -> None:
    """Measure how old the command in effect is when the plant is held.

    The controller is killed, stopped, or hangs (asleep or busy), the bus is cut, or the program is killed (orphaned).

    Real processes in real time on a plant that is not simulated; about 25 minutes for 200 trials.

    Exit code: 0 every plant was held in time, 1 one was not.
    """
    from benchmarks.holds.measure import measure_holds, render

    with tempfile.TemporaryDirectory(prefix="holds-") as folder:
        found = measure_holds(trials, out or Path(folder))
    if as_json:
        print_json(found)
    else:
        typer.echo(render(found))
    if any(row["within"] < row["trials"] for row in found["held"]):
        raise typer.Exit(1)


@app.command()
def stalls(
    count: Annotated[int, typer.Option(min=9, help="Faults to inject, of nine kinds.")] = 1000,
    seed: Annotated[int, typer.Option(help="Seed of the ticks, kinds and durations.")] = 1,
    as_json: AsJson = False,
) -> None:
    """Inject stalls of 1 to 5 ms, and compare what the timing certificate finds with what was injected.

    At random ticks, the driver and the controller sleep, are stopped or compute for too long, and the bus delays or
    loses messages. Two trials in real time, without and with these faults; about a minute.

    Exit code: 0 measured, whatever the figures.
    """
    from benchmarks.stalls import measure_stalls, render

    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        found = measure_stalls(count, Path(folder), seed)
    if as_json:
        print_json(found)
    else:
        typer.echo(render(found))


@app.command()
def digest(
    run: Annotated[
        Path, typer.Argument(metavar="RUN", exists=True, file_okay=False, help="A run directory.", show_default=False)
    ],
) -> None:
    """Print a digest of what each trial of a run recorded, to compare the bits of two versions.

    One line per trial: its name, then the first 16 hex digits of the SHA-256 of all messages on /command, /internals,
    /state and /truth. Time stamps are left out.
    """
    from benchmarks.digest import UnreadableBagError, digests, line

    try:
        found = digests(run)
    except UnreadableBagError as error:
        raise RunDirectoryError(str(error)) from error
    if not found:
        raise ExperimentError(f"{run}: there is no trials/*/bag.mcap in it; is it a run directory?")
    for trial, topics in found.items():
        typer.echo(line(trial, topics))


def _settings(quick: bool, repeats: int | None) -> Settings:
    from benchmarks.measurands import QUICK, Settings

    settings = QUICK if quick else Settings()
    return settings if repeats is None else replace(settings, repeats=repeats)


def _measure(settings: Settings, only: list[str]) -> dict[str, Any]:
    from benchmarks.measurands import names
    from benchmarks.run import measure

    known = names()
    for name in only:
        if name not in known:
            raise ExperimentError(f"--only: there is no '{name}'{nearest(name, known)} (there are: {', '.join(known)})")
    return measure(settings, only, lambda line: typer.echo(line, err=True))


def _read(path: Path) -> dict[str, Any]:
    from benchmarks.run import FORM
    from hilrig.recording.run_directory import read_json

    found = read_json(path)
    if not isinstance(found, dict) or found.get("form") != FORM:
        raise ExperimentError(f"{path}: not written by --out of this version (form {FORM})")
    return found


def _write(found: dict[str, Any], out: Path | None, markdown: Path | None) -> None:
    from benchmarks.page import page
    from hilrig.recording.run_directory import to_json

    if out is not None:
        out.write_text(to_json(found) + "\n", encoding="utf-8")
    if markdown is not None:
        markdown.write_text(page(found), encoding="utf-8")


def _show(found: dict[str, Any]) -> None:
    from benchmarks.tables import machine_lines, tables
    from hilrig.cli.terminal import print_table

    for line in machine_lines(found["machine"]):
        typer.echo(line)
    for table in tables(found):
        typer.echo("")
        # The first column, without a heading, contains words, and so does the one that says why something is missing.
        columns = {heading: "" if heading in ("", "why") else "right" for heading in table.columns}
        print_table(table.title, columns, table.rows)
    for line in found["warnings"]:
        typer.echo(f"warning: {line}", err=True)


if __name__ == "__main__":
    main(app)
