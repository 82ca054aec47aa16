"""The driver's process: plant, clock of the trial, and the bus."""

from __future__ import annotations

import time
from collections import deque

from hilrig.errors import Stopped
from hilrig.loop import PlantSide, drive, warm_up_plant
from hilrig.recording.run_directory import trial_directory
from hilrig.rig.channels import DRIVER, PARCEL, Codecs, Record, Stamps
from hilrig.rig.child import Child, main
from hilrig.rig.clock import PROGRESS, Pacer
from hilrig.rig.faults import Injector
from hilrig.signals import Command, Measurement, Truth
from hilrig.trial import Trial


class BusWire:
    """The driver's end of the bus."""

    def __init__(self, child: Child, trial: Trial, injector: Injector | None) -> None:
        self._child, self._injector = child, injector
        self._realtime = trial.clock == "realtime"
        self._codecs = Codecs(trial, {})
        self._pacer = Pacer(trial.period, self._realtime)
        state = child.bus.outbox("state", blocking=not self._realtime)
        self._state = state if injector is None else injector.outbox(state)
        self._inbox = child.bus.inbox("command")
        self._record = Record(child.bus.outbox("record", blocking=True), DRIVER)
        self._waiting: deque[tuple[int, Command]] = deque()
        self._held: tuple[int, Command | None] = (-1, None)
        self._stamps = Stamps("DriverTiming", 5)
        self._moments = (0, 0, 0)
        self._next_report = 0

    def wait(self, tick: int) -> None:
        """Wait for the tick's due time; report progress and look for orders now and then."""
        due = self._pacer.wait(tick)
        woke = time.monotonic_ns()
        if woke > self._next_report:
            self._next_report = woke + PROGRESS
            self._child.tell("progress", tick=tick)
            if self._child.told_to_stop():
                raise Stopped("by order")
        self._moments = (due, woke, 0)
        if self._injector is not None:
            self._injector.stall(tick)

    def publish(self, tick: int, measurement: Measurement, truth: Truth | None) -> None:
        """Send the state; keep it and the truth for the record."""
        payload = self._codecs.state(tick, measurement)
        self._state.put(payload)
        self._moments = (*self._moments[:2], time.monotonic_ns())
        self._record.add("state", payload)
        if truth is not None:
            self._record.add("truth", self._codecs.truth(tick, truth))
        if tick % PARCEL == PARCEL - 1:
            self._record.ship()

    def command(self, tick: int, wanted: int) -> Command | None:
        """Return the command for this period; in real time the last one is held when the wanted one is late."""
        self._collect(wanted)
        late = max(wanted - self._held[0], 0)
        self._record.add("driver_timing", self._stamps.note(tick, *self._moments, time.monotonic_ns(), late))
        return self._held[1]

    def _collect(self, wanted: int) -> None:
        """Make the newest command that is not newer than `wanted` the held one."""
        while True:
            while self._waiting and self._waiting[0][0] <= wanted:
                self._held = self._waiting.popleft()
            if self._held[0] >= wanted or self._waiting or not self._receive(wait=not self._realtime):
                return

    def _receive(self, wait: bool) -> bool:
        payload = self._inbox.take() if wait else self._inbox.poll()
        if payload is None:
            return False
        if not payload:
            raise Stopped("the controller ended first")
        tick, (torque, position) = self._codecs.read_command(payload)
        self._waiting.append((tick, Command(torque, position)))
        return True

    def end(self) -> None:
        """Send what is left and say that this was all."""
        self._state.end()
        self._record.add("driver_timing", self._stamps.flush())
        self._record.end()


def work(child: Child) -> None:
    """Run the trial from the driver's side."""
    trial = child.read_trial()
    warm_up_plant(trial)
    injector = Injector.of(trial, "driver")
    wire, side = BusWire(child, trial, injector), PlantSide(trial)
    try:
        child.ready(("controller", "logger"))
    except BaseException:
        side.close()
        raise
    try:
        ending = drive(side, wire)
    finally:
        wire.end()
        if injector is not None:
            injector.end(trial_directory(child.run, trial.id))
    child.tell("done", **ending._asdict())


if __name__ == "__main__":
    main(work)
