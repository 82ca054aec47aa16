"""The loop over the ticks on the driver's side, in lockstep over the bus and in real time."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from hilrig.core.errors import Stopped, Tripped
from hilrig.loop.driver_node import DriverNode


class Wire(Protocol):
    """How the driver node reaches the controller node: over the bus, or by a call."""

    def wait(self, tick: int) -> None:
        """Wait until the tick may begin. Raises Stopped if the trial is to end."""
        ...

    def publish(self, tick: int) -> None:
        """Send the measurement of `tick`."""
        ...

    def take_command(self, tick: int, wanted: int) -> None:
        """Put the command of tick `wanted` into effect for the period that begins at `tick`.

        In real time, take the newest command that is not newer than that; if there is none, the previous one stays.
        """
        ...


class Ending(NamedTuple):
    """How a trial ended, from the driver's side."""

    outcome: str
    """completed, tripped or aborted"""
    reason: str
    ticks: int


def do_ticks(node: DriverNode, wire: Wire) -> Ending:
    """Do all ticks of the node's trial, release the plant, and return how it ended.

    During the period that begins at tick k the command of tick k - delay acts on the plant; before there is one, the
    command that holds it. In lockstep the measurement is sent first, because its own command may be the one to wait
    for. In real time the command that acts now has already arrived, and is applied before anything else.
    """
    trial = node.trial
    tick, delay, realtime = 0, trial.actuation_delay, trial.clock == "realtime"
    try:
        while tick < trial.ticks:
            wire.wait(tick)
            node.measure(tick)
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
    finally:
        node.close()
    return Ending("completed", "", tick)
