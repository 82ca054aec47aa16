"""The loop over the ticks on the driver's side, in lockstep over the bus and in real time."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from hilrig.core.errors import Stopped, Tripped
from hilrig.loop.driver_node import DriverNode


class Wire(Protocol):
    """How the driver node reaches the controller node: over the bus, or by a call."""

    def wait(self, tick: int) -> int:
        """Wait until the tick may begin, and return it. Raises Stopped if the trial is to end.

        In real time a later tick is returned if this one is overdue by more than a period: old ticks are left out, not
        made up for. Raises Tripped after a standstill.
        """
        ...

    def publish(self, tick: int) -> None:
        """Send the measurement of `tick`."""
        ...

    def take_command(self, tick: int, wanted: int) -> None:
        """Put the command of tick `wanted` into effect for the period that begins at `tick`.

        In real time, take the newest command that is not newer than that; if there is none, the previous one stays.
        Raises Tripped if the command in effect is older than the watchdog permits.
        """
        ...


class Ending(NamedTuple):
    """How a trial ended, from the driver's side."""

    outcome: str
    """completed, tripped, timed_out or aborted"""
    reason: str
    ticks: int
    """Ticks that have passed, those left out included"""


def do_ticks(node: DriverNode, wire: Wire) -> Ending:
    """Do all ticks of the node's trial and return how they ended. The plant is left to the caller.

    During the period that begins at tick k the command of tick k - delay acts on the plant; before there is one, the
    command that holds it. In lockstep the measurement is sent first, because its own command may be the one to wait
    for. In real time the command that acts now has already arrived, and is applied before anything else.
    """
    trial = node.trial
    tick, ticks, delay, realtime = 0, trial.ticks, trial.actuation_delay, trial.clock == "realtime"
    try:
        while tick < ticks:
            due = wire.wait(tick)
            if due >= ticks:
                tick = ticks
                break
            node.measure(due, due - tick)
            tick = due
            if not realtime:
                wire.publish(tick)
            wire.take_command(tick, tick - delay)
            node.advance()
            if realtime:
                wire.publish(tick)
            tick += 1
    except Tripped as trip:
        return Ending("tripped", str(trip), tick)
    except Stopped as stop:
        return Ending("aborted", str(stop), tick)
    return Ending("completed", "", tick)
