"""The durations that the certificate tells of, each as one array over the ticks for which it is known."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hilrig.recording.certificate.table import NS, Flags, Stamps, Table, find


class Terms(NamedTuple):
    """What the loop was to do."""

    clock: str
    """"lockstep" or "realtime\""""
    period: float
    """l, s"""
    actuation_delay: int
    """d: the command of tick k - d is to take effect at tick k"""

    @property
    def realtime(self) -> bool:
        """Whether ticks were due at times of their own."""
        return self.clock == "realtime"

    @property
    def period_ns(self) -> int:
        """l, ns"""
        return round(self.period * NS)


def durations(table: Table, terms: Terms) -> dict[str, Stamps | None]:
    """Return durations in ns, by name; None for what cannot be said.

    lateness: woke - due, in real time. state_transport: measurement published to received by the controller.
    compute: received to torque known. command_transport: command published to received by the driver. command_age: woke
    of the measurement's tick to its command applied. round_trip: measurement published to its command received.
    With two clocks neither transport is known, only the round trip.
    """
    own, answer, here = table.driver, table.answer, table.answered
    back = table.returned > 0
    there, home = here & table.one_clock, here & back & table.one_clock
    return {
        "lateness": own.woke - own.due if terms.realtime else None,
        "state_transport": (answer.received - own.published)[there] if table.one_clock else None,
        "compute": table.answers.computed - table.answers.received,
        "command_transport": (table.returned - answer.published)[home] if table.one_clock else None,
        "command_age": command_age(table),
        "round_trip": (table.returned - own.published)[back],
    }


def command_age(table: Table) -> Stamps:
    """Return the age of the command in effect at each tick, (K,) ns: woke of its measurement's tick to applied.

    Ticks before the first command, and those whose measurement's stamps are not in the record, are left out.
    """
    own = table.driver
    place, known = find(own.tick, own.command)
    known &= own.command >= 0
    return (own.applied - own.woke[place])[known] if own.tick.size else own.applied


def overran(table: Table, terms: Terms) -> Flags:
    """Return the ticks at which the command was applied a whole period or more after the tick was due, (N,)."""
    return (table.driver.applied - table.driver.due >= terms.period_ns) & terms.realtime


def late_ticks(table: Table, terms: Terms) -> Flags:
    """Return the ticks that were late, (N,).

    In real time a tick k is late if the command applied was older than that of tick k - d, or if it was applied a whole
    period or more after the tick was due. In lockstep the plant waits, and no tick is late.
    """
    older = (table.driver.command < table.driver.tick - terms.actuation_delay) & terms.realtime
    return older | overran(table, terms)


def median(values: Stamps) -> int:
    """Return the typical duration; 0 if there is none."""
    return int(np.median(values)) if values.size else 0
