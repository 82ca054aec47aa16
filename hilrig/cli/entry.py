"""Where the program begins."""

from __future__ import annotations

import os
import sys
import threading
import traceback
from collections.abc import Callable
from importlib import import_module

import typer

from hilrig.cli.application import app
from hilrig.cli.verbs import VERBS
from hilrig.core.errors import HilrigError, RigError

THREAD_TIMEOUT_S = 1.0
"""How long each remaining thread may take to finish at the end"""

for verb in VERBS:
    import_module(f"hilrig.cli.verbs.{verb}")


def main(program: Callable[[], object] = app) -> None:
    """Run a program, with one readable message per error.

    Exit code 1: the rig or the system failed; 2: a wrong call.
    """
    try:
        _run(program)
    except SystemExit as end:
        _end_threads(end.code)
        raise


def _run(program: Callable[[], object]) -> None:
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


def _end_threads(code: object) -> None:
    """End the process at once if plug-in code left a thread that Python would wait for, perhaps for ever."""
    left = [thread for thread in threading.enumerate() if thread is not threading.main_thread() and not thread.daemon]
    for thread in left:
        thread.join(THREAD_TIMEOUT_S)
    if running := [thread.name for thread in left if thread.is_alive()]:
        typer.echo(f"warning: ended while a thread was still running: {', '.join(running)}", err=True)
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code if isinstance(code, int) else int(code is not None))
