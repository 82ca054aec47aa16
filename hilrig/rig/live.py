"""Which run is going on: live.json in its directory, for whoever wants to watch it.

The file is there while the run's program is at work; a program that was killed leaves it behind, with its process id.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any

from hilrig.core.errors import RunDirectoryError
from hilrig.recording.run_directory import read_json, write_json

FILE = "live.json"
ON_BUS, IN_PROCESS = "zenoh", "in-process"


@dataclass(frozen=True)
class LiveTrial:
    """A trial that is going on."""

    id: str
    endpoint: str
    """Where its logger takes watchers"""
    cores: tuple[int, ...]
    """The logger's cores: where a watcher is not in the loop's way"""


@dataclass(frozen=True)
class LiveRun:
    """What live.json says."""

    pid: int
    """Of the run's program"""
    born: int
    """When that process was started, in clock ticks since boot: a process id may be given again"""
    transport: str
    trials: tuple[LiveTrial, ...] = ()
    """Those going on, in the order in which they were begun"""

    @property
    def alive(self) -> bool:
        """Whether the run's program still is at work."""
        return birth(self.pid) == self.born


def read_live(run: Path) -> LiveRun | None:
    """Return what live.json of a run says; None if there is none: the run has ended, or was never begun."""
    try:
        document = read_json(run / FILE)
    except RunDirectoryError:
        # Missing, or not JSON: it is written whole or not at all.
        return None
    trials = tuple(LiveTrial(id, item["endpoint"], tuple(item["cores"])) for id, item in document["trials"].items())
    return LiveRun(document["pid"], document["born"], document["transport"], trials)


def birth(pid: int) -> int | None:
    """Return when a process was started, in clock ticks since boot; None if there is no such process."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return None
    # The name, in brackets, may hold anything.
    words = status.rsplit(")", 1)[1].split()
    return None if words[0] == "Z" else int(words[19])


@dataclass
class Live:
    """Keeps live.json while a run goes on. Trials may begin and end in several threads."""

    run: Path
    transport: str
    _trials: dict[str, Mapping[str, Any]] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def begin(self, trial: str, endpoint: str, cores: Sequence[int]) -> None:
        """Say that a trial is being started and where its logger takes watchers."""
        with self._lock:
            self._trials[trial] = {"endpoint": endpoint, "cores": list(cores)}
            self._write()

    def end(self, trial: str) -> None:
        """Say that a trial has ended."""
        with self._lock:
            self._trials.pop(trial, None)
            self._write()

    def _write(self) -> None:
        pid = os.getpid()
        document = {"pid": pid, "born": birth(pid), "transport": self.transport, "trials": self._trials}
        write_json(self.run / FILE, document)

    def __enter__(self) -> Live:
        self._write()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(FileNotFoundError):
            (self.run / FILE).unlink()
