"""The live view of a trial: what the logger sends to watchers, made from the messages that it records anyway.

Driver and controller know nothing about it. A watcher sends requests; the logger sends views for one second after each.
So a suspended watcher (Ctrl-Z, a closed lid) leaves no more unread than its socket buffer holds. More would block the
logger when it sends or leaves the bus, and eventually the loop.
"""

from __future__ import annotations

import time
import traceback
from collections import defaultdict
from collections.abc import Mapping
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hilrig.core.signals import WRENCH_AXES, Reference
from hilrig.experiment.trial import TaskSpec, make_impedance
from hilrig.kinds.auxiliary_error import auxiliary_error
from hilrig.recording.certificate.late import is_late
from hilrig.recording.messages.codec import Codec, definition, sizes_in
from hilrig.recording.timing import terms_of
from hilrig.rig.bus import Bus
from hilrig.rig.view import ASKING, CHANNEL, GRANT_S, INTERVAL_S, WATCHER, view_codec

LEAST_TICKS = 2
"""Minimum in a view: the acceleration is a difference"""

MOST_REQUESTS = 64
"""Requests that are read before each view"""
DRIVER_TIMING = Codec(definition("DriverTiming"), {})

Fields = dict[str, np.ndarray]
"""The fields of many messages of one channel, by name"""
Messages = NDArray[np.uint8]
"""(N, bytes)"""


class ViewMaker:
    """Makes the views of one trial; keeps messages only from one view to the next."""

    def __init__(self, trial: Mapping[str, Any]) -> None:
        """`trial` is the trial's document in plan.json."""
        self._axes = tuple(trial["axes"])
        self._terms = terms_of(trial)
        self._impedance = make_impedance(TaskSpec.from_document(trial["task"]), self._axes)
        self._codec = view_codec(len(self._axes))
        self._codecs: dict[str, Codec] = {}
        self._kept: dict[str, list[Messages]] = defaultdict(list)
        self._simulated: bool | None = None
        self._began: float | None = None
        self._late, self._timed, self._lateness_s = 0, 0, 0.0
        self._last_timed = -1

    def note(self, channel: str, payloads: Messages) -> None:
        """Add the latest messages of a channel."""
        self._began = self._began or time.monotonic()
        if channel == "driver_timing":
            self._note_timing(payloads)
        elif channel in ("truth", "internals"):
            self._kept[channel].append(payloads)
            self._simulated = channel == "truth" or self._simulated
        elif channel == "state":
            # The truth of a simulated plant comes in the same packet as its state.
            self._simulated = self._simulated or False

    def _note_timing(self, payloads: Messages) -> None:
        self._timed += payloads.shape[0]
        if self._terms.realtime:
            timing, terms = DRIVER_TIMING.table(payloads), self._terms
            tick, command, due, applied = (timing[name] for name in ("tick", "command", "due", "applied"))
            late = is_late(tick, command, due, applied, terms.actuation_delay, terms.period_ns)
            # A tick that was left out is late too.
            missed = int(tick[-1]) - self._last_timed - tick.size
            self._last_timed = int(tick[-1])
            self._timed += missed
            self._late += int(np.count_nonzero(late)) + missed
            self._lateness_s = max(self._lateness_s, float((timing["woke"] - timing["due"]).max()) / 1e9)

    def skip(self) -> None:
        """Drop the collected messages: nobody is watching."""
        self._kept.clear()
        self._lateness_s = 0.0

    def view(self) -> bytes | None:
        """Return a view of the ticks noted since the last one; None if fewer than two are complete."""
        if self._simulated is None:
            return None
        names = ("internals", "truth") if self._simulated else ("internals",)
        columns = {name: self._columns(name) for name in names if self._kept[name]}
        if len(columns) < len(names):
            return None
        ticks = reduce(np.intersect1d, [table["tick"] for table in columns.values()])
        if ticks.size < LEAST_TICKS:
            return None
        picked = {name: _pick(table, ticks) for name, table in columns.items()}
        for name, table in columns.items():
            seen = np.count_nonzero(table["tick"] <= ticks[-1])
            self._kept[name] = [np.concatenate(self._kept[name])[seen:]]
        return self._packed(picked["internals"], picked.get("truth"))

    def _columns(self, name: str) -> Fields:
        payloads = np.concatenate(self._kept[name])
        if name not in self._codecs:
            form = definition("Truth" if name == "truth" else "Internals")
            self._codecs[name] = Codec(form, sizes_in(form, payloads[0].tobytes()))
        # The law's memory comes after the common fields of the internals; a view does not need it.
        return self._codecs[name].table(payloads[:, : self._codecs[name].size])

    def _packed(self, internals: Fields, truth: Fields | None) -> bytes:
        source = internals if truth is None else truth
        position, velocity, time_ = source["position"], source["velocity"], source["time"]
        force = source["force"] if truth is None else source["wrench"][:, [WRENCH_AXES.index(a) for a in self._axes]]
        reference = Reference(*(internals[f"reference_{name}"] for name in Reference._fields))
        acceleration = np.gradient(velocity, time_, axis=0)
        auxiliary = auxiliary_error(self._impedance, position, velocity, acceleration, force, reference)
        sigma = self._impedance.sigma
        error = np.where(sigma == 1, reference.position - position, reference.force - force)
        largest = error[np.argmax(np.abs(error), axis=0), np.arange(sigma.size)]
        lateness_s, self._lateness_s = self._lateness_s, 0.0
        elapsed_s = time.monotonic() - (self._began or 0.0)
        return self._codec.pack(
            (
                int(source["tick"][-1]), float(time_[-1]), elapsed_s, self._late, self._timed,
                lateness_s, position[-1], velocity[-1], force[-1], reference.position[-1], reference.force[-1], largest,
                np.sqrt(np.mean(auxiliary**2, axis=0)),
            )
        )  # fmt: skip


def _pick(table: Fields, ticks: np.ndarray) -> Fields:
    """Return the rows of these ticks."""
    rows = np.searchsorted(table["tick"], ticks)
    return {name: values[rows] for name, values in table.items()}


class Views:
    """Sends the views of a trial as long as someone requests them, at most one every INTERVAL_S."""

    def __init__(self, bus: Bus, trial: Mapping[str, Any]) -> None:
        self._outbox = bus.outbox(CHANNEL, blocking=False)
        self._asking, self._request = bus.tick_inbox(ASKING), bus.lead(ASKING, WATCHER)
        self._maker: ViewMaker | None = ViewMaker(trial)
        self._next, self._until = 0.0, 0.0

    def note(self, fresh: Mapping[str, Messages]) -> None:
        """Add the messages of a packet, by channel, and send a view if one is due.

        An error in a view must not harm the recording: it is printed, and no more views are sent.
        """
        if self._maker is None:
            return
        try:
            for channel, payloads in fresh.items():
                self._maker.note(channel, payloads)
            if time.monotonic() >= self._next:
                self._next = time.monotonic() + INTERVAL_S
                self._send(self._maker)
        except Exception:
            traceback.print_exc()
            print("the live view stops here; recording continues", flush=True)
            self._maker = None

    def _send(self, maker: ViewMaker) -> None:
        now = time.monotonic()
        for _ in range(MOST_REQUESTS):
            message = self._asking.poll()
            if message is None:
                break
            # Every watch process numbers its own requests, so only the lead counts.
            if message.startswith(self._request):
                self._until = now + GRANT_S
        if now > self._until:
            maker.skip()
        elif (payload := maker.view()) is not None:
            self._outbox.put(payload)

    def end(self) -> None:
        """Send a view of the last ticks of the trial."""
        self._next = 0.0
        self.note({})
