"""The controller's process: woken by a measurement, it answers with a command."""

from __future__ import annotations

import time

from hilrig.errors import Tripped
from hilrig.loop import ControlSide, warm_up_control
from hilrig.recording.run_directory import trial_directory
from hilrig.rig.channels import CONTROLLER, PARCEL, Codecs, Record, Stamps
from hilrig.rig.child import Child, main
from hilrig.rig.faults import Injector


def work(child: Child) -> None:
    """Answer every measurement until the driver says that it was the last."""
    trial = child.read_trial()
    realtime = trial.clock == "realtime"
    memory = warm_up_control(trial)
    codecs, side, stamps = Codecs(trial, memory), ControlSide(trial), Stamps("ControllerTiming", 4)
    states = child.bus.inbox("state", latest_only=realtime)
    commands = child.bus.outbox("command", blocking=not realtime)
    injector = Injector.of(trial, "controller")
    commands = commands if injector is None else injector.outbox(commands)
    record = Record(child.bus.outbox("record", blocking=True), CONTROLLER)
    child.ready(("driver", "logger"), memory=memory)
    try:
        while payload := states.take():
            received = time.monotonic_ns()
            tick, measurement = codecs.read_state(payload)
            if injector is not None:
                injector.stall(tick)
                injector.compute(tick)
            answer = side.control(tick, measurement)
            computed = time.monotonic_ns()
            command = codecs.command(tick, answer)
            commands.put(command)
            published = time.monotonic_ns()
            record.add("command", command)
            record.add("internals", codecs.internals(tick, answer))
            record.add("controller_timing", stamps.note(tick, tick, received, computed, published))
            if tick % PARCEL == PARCEL - 1:
                record.ship()
    except Tripped as trip:
        child.tell("tripped", reason=str(trip))
    finally:
        commands.end()
        record.add("controller_timing", stamps.flush())
        record.end()
        if injector is not None:
            injector.end(trial_directory(child.run, trial.id))
    child.tell("done")


if __name__ == "__main__":
    main(work)
