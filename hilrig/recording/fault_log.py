"""faults.json: the faults that were injected into a trial, as logged by the processes that injected them."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from hilrig.recording.run_directory import read_json, write_json


class InjectedFault(NamedTuple):
    """One injected fault."""

    tick: int
    role: str
    """The process that injected the fault: driver or controller"""
    kind: str
    """A field of `hilrig.core.signals.Faults`"""
    begin: int
    """CLOCK_MONOTONIC, ns"""
    end: int
    """CLOCK_MONOTONIC, ns; equal to `begin` for a lost message"""


def add_faults(directory: Path, faults: Iterable[InjectedFault]) -> None:
    """Add faults to the log in a trial's directory. Several processes may do this at the same time."""
    folder = os.open(directory, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        all_faults = sorted([*read_faults(directory), *faults])
        write_json(directory / "faults.json", [fault._asdict() for fault in all_faults])
    finally:
        os.close(folder)


def read_faults(directory: Path) -> list[InjectedFault]:
    """Return the faults that were injected into the trial in `directory`, by tick; none if there is no log."""
    path = directory / "faults.json"
    return [InjectedFault(**item) for item in read_json(path)] if path.is_file() else []
