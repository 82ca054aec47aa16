"""A trial without the bus: both nodes and the recorder in one process. Same ticks, same bits."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from hilrig.core.errors import Stopped, Tripped
from hilrig.core.interfaces import Progress
from hilrig.experiment.trial import Trial
from hilrig.loop.controller_node import ControllerNode
from hilrig.loop.driver_node import DriverNode
from hilrig.loop.life_cycle import live
from hilrig.loop.ticks import Ending
from hilrig.loop.whole_trial import TrialRows, WholeTrial
from hilrig.recording.certificate.durations import Terms
from hilrig.recording.messages.codec import Codec
from hilrig.recording.messages.layouts import definitions, layouts
from hilrig.recording.messages.record_batch import RecordBatch
from hilrig.recording.recorder import TIMING, Recorder
from hilrig.recording.run_directory import trial_directory, write_json
from hilrig.recording.timing import certify
from hilrig.rig.channels import NAMES, RecordBatches
from hilrig.rig.clock import PROGRESS_NS, Pacer, Timer
from hilrig.rig.memory import LawMemory
from hilrig.rig.outcome import Outcome
from hilrig.rig.rows import FEWEST, HeardCommand, HeardState, controller_rows, driver_rows
from hilrig.rig.warm_up import warm_up_controller, warm_up_driver

BLOCK = 1024
"""Ticks of a compiled trial between two checks of the clock and for Ctrl-C"""
ROWS = 128
"""Ticks that are recorded together when the trial runs tick by tick"""
DRIVER, CONTROLLER = ("state", "truth", "applied"), ("command", "internals")
"""The channels of a block, by the node that writes them"""


class Caller:
    """The caller of the trial: receives its progress and may request its end."""

    def __init__(self, report: Callable[[int], None], stop: Callable[[], bool]) -> None:
        self._report, self._stop = report, stop
        self._next_report_ns = 0

    def look(self, tick: int, now_ns: int) -> None:
        """Report that `tick` comes next, if it is time to. Raises Stopped when told to end.

        That the first tick is done is always reported: what is compiled at its first use is there from then on.
        """
        if now_ns > self._next_report_ns or tick == 1:
            self._next_report_ns = now_ns + PROGRESS_NS
            self._report(tick)
            if self._stop():
                raise Stopped("interrupted")


class DirectWire:
    """Passes each measurement to the controller by a function call, and records the messages."""

    def __init__(self, driver: DriverNode, codecs: Mapping[str, Codec], recorder: Recorder, caller: Caller) -> None:
        trial = driver.trial
        self._driver, self._recorder, self._caller = driver, recorder, caller
        self._period, self._realtime = trial.period, trial.clock == "realtime"
        self._pacer = Pacer(trial.period, self._realtime, trial.rig.spin)
        self._timer = Timer(self._pacer, trial.period)
        self._row = -1
        self._record = RecordBatches(codecs, NAMES, ROWS)
        batches = self._record.batches
        self._state, self._command = batches["state"], batches["command"]
        self._heard_state, self._heard_command = HeardState(codecs), HeardCommand(codecs)
        self._rows = driver_rows(batches)
        driver.bind(self._rows, self._heard_command.acting)
        self._controller = ControllerNode(trial)
        self._controller.bind(self._heard_state.rows, controller_rows(batches))
        self._commands: dict[int, tuple[bytes, int]] = {}
        self._acting, self._computed = -1, 0
        self._due = self._woke = self._published = self._applied = 0
        self._stamps: dict[str, list[tuple[float, ...]]] = {name: [] for name in TIMING}

    def wait(self, tick: int) -> int:
        """Wait for the tick's due time, and return the tick that is due then. Raises Stopped if told to end."""
        self._row = (self._row + 1) % ROWS
        if self._realtime:
            tick, self._due, _ = self._timer.wait(tick)
        else:
            self._due = self._pacer.wait(tick)
        self._woke = time.monotonic_ns()
        self._caller.look(tick, self._woke)
        return tick

    def enter(self, stage: str) -> None:
        """Do nothing: a simulated plant has no stages that take time."""

    def wait_in_stage(self, number: int) -> float:
        """Return the time that the stage has taken, s; nobody waits for a simulated plant."""
        self._caller.look(0, time.monotonic_ns())
        return number * self._period

    def note_stage(self, progress: Progress) -> None:
        """Do nothing."""

    def publish(self, tick: int) -> None:
        """Let the controller answer, and record."""
        row, written = self._row, self._record.written
        self._published = time.monotonic_ns()
        written["state"] = row + 1
        if self._driver.truthful:
            written["truth"] = row + 1
        self._heard_state.read(self._state.framed(row))
        self._controller.answer()
        computed = time.monotonic_ns()
        self._commands[tick] = (self._command.framed(row), computed)
        written["command"] = written["internals"] = row + 1
        time_s = tick * self._period
        self._stamps["controller_timing"].append(
            (tick, time_s, self._published, self._published, computed, computed, 0)
        )
        if self._realtime:
            self._note(tick)

    def take_command(self, tick: int, wanted: int) -> None:
        """Put the command of tick `wanted` into effect; in one process it is never late."""
        if wanted in self._commands:
            message, self._computed = self._commands.pop(wanted)
            self._acting = wanted
            self._heard_command.read(message)
        self._applied = time.monotonic_ns()
        if not self._realtime:
            self._note(tick)

    def _note(self, tick: int) -> None:
        """Write the time stamps of this tick; record when the batches are full."""
        self._stamps["driver_timing"].append((
            tick, tick * self._period, self._due, self._woke, self._published, self._acting, self._computed,
            self._applied, 0, 1, 0,
        ))  # fmt: skip
        if self._row == ROWS - 1:
            self._hand_over()

    def _hand_over(self) -> None:
        self._record.written["applied"] = int(self._rows.changed[0])
        self._rows.changed[0] = 0
        for name, stamps in self._stamps.items():
            self._record.batches[name].write(stamps)
            self._record.written[name] = len(stamps)
            stamps.clear()
        for name, payloads in self._record.hand_over():
            self._recorder.store(name, payloads.copy())  # the next ticks overwrite them
        self._recorder.write()

    def end(self) -> None:
        """Record what is left."""
        self._hand_over()
        for name, count in self._record.counts.items():
            self._recorder.sent(name, count)


