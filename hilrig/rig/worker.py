"""Runs trials without the bus in a separate process, and watches that process: a law is a guest, and may hang."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path

from hilrig.experiment.trial import Trial
from hilrig.recording.run_directory import trial_directory
from hilrig.rig.cores import cores_for
from hilrig.rig.outcome import Outcome
from hilrig.rig.processes import (
    KILL_TIMEOUT_S,
    READY_TIMEOUT_S,
    SILENCE_TIMEOUT_S,
    TERM_TIMEOUT_S,
    ChildProcess,
    Stopwatch,
    log_of,
)

ROLE = "worker"
LISTEN_S = 0.05
"""How long to listen to the worker between two checks of whether it is alive and whether its trial must be aborted"""


class Worker:
    """A process that runs trials one after the other with `run_in_process`; `slot` decides which core it gets.

    Without a slot it may use all cores: while it computes, it records on another one.

    It is started for the first trial, and again after a trial that it did not end itself. One process runs many trials
    because starting it takes seconds, and a compiled trial only a fraction of a second.
    """

    def __init__(self, run: Path, slot: int | None) -> None:
        self._run, self._slot = run, slot
        self._process: ChildProcess | None = None
        self._line: Connection | None = None

    def do(self, trial: Trial, report: Callable[[int], None], stop: Callable[[], bool]) -> Outcome:
        """Run one trial and return its outcome."""
        directory = trial_directory(self._run, trial.id)
        if self._process is None or self._line is None or self._process.exit_code is not None:
            self._process, self._line = self._start(directory)
        supervision = _Supervision(trial, directory, self._process, self._line, report)
        kept = False
        try:
            self._line.send(trial.id)
            outcome = supervision.outcome(stop)
            kept = supervision.reusable
        finally:
            if not kept:
                self.close()
        return outcome

    def _start(self, directory: Path) -> tuple[ChildProcess, Connection]:
        self.close()
        ours, theirs = Pipe()
        with theirs:
            cores = () if self._slot is None else cores_for(self._slot)["driver"]
            orders = {
                "run": str(self._run.resolve()), "line": theirs.fileno(), "cores": cores, "parent": os.getpid(),
            }  # fmt: skip
            process = ChildProcess.start(
                "the worker process", f"hilrig.rig.{ROLE}_process", json.dumps(orders), log_of(directory, ROLE),
                [theirs.fileno()],
            )  # fmt: skip
            return process, ours

    def close(self) -> None:
        """Kill the process, if there is one."""
        if self._process is not None:
            self._process.kill()
        if self._line is not None:
            self._line.close()
        self._process = self._line = None


class _Supervision:
    """Follows one trial in a worker to its outcome."""

    def __init__(
        self, trial: Trial, directory: Path, process: ChildProcess, line: Connection, report: Callable[[int], None]
    ) -> None:
        self._trial, self._directory, self._process, self._line = trial, directory, process, line
        self._report = report
        self._silence = Stopwatch()
        self._began: float | None = None
        self._ticks = 0
        self._reported: Outcome | None = None
        """The outcome, as the worker reported it"""
        self._told_to_stop = False

    @property
    def reusable(self) -> bool:
        """Whether the worker can take another trial: it reported an outcome, and was not told to stop.

        A stop that it has not read yet would be taken for the name of its next trial.
        """
        return self._reported is not None and not self._told_to_stop

    def outcome(self, stop: Callable[[], bool]) -> Outcome:
        """Follow the trial to its end; return the outcome that the worker reported, or why it reported none."""
        while self._listen():
            if stop():
                return self._cut_short("aborted", "interrupted")
            if hung := self._hung():
                return self._cut_short("timed_out", hung)
        if self._reported is not None:
            return self._reported
        self._process.wait(KILL_TIMEOUT_S)
        log = log_of(self._directory, ROLE)
        return self._without_report("failed", f"{self._process.how_it_ended(log)} (see {log})")

    def _listen(self) -> bool:
        """Handle at most one message that the worker sends within `LISTEN_S`; return whether more will come."""
        try:
            if self._line.poll(LISTEN_S):
                self._take(self._line.recv())
            elif self._process.exit_code is not None:
                return self._line.poll()
        except (EOFError, OSError):  # OSError: it ended without reading everything we sent
            return False
        return self._reported is None

    def _take(self, said: Outcome | int) -> None:
        self._silence.restart()
        if isinstance(said, Outcome):
            self._reported = said
        else:
            self._began = time.monotonic() if self._began is None else self._began
            self._ticks = said
            self._report(said)

    def _hung(self) -> str:
        """Return why the worker counts as hung; empty if it does not."""
        silent = self._silence.look()
        if self._ticks == 0:  # what is compiled at its first use may take long, as the law's start may
            return f"not ready after {READY_TIMEOUT_S:g} s: {ROLE}" if silent > READY_TIMEOUT_S else ""
        if silent > SILENCE_TIMEOUT_S:
            return f"no progress for {SILENCE_TIMEOUT_S:g} s after tick {self._ticks}"
        return ""

    def _cut_short(self, outcome: str, reason: str) -> Outcome:
        """End the trial, with a complete record if possible: the worker is asked to stop before it gets a signal."""
        self._told_to_stop = True
        with suppress(OSError):
            self._line.send("stop")
        self._process.end(TERM_TIMEOUT_S, enough=lambda: not self._listen())
        while self._process.exit_code is not None and self._listen():
            pass  # its report may still be in transit
        reported = self._reported
        if reported is None:
            return self._without_report(outcome, reason)
        return replace(reported, outcome=outcome, reason=reason) if reported.outcome == "aborted" else reported

    def _without_report(self, outcome: str, reason: str) -> Outcome:
        wall_s = 0.0 if self._began is None else time.monotonic() - self._began
        return Outcome.of(self._trial, outcome, reason, self._ticks, wall_s, {})
