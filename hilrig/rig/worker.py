"""Runs trials without the bus in a process beside this one, so that several can go on at once, and watches over it."""

from __future__ import annotations

import json
import os
import subprocess
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
from hilrig.rig.launching import how_it_ended, launch
from hilrig.rig.outcome import Outcome
from hilrig.rig.supervisor import GRACE, READY_TIMEOUT, SILENCE_TIMEOUT

ROLE = "worker"
LOOK = 0.05
"""s between two looks whether the worker lives, and whether someone wants an end"""


class Worker:
    """A process that runs one trial after the other as `run_in_process` does; `slot` says which core it is given.

    It is started for the first trial, and anew after a trial that it did not end itself. One process for many trials:
    to start one takes seconds, and a compiled trial a fraction of one.
    """

    def __init__(self, run: Path, slot: int) -> None:
        self._run, self._slot = run, slot
        self._process: subprocess.Popen[bytes] | None = None
        self._line: Connection | None = None

    def do(self, trial: Trial, report: Callable[[int], None], stop: Callable[[], bool]) -> Outcome:
        """Run one trial and return its outcome."""
        directory = trial_directory(self._run, trial.id)
        if self._process is None or self._line is None or self._process.poll() is not None:
            self._process, self._line = self._start(directory)
        watch = _Watch(trial, directory, self._process, self._line, report)
        kept = False
        try:
            self._line.send(trial.id)
            outcome = watch.until_the_end(stop)
            kept = watch.ended_by_itself
        finally:
            if not kept:
                self.close()
        return outcome

    def _start(self, directory: Path) -> tuple[subprocess.Popen[bytes], Connection]:
        self.close()
        ours, theirs = Pipe()
        with theirs:
            orders = {
                "run": str(self._run.resolve()), "line": theirs.fileno(), "cores": cores_for(self._slot)["driver"],
                "parent": os.getpid(),
            }  # fmt: skip
            return launch(directory, ROLE, json.dumps(orders), [theirs.fileno()]), ours

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        if self._line is not None:
            self._line.close()
        self._process = self._line = None


class _Watch:
    """Follows one worker from its start to its outcome."""

    def __init__(
        self, trial: Trial, directory: Path, process: subprocess.Popen[bytes], line: Connection,
        report: Callable[[int], None],
    ) -> None:  # fmt: skip
        self._trial, self._directory, self._process, self._line = trial, directory, process, line
        self._report = report
        self._heard = time.monotonic()
        self._began: float | None = None
        self._ticks = 0
        self._said: Outcome | None = None
        """The outcome, from the worker itself"""
        self._told = False

    @property
    def ended_by_itself(self) -> bool:
        """Whether the worker said how the trial ended, and was told nothing that it would take for its next trial."""
        return self._said is not None and not self._told

    def until_the_end(self, stop: Callable[[], bool]) -> Outcome:
        """Return the outcome of the trial: the worker's own, or why it has none."""
        while self._listen(LOOK):
            if stop():
                return self._cut_short("aborted", "interrupted")
            if hung := self._hung():
                return self._cut_short("timed_out", hung)
        if self._said is not None:
            return self._said
        self._process.wait()
        return self._without_a_word("failed", how_it_ended(self._directory, ROLE, self._process.returncode))

    def _listen(self, timeout: float) -> bool:
        """Take in what the worker says within `timeout`, one thing at most; return whether there is more to come."""
        try:
            if self._line.poll(timeout):
                self._take(self._line.recv())
            elif self._process.poll() is not None:
                return self._line.poll()
        except (EOFError, OSError):  # OSError: it left something of ours unread
            return False
        return self._said is None

    def _take(self, said: Outcome | int) -> None:
        self._heard = time.monotonic()
        if isinstance(said, Outcome):
            self._said = said
        else:
            self._began = self._heard if self._began is None else self._began
            self._ticks = said
            self._report(said)

    def _hung(self) -> str:
        """Return in words that the worker has hung; empty if it has not."""
        limit = READY_TIMEOUT if self._began is None else SILENCE_TIMEOUT
        if time.monotonic() - self._heard <= limit:
            return ""
        when = f"no progress for {limit:g} s after tick {self._ticks}"
        return f"not ready after {limit:g} s: {ROLE}" if self._began is None else when

    def _cut_short(self, outcome: str, reason: str) -> Outcome:
        """End the trial, so that its record is whole if that can be; the worker is asked first, then told."""
        self._told = True
        for tell in (lambda: self._line.send("stop"), self._process.terminate):
            with suppress(OSError):
                tell()
            deadline = time.monotonic() + GRACE
            while time.monotonic() < deadline and self._listen(LOOK):
                pass
        said = self._said
        if said is None:
            return self._without_a_word(outcome, reason)
        return replace(said, outcome=outcome, reason=reason) if said.outcome == "aborted" else said

    def _without_a_word(self, outcome: str, reason: str) -> Outcome:
        wall = 0.0 if self._began is None else time.monotonic() - self._began
        return Outcome.of(self._trial, outcome, reason, self._ticks, wall, {})
