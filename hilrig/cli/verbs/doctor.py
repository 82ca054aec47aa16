"""doctor: whether this machine can run the loop at 1 ms."""

from __future__ import annotations

import dataclasses
import sys
from typing import TYPE_CHECKING, Annotated

import typer

from hilrig.cli.application import AsJson, app, print_json

if TYPE_CHECKING:
    from rich.console import Console

    from hilrig.cli.doctor.findings import Finding
    from hilrig.cli.doctor.verdict import Probe, Readiness

FINDING_STYLES = {"ok": "green", "note": "yellow", "fault": "red"}
WORDS = {"ready": "green", "usable with late ticks": "yellow", "not ready": "red"}


@app.command()
def doctor(
    seconds: Annotated[float, typer.Option(min=0.1, max=3600, help="How long to measure, in seconds.")] = 10.0,
    as_json: AsJson = False,
) -> None:
    """Check whether this machine can run the loop at 1 ms.

    Reads the machine's settings, then measures at 1 kHz how late a process wakes up and how long a message and its
    answer take over the bus, with the default set-up of an experiment. Lists how to fix the faults found. Exit code: 0
    the machine was examined, whatever was found.
    """
    from hilrig.cli.doctor.findings import findings, from_probe
    from hilrig.cli.doctor.host import read_host
    from hilrig.cli.doctor.probe import probe
    from hilrig.cli.doctor.trying import try_things
    from hilrig.cli.doctor.verdict import judge_probe
    from hilrig.experiment.rig_settings import RigSettings

    settings = RigSettings()
    # Before the probe, which itself loads the machine.
    host = read_host(try_things(settings.priority))
    if not as_json:
        typer.echo(f"measuring for {seconds:g} s ...", err=True)
    measured = probe(seconds, settings)
    verdict, found = judge_probe(measured), [*findings(host), *from_probe(measured)]
    if as_json:
        print_json(
            {
                "verdict": verdict._asdict(),
                "findings": [item._asdict() for item in found],
                "probe": measured._asdict(),
                "host": {**dataclasses.asdict(host), "tried": host.tried._asdict()},
            }
        )
    else:
        _show(found, measured, verdict)


def _show(found: list[Finding], measured: Probe, verdict: Readiness) -> None:
    from rich.console import Console

    # A pipe has no width, so nothing may be folded there.
    console = Console(highlight=False, width=None if sys.stdout.isatty() else 200)
    _print_findings(console, found)
    _print_probe(console, measured)
    console.print(f"\n1 ms on this machine: [bold {WORDS[verdict.word]}]{verdict.word}[/]")
    for reason in verdict.because:
        console.print(f"  {reason}", markup=False)
    _print_remedies(console, found)


def _print_findings(console: Console, found: list[Finding]) -> None:
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, show_header=False)
    for item in found:
        table.add_row(Text(item.verdict, style=FINDING_STYLES[item.verdict]), item.name, Text(item.value))
    console.print(table)


def _print_probe(console: Console, measured: Probe) -> None:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column(f"probe of {measured.ticks} ticks, us")
    rows = {"wake-up lateness": measured.lateness_us, "round trip over the bus": measured.round_trip_us}
    names = list(measured.lateness_us)
    for name in names:
        table.add_column(name, justify="right")
    for title, row in rows.items():
        table.add_row(title, *(f"{row[name]:.1f}" if row else "-" for name in names))
    table.add_row("late ticks", f"{measured.late}", f"({measured.late / measured.ticks:.2%})")
    console.print()
    console.print(table)


def _print_remedies(console: Console, found: list[Finding]) -> None:
    """Print how to fix each finding, one line each, never folded: users copy these lines."""
    for verdict, title in (("fault", "To fix the faults:"), ("note", "Also worth trying:")):
        items = [item for item in found if item.verdict == verdict and item.remedy]
        if items:
            console.print(f"\n{title}")
        for item in items:
            console.print(f"  {item.name}", style=FINDING_STYLES[verdict])
            console.print(f"    {item.remedy}", soft_wrap=True, markup=False)
