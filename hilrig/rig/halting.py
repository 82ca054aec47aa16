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
BRIDGE = "hilrig_drivers/bridge.py"
"""The file of the process that owns a robot for a driver; it may be run by another interpreter"""
RUNNING = ("run", "reproduce")
"""The verbs that run trials"""
LOOK_S = 0.02
"""Time between two checks of whether a driver has ended"""
FIRST_S = 0.1
"""How long the drivers may take to hold their plants in their own way, before the bridges are told too"""


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


@dataclass(frozen=True)
class FoundBridge:
    """A process that owns a robot for a driver, from the first trial of a run until the program ends."""

    process: FoundProcess
    robot: str
    """The file of the robot's side"""
    program: int
    """Process id of the program whose run it belongs to; 0 if somebody started it by hand"""

    def __str__(self) -> str:
        return f"bridge to {self.robot} (process {self.process.pid})"


def halt_all(
    timeout_s: float, below: Path | None = None
) -> tuple[list[FoundDriver | FoundBridge], list[FoundDriver | FoundBridge]]:
    """Halt all rigs, or those whose run is below a folder.

    Return the drivers that have held and closed their plants and the bridges that have held their robots, and those
    that still run after `timeout_s`. All drivers are told before any is waited for, the bridges 0.1 s later. A process
    that was stopped (SIGSTOP) goes on, in order to hold its plant. The programs are told too, so that none starts a
    further trial.
    """
    processes = list(_own_processes())
    found = (driver for process in processes if (driver := _as_driver(process)))
    drivers = [driver for driver in found if below is None or Path(driver.run).is_relative_to(below.resolve())]
    programs = {driver.program for driver in drivers}
    bridges = [bridge for process in processes if (bridge := _as_bridge(process))]
    bridges = [bridge for bridge in bridges if below is None or bridge.program in programs]
    _tell(drivers)
    for process in processes:
        if process.pid in programs or (below is None and _runs_trials(process.words)):
            process.send(signal.SIGINT)
    if bridges:
        _wait(drivers, FIRST_S)
    _tell(bridges)
    holders = [*drivers, *bridges]
    _wait(holders, timeout_s)
    still = [holder for holder in holders if holder.process.alive]
    return [holder for holder in holders if holder not in still], still


def _tell(holders: Sequence[FoundDriver | FoundBridge]) -> None:
    for holder in holders:
        holder.process.send(signal.SIGUSR1)
        holder.process.send(signal.SIGCONT)


def _wait(holders: Sequence[FoundDriver | FoundBridge], timeout_s: float) -> None:
    """Wait until all have ended, but no longer than `timeout_s`."""
    deadline = time.monotonic() + timeout_s
    while any(holder.process.alive for holder in holders) and time.monotonic() < deadline:
        time.sleep(LOOK_S)


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


def _as_bridge(process: FoundProcess) -> FoundBridge | None:
    words = process.words
    at = next((i for i, word in enumerate(words) if word.endswith(BRIDGE)), None)
    if at is None or at + 1 >= len(words):
        return None
    owner = words[words.index("--owner") + 1] if "--owner" in words[:-1] else "0"
    return FoundBridge(process, words[at + 1], int(owner) if owner.isdigit() else 0)


def _runs_trials(words: Sequence[str]) -> bool:
    """Return whether a command line is that of `hilrig run`, however it was started: it may be between two trials."""
    ours = (i for i, word in enumerate(words[:4]) if Path(word).name == "hilrig")
    return any(word in RUNNING for i in ours for word in words[i + 1 :])
