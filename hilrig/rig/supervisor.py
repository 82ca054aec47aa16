"""Starts the processes of one trial, watches them, and makes sure that none remains."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hilrig.experiment.trial import Trial
from hilrig.loop.driver_node import LOOK_AT_THE_ARM
from hilrig.recording.run_directory import read_driver_record
from hilrig.recording.timing import add_refused
from hilrig.rig.child import HALTED
from hilrig.rig.live import Live
from hilrig.rig.outcome import Outcome
from hilrig.rig.processes import READY_TIMEOUT_S, SILENCE_TIMEOUT_S, TERM_TIMEOUT_S, Stopwatch, pause
from hilrig.rig.trial_processes import ROLES, Rig

LAST_WORDS_TIMEOUT_S = 0.5
"""How long the last message of an ended process may take to arrive"""
STOP_TIMEOUT_S = 1.0
"""How long a process may take to end by itself when a trial is cut short, before it gets SIGTERM"""
WRITE_TIMEOUT_S = 60.0
"""How long the logger may take to write its remaining messages"""
MOST_HEARD = 1000
"""Messages that are handled between two looks at the children"""
_STAGE_WORDS = {"connect": "connecting", "prepare": "preparing", "approach": "approaching", "retract": "retracting"}
TOKENS_S = 1.0
"""Time between two checks of the liveliness tokens"""


def run_on_bus(
    run: Path,
    trial: Trial,
    report: Callable[[int], None] = lambda tick: None,
    stop: Callable[[], bool] = lambda: False,
    slot: int = 0,
    live: Live | None = None,
    doing: Callable[[str], None] = lambda words: None,
) -> Outcome:
    """Run one trial in three fresh processes over the bus and return its outcome.

    `report` is called with the tick that the trial has reached, `stop` is polled for an abort, `slot` decides which
    cores the processes get, `live` receives the endpoint where the trial can be watched, and `doing` is told in words
    what the plant does before and after the ticks.
    """
    with Rig(run, trial, slot, live) as rig:
        return Supervision(rig, report, stop, doing).outcome()


class Supervision:
    """Follows one trial from the start of its processes to its outcome."""

    def __init__(
        self, rig: Rig, report: Callable[[int], None], stop: Callable[[], bool], doing: Callable[[str], None]
    ) -> None:
        self._rig, self._report, self._stop, self._doing = rig, report, stop, doing
        self._ready: dict[str, dict[str, Any]] = {}
        self._done: dict[str, dict[str, Any]] = {}
        self._verdict: tuple[str, str] | None = None
        self._begun = False
        self._exits: dict[str, float] = {}
        self._missing: set[str] = set()
        self._ticks = 0
        self._stage = "connect"
        self._silence = Stopwatch()
        self._next_look_for_tokens = 0.0

    def outcome(self) -> Outcome:
        """Follow the trial to its end and return its outcome."""
        began = time.monotonic()
        if self._all_ready():
            began = time.monotonic()
            self._silence.restart()
            self._begun = True
            setup = {role: self._ready[role]["setup"] for role in ROLES}
            self._rig.order("go", memory=self._ready["controller"]["memory"], setup=setup)
            self._follow()
        wall_s = time.monotonic() - began
        channels = self._bring_down()
        add_refused(self._rig.directory / "timing.json", "status", self._rig.statuses.refused)
        outcome, reason = self._verdict or ("completed", "")
        record = self._done.get("driver") or read_driver_record(self._rig.directory)
        told = {name: record.get(name) for name in ("loop_s", "stages", "held_command_age_s")}
        return Outcome.of(self._rig.trial, outcome, reason, self._ticks, wall_s, channels, **told)

    def _all_ready(self) -> bool:
        waited = Stopwatch()
        while len(self._ready) < len(ROLES):
            self._look()
            if self._verdict:
                return False
            if waited.look() > READY_TIMEOUT_S:
                joined = self._rig.bus.alive()
                missing = [role for role in ROLES if role not in joined] or [r for r in ROLES if r not in self._ready]
                self._conclude("timed_out", f"not ready after {READY_TIMEOUT_S:g} s: {', '.join(missing)}")
                return False
        return True

    def _follow(self) -> None:
        while "driver" not in self._done and not self._verdict:
            self._look()
            limit = READY_TIMEOUT_S if self._stage == "connect" else SILENCE_TIMEOUT_S
            if self._silence.look() > limit:
                where = f"in the stage '{self._stage}'" if self._stage != "ticks" else f"after tick {self._ticks}"
                self._conclude("timed_out", f"no progress for {limit:g} s {where}")
            self._check_tokens()

    def _look(self) -> None:
        """Handle the children's messages, check that they are alive, and check whether to abort the trial."""
        self._hear()
        now = time.monotonic()
        for role, child in self._rig.children.items():
            gone = child.exit_code is not None and role not in self._done
            # Its last message may still be in transit.
            if gone and now - self._exits.setdefault(role, now) > LAST_WORDS_TIMEOUT_S:
                self._lost(role)
        if self._stop():
            self._conclude("aborted", "interrupted")
        pause()

    def _hear(self) -> None:
        """Handle the children's messages; one that cannot be read is counted as refused."""
        for _ in range(MOST_HEARD):
            item = self._rig.statuses.poll()
            if item is None:
                return
            try:
                status = json.loads(item)
                self._take(status["role"], status["event"], status)
            except (ValueError, KeyError, TypeError):
                self._rig.statuses.refuse()

    def _take(self, role: str, event: str, status: dict[str, Any]) -> None:
        self._silence.restart()
        if role == "driver" and LOOK_AT_THE_ARM in status.get("reason", ""):
            self._verdict = None  # whatever ended the trial, this matters more; the driver's reason names both
        if event == "ready":
            self._ready[role] = status
        elif event == "progress":
            self._ticks = status["tick"]
            self._report(self._ticks)
        elif event == "stage":
            self._stage = status["stage"]
            self._doing(_STAGE_WORDS.get(self._stage, ""))
        elif event == "doing":
            self._doing(status["words"])
        elif event == "done":
            self._done[role] = status
            if role == "driver":
                self._ticks = status["ticks"]
                halted = HALTED in status["reason"]
                if halted:  # the program was told to stop at the same time
                    self._verdict = None
                # If the driver stopped because its controller ended, the driver is not the cause.
                if status["outcome"] in ("tripped", "timed_out", "failed") or halted:
                    self._conclude(status["outcome"], status["reason"])
        else:
            self._conclude("tripped" if event == "tripped" else "failed", f"{role}: {status['reason']}")

    def _lost(self, role: str) -> None:
        """Note that a process ended without reporting it."""
        self._done[role] = {}
        self._conclude("failed", self._rig.how_it_ended(role))

    def _check_tokens(self) -> None:
        """Check the liveliness tokens: across hosts no exit code shows that a process is gone."""
        now = time.monotonic()
        if now < self._next_look_for_tokens or self._verdict:
            return
        self._next_look_for_tokens = now + TOKENS_S
        missing = {role for role in ROLES if role not in self._rig.bus.alive() | self._done.keys() | self._exits.keys()}
        # Twice in a row: on a busy machine a token may appear late.
        gone, self._missing = missing & self._missing, missing
        if gone:
            self._conclude("failed", f"{', '.join(sorted(gone))} vanished from the bus")

    def _conclude(self, outcome: str, reason: str) -> None:
        """Set the verdict unless there is one already: later problems are consequences of the first.

        The watchdog in the driver is faster than the last words of a process that has died, so these are added.
        """
        if self._verdict is None:
            gone = [
                self._rig.how_it_ended(role)
                for role, child in self._rig.children.items()
                if outcome == "tripped" and child.failed and role not in self._done
            ]
            self._verdict = (outcome, "; ".join([reason, *gone]))

    def _bring_down(self) -> dict[str, Any]:
        """End the children in order, the logger last, and return the logger's report of what it stored."""
        children = self._rig.children
        if self._verdict and self._begun:
            self._rig.order("stop")
        elif self._verdict:
            for child in children.values():
                child.terminate()
        stop_s, patience_s = self._rig.stop_time_s, STOP_TIMEOUT_S if self._verdict else TERM_TIMEOUT_S
        children["driver"].wait(stop_s + patience_s, self._listen)
        # Before the driver is forced: it may be waiting on a link that a stopped controller does not read.
        children["controller"].end(0.0 if self._verdict else patience_s, enough=self._listen)
        children["driver"].end(stop_s, stop_s + TERM_TIMEOUT_S, self._listen)
        children["logger"].end(
            STOP_TIMEOUT_S if self._verdict else WRITE_TIMEOUT_S,
            WRITE_TIMEOUT_S if self._begun else STOP_TIMEOUT_S,
            self._listen,
        )
        self._hear_last_words()
        if not self._verdict and self._done.get("driver", {}).get("outcome") != "completed":
            self._conclude("failed", self._done.get("driver", {}).get("reason") or "the driver did not finish")
        return self._done.get("logger", {}).get("channels", {})

    def _listen(self) -> bool:
        """Handle the children's messages while waiting for one of them; no message ends the wait."""
        self._hear()
        return pause()

    def _hear_last_words(self) -> None:
        """Wait for the last messages of the processes that have ended, `LAST_WORDS_TIMEOUT_S` at most."""
        deadline = time.monotonic() + LAST_WORDS_TIMEOUT_S
        self._hear()
        while any(role not in self._done for role in ROLES) and time.monotonic() < deadline:
            self._listen()
