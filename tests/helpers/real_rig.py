"""The real rig seen from outside: its processes, its runs, and a controller with a fault."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
import pytest

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


def only_run(under: Path) -> Path:
    """Return the one run directory below `under`/runs."""
    (run,) = (under / "runs").iterdir()
    return run


def socket_directories() -> set[str]:
    """Return the directories with the bus's sockets that exist now."""
    return {name for name in os.listdir(tempfile.gettempdir()) if name.startswith("hilrig-")}


def wait_for(condition: Callable[[], Any], timeout: float = 90.0) -> Any:
    """Return the first true value of `condition`."""
    deadline = time.monotonic() + timeout
    while time.monotonic() < deadline:
        if value := condition():
            return value
        time.sleep(0.02)
    pytest.fail(f"{condition} did not come true in {timeout} s")


def under_way(under: Path) -> Callable[[], bool]:
    """Return a condition: a trial runs, with something in its bag."""

    def condition() -> bool:
        bags = list((under / "runs").glob("*/trials/*/bag.mcap"))
        return bool(bags) and bags[0].stat().st_size > 200_000

    return condition
