"""Starts the processes of one trial, watches over them, and sees that none is left."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any

from hilrig.experiment.trial import Trial
from hilrig.recording.run_directory import trial_directory
from hilrig.rig.bus import Bus
from hilrig.rig.child import Orders
from hilrig.rig.cores import cores_for
from hilrig.rig.launching import how_it_ended, launch
from hilrig.rig.live import Live
from hilrig.rig.outcome import Outcome
from hilrig.rig.socket_folder import make_socket_folder

ROLES = ("driver", "controller", "logger")
READY_TIMEOUT = float(os.environ.get("HILRIG_READY_TIMEOUT", "180"))
"""s: the first trial on a machine compiles its kernels"""
SILENCE_TIMEOUT = float(os.environ.get("HILRIG_SILENCE_TIMEOUT", "15"))
"""s without progress after which a trial has hung"""
FAREWELL = 0.5
"""s that the last word of a process that has ended may take"""
PROMPT = 1.0
"""s that a process is given to end by itself when a trial is cut short; then it is told by SIGTERM"""
GRACE = 5.0
"""s that a process is given to end when it has been told, before it is killed"""
WRITING = 60.0
"""s that the logger is given to write what it has"""
STEP = 0.005
"""s between two looks at the children"""


def run_on_bus(
    run: Path,
    trial: Trial,
    report: Callable[[int], None] = lambda tick: None,
    stop: Callable[[], bool] = lambda: False,
    slot: int = 0,
    live: Live | None = None,
) -> Outcome:
    """Run one trial in three fresh processes over the bus; `slot` says which cores they are given.

    `live` is told where the trial can be watched.
    """
    with Rig(run, trial, slot, live) as rig:
        return Watch(rig, report, stop).until_the_end()


class Rig:
    """The three processes of one trial and the supervisor's place on their bus."""

    def __init__(self, run: Path, trial: Trial, slot: int, live: Live | None) -> None:
        self.run, self.trial = run, trial
        self.directory = trial_directory(run, trial.id)
        self._cores = cores_for(slot, trial.clock == "realtime")
        self._live = live
        self.children: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Rig:
        self._sockets = make_socket_folder()
        try:
            low_latency = self.trial.rig.low_latency_link or self.trial.clock == "lockstep"
            self.bus = Bus(self.trial.id, "supervisor", [self._endpoint("supervisor")], [], low_latency)
            self._orders = self.bus.outbox("order", blocking=True)
            self.statuses = self.bus.inbox("status")
            self.bus.announce()
            for role, listens, connects in (
                ("driver", ["driver"], ["supervisor"]),
                ("controller", ["controller"], ["supervisor", "driver"]),
                ("logger", ["logger"], ["supervisor", "driver", "controller"]),
            ):
                self.children[role] = self._start(role, listens, connects)
            if self._live:
                self._live.begin(self.trial.id, self._endpoint("logger"), self._cores["logger"])
        except BaseException:
            self._clean_up()
            raise
        return self

    def _endpoint(self, name: str) -> str:
        return f"unixsock-stream/{self._sockets}/{name[0]}.sock"

    def _start(self, role: str, listens: list[str], connects: list[str]) -> subprocess.Popen[bytes]:
        orders = Orders(
            role, str(self.run.resolve()), self.trial.id, self._sockets,
            tuple(map(self._endpoint, listens)), tuple(map(self._endpoint, connects)),
            self._cores[role], self.trial.clock == "realtime", asdict(self.trial.rig), READY_TIMEOUT, os.getpid(),
        )  # fmt: skip
        return launch(self.directory, role, orders.to_json())

    def order(self, order: str, **details: Any) -> None:
        """Tell all children."""
        self._orders.put(json.dumps({"order": order, **details}).encode())

    def terminate(self, *roles: str) -> None:
        """Ask these processes to end now."""
        for role in roles:
            if self.children[role].poll() is None:
                self.children[role].send_signal(signal.SIGTERM)

    def wait(self, role: str, timeout: float) -> bool:
        """Wait for a process to end; return whether it did."""
        try:
            self.children[role].wait(timeout)
        except subprocess.TimeoutExpired:
            return False
        return True

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._clean_up()

    def _clean_up(self) -> None:
        if self._live:
            self._live.end(self.trial.id)
        for process in self.children.values():
            if process.poll() is None:
                process.kill()
            process.wait()
        if hasattr(self, "bus"):
            self.bus.close()
        shutil.rmtree(self._sockets, ignore_errors=True)


