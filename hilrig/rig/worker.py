"""Runs a trial without the bus in a process of its own, so that several can go on at once, and watches over it."""

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

from hilrig.recording.run_directory import trial_directory
from hilrig.rig.cores import cores_for
from hilrig.rig.launching import how_it_ended, launch
from hilrig.rig.outcome import Outcome
from hilrig.rig.supervisor import GRACE, READY_TIMEOUT, SILENCE_TIMEOUT
from hilrig.trial import Trial

ROLE = "worker"
LOOK = 0.05
"""s between two looks whether the worker lives, and whether someone wants an end"""


def run_in_worker(
    run: Path, trial: Trial, report: Callable[[int], None], stop: Callable[[], bool], slot: int
) -> Outcome:
    """Run one trial as `run_in_process` does, in a fresh process; `slot` says which core it is given."""
    directory = trial_directory(run, trial.id)
    ours, theirs = Pipe()
    with ours:
        with theirs:
            orders = {
                "run": str(run.resolve()), "trial": trial.id, "line": theirs.fileno(),
                "cores": cores_for(slot)["driver"], "parent": os.getpid(),
            }  # fmt: skip
            process = launch(directory, ROLE, json.dumps(orders), [theirs.fileno()])
        try:
            return _Watch(trial, directory, process, ours, report).until_the_end(stop)
        finally:
            process.kill()
            process.wait()


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
