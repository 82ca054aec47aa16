"""Halts every rig of this user on this host: its driver holds the plant, and its program starts no further trial."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from hilrig.rig.live import birth

DRIVER = "hilrig.rig.driver_process"
RUNNING = ("run", "reproduce")
"""The verbs that run trials"""
LOOK_S = 0.02
"""Time between two checks of whether a driver has ended"""


@dataclass(frozen=True)
class FoundProcess:
    """A process of this user: its id, when it was started, in clock ticks since boot, and its command line."""

    pid: int
    born: int
    words: tuple[str, ...]

    @property
    def alive(self) -> bool:
        """Whether this process still runs, and not another one with its id."""
        return birth(self.pid) == self.born

    def send(self, number: int) -> None:
        """Send a signal, if the process still runs."""
        if self.alive:
            with suppress(ProcessLookupError):
                os.kill(self.pid, number)


@dataclass(frozen=True)
class FoundDriver:
    """The driver process of a trial."""

    process: FoundProcess
    run: str
    trial: str
    program: int
    """Process id of the program that runs the trials"""

    def __str__(self) -> str:
        return f"trial {self.trial} of {self.run} (process {self.process.pid})"


def halt_all(timeout_s: float, below: Path | None = None) -> tuple[list[FoundDriver], list[FoundDriver]]:
    """Halt all rigs, or those whose run is below a folder.

    Return the drivers that have held and closed their plants, and those that still run after `timeout_s`. All are told
    before any is waited for. A driver that was stopped (SIGSTOP) goes on, in order to hold its plant. The programs are
    told too, so that none starts a further trial.
    """
    processes = list(_own_processes())
    found = (driver for process in processes if (driver := _as_driver(process)))
    drivers = [driver for driver in found if below is None or Path(driver.run).is_relative_to(below.resolve())]
    for driver in drivers:
        driver.process.send(signal.SIGUSR1)
        driver.process.send(signal.SIGCONT)
    programs = {driver.program for driver in drivers}
    for process in processes:
        if process.pid in programs or (below is None and _runs_trials(process.words)):
            process.send(signal.SIGINT)
    deadline = time.monotonic() + timeout_s
    while any(driver.process.alive for driver in drivers) and time.monotonic() < deadline:
        time.sleep(LOOK_S)
    still = [driver for driver in drivers if driver.process.alive]
    return [driver for driver in drivers if driver not in still], still


def _own_processes() -> Iterator[FoundProcess]:
    user = os.getuid()
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit() or int(folder.name) == os.getpid():
            continue
        with suppress(OSError):  # it has ended meanwhile
            if folder.stat().st_uid != user:
                continue
            words = (folder / "cmdline").read_text(errors="replace").rstrip("\0").split("\0")
            if (born := birth(int(folder.name))) is not None:
                yield FoundProcess(int(folder.name), born, tuple(words))


def _as_driver(process: FoundProcess) -> FoundDriver | None:
    if DRIVER not in process.words:
        return None
    try:
        orders = json.loads(process.words[-1])
        return FoundDriver(process, orders["run"], orders["trial"], orders["parent"])
    except (ValueError, KeyError, TypeError):
        return None


def _runs_trials(words: Sequence[str]) -> bool:
    """Return whether a command line is that of `hilrig run`, however it was started: it may be between two trials."""
    ours = (i for i, word in enumerate(words[:4]) if Path(word).name == "hilrig")
    return any(word in RUNNING for i in ours for word in words[i + 1 :])
