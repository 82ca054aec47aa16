"""The verb that measures hilrig beside what it stands on: bench."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hilrig.cli.application import AsJson, app, print_json
from hilrig.core.errors import ExperimentError, nearest

if TYPE_CHECKING:
    from benchmarks import Settings

bench_app = typer.Typer(rich_markup_mode=None)
app.add_typer(bench_app, name="bench")


@bench_app.callback(invoke_without_command=True)
def bench(
    context: typer.Context,
    quick: Annotated[bool, typer.Option("--quick", help="One short repeat: some two minutes, and no spread.")] = False,
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Measure this part: bus, lockstep, realtime, load, unprivileged, watch, certificate; or one "
            "measurand, by the name that the progress shows. May be repeated.",
        ),
    ] = None,
    repeats: Annotated[int | None, typer.Option(help="Repeats; default 5, with --quick 1.", show_default=False)] = None,
    as_json: AsJson = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", dir_okay=False, show_default=False, help="Write the JSON to this file, too."),
    ] = None,
    markdown: Annotated[
        Path | None,
        typer.Option(metavar="FILE", dir_okay=False, show_default=False, help="Write the page about performance."),
    ] = None,
    source: Annotated[
        Path | None,
        typer.Option(
            "--from", metavar="FILE", exists=True, dir_okay=False, show_default=False,
            help="Show what --out wrote, instead of measuring.",
        ),
    ] = None,
) -> None:  # fmt: skip
    """Measure hilrig's loop beside a bare exchange, other transports and cyclictest, on this machine.

    One interleaved run of some twelve minutes. Leave the machine alone meanwhile.

    Exit code: 0 it was measured, whatever came out; 2 the call is wrong.
    """
    if context.invoked_subcommand is not None:
        return
    if repeats is not None and repeats < 1:
        raise ExperimentError(f"--repeats: {repeats} repeats; 1 is the least")
    for path in (out, markdown):
        if path is not None and not path.absolute().parent.is_dir():
            raise ExperimentError(f"{path}: there is no folder {path.absolute().parent}")
    found = _read(source) if source else _measure(_settings(quick, repeats), only or [])
    _tell(found, as_json, out, markdown)


@bench_app.command()
def stalls(
    count: Annotated[int, typer.Option(min=9, help="Faults to inject, of nine kinds.")] = 1000,
    seed: Annotated[int, typer.Option(help="Of the ticks, the kinds and the durations.")] = 1,
    as_json: AsJson = False,
) -> None:
    """Inject stalls of 1 to 5 ms, and compare what the certificate finds with what was injected.

    Sleeps and stops of driver and controller, a controller that computes too long, messages that the bus delays or
    loses, at random ticks; about a minute of real time, without and with them.

    Exit code: 0 it was measured, whatever came out.
    """
    import tempfile

    from benchmarks.stalls import measure_stalls, render

    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        found = measure_stalls(count, Path(folder), seed)
    if as_json:
        print_json(found)
    else:
        typer.echo(render(found))


def _settings(quick: bool, repeats: int | None) -> Settings:
    from dataclasses import replace

    from benchmarks import QUICK, Settings

    settings = QUICK if quick else Settings()
    return settings if repeats is None else replace(settings, repeats=repeats)


def _measure(settings: Settings, only: list[str]) -> dict[str, Any]:
    from benchmarks import measure, names

    known = names()
    for name in only:
        if name not in known:
            raise ExperimentError(f"--only: there is no '{name}'{nearest(name, known)} (there are: {', '.join(known)})")
    return measure(settings, only, lambda line: typer.echo(line, err=True))


def _read(path: Path) -> dict[str, Any]:
    from benchmarks import FORM
    from hilrig.recording.run_directory import read_json

    found = read_json(path)
    if not isinstance(found, dict) or found.get("form") != FORM:
        raise ExperimentError(f"{path}: not what 'hilrig bench --out' of this version writes (form {FORM})")
    return found


def _tell(found: dict[str, Any], as_json: bool, out: Path | None, markdown: Path | None) -> None:
    from benchmarks.page import page
    from hilrig.recording.run_directory import to_json

    if out is not None:
        out.write_text(to_json(found) + "\n", encoding="utf-8")
    if markdown is not None:
        markdown.write_text(page(found), encoding="utf-8")
    if as_json:
        print_json(found)
    else:
        _show(found)


def _show(found: dict[str, Any]) -> None:
    from benchmarks.tables import machine_lines, tables
    from hilrig.cli.terminal import print_table

    for line in machine_lines(found["machine"]):
        typer.echo(line)
    for table in tables(found):
        typer.echo("")
        # The first column, without a heading, is words; so is what says why something is missing.
        columns = {heading: "" if heading in ("", "why") else "right" for heading in table.columns}
        print_table(table.title, columns, table.rows)
    for line in found["warnings"]:
        typer.echo(f"warning: {line}", err=True)