class BlockRecorder:
    """Records blocks of ticks. The ticks of a block are not timed individually, so there are no stamps."""

    def __init__(self, codecs: Mapping[str, Codec], recorder: Recorder) -> None:
        self._codecs, self._recorder = codecs, recorder
        self._counts = dict.fromkeys(NAMES, 0)

    def room(self, ticks: int) -> tuple[dict[str, RecordBatch], TrialRows]:
        """Return batches for this many ticks, and their rows."""
        batches = {name: RecordBatch(self._codecs[name], max(ticks, FEWEST)) for name in DRIVER + CONTROLLER}
        return batches, TrialRows(driver_rows(batches), controller_rows(batches))

    def store(self, batches: Mapping[str, RecordBatch], rows: TrialRows) -> None:
        """Record the rows written in a block."""
        written = dict.fromkeys(DRIVER, int(rows.driver.written[0]))
        written |= dict.fromkeys(CONTROLLER, int(rows.controller.written[0]))
        written["applied"] = int(rows.driver.changed[0])
        for name, count in written.items():
            self._recorder.store(name, batches[name].payloads[:count])
            self._counts[name] += count
        self._recorder.write()

    def end(self) -> None:
        """Report how many messages there were."""
        for name, count in self._counts.items():
            self._recorder.sent(name, count)


def run_in_process(
    run: Path,
    trial: Trial,
    report: Callable[[int], None] = lambda tick: None,
    stop: Callable[[], bool] = lambda: False,
) -> Outcome:
    """Run one trial in this process and return its outcome; `report` receives progress, `stop` is polled.

    It runs in blocks if it is in lockstep and its plant offers kernels, otherwise tick by tick.
    """
    directory, caller = trial_directory(run, trial.id), Caller(report, stop)
    if trial.clock == "realtime":
        warm_up_driver(trial)
    driver = DriverNode(trial)
    try:
        driver.connect()
        if trial.clock == "lockstep" and driver.compiled and not driver.staged:
            return _in_blocks(directory, driver, caller)
        return _tick_by_tick(directory, driver, caller)
    finally:
        driver.release()


