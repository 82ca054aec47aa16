"""How a worker is supervised, with a pipe instead of a worker."""

from __future__ import annotations

from collections.abc import Callable
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import pytest
from helpers.builders import trial

from hilrig.rig.outcome import Outcome
from hilrig.rig.worker import _Supervision


class Alive:
    """A process that keeps running; when it is told to end it takes its time."""

    exit_code = None

    def end(self, timeout_s: float, enough: Callable[[], bool]) -> None:
        while not enough():
            pass


@pytest.mark.parametrize("told", [False, True])
def test_a_worker_that_was_told_to_stop_does_no_further_trial(tmp_path: Path, told: bool) -> None:
    """It may end its trial just then: the order to stop is still in the line, where the name of a trial is expected."""
    subject = trial()
    ours, theirs = Pipe()
    with ours, theirs:
        process: Any = Alive()
        supervision = _Supervision(subject, tmp_path, process, ours, lambda tick: None)
        reported = Outcome.of(subject, "completed", "", 200, 1.0, {"state": {"lost": 0}})

        def stop() -> bool:
            theirs.send(reported)
            return told

        assert supervision.outcome(stop) == reported
        assert supervision.reusable is not told
        assert theirs.poll() is told


def test_a_report_that_was_on_its_way_when_the_worker_ended_counts(tmp_path: Path) -> None:
    """The worker reports its outcome, reads the order to stop as the name of a trial, and ends."""
    subject = trial()
    ours, theirs = Pipe()
    with ours, theirs:
        process: Any = Alive()
        reported = Outcome.of(subject, "completed", "", 200, 1.0, {"state": {"lost": 0}})

        def end(timeout_s: float, enough: Callable[[], bool]) -> None:
            theirs.send(reported)
            process.exit_code = 0

        process.end = end
        supervision = _Supervision(subject, tmp_path, process, ours, lambda tick: None)
        assert supervision.outcome(lambda: True) == reported
        assert not supervision.reusable
