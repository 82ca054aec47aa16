"""The driver process: plant, clock of the trial, and the bus."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping

from hilrig.core.errors import Stopped
from hilrig.loop.driver_node import DriverNode
from hilrig.loop.ticks import do_ticks
from hilrig.recording.messages.codec import Codec
from hilrig.recording.messages.layouts import layouts
from hilrig.recording.run_directory import trial_directory
from hilrig.rig.channels import DRIVER_CHANNELS, RecordSender
from hilrig.rig.child import Child, main
from hilrig.rig.clock import PROGRESS_NS, Pacer
from hilrig.rig.command_receiver import BlockingCommandReceiver, CommandReceiver
from hilrig.rig.faults import Injector
from hilrig.rig.rows import HeardCommand, driver_rows
from hilrig.rig.warm_up import warm_up_driver

UNHEARD = 100
"""Ticks without an answer in real time, after which only one measurement in this many is sent: about 250 unread ones
fill the socket buffer of a process that does not read, and then the link makes the driver wait, dropping or not"""


class BusWire:
    """The driver's end of the bus."""

    def __init__(self, child: Child, node: DriverNode, codecs: Mapping[str, Codec], injector: Injector | None) -> None:
        trial = node.trial
        self._child, self._node, self._injector = child, node, injector
        self._period, self._realtime = trial.period, trial.clock == "realtime"
        self._pacer = Pacer(trial.period, self._realtime, trial.rig.spin)
        outbox = child.bus.outbox("state", blocking=not self._realtime)
        self._outbox = outbox if injector is None else injector.outbox(outbox)
        inbox = child.bus.inbox("command")
        self._commands = CommandReceiver(inbox) if self._realtime else BlockingCommandReceiver(inbox)
        self._record = RecordSender(child.record(), codecs, DRIVER_CHANNELS)
        self._state = self._record.batches["state"]
        self._certified = child.settings.certificate
        self._resumed = child.resume_monitor
        self._heard = HeardCommand(codecs)
        node.bind(driver_rows(self._record.batches), self._heard.acting)
        self._waiting: deque[tuple[int, int, bytes]] = deque()
        self._acting, self._received = -1, 0
        self._due = self._woke = self._published = self._applied = 0
        self._next_report = 0

    def wait(self, tick: int) -> None:
        """Wait until the tick is due; report progress and check for orders now and then."""
        self._due = self._pacer.wait(tick)
        self._woke = woke = time.monotonic_ns()
        if woke > self._next_report:
            self._next_report = woke + PROGRESS_NS
            self._child.tell("progress", tick=tick)
            if self._child.told_to_stop():
                raise Stopped("by order")
        if self._injector is not None:
            self._injector.stall(tick)

    def publish(self, tick: int) -> None:
        """Send the state from its batch."""
        row = tick % self._record.rows
        if self._realtime and tick % UNHEARD and tick - self._acting > UNHEARD:
            self._published = 0
        else:
            message = self._state.message(row)
            self._published = time.monotonic_ns()
            self._outbox.put(message)
        self._record.written["state"] = row + 1
        if self._node.truthful:
            self._record.written["truth"] = row + 1
        if self._realtime:
            self._note(tick, row)

    def take_command(self, tick: int, wanted: int) -> None:
        """Put the command for this period into effect; in real time the last one stays when the wanted one is late."""
        self._collect(wanted)
        self._applied = time.monotonic_ns()
        if not self._realtime:
            self._note(tick, tick % self._record.rows)

    def _collect(self, wanted: int) -> None:
        """Put into effect the newest command that is not newer than `wanted`."""
        while True:
            while self._waiting and self._waiting[0][0] <= wanted:
                self._acting, self._received, message = self._waiting.popleft()
                self._heard.read(message)
            if self._acting >= wanted or self._waiting:
                return
            arrival = self._commands.take()
            if arrival is None:
                return
            received, message = arrival
            if not message:
                raise Stopped("the controller ended first")
            self._waiting.append((int.from_bytes(message[4:12], "little"), received, message))

    def _note(self, tick: int, row: int) -> None:
        """Write the time stamps of this tick; hand over the record when the batches are full."""
        if self._certified:
            self._record.stamps.append((
                tick, tick * self._period, self._due, self._woke, self._published, self._acting, self._received,
                self._applied, self._resumed.last,
            ))  # fmt: skip
        if row == self._record.rows - 1:
            self._record.ship()

    def rehearse(self) -> None:
        """Send what nobody reads."""
        self._record.rehearse()

    def end(self) -> None:
        """Send the remaining messages and mark the end."""
        self._outbox.end()
        self._record.end()
        self._child.finish_record()


def work(child: Child) -> None:
    """Run the driver's side of the trial."""
    trial = child.read_trial()
    warm_up_driver(trial)
    injector = Injector.of(trial, "driver")
    node = DriverNode(trial)
    try:
        codecs = layouts(trial.driver.robot.joints, len(trial.axes), {})
        wire = BusWire(child, node, codecs, injector)
        child.ready(("controller", "logger"), wire.rehearse)
        try:
            began = time.monotonic()
            ending = do_ticks(node, wire)
            loop_s = time.monotonic() - began
        finally:
            wire.end()
            if injector is not None:
                injector.end(trial_directory(child.run, trial.id))
    finally:
        node.close()
    child.tell("done", loop_s=loop_s, **ending._asdict())


if __name__ == "__main__":
    main(work)