def _tick_by_tick(directory: Path, driver: DriverNode, caller: Caller) -> Outcome:
    trial = driver.trial
    law_memory = LawMemory(trial.rig.law_memory)
    with law_memory.bounded():
        memory = warm_up_controller(trial)
    codecs = layouts(trial.driver.robot.joints, len(trial.axes), memory)
    began = time.monotonic()
    with Recorder(directory, trial.period, definitions(memory)) as recorder:
        wire = DirectWire(driver, codecs, recorder, caller)
        try:
            with law_memory.bounded():
                ending = live(driver, wire)
        finally:
            wire.end()
        return _outcome(directory, trial, ending, recorder, time.monotonic() - began)


def _in_blocks(directory: Path, driver: DriverNode, caller: Caller) -> Outcome:
    trial = driver.trial
    codecs = layouts(trial.driver.robot.joints, len(trial.axes), {})
    whole, refused, law_memory = WholeTrial(driver), None, LawMemory(trial.rig.law_memory)
    try:
        with law_memory.bounded():
            memory = whole.start(driver_rows({name: RecordBatch(codecs[name], FEWEST) for name in DRIVER}))
    except Tripped as trip:
        memory, refused = {}, Ending("tripped", str(trip), 0)
    with Recorder(directory, trial.period, definitions(memory)) as recorder:
        blocks = BlockRecorder(layouts(trial.driver.robot.joints, len(trial.axes), memory), recorder)
        if refused is None:
            whole.do(0, blocks.room(0)[1])  # compiles or loads the loop before timing starts
        began, loop_s = time.monotonic(), 0.0
        try:
            ending, loop_s = (refused, 0.0) if refused else _do_blocks(whole, blocks, caller, trial, law_memory)
        finally:
            blocks.end()
        return _outcome(directory, trial, ending, recorder, time.monotonic() - began, loop_s)


def _do_blocks(
    whole: WholeTrial, blocks: BlockRecorder, caller: Caller, trial: Trial, law_memory: LawMemory
) -> tuple[Ending, float]:
    """Run all ticks; return how they ended, and the time spent in them without recording, s.

    While a block is computed, a thread records the previous one, except if the law is in Python, which would keep
    waiting for that thread.
    """
    ending, loop_s, recorded = None, 0.0, None
    with ThreadPoolExecutor(1) as thread:
        while ending is None:
            try:
                caller.look(whole.tick, time.monotonic_ns())
            except Stopped as stop:
                ending = Ending("aborted", str(stop), whole.tick)
                break
            block = min(BLOCK if whole.tick else 1, trial.ticks - whole.tick)
            batches, rows = blocks.room(block)
            began = time.monotonic()
            try:
                with law_memory.bounded():
                    ending = whole.do(block, rows)
            finally:
                loop_s += time.monotonic() - began
                earlier, recorded = recorded, thread.submit(blocks.store, batches, rows)
                _wait_for(earlier)
                if whole.in_python:
                    _wait_for(recorded)
    _wait_for(recorded)
    return ending, loop_s


def _wait_for(recorded: Future[None] | None) -> None:
    """Wait until a block is recorded. Raises the error that recording it raised."""
    if recorded is not None:
        recorded.result()


def _outcome(
    directory: Path, trial: Trial, ending: Ending, recorder: Recorder, wall_s: float, loop_s: float = 0.0
) -> Outcome:
    """Write the certificate, and return the outcome."""
    summary = recorder.summary()
    terms = Terms(trial.clock, trial.period, trial.actuation_delay)
    timing = certify(terms, trial.timing, recorder.timing())
    write_json(directory / "timing.json", timing)
    return Outcome.of(trial, *ending, wall_s, summary, loop_s or None)
