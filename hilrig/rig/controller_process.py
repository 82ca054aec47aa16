"""The controller's process: woken by a measurement, it answers with a command."""

from __future__ import annotations

import time

from hilrig.core.errors import Tripped
from hilrig.recording.messages.layouts import layouts
from hilrig.recording.run_directory import trial_directory
from hilrig.rig.bus import Inbox, Outbox
from hilrig.rig.channels import CONTROLLER, Record
from hilrig.rig.child import Child, main
from hilrig.rig.faults import Injector
from hilrig.rig.nodes import ControllerNode, warm_up_control


def work(child: Child) -> None:
    """Answer every measurement until the driver says that it was the last."""
    trial = child.read_trial()
    memory = warm_up_control(trial)
    codecs = layouts(trial.driver.robot.joints, len(trial.axes), memory)
    realtime = trial.clock == "realtime"
    states = child.bus.inbox("state", latest_only=realtime)
    commands = child.bus.outbox("command", blocking=not realtime)
    injector = Injector.of(trial, "controller")
    if injector is not None:
        commands = injector.outbox(commands)
    record = Record(child.record(), codecs, CONTROLLER)
    half = ControllerNode(trial, codecs, record.batches, record.rows)
    child.ready(("driver", "logger"), record.rehearse, memory=memory)
    try:
        answer_all(child, trial.period, half, record, states, commands, injector)
    except Tripped as trip:
        child.tell("tripped", reason=str(trip))
    finally:
        commands.end()
        record.end()
        child.finish_record()
        if injector is not None:
            injector.end(trial_directory(child.run, trial.id))
    child.tell("done")


def answer_all(
    child: Child, period: float, half: ControllerNode, record: Record, states: Inbox, commands: Outbox,
    injector: Injector | None,
) -> None:  # fmt: skip
    """Answer until the last measurement. Raises Tripped."""
    now, put, message = time.monotonic_ns, commands.put, record.batches["command"].message
    note, last = record.stamps.append, record.rows - 1
    certified, resume_monitor = child.settings.certificate, child.resume_monitor
    while True:
        waiting = now()
        state = states.take()
        if not state:
            return
        received = now()
        tick = int.from_bytes(state[4:12], "little")
        if injector is not None:
            injector.stall(tick)
            injector.compute(tick)
        row = half.answer(state)
        computed = now()
        command = message(row)
        published = now()
        put(command)
        if certified:
            note((tick, tick * period, waiting, received, computed, published, resume_monitor.last))
        record.wrote(row)
        if row == last:
            record.ship()


if __name__ == "__main__":
    main(work)
