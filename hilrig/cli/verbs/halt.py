"""halt: hold all plants."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hilrig.cli.application import app
from hilrig.core.errors import RigError


@app.command()
def halt(
    timeout: Annotated[
        float, typer.Option(help="How long to wait until the plants are held, s.", min=0.1, max=600.0)
    ] = 10.0,
    below: Annotated[
        Path | None, typer.Option(help="Halt only the runs in progress below this folder.", show_default=False)
    ] = None,
) -> None:
    """Hold every plant on this machine, and end all runs.

    Each driver holds its plant where it is, closes it, and ends its trial as aborted; no further trial is started. A
    bridge that owns a robot holds it and ends. This is no emergency stop: it needs a machine and a driver that still
    work. Keep the robot's own one within reach.

    Exit code: 0 all plants are held, or there were none; 1 a driver has not ended in time.
    """
    from hilrig.rig.halting import halt_all

    held, still = halt_all(timeout, below)
    for holder in held:
        typer.echo(f"held     {holder}")
    if still:
        lines = "\n".join(f"running  {holder}" for holder in still)
        raise RigError(
            f"{lines}\nnot held after {timeout:g} s: use the robot's own emergency stop, then look at the driver"
        )
    if not held:
        typer.echo("no rig of yours is running on this machine")
