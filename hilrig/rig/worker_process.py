"""The process of a worker: runs whole trials without the bus, and talks to its parent over a line (a socket pair)."""

from __future__ import annotations

import json
import os
import sys
import traceback
from multiprocessing.connection import Connection
from pathlib import Path

from hilrig.core.errors import Stopped, describe_error
from hilrig.recording.run_directory import read_trial
from hilrig.rig.child import Signals
from hilrig.rig.cores import pin
from hilrig.rig.in_process import run_in_process
from hilrig.rig.outcome import Outcome
from hilrig.rig.processes import log_of


def main() -> None:
    """Run the trials named on the line, one after the other; report the ticks reached, and then the outcome."""
    orders = json.loads(sys.argv[1])
    run, line = Path(orders["run"]), Connection(orders["line"])
    signals = Signals()
    try:
        signals.listen(orders["parent"])
        if orders["cores"]:
            pin(orders["cores"])
        while not line.closed:
            name = line.recv()
            _write_to(log_of(run / "trials" / name, "worker"))
            line.send(_outcome(run, name, line))
    except (Stopped, EOFError, OSError) as end:  # OSError, EOFError: the parent has closed the line
        print(f"stopped: {end}", flush=True)
    finally:
        signals.enough()


def _write_to(log: Path) -> None:
    """Send everything printed from now on, also by C libraries, to `log`."""
    sys.stdout.flush()
    with log.open("ab") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)


def _outcome(run: Path, name: str, line: Connection) -> Outcome:
    """Run the trial and return its outcome. Any message on the line means stop, and so does closing it."""
    trial = read_trial(run, name)
    try:
        return run_in_process(run, trial, line.send, line.poll)
    except Stopped:
        raise
    except BaseException as error:  # whatever a law raises; Ctrl-C reaches a worker as a message
        traceback.print_exc()
        log = log_of(run / "trials" / name, "worker")
        return Outcome.of(trial, "failed", f"{describe_error(error)} (see {log})", 0, 0.0, {})


if __name__ == "__main__":
    main()