class Watch:
    """Follows one trial from the start of its processes to its outcome."""

    def __init__(self, rig: Rig, report: Callable[[int], None], stop: Callable[[], bool]) -> None:
        self._rig, self._report, self._stop = rig, report, stop
        self._ready: dict[str, dict[str, Any]] = {}
        self._done: dict[str, dict[str, Any]] = {}
        self._verdict: tuple[str, str] | None = None
        self._begun = False
        self._exits: dict[str, float] = {}
        self._missing: set[str] = set()
        self._ticks = 0
        self._heard = time.monotonic()
        self._look_for_tokens = 0.0

    def until_the_end(self) -> Outcome:
        """Return the outcome of the trial."""
        began = time.monotonic()
        if self._all_ready():
            began = self._heard = time.monotonic()
            self._begun = True
            setup = {role: self._ready[role]["setup"] for role in ROLES}
            self._rig.order("go", memory=self._ready["controller"]["memory"], setup=setup)
            self._follow()
        wall = time.monotonic() - began
        channels = self._bring_down()
        outcome, reason = self._verdict or ("completed", "")
        loop_s = self._done.get("driver", {}).get("loop_s")
        return Outcome.of(self._rig.trial, outcome, reason, self._ticks, wall, channels, loop_s)

    def _all_ready(self) -> bool:
        deadline = time.monotonic() + READY_TIMEOUT
        while len(self._ready) < len(ROLES):
            self._look()
            if self._verdict:
                return False
            if time.monotonic() > deadline:
                joined = self._rig.bus.alive()
                missing = [role for role in ROLES if role not in joined] or [r for r in ROLES if r not in self._ready]
                self._conclude("timed_out", f"not ready after {READY_TIMEOUT:g} s: {', '.join(missing)}")
                return False
        return True

    def _follow(self) -> None:
        while "driver" not in self._done and not self._verdict:
            self._look()
            if time.monotonic() - self._heard > SILENCE_TIMEOUT:
                self._conclude("timed_out", f"no progress for {SILENCE_TIMEOUT:g} s after tick {self._ticks}")
            self._check_tokens()

    def _look(self) -> None:
        """Take in what the children said, whether they live, and whether someone wants an end."""
        self._hear()
        now = time.monotonic()
        for role, process in self._rig.children.items():
            gone = process.poll() is not None and role not in self._done
            # What it said last may still be on its way.
            if gone and now - self._exits.setdefault(role, now) > FAREWELL:
                self._lost(role, process.returncode)
        if self._stop():
            self._conclude("aborted", "interrupted")
        time.sleep(STEP)

    def _hear(self) -> None:
        """Take in what the children said."""
        while (item := self._rig.statuses.poll()) is not None:
            self._take(json.loads(item))

    def _take(self, status: dict[str, Any]) -> None:
        role, event = status["role"], status["event"]
        self._heard = time.monotonic()
        if event == "ready":
            self._ready[role] = status
        elif event == "progress":
            self._ticks = status["tick"]
            self._report(self._ticks)
        elif event == "done":
            self._done[role] = status
            if role == "driver":
                self._ticks = status["ticks"]
                # A driver that stopped because its controller ended is not the cause.
                if status["outcome"] == "tripped":
                    self._conclude("tripped", status["reason"])
        else:
            self._conclude("tripped" if event == "tripped" else "failed", f"{role}: {status['reason']}")

    def _lost(self, role: str, code: int) -> None:
        """A process ended without a word."""
        self._done[role] = {}
        if not self._verdict:
            self._conclude("failed", how_it_ended(self._rig.directory, role, code))

    def _check_tokens(self) -> None:
        """Across hosts no exit code tells that a process is gone; its liveliness token does."""
        now = time.monotonic()
        if now < self._look_for_tokens or self._verdict:
            return
        self._look_for_tokens = now + 1.0
        missing = {role for role in ROLES if role not in self._rig.bus.alive() | self._done.keys() | self._exits.keys()}
        # Twice in a row: a token may be late to show where the machine is busy.
        gone, self._missing = missing & self._missing, missing
        if gone:
            self._conclude("failed", f"{', '.join(sorted(gone))} vanished from the bus")

    def _conclude(self, outcome: str, reason: str) -> None:
        """The first verdict stands: what comes after it is its consequence."""
        if self._verdict is None:
            self._verdict = (outcome, reason)

    def _bring_down(self) -> dict[str, Any]:
        """End the children in order, the logger last, and return the logger's account."""
        rig = self._rig
        if self._verdict and self._begun:
            rig.order("stop")
        elif self._verdict:
            rig.terminate(*ROLES)
        patience = PROMPT if self._verdict else GRACE
        for role in ("driver", "controller"):
            if not self._ended(role, patience):
                rig.terminate(role)
                if not self._ended(role, GRACE):
                    rig.children[role].kill()
        if not self._ended("logger", PROMPT if self._verdict else WRITING):
            rig.terminate("logger")
            self._ended("logger", WRITING if self._begun else PROMPT)
        self._hear_all()
        if not self._verdict and self._done.get("driver", {}).get("outcome") != "completed":
            self._conclude("failed", self._done.get("driver", {}).get("reason") or "the driver did not finish")
        return self._done.get("logger", {}).get("channels", {})

    def _hear_all(self) -> None:
        """Wait for the last words of all that have ended, as long as words can take."""
        deadline = time.monotonic() + FAREWELL
        while any(role not in self._done for role in ROLES) and time.monotonic() < deadline:
            self._hear()
            time.sleep(STEP)

    def _ended(self, role: str, timeout: float) -> bool:
        """Wait for a process, listening meanwhile."""
        deadline = time.monotonic() + timeout
        while self._rig.children[role].poll() is None:
            if time.monotonic() > deadline:
                return False
            self._hear()
            time.sleep(STEP)
        self._hear()
        return True
