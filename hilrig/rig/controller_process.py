"""The controller process: woken by a measurement, it answers with a command."""

from __future__ import annotations

import time

from hilrig.core.errors import Tripped
from hilrig.loop.controller_node import ControllerNode
from hilrig.recording.messages.layouts import layouts
from hilrig.recording.run_directory import trial_directory
from hilrig.rig.bus import Outbox
from hilrig.rig.channels import CONTROLLER_CHANNELS, RecordSender
from hilrig.rig.child import Child, main
from hilrig.rig.faults import Injector
from hilrig.rig.frames import TickScreen
from hilrig.rig.memory import LawMemory
from hilrig.rig.rows import HeardState, controller_rows
from hilrig.rig.state_receiver import StateReceiver
from hilrig.rig.warm_up import warm_up_controller


def work(child: Child) -> None:
    """Answer every measurement until the driver marks the last one.

    Raises RigError if the law asks for too much memory.
    """
    trial = child.read_trial()
    law_memory = LawMemory(trial.rig.law_memory)
    with law_memory.bounded():
        memory = warm_up_controller(trial)
    codecs = layouts(trial.driver.robot.joints, len(trial.axes), memory)
    realtime = trial.clock == "realtime"
    lead = child.bus.lead("state", "driver")
    screen = TickScreen(lead, codecs["state"].size)
    inbox = child.bus.tick_inbox("state")
    commands = child.bus.tick_outbox("command", blocking=not realtime)
    injector = Injector.of(trial, "controller")
    if injector is not None:
        commands = injector.outbox(commands)
    record = RecordSender(child.record(), codecs, CONTROLLER_CHANNELS, {"command": commands.lead}, realtime)
    node, heard = ControllerNode(trial), HeardState(codecs, lead)
    node.bind(heard.rows, controller_rows(record.batches))
    states = StateReceiver(inbox, screen, trial.ticks, trial.period, realtime)
    child.ready(("driver", "logger"), record.rehearse, memory=memory)
    try:
        with law_memory.bounded():
            answer_all(child, node, heard, record, states, commands, injector)
    except Tripped as trip:
        child.tell("tripped", reason=str(trip))
    finally:
        commands.end()
        record.end({"state": dict(screen.refused), "order": child.refused_orders})
        child.finish_record()
        if injector is not None:
            injector.end(trial_directory(child.run, trial.id))
    child.tell("done")


def answer_all(
    child: Child, node: ControllerNode, heard: HeardState, record: RecordSender, states: StateReceiver,
    commands: Outbox, injector: Injector | None,
) -> None:  # fmt: skip
    """Answer until the last measurement. Raises Tripped."""
    now, put, framed = time.monotonic_ns, commands.put, record.batches["command"].framed
    note, last, screen = record.stamps.append, record.rows - 1, states.screen
    certified, resumed, period = child.settings.certificate, child.resume_monitor, node.trial.period
    while True:
        waiting = now()
        state = states.take()
        if not state:
            return
        received = now()
        tick = screen.last
        try:
            if injector is not None:
                injector.stall(tick)
                injector.compute(tick)
            heard.read(state)
            row = node.answer()
        except BaseException:
            # So that the certificate shows who the loop waited for, even if a signal ended a law that hung.
            if certified:
                note((tick, tick * period, waiting, received, now(), now(), resumed.last))
            raise
        computed = now()
        command = framed(row)
        published = now()
        put(command)
        if certified:
            note((tick, tick * period, waiting, received, computed, published, resumed.last))
        record.wrote(row)
        if row == last:
            record.ship()


if __name__ == "__main__":
    main(work)
