"""What a run came to: its report, which expectations are met, and both for CI."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

Junit = Annotated[
    Path | None,
    typer.Option(
        "--junit",
        metavar="FILE",
        dir_okay=False,
        writable=True,
        show_default=False,
        help="Write trials and expectations as JUnit XML, for CI.",
    ),
]


def make_room(junit: Path | None) -> None:
    """Make the folder that the JUnit file goes to. Raises RunDirectoryError: before the run, not after it."""
    from hilrig.recording.run_directory import make_directory

    if junit is not None:
        with suppress(FileExistsError):
            make_directory(junit.parent)


def tell_results(run: Path, out: Path | None, report: bool, junit: Path | None) -> bool:
    """Measure a run, make its report if wanted, and print both; return whether every expectation is met."""
    from hilrig.terminal import errors, print_expectations

    with errors.status("making the report" if report else "measuring"):
        from hilrig.report import junit_xml, measure_run, write_report

        measured = measure_run(run, to_draw=report)
        if junit is not None:
            junit.write_text(junit_xml(measured.data, measured.expected), encoding="utf-8")
        page = write_report(measured, out) if report else None
    if page is not None:
        typer.echo(f"report   {page}")
    if measured.expected:
        print_expectations(measured.expected)
    return all(item.met for item in measured.expected)
