"""A trial without the bus: both halves and the recorder in one process. The same ticks, the same bits."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from hilrig.core.errors import Stopped
from hilrig.core.signals import Command, Measurement, Truth
from hilrig.experiment.trial import Trial
from hilrig.loop.compiled.trial import Block, CompiledTrial, can_compile, warm_up
from hilrig.loop.tick import Answer, ControlSide, Ending, PlantSide, do_ticks, warm_up_control, warm_up_plant
from hilrig.recording.certificate.durations import Terms
from hilrig.recording.messages.codec import Codec
from hilrig.recording.messages.layouts import definitions, layouts
from hilrig.recording.recorder import TIMING, Recorder
from hilrig.recording.run_directory import trial_directory, write_json
from hilrig.recording.timing import certify
from hilrig.rig.channels import NAMES, RecordBatches
from hilrig.rig.clock import PROGRESS, Pacer
from hilrig.rig.nodes import internals, write
from hilrig.rig.outcome import Outcome

BLOCK = 1024
"""Ticks of a compiled trial between two looks at the clock and for Ctrl-C"""
ROWS = 128
"""Ticks that are recorded at a time where each is done by itself"""


class DirectWire:
    """Hands the measurement to the controller by a call."""

    def __init__(
        self, trial: Trial, control: ControlSide, recorder: Recorder, codecs: Mapping[str, Codec],
        report: Callable[[int], None], stop: Callable[[], bool],
    ) -> None:  # fmt: skip
        self._trial, self._control, self._recorder = trial, control, recorder
        self._report, self._stop = report, stop
        self._pacer = Pacer(trial.period, trial.clock == "realtime", trial.rig.spin)
        self._commands: dict[int, tuple[Command, int]] = {}
        self._acting: tuple[Command | None, int] = (None, 0)
        self._sheets = RecordBatches(codecs, NAMES, ROWS)
        self._row = 0
        self._due = self._woke = self._published = self._applied = 0
        self._acting_tick = -1
        self._next_report = 0
        self.last_answer: Answer
        self.loop_s = 0.0
        """s spent in blocks of ticks, without recording them"""
        self._in_blocks: dict[str, int] = dict.fromkeys(NAMES, 0)

    def wait(self, tick: int) -> None:
        """Wait for the tick's due time. Raises Stopped when told to."""
        self._due = self._pacer.wait(tick)
        self._woke = time.monotonic_ns()
        if self._woke > self._next_report:
            self._next_report = self._woke + PROGRESS
            self._report(tick)
            if self._stop():
                raise Stopped("interrupted")

    def publish(self, tick: int, measurement: Measurement, truth: Truth | None) -> None:
        """Let the controller answer, and record."""
        self._published = time.monotonic_ns()
        self._write("state", tick, measurement)
        if truth is not None:
            self._write("truth", tick, truth)
        self.last_answer = answer = self._control.control(tick, measurement)
        computed = time.monotonic_ns()
        self._commands[tick] = (answer.command, computed)
        self._write("command", tick, answer.command)
        self._write("internals", tick, internals(answer))
        self._write("controller_timing", tick, (self._published, self._published, computed, computed, 0))
        if self._trial.clock == "realtime":
            self._note(tick)

    def command(self, tick: int, wanted: int) -> Command | None:
        """Return the command of tick `wanted`: in one process it is never older."""
        if wanted in self._commands:
            self._acting_tick, self._acting = wanted, self._commands.pop(wanted)
        self._applied = time.monotonic_ns()
        if self._trial.clock == "lockstep":
            self._note(tick)
        return self._acting[0]

    def _note(self, tick: int) -> None:
        """Note when things happened at this tick; record when the batches are full."""
        moments = (self._due, self._woke, self._published, self._acting_tick, self._acting[1], self._applied, 0)
        self._write("driver_timing", tick, moments)
        self._row += 1
        if self._row == ROWS:
            self.record()

    def _write(self, name: str, tick: int, values: tuple[Any, ...]) -> None:
        write(self._sheets.batches[name], self._row, tick, self._trial, values)
        self._sheets.written[name] = self._row + 1

    def record(self, stamps: bool = True) -> None:
        """Record what is on the batches, with the time stamps or without."""
        for name, payloads in self._sheets.hand_over():
            if stamps or name not in TIMING:
                self._recorder.store(name, payloads.copy())  # the next ticks take their place
            else:
                self._sheets.counts[name] = 0
        self._recorder.write()
        self._row = 0

    def publish_block(self, block: Block) -> None:
        """Record a block of ticks."""
        for name, payloads in block.messages():
            self._recorder.store(name, payloads)
            self._in_blocks[name] += payloads.shape[0]
        self._recorder.write()

    def end(self) -> None:
        """Record what is left."""
        self.record()
        for name, count in self._sheets.counts.items():
            self._recorder.sent(name, count + self._in_blocks[name])


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
    codecs = layouts(trial.driver.robot.joints, len(trial.axes), memory)
    plant, control = PlantSide(trial), ControlSide(trial)
    began = time.monotonic()
    terms = Terms(trial.clock, trial.period, trial.actuation_delay)
    with Recorder(directory, trial.period, definitions(memory)) as recorder:
        wire = DirectWire(trial, control, recorder, codecs, report, stop)
        try:
            ending = _ticks(plant, control, wire)
        finally:
            plant.close()
            wire.end()
        summary = recorder.summary()
        timing = certify(terms, trial.timing, recorder.timing())
        write_json(directory / "timing.json", timing)
    return Outcome.of(trial, *ending, time.monotonic() - began, summary, wire.loop_s or None)


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
    wire.record(stamps=False)
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
