"""How a worker is watched, without one."""

from __future__ import annotations

from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import pytest
from helpers.builders import trial

from hilrig.rig.outcome import Outcome
from hilrig.rig.worker import _Watch


class Alive:
    """A process that goes on."""

    def poll(self) -> None:
        return None

    def terminate(self) -> None:
        """Told to end; it takes its time."""


@pytest.mark.parametrize("told", [False, True])
def test_a_worker_that_was_told_to_stop_does_no_further_trial(tmp_path: Path, told: bool) -> None:
    """It may end its trial just then: what it was told is still in the line, and would be the name of its next one."""
    subject = trial()
    ours, theirs = Pipe()
    with ours, theirs:
        process: Any = Alive()
        watch = _Watch(subject, tmp_path, process, ours, lambda tick: None)
        said = Outcome.of(subject, "completed", "", 200, 1.0, {"state": {"lost": 0}})

        def stop() -> bool:
            theirs.send(said)
            return told

        assert watch.until_the_end(stop) == said
        assert watch.ended_by_itself is not told
        assert theirs.poll() is told
