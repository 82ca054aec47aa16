"""A trial without the bus: both halves and the recorder in one process. The same ticks, the same bits."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from hilrig.compiled.tick import Block
from hilrig.compiled.trial import CompiledTrial, can_compile, warm_up
from hilrig.errors import Stopped
from hilrig.loop import Answer, ControlSide, Ending, PlantSide, do_ticks, warm_up_control, warm_up_plant
from hilrig.recording.old_timing import summarise_batches
from hilrig.recording.recorder import Recorder
from hilrig.recording.run_directory import trial_directory, write_json
from hilrig.rig.channels import Codecs, Stamps, channels
from hilrig.rig.clock import PROGRESS, Pacer
from hilrig.rig.outcome import Outcome
from hilrig.signals import Command, Measurement, Truth
from hilrig.trial import Trial

BLOCK = 1024
"""Ticks of a compiled trial between two looks at the clock and for Ctrl-C"""


class DirectWire:
    """Hands the measurement to the controller by a call."""

    def __init__(
        self, trial: Trial, control: ControlSide, recorder: Recorder, codecs: Codecs,
        report: Callable[[int], None], stop: Callable[[], bool],
    ) -> None:  # fmt: skip
        self._control, self._recorder, self._codecs = control, recorder, codecs
        self._report, self._stop = report, stop
        self._pacer = Pacer(trial.period, trial.clock == "realtime")
        self._commands: dict[int, Command] = {}
        self._driver_stamps, self._controller_stamps = (
            Stamps("DriverTiming", 5),
            Stamps("ControllerTiming", 4),
        )
        self._moments = (0, 0)
        self._next_report = 0
        self.last_answer: Answer
        self.loop_s = 0.0
        """s spent in blocks of ticks, without recording them"""
        self.sent: dict[str, int] = dict.fromkeys(recorder.summary(), 0)

    def wait(self, tick: int) -> None:
        """Wait for the tick's due time. Raises Stopped when told to."""
        due = self._pacer.wait(tick)
        woke = time.monotonic_ns()
        self._moments = (due, woke)
        if woke > self._next_report:
            self._next_report = woke + PROGRESS
            self._report(tick)
            if self._stop():
                raise Stopped("interrupted")

    def publish(self, tick: int, measurement: Measurement, truth: Truth | None) -> None:
        """Let the controller answer, and record."""
        received = time.monotonic_ns()
        self._store("state", self._codecs.state(tick, measurement))
        if truth is not None:
            self._store("truth", self._codecs.truth(tick, truth))
        self.last_answer = answer = self._control.control(tick, measurement)
        computed = time.monotonic_ns()
        self._store("command", self._codecs.command(tick, answer))
        self._store("internals", self._codecs.internals(tick, answer))
        self._commands[tick] = answer.command
        batch = self._controller_stamps.note(tick, tick, received, computed, time.monotonic_ns())
        self._store("controller_timing", batch)
        self._moments = (*self._moments[:2], received)

    def command(self, tick: int, wanted: int) -> Command | None:
        """Return the command of tick `wanted`: in one process it is never late."""
        batch = self._driver_stamps.note(tick, *self._moments, time.monotonic_ns(), 0)
        self._store("driver_timing", batch)
        return self._commands.pop(wanted, None)

    def forget_times(self) -> None:
        """Drop the times noted so far."""
        self._driver_stamps.flush()
        self._controller_stamps.flush()

    def publish_block(self, block: Block) -> None:
        """Record a block of ticks."""
        for name, ticks, payloads in self._codecs.rows(block):
            self._recorder.store_rows(name, payloads, ticks)
            self.sent[name] += ticks.size
        self._recorder.end_block()

    def end(self) -> None:
        """Record what is left."""
        self._store("driver_timing", self._driver_stamps.flush())
        self._store("controller_timing", self._controller_stamps.flush())
        for name, count in self.sent.items():
            self._recorder.sent(name, count)

    def _store(self, name: str, payload: bytes | None) -> None:
        if payload is not None:
            self._recorder.store(name, payload)
            self.sent[name] += 1


def run_in_process(
    run: Path,
    trial: Trial,
    report: Callable[[int], None] = lambda tick: None,
    stop: Callable[[], bool] = lambda: False,
) -> Outcome:
    """Run one trial in this process and return its outcome; `report` hears of progress, `stop` is asked."""
    directory = trial_directory(run, trial.id)
    warm_up_plant(trial)
    memory = warm_up_control(trial)
    if trial.clock == "lockstep":
        warm_up(trial)
    codecs, plant, control = Codecs(trial, memory), PlantSide(trial), ControlSide(trial)
    began = time.monotonic()
    with Recorder(directory, trial.period, channels(memory)) as recorder:
        wire = DirectWire(trial, control, recorder, codecs, report, stop)
        try:
            ending = _ticks(plant, control, wire)
        finally:
            plant.close()
            wire.end()
        summary = recorder.summary()
        timing = summarise_batches(trial.clock, recorder.timing)
        write_json(directory / "timing.json", {**timing, "loop_s": round(wire.loop_s, 4)})
    return Outcome.of(trial, *ending, time.monotonic() - began, summary)


def _ticks(plant: PlantSide, control: ControlSide, wire: DirectWire) -> Ending:
    """Do all ticks, and tell how they ended: one by one, or in blocks where plant and robot offer kernels."""
    trial = plant.trial
    if trial.clock == "realtime":
        return do_ticks(plant, wire, 0, trial.ticks)
    begun = do_ticks(plant, wire, 0, 1)
    if begun.outcome != "completed":
        return begun
    if not can_compile(plant, control):
        return do_ticks(plant, wire, 1, trial.ticks)
    return _blocks(CompiledTrial(plant, control, wire.last_answer), wire)


def _blocks(compiled: CompiledTrial, wire: DirectWire) -> Ending:
    """Do the ticks after the first one in blocks. No tick has a time of its own then, so none is recorded.

    While a block is computed, a thread records the one before it; unless the law is in Python, which would have to wait
    for that thread at every turn.
    """
    wire.forget_times()
    ending, recorded = None, None
    with ThreadPoolExecutor(1) as thread:
        while ending is None:
            try:
                wire.wait(compiled.tick)
            except Stopped as stop:
                ending = Ending("aborted", str(stop), compiled.tick)
                break
            before = compiled.recent
            began = time.monotonic()
            try:
                ending = compiled.do(BLOCK)
            finally:
                wire.loop_s += time.monotonic() - began
                earlier = recorded
                if compiled.recent is not before:  # else it was stopped on the threshold
                    recorded = thread.submit(wire.publish_block, compiled.recent)
                if earlier is not None:
                    earlier.result()
                if compiled.in_python and recorded is not None:
                    recorded.result()
    if recorded is not None:
        recorded.result()
    return ending
