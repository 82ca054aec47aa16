"""live.json in a run directory: which trials are running, for `hilrig watch`.

The file exists as long as the program that runs the trials. If that program is killed, the file stays, and the process
id in it shows that the program is gone.
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
    """A trial that is running."""

    id: str
    endpoint: str
    """Endpoint at which its logger accepts watch processes"""
    cores: tuple[int, ...]
    """The logger's cores, on which a watch process does not disturb the loop"""
    epoch: bytes
    """The epoch of its messages"""


@dataclass(frozen=True)
class LiveRun:
    """The content of live.json."""

    pid: int
    """Process id of the program that runs the trials"""
    born: int
    """Start time of that process, in clock ticks since boot: the kernel may reuse a process id"""
    transport: str
    trials: tuple[LiveTrial, ...] = ()
    """The running trials, in the order in which they were started"""

    @property
    def alive(self) -> bool:
        """Whether the program that runs the trials still exists."""
        return birth(self.pid) == self.born


def read_live(run: Path) -> LiveRun | None:
    """Return the content of a run's live.json; None if the file does not exist: the run has ended or never started."""
    try:
        document = read_json(run / FILE)
    except RunDirectoryError:
        # It is missing or not JSON; hilrig itself never writes a partial file.
        return None
    trials = tuple(
        LiveTrial(id, item["endpoint"], tuple(item["cores"]), bytes.fromhex(item["epoch"]))
        for id, item in document["trials"].items()
    )
    return LiveRun(document["pid"], document["born"], document["transport"], trials)


def birth(pid: int) -> int | None:
    """Return when a process was started, in clock ticks since boot; None if there is no such process."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return None
    # The name, in brackets, may contain anything.
    words = status.rsplit(")", 1)[1].split()
    return None if words[0] == "Z" else int(words[19])


@dataclass
class Live:
    """Keeps live.json up to date during a run. Trials may begin and end in several threads."""

    run: Path
    transport: str
    _trials: dict[str, Mapping[str, Any]] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def begin(self, trial: str, endpoint: str, cores: Sequence[int], epoch: bytes) -> None:
        """Add a trial that is being started, and the endpoint at which its logger accepts watch processes."""
        with self._lock:
            self._trials[trial] = {"endpoint": endpoint, "cores": list(cores), "epoch": epoch.hex()}
            self._write()

    def end(self, trial: str) -> None:
        """Remove a trial that has ended."""
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
