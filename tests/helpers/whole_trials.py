"""Whole trials in blocks of ticks, in memory, and their messages."""

from __future__ import annotations

from helpers.in_memory import memory_of
from helpers.plain_loop import Passed
from hilrig.core.errors import Tripped
from hilrig.experiment.trial import Trial
from hilrig.loop.driver_node import DriverNode
from hilrig.loop.ticks import Ending
from hilrig.loop.whole_trial import TrialRows, WholeTrial
from hilrig.recording.messages.layouts import layouts
from hilrig.recording.messages.record_batch import RecordBatch
from hilrig.rig.rows import controller_rows, driver_rows

CHANNELS = ("state", "truth", "command", "internals")


class Blocks:
    """A whole trial done in blocks, and its messages."""

    def __init__(self, subject: Trial, sizes: dict[str, int]) -> None:
        self._codecs = layouts(2, 2, sizes)
        node = DriverNode(subject)
        node.connect()
        self.trial = WholeTrial(node)
        self.passed = Passed()

    def start(self) -> None:
        self.trial.start(
            driver_rows({name: RecordBatch(self._codecs[name], 2) for name in ("state", "truth", "applied")})
        )

    def do(self, ticks: int) -> Ending | None:
        batches = {name: RecordBatch(self._codecs[name], max(ticks, 2)) for name in (*CHANNELS, "applied")}
        rows = TrialRows(driver_rows(batches), controller_rows(batches))
        try:
            return self.trial.do(ticks, rows)
        finally:
            for name in CHANNELS:
                node = rows.driver if name in ("state", "truth") else rows.controller
                getattr(self.passed, name).extend(batches[name].message(row) for row in range(node.written[0]))


def run_in_blocks(subject: Trial, sizes: dict[str, int], block: int) -> tuple[Passed, Ending]:
    """Run a trial in blocks of so many ticks; return its messages and how it ended."""
    blocks, ending = Blocks(subject, sizes), None
    try:
        blocks.start()
    except Tripped as trip:
        ending = Ending("tripped", str(trip), 0)
    while ending is None:
        ending = blocks.do(block)
    blocks.passed.reason = ending.reason
    return blocks.passed, ending


def pass_whole(subject: Trial, block: int = 37) -> Passed:
    """Run a trial in blocks of so many ticks; return its messages."""
    return run_in_blocks(subject, memory_of(subject), block)[0]
