"""kinds: the kinds that an experiment file can name, and their parameters."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hilrig.cli.application import app
from hilrig.core.compiler import interpret
from hilrig.core.errors import ExperimentError, nearest

if TYPE_CHECKING:
    from hilrig.experiment.schema import ParameterRow

GROUPS = ("controllers", "drivers", "robots", "references", "disturbances", "metrics")


@app.command()
def kinds(
    group: Annotated[
        str | None,
        typer.Argument(metavar="GROUP", help=f"One of {', '.join(GROUPS)}; or a key of the file.", show_default=False),
    ] = None,
    kind: Annotated[
        str | None, typer.Argument(metavar="KIND", help="A kind of the group, or ./file.py.", show_default=False)
    ] = None,
) -> None:
    """List controllers, drivers, metrics and so on, or describe one.

    A kind is what an experiment file names with 'kind:'. For GROUP and KIND, prints the kind's equation and its
    parameters, with unit, default, bounds, scale and meaning; for a key of the file, such as 'safety', the same of what
    it takes.
    """
    from hilrig.experiment.model import Experiment
    from hilrig.experiment.schema import describe_record, records_in
    from hilrig.kinds import registry as plugins

    interpret()
    keys = records_in(Experiment)
    if group is None:
        for name in GROUPS:
            typer.echo(f"{name:13} {', '.join(plugins.kind_names(name))}")
        typer.echo(f"keys          {', '.join(keys)}")
        return
    if group in keys and kind is None:
        typer.echo(f"{inspect.getdoc(keys[group]) or ''}\n")
        _print(describe_record(keys[group]))
        return
    if group not in GROUPS:
        names = (*GROUPS, *keys)
        raise ExperimentError(
            f"there is no group '{group}'{nearest(group, names)} (groups: {', '.join(GROUPS)}; keys: {', '.join(keys)})"
        )
    if kind is not None:
        _describe(group, kind)
        return
    classes, failed = plugins.load_kinds(group)
    for name in plugins.kind_names(group):
        typer.echo(f"{name:20} {f'cannot be loaded: {failed[name]}' if name in failed else _first_line(classes[name])}")


def _first_line(cls: type) -> str:
    """Return the summary line of the module of a kind."""
    return (inspect.getdoc(inspect.getmodule(cls)) or "").split("\n")[0]


def _describe(group: str, kind: str) -> None:
    from hilrig.experiment.schema import describe_kind
    from hilrig.kinds import registry as plugins

    typer.echo(f"{inspect.getdoc(plugins.load_kind(group, kind, Path.cwd())) or ''}\n")
    _print(describe_kind(group, kind))


def _print(parameters: Iterable[ParameterRow]) -> None:
    from hilrig.cli.terminal import print_table

    rows = [
        [row.name, row.unit, row.default, _bound(row.low), _bound(row.high), row.scale, row.meaning]
        for row in parameters
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


def _bound(value: float) -> str:
    return f"{value:g}" if math.isfinite(value) else ""
