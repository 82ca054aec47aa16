"""The durations that the certificate reports, each as an array over the ticks for which it is known."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hilrig.recording.certificate.late import is_late
from hilrig.recording.certificate.table import NS, Flags, Stamps, StampTable, find


class Terms(NamedTuple):
    """What the loop was configured to do."""

    clock: str
    """"lockstep" or "realtime\""""
    period: float
    """l, s"""
    actuation_delay: int
    """d: the command of tick k - d must take effect at tick k"""

    @property
    def realtime(self) -> bool:
        """Whether each tick had a due time."""
        return self.clock == "realtime"

    @property
    def period_ns(self) -> int:
        """l, ns"""
        return round(self.period * NS)


def durations(table: StampTable, terms: Terms) -> dict[str, Stamps | None]:
    """Return durations in ns, by name; None for those that cannot be determined.

    lateness: woke - due, in real time. state_transport: measurement published to received by the controller.
    compute: received to torque known. command_transport: command published to received by the driver. command_age: woke
    of the measurement's tick to its command applied. round_trip: measurement published to its command received.
    With two clocks, the round trip is known but neither transport is.
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


def command_age(table: StampTable) -> Stamps:
    """Return the age of the command in effect at each tick, (K,) ns: woke of its measurement's tick to applied.

    Ticks before the first command, and ticks without stamps of the measurement, are left out.
    """
    own = table.driver
    place, known = find(own.tick, own.command)
    known &= own.command >= 0
    return (own.applied - own.woke[place])[known] if own.tick.size else own.applied


def late_ticks(table: StampTable, terms: Terms) -> Flags:
    """Return the ticks that were late, (N,), by the rule in `late.py`; none in lockstep, where the plant waits."""
    own = table.driver
    late = is_late(own.tick, own.command, own.due, own.applied, terms.actuation_delay, terms.period_ns)
    return late & terms.realtime


def median(values: Stamps) -> int:
    """Return the typical duration; 0 if there is none."""
    return int(np.median(values)) if values.size else 0
