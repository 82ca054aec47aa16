"""The real rig seen from outside: its processes, its runs, and a controller with a fault."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import psutil

from helpers.patience import PATIENCE

PROJECT = Path(__file__).parents[2]
LONG = 600.0
"""s: a trial that does not end during a test"""


def rig_processes(under: Path) -> dict[str, psutil.Process]:
    """Return the rig's processes that work in a run below `under`: role -> process."""
    found: dict[str, psutil.Process] = {}
    for process in psutil.process_iter():
        try:
            line = process.cmdline()
        except psutil.Error:
            continue
        if any(str(under) in word for word in line) and process.status() != psutil.STATUS_ZOMBIE:
            for word in line:
                if word.startswith("hilrig.rig."):
                    found[word.removeprefix("hilrig.rig.").removesuffix("_process")] = process
    return found


LAW = '''
"""A controller with a fault."""
import os
import time
from dataclasses import dataclass
from typing import NamedTuple
import numpy as np
from hilrig.core.interfaces import Law

class Memory(NamedTuple):
    count: np.ndarray

@dataclass(frozen=True)
class Faulty:
    """Holds the torque it finds, but for its fault."""

    def start(self, task, state):
        {start}
        return Law(self.step, state.torque.copy(), Memory(np.zeros(1)))

    def step(self, torque, memory, state, reference):
        memory.count[0] += 1
        if {when}:
            {step}
        return torque
'''


def faulty(folder: Path, step: str, *, when: str = "memory.count[0] > 200", start: str = "pass") -> str:
    """Write a controller that does `step` in every call where `when` holds; return its line of the experiment."""
    (folder / "faulty.py").write_text(LAW.format(step=step, when=when, start=start))
    return "faulty: {kind: ./faulty.py}"


def gated(folder: Path, name: str) -> str:
    """Write a law that crawls from its 200th call on, until the file `gate(folder, name)` is there; return its line.

    What happens beside a trial can then be waited for, and the trial still ends by itself: ten ticks a second.
    """
    shut = f"memory.count[0] > 200 and not os.path.exists({str(gate(folder, name))!r})"
    (folder / f"{name}.py").write_text(LAW.format(step="time.sleep(0.1)", when=shut, start="pass"))
    return f"{name}: {{kind: ./{name}.py}}"


def gate(folder: Path, name: str) -> Path:
    """Return the file that lets the gated law go on."""
    return folder / f"{name}.go"


def only_run(under: Path) -> Path:
    """Return the one run directory below `under`/runs."""
    (run,) = (under / "runs").iterdir()
    return run


def socket_directories() -> set[str]:
    """Return the directories with the bus's sockets that exist now."""
    return {name for name in os.listdir(tempfile.gettempdir()) if name.startswith("hilrig-")}


def recorded(under: Path) -> list[int]:
    """Return how many bytes are in the bag of each trial below `under`, the smallest first."""
    return sorted(bag.stat().st_size for bag in (under / "runs").glob("*/trials/*/bag.mcap"))


def under_way(under: Path, trials: int = 1) -> Callable[[], bool]:
    """Return a condition: so many trials run, with something in their bags."""
    return lambda: len([size for size in recorded(under) if size > 200_000]) >= trials


def end_of(process: subprocess.Popen[str]) -> tuple[str, str]:
    """Wait for the end of a process; return what it printed: stdout and stderr."""
    return process.communicate(timeout=PATIENCE)
