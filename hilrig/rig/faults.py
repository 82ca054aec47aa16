"""Injects the faults of a trial into a process of the loop, and logs what was injected."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np

from hilrig.core.interfaces import is_fault
from hilrig.core.signals import Array, Faults
from hilrig.experiment.trial import Trial, disturbance_schedule
from hilrig.recording.fault_log import InjectedFault, add_faults
from hilrig.rig.bus import Outbox
from hilrig.rig.faulty_outbox import FaultyOutbox
from hilrig.rig.stopping import Stopper

SENDS = {"driver": "state", "controller": "command"}
"""The channel on which each process sends"""


class Injector:
    """Injects the faults of one process of the loop. A trial without faults has no injector and no overhead."""

    def __init__(self, role: Literal["driver", "controller"], faults: Faults) -> None:
        self._role, self._channel = role, SENDS[role]
        self._stalls = _by_tick(getattr(faults, f"{role}_stall"))
        self._stops = _by_tick(getattr(faults, f"{role}_stop"))
        self._busy = _by_tick(faults.controller_busy) if role == "controller" else {}
        self._delays = _by_tick(getattr(faults, f"{self._channel}_delay"))
        self._losses = _by_tick(getattr(faults, f"{self._channel}_loss"))
        self._stopper = Stopper() if self._stops else None
        self._log: list[InjectedFault] = []

    @classmethod
    def of(cls, trial: Trial, role: Literal["driver", "controller"]) -> Injector | None:
        """Return the injector for one process of a trial, or None if it has no faults to inject."""
        if not any(map(is_fault, trial.disturbances)):
            return None
        injector = cls(role, disturbance_schedule(trial).faults)
        return injector if injector.planned else None

    @property
    def planned(self) -> int:
        """Number of faults to inject"""
        return sum(map(len, (self._stalls, self._stops, self._busy, self._delays, self._losses)))

    def stall(self, tick: int) -> None:
        """Stall, by sleeping or by SIGSTOP, if a stall is due at `tick`."""
        if tick in self._stalls:
            self._do(tick, f"{self._role}_stall", _sleep, self._stalls[tick])
        if tick in self._stops and self._stopper is not None:
            self._do(tick, f"{self._role}_stop", self._stopper.stop, self._stops[tick])

    def compute(self, tick: int) -> None:
        """Keep the processor busy if the controller must take longer at `tick`."""
        if tick in self._busy:
            self._do(tick, f"{self._role}_busy", _compute, self._busy[tick])

    def outbox(self, outbox: Outbox) -> Outbox:
        """Return an outbox on the same key that delays and loses the messages specified by the faults."""
        if not self._delays and not self._losses:
            return outbox
        return FaultyOutbox(
            outbox, self._delays, self._losses,
            lambda tick, what, begin, end: self._note(tick, f"{self._channel}_{what}", begin, end),
        )  # fmt: skip

    def end(self, directory: Path) -> None:
        """Write the injected faults to the log in the trial's directory."""
        add_faults(directory, self._log)

    def _do(self, tick: int, kind: str, act: Callable[[int], None], duration_ns: int) -> None:
        begin = time.monotonic_ns()
        act(duration_ns)
        self._note(tick, kind, begin, time.monotonic_ns())

    def _note(self, tick: int, kind: str, begin: int, end: int) -> None:
        self._log.append(InjectedFault(tick, self._role, kind, begin, end))


def _by_tick(values: Array) -> dict[int, int]:
    """Return tick -> duration, ns, for the nonzero `values` (N,), s."""
    return {int(tick): round(float(values[tick]) * 1e9) for tick in np.flatnonzero(values)}


def _sleep(duration_ns: int) -> None:
    time.sleep(duration_ns / 1e9)


def _compute(duration_ns: int) -> None:
    end = time.monotonic_ns() + duration_ns
    while time.monotonic_ns() < end:
        pass
