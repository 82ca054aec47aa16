"""The results of a run: its report, the expectations that were met, and the JUnit file for CI."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from hilrig.experiment import Experiment
    from hilrig.experiment.trial import Trial
    from hilrig.rig.outcome import Outcome

Junit = Annotated[
    Path | None,
    typer.Option(
        "--junit",
        metavar="FILE",
        dir_okay=False,
        writable=True,
        show_default=False,
        help="Write trials and expectations to this file as JUnit XML, for CI.",
    ),
]


def make_room(junit: Path | None) -> None:
    """Create the folder for the JUnit file, before the run. Raises RunDirectoryError."""
    from hilrig.recording.run_directory import make_directory

    if junit is not None:
        with suppress(FileExistsError):
            make_directory(junit.parent)


def tell_run(run: Path, experiment: Experiment, trials: Sequence[Trial], outcomes: Sequence[Outcome]) -> bool:
    """Print how many trials of a run completed, and which did not keep their timing budget.

    Return whether every trial completed within its budget, or ended as expected.
    """
    from hilrig.experiment.expecting import ended_early, ends_as_expected
    from hilrig.recording.run_directory import INVALID, ending, read_outcome, reason_of

    expect = experiment.to_document()["expect"]
    planned = {trial.id: trial for trial in trials}
    read = {item.trial: read_outcome(run, item.trial) for item in outcomes}
    ended = {name: ending(outcome) for name, outcome in read.items()}
    expected = [
        word for name, word in ended.items() if (trial := planned[name])
        and ends_as_expected(expect, trial.controller_name, trial.condition_name, word)
    ]  # fmt: skip
    completed, invalid = (sum(word == wanted for word in ended.values()) for wanted in ("completed", INVALID))
    others = f", {invalid} invalid" * (invalid > 0) + ended_early(expected)
    typer.echo(f"run      {run}  ({completed} of {len(trials)} trials completed{others})")
    for name, word in ended.items():
        if word == INVALID:
            typer.echo(f"invalid  {name}  {reason_of(read[name])}")
    return completed + sum(word != "completed" for word in expected) == len(trials)


def tell_results(run: Path, out: Path | None, report: bool, junit: Path | None) -> bool:
    """Measure a run, make its report if wanted, and print both. Return whether every expectation was met."""
    from hilrig.cli.terminal import errors, print_expectations

    with errors.status("making the report" if report else "measuring"):
        from hilrig.core.text import write_text
        from hilrig.report import junit_xml, measure_run, write_report

        measured = measure_run(run, to_draw=report)
        if junit is not None:
            write_text(junit, junit_xml(measured.data, measured.expected))
        page = write_report(measured, out) if report else None
    for kind, reason in measured.failed_metrics.items():
        typer.echo(f"warning: the metric '{kind}' failed and is left out: {reason}", err=True)
    if page is not None:
        typer.echo(f"report   {page}")
    if measured.expected:
        print_expectations(measured.expected)
    return all(item.met for item in measured.expected)
