"""The driver process: plant, clock of the trial, and the bus."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping
from typing import Any

from hilrig.core.errors import Stopped
from hilrig.core.interfaces import Progress
from hilrig.loop.driver_node import DriverNode
from hilrig.loop.life_cycle import in_words, live
from hilrig.recording.messages.codec import Codec
from hilrig.recording.messages.layouts import layouts
from hilrig.recording.run_directory import DRIVER_RECORD, trial_directory, write_json
from hilrig.rig.channels import DRIVER_CHANNELS, RecordSender
from hilrig.rig.child import Child, main
from hilrig.rig.clock import NANOSECONDS, PROGRESS_NS, Pacer, Samples, Timer
from hilrig.rig.command_receiver import Arrival, BlockingCommandReceiver, CommandReceiver
from hilrig.rig.faults import Injector
from hilrig.rig.frames import TickScreen
from hilrig.rig.rows import HeardCommand, driver_rows
from hilrig.rig.stage_record import StageRecord
from hilrig.rig.warm_up import warm_up_driver
from hilrig.rig.watchdog import CommandAge, Watchdog

UNANSWERED = 100
"""Ticks without an answer in real time, after which only one measurement in this many is sent: about 250 unread ones
fill the socket buffer of a process that does not read, and then the link makes the driver wait, dropping or not"""


class BusWire:
    """The driver's end of the bus."""

    __slots__ = (
        "_acting", "_age", "_applied", "_certified", "_child", "_commands", "_due", "_heard", "_injector", "_last",
        "_next_report", "_node", "_outbox", "_pacer", "_period", "_published", "_realtime", "_received", "_record",
        "_resumed", "_row", "_rows", "_sample", "_sampled", "_screen", "_signals", "_stages", "_state", "_timer",
        "_waiting", "_watchdog", "_woke",
    )  # fmt: skip
    # CPython looks up the attributes of an instance with more than 29 of them more slowly: 0.4 us per tick.

    def __init__(self, child: Child, node: DriverNode, codecs: Mapping[str, Codec], injector: Injector | None) -> None:
        trial = node.trial
        self._child, self._node, self._injector = child, node, injector
        self._signals, self._sample = child.signals, node.arrays.observation.sample
        self._period, self._realtime = trial.period, trial.clock == "realtime"
        self._pacer = Pacer(trial.period, self._realtime, trial.rig.spin)
        outbox = child.bus.tick_outbox("state", blocking=not self._realtime)
        self._outbox = outbox if injector is None else injector.outbox(outbox)
        lead = child.bus.lead("command", "controller")
        self._screen = TickScreen(lead, codecs["command"].size)
        inbox = child.bus.tick_inbox("command")
        self._commands = (
            CommandReceiver(inbox, self._screen)
            if self._realtime
            else BlockingCommandReceiver(inbox, self._screen, child.signals)
        )
        self._record = RecordSender(child.record(), codecs, DRIVER_CHANNELS, {"state": outbox.lead}, self._realtime)
        self._state = self._record.batches["state"]
        self._stages = StageRecord(self._record, trial.period)
        self._certified = child.settings.certificate
        self._resumed = child.resume_monitor
        self._heard = HeardCommand(codecs, lead)
        self._rows = driver_rows(self._record.batches)
        node.bind(self._rows, self._heard.acting)
        self._waiting: deque[Arrival] = deque()
        self._acting, self._received = -1, 0
        self._row, self._last = -1, self._record.rows - 1
        self._due = self._sampled = 0
        self._woke = self._published = self._applied = 0
        self._next_report = 0
        self._timer: Timer | Samples = Timer(self._pacer, trial.period)
        self._age = CommandAge(trial)
        self._watchdog = Watchdog(node, self._age.limit_s, lambda why: child.tell("tripped", reason=why))

    def enter(self, stage: str) -> None:
        """Tell the supervisor that a stage begins. The watchdog watches from the first one that moves the plant."""
        self._child.tell("stage", stage=stage)
        self._stages.enter(stage)
        if stage == "release":
            self._watchdog.stop()
        elif stage != "connect" and self._realtime:
            self._watchdog.start()
        if stage == "ticks" and self._realtime:
            await_sample = getattr(self._node.plant, "await_sample", None)
            if await_sample is not None and self._node.trial.rig.pace == "samples":
                self._timer = Samples(await_sample, self._period, self._age.sample_limit_s)

    def wait_in_stage(self, number: int) -> float:
        """Wait for a period of a stage; return the time since its first one, s. Raises Stopped, Tripped."""
        self._pacer.wait(number)
        self._watchdog.stroke(time.monotonic_ns())
        self._watchdog.check()
        self._check_orders()
        return self._stages.elapsed()

    def note_stage(self, progress: Progress) -> None:
        """Record and report what the plant does."""
        self._stages.note(self._node, progress)
        if (now := time.monotonic_ns()) > self._next_report:
            self._next_report = now + PROGRESS_NS
            self._child.tell("doing", words=in_words(progress))

    def wait(self, tick: int) -> int:
        """Wait until the tick is due; report progress and check for orders now and then."""
        self._row = 0 if self._row == self._last else self._row + 1
        if self._realtime:
            begun = self._timer.wait(tick)
            self._woke = woke = time.monotonic_ns()
            self._due, self._sampled = begun.due, begun.sampled
            self._age.begin(begun.tick, begun.tick - tick, woke)
            self._watchdog.stroke(woke)
            tick = begun.tick
        else:
            self._due = self._woke = woke = time.monotonic_ns()
        if woke > self._next_report:
            self._next_report = woke + PROGRESS_NS
            self._child.tell("progress", tick=tick)
            self._check_orders()
        if self._signals.told:
            self._signals.check()
        if self._injector is not None:
            self._injector.stall(tick)
        return tick

    def _check_orders(self) -> None:
        self._child.signals.check()
        if self._child.told_to_stop():
            raise Stopped("by order")

    def publish(self, tick: int) -> None:
        """Send the state from its batch."""
        row = self._row
        self._screen.newest = tick
        if self._realtime and tick % UNANSWERED and tick - self._acting > UNANSWERED:
            self._published = 0
        else:
            message = self._state.framed(row)
            self._published = time.monotonic_ns()
            self._outbox.put(message)
        self._record.written["state"] = row + 1
        if self._node.truthful:
            self._record.written["truth"] = row + 1
        if self._realtime:
            self._note(tick)

    def take_command(self, tick: int, wanted: int) -> None:
        """Put the command for this period into effect; in real time the last one stays when the wanted one is late."""
        self._collect(wanted)
        self._applied = time.monotonic_ns()
        if self._realtime:
            self._watchdog.check()
            self._age.check(tick, self._acting, self._applied, self._node.fresh)
        else:
            self._note(tick)

    def _collect(self, wanted: int) -> None:
        """Put into effect the newest command that is not newer than `wanted`."""
        while self._waiting and self._waiting[0][0] <= wanted:
            self._apply(*self._waiting.popleft())
        while self._acting < wanted and not self._waiting:
            arrival = self._commands.take()
            if arrival is None:
                return
            tick, received, message = arrival
            if not message:
                raise Stopped("the controller ended first")
            if tick <= wanted:
                self._apply(tick, received, message)
            else:
                self._waiting.append(arrival)

    def _apply(self, tick: int, received: int, message: bytes) -> None:
        self._acting, self._received = tick, received
        self._heard.read(message)

    def _note(self, tick: int) -> None:
        """Write the time stamps of this tick; hand over the record when the batches are full."""
        if self._certified:
            stamp, fresh = self._sample.tolist()
            sampled = self._sampled if stamp != stamp else round(stamp * NANOSECONDS)  # nan: the plant does not say
            self._record.stamps.append((
                tick, tick * self._period, self._due, self._woke, self._published, self._acting, self._received,
                self._applied, sampled, fresh != 0.0 or tick == 0, self._resumed.last,
            ))  # fmt: skip
        if self._row == self._last:
            self._ship()

    def _ship(self) -> None:
        self._record.written["applied"] = int(self._rows.changed[0])
        self._rows.changed[0] = 0
        self._record.ship()

    def rehearse(self) -> None:
        """Send what nobody reads."""
        self._record.rehearse()

    def end(self) -> None:
        """Send the remaining messages and mark the end."""
        self._outbox.end()
        self._ship()
        self._record.end({"command": dict(self._screen.refused), "order": self._child.refused_orders})
        self._child.finish_record()

    def account(self) -> dict[str, Any]:
        """Return what the supervisor is to know of the end."""
        stages = self._stages.durations
        ticking = self._realtime and "ticks" in stages and "retract" not in stages
        age = self._age.age(self._node.held_ns) * 1e-9 if ticking else None
        return {"loop_s": stages.get("ticks"), "stages": stages, "held_command_age_s": age}


def work(child: Child) -> None:
    """Run the driver's side of the trial."""
    trial = child.read_trial()
    warm_up_driver(trial)
    injector = Injector.of(trial, "driver")
    node = DriverNode(trial)
    codecs = layouts(trial.driver.robot.joints, len(trial.axes), {})
    wire = BusWire(child, node, codecs, injector)
    child.ready(("controller", "logger"), wire.rehearse)
    # From here on signals are noted, and end the trial at the next period: nothing interrupts the plant's code.
    child.signals.raising = False
    record: dict[str, Any] = {}
    try:
        record = {**live(node, wire)._asdict(), **wire.account()}
        # At once: if the program or the bus is gone, nobody else hears how it ended.
        write_json(trial_directory(child.run, trial.id) / DRIVER_RECORD, record)
    finally:
        wire.end()
        if injector is not None:
            injector.end(trial_directory(child.run, trial.id))
    child.tell("done", **record)


if __name__ == "__main__":
    main(work)
