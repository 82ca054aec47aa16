"""Where the program begins."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable
from importlib import import_module

import typer

from hilrig.cli.application import app
from hilrig.cli.verbs import VERBS
from hilrig.core.errors import HilrigError, RigError

for verb in VERBS:
    import_module(f"hilrig.cli.verbs.{verb}")


def main(program: Callable[[], object] = app) -> None:
    """Run a program, with one readable message per error.

    Exit code 1: the rig or the system failed; 2: a wrong call.
    """
    try:
        program()
    except HilrigError as error:
        if "--debug" in sys.argv:
            traceback.print_exc()
        typer.echo(f"{error}", err=True)
        sys.exit(1 if isinstance(error, RigError) else 2)
    except OSError as error:
        if "--debug" in sys.argv:
            traceback.print_exc()
        typer.echo(f"{error.filename or 'hilrig'}: {error.strerror or error}", err=True)
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(130)
