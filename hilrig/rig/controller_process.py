"""The controller process: woken by a measurement, it answers with a command."""

from __future__ import annotations

import time

from hilrig.core.errors import Tripped
from hilrig.loop.controller_node import ControllerNode
from hilrig.recording.messages.layouts import layouts
from hilrig.recording.run_directory import trial_directory
from hilrig.rig.bus import Inbox, Outbox
from hilrig.rig.channels import CONTROLLER_CHANNELS, RecordSender
from hilrig.rig.child import Child, main
from hilrig.rig.faults import Injector
from hilrig.rig.rows import HeardState, controller_rows
from hilrig.rig.warm_up import warm_up_controller


def work(child: Child) -> None:
    """Answer every measurement until the driver marks the last one."""
    trial = child.read_trial()
    memory = warm_up_controller(trial)
    codecs = layouts(trial.driver.robot.joints, len(trial.axes), memory)
    realtime = trial.clock == "realtime"
    states = child.bus.inbox("state", latest_only=realtime)
    commands = child.bus.outbox("command", blocking=not realtime)
    injector = Injector.of(trial, "controller")
    if injector is not None:
        commands = injector.outbox(commands)
    record = RecordSender(child.record(), codecs, CONTROLLER_CHANNELS)
    node, heard = ControllerNode(trial), HeardState(codecs)
    node.bind(heard.rows, controller_rows(record.batches))
    child.ready(("driver", "logger"), record.rehearse, memory=memory)
    try:
        answer_all(child, node, heard, record, states, commands, injector)
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
    child: Child, node: ControllerNode, heard: HeardState, record: RecordSender, states: Inbox, commands: Outbox,
    injector: Injector | None,
) -> None:  # fmt: skip
    """Answer until the last measurement. Raises Tripped."""
    now, put, message = time.monotonic_ns, commands.put, record.batches["command"].message
    note, last = record.stamps.append, record.rows - 1
    certified, resumed, period = child.settings.certificate, child.resume_monitor, node.trial.period
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
        heard.read(state)
        row = node.answer()
        computed = now()
        command = message(row)
        published = now()
        put(command)
        if certified:
            note((tick, tick * period, waiting, received, computed, published, resumed.last))
        record.wrote(row)
        if row == last:
            record.ship()


if __name__ == "__main__":
    main(work)
