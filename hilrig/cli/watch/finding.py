"""Finds the run to watch."""

from __future__ import annotations

from pathlib import Path

from hilrig.core.errors import RunDirectoryError
from hilrig.recording.run_directory import list_runs, read_manifest
from hilrig.rig.live import IN_PROCESS, LiveRun, read_live


def newest_live_run(runs: Path) -> Path:
    """Return the newest running run below `runs`, preferably one on the bus.

    Raises RunDirectoryError if there is none.
    """
    found = {path: live for path in reversed(list_runs(runs)) if (live := read_live(path)) is not None and live.alive}
    on_bus = [path for path, live in found.items() if live.transport != IN_PROCESS]
    if on_bus:
        return on_bus[0]
    for path in found:
        raise RunDirectoryError(without_bus(path))
    raise RunDirectoryError(f"no run below {runs}/ is running; start one with: hilrig run EXPERIMENT --watch")


def going_on(run: Path) -> LiveRun:
    """Return the content of the run's live.json. Raises RunDirectoryError if the run cannot be watched."""
    live = read_live(run)
    if live is None:
        finished = read_manifest(run).get("finished")
        ended = f"it ended at {finished}" if finished else "it is not running"
        raise RunDirectoryError(f"{run}: {ended}; see: hilrig show {run}")
    if not live.alive:
        raise RunDirectoryError(gone(run, live))
    if live.transport == IN_PROCESS:
        raise RunDirectoryError(without_bus(run))
    return live


def gone(run: Path, live: LiveRun) -> str:
    """Return the message that the run's program ended without removing live.json."""
    return f"{run}: no longer running, its program (process {live.pid}) was killed; see: hilrig show {run}"


def without_bus(run: Path) -> str:
    """Return the message that the run has no bus."""
    return f"{run}: runs in one process (--in-process), without a bus: there is nothing to watch"
