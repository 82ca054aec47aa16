"""The life of a plant in one trial: connect, prepare, approach, ticks, retract, hold, close.

Every way out of it goes through `hold`, and then `close`, once each. The stages around the ticks are the plant's own;
the rig measures, checks the safety limits and records at each of their periods, and can end them at any one.
"""

from __future__ import annotations

import math
from typing import Protocol

from hilrig.core.errors import RigError, Stopped, TimedOut, Tripped, describe_error
from hilrig.core.interfaces import Progress
from hilrig.core.signals import still
from hilrig.experiment.trial import Trial
from hilrig.loop.driver_node import DriverNode
from hilrig.loop.ticks import Ending, Wire, do_ticks

STAGES = ("connect", "prepare", "approach", "ticks", "retract", "release")
"""In their order; Stage.msg counts from 0"""


class StageWire(Wire, Protocol):
    """A wire on which the plant's stages are paced and noted."""

    def enter(self, stage: str) -> None:
        """Note that a stage begins."""
        ...

    def wait_in_stage(self, number: int) -> float:
        """Wait for a period of the stage, counted from 0; return the time since the first one, s. Raises Stopped."""
        ...

    def note_stage(self, progress: Progress) -> None:
        """Record and report what the plant does in this period."""
        ...


def live(node: DriverNode, wire: StageWire) -> Ending:
    """Live through a trial and return how it ended.

    Raises PluginError, RigError and whatever a plant raises; the plant is held and closed before. That it could not be
    held is told beside whatever ended the trial.
    """
    try:
        ending = _until_release(node, wire)
    except BaseException as error:
        if stuck := _release(node, wire):
            raise RigError(f"{describe_error(error)}; {stuck}") from error
        raise
    if stuck := _release(node, wire):
        return Ending("failed", f"{ending.reason}; {stuck}" if ending.reason else stuck, ending.ticks)
    return ending


def _release(node: DriverNode, wire: StageWire) -> str:
    """Hold and close the plant; return why that was not possible, empty if it was."""
    wire.enter("release")
    try:
        node.release()
    except RigError as error:
        return str(error)
    return ""


def _until_release(node: DriverNode, wire: StageWire) -> Ending:
    ticks = 0
    try:
        if not node.connected:
            wire.enter("connect")
            node.connect()
        _do_stage(node, wire, "prepare")
        node.require_start(still(len(node.trial.axes)))
        _do_stage(node, wire, "approach")
        wire.enter("ticks")
        ending = do_ticks(node, wire)
        ticks = ending.ticks
        if ending.outcome == "completed":
            _do_stage(node, wire, "retract")
        return ending
    except Tripped as trip:
        return Ending("tripped", str(trip), ticks)
    except TimedOut as late:
        return Ending("timed_out", str(late), ticks)
    except Stopped as stop:
        return Ending("aborted", str(stop), ticks)


def _do_stage(node: DriverNode, wire: StageWire, stage: str) -> None:
    """Do a stage of the plant, if it offers one. Raises Tripped, Stopped, TimedOut, PluginError."""
    steps = node.steps(stage)
    if steps is None:
        return
    wire.enter(stage)
    limit, quiet, progress, number = _limit(node.trial, stage), still(len(node.trial.axes)), Progress(stage), 0
    while True:
        if wire.wait_in_stage(number) > limit:
            raise TimedOut(f"{stage} took more than {limit:g} s (safety.{stage}_timeout): {in_words(progress)}")
        found = node.step(stage, steps, quiet)
        if found is None:
            return
        progress = found
        wire.note_stage(progress)
        number += 1


def _limit(trial: Trial, stage: str) -> float:
    return getattr(trial.limits, f"{stage}_timeout")


def in_words(progress: Progress) -> str:
    """Return what a plant does, in words: "approaching, 1.2 N of 3.5 N"."""
    unit = f" {progress.unit}" if progress.unit else ""
    value = "" if math.isnan(progress.value) else f"{progress.value:.3g}{unit}"
    target = "" if math.isnan(progress.target) else f"{' of' if value else 'to'} {progress.target:.3g}{unit}"
    return f"{progress.what}, {value}{target}" if value or target else progress.what
