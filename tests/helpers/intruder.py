"""Finds a rig's sockets as any process of the same user can, and sends what is not of its trial."""

from __future__ import annotations

import json
import os
import struct
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from helpers.patience import wait_for
from helpers.real_rig import recorded, rig_processes
from hilrig.recording.messages.codec import CDR_HEADER
from hilrig.recording.messages.layouts import layouts
from hilrig.rig.bus import Bus
from hilrig.rig.frames import lead, new_epoch, numbered
from hilrig.rig.socket_folder import endpoint

SENDERS = {
    "state": "driver", "command": "controller", "order": "supervisor", "status": "driver", "record": "controller",
}  # fmt: skip
ROLES = ("driver", "controller", "logger")
TICK = struct.Struct("<Q")
BEGUN_BYTES = 5_000
"""Size of a bag that has the first ticks"""
PAUSE_S = 0.002
BURST = 100


class Intruder:
    """Sends messages that must have no effect; `sent` counts them by channel."""

    def __init__(self, tmp_path: Path) -> None:
        """Wait for a trial below `tmp_path` that has begun, and join its bus."""
        wait_for(lambda: any(size > BEGUN_BYTES for size in recorded(tmp_path)))
        self.processes = rig_processes(tmp_path)
        first = json.loads(self.processes["driver"].cmdline()[-1])
        self.epoch = bytes.fromhex(first["epoch"])
        ends = [endpoint(first["sockets"], name) for name in ("supervisor", *ROLES)]
        low_latency = not first["realtime"] or first["settings"]["low_latency_link"]
        self.bus = Bus(first["trial"], "intruder", [], ends, low_latency, self.epoch)
        missing = self.bus.wait_for(ROLES, 10.0)
        assert not missing, missing
        self.sent: Counter[str] = Counter()
        self._out = {name: self.bus.tick_outbox(name, blocking=True) for name in SENDERS}

    def send(self, channel: str, message: bytes, times: int = 1) -> None:
        """Send a message, which the receivers must refuse."""
        put = self._out[channel].put
        for _ in range(times):
            put(message)
        self.sent[channel] += times

    def send_all(self) -> int:
        """Send each kind of message once; return how many kinds there were."""
        kinds = [*self._on_ticks("state"), *self._on_ticks("command")]
        kinds += [kind for channel in ("order", "status", "record") for kind in self._numbered(channel)]
        for channel, message in kinds:
            self.send(channel, message)
            time.sleep(PAUSE_S)
        return len(kinds)

    def _on_ticks(self, channel: str) -> Iterator[tuple[str, bytes]]:
        """Yield what is wrong in each of the ways that a state or a command can be."""
        size = layouts(2, 2, {})[channel].size
        good = lead(self.epoch, channel, SENDERS[channel])
        foreign = lead(new_epoch(), channel, SENDERS[channel])
        values = size - len(CDR_HEADER) - TICK.size

        def message(head: bytes, tick: int, value: float = 0.0) -> bytes:
            return head + CDR_HEADER + TICK.pack(tick) + (struct.pack("<d", value) * values)[:values]

        whole = message(good, 0)
        yield channel, b"\0"
        yield channel, os.urandom(3)
        yield channel, os.urandom(size + 12)
        yield channel, os.urandom(60_000)
        yield channel, foreign  # the end of another trial's channel
        yield channel, lead(self.epoch, channel, "intruder")
        yield channel, message(foreign, 5)
        yield channel, message(foreign, 5, float("nan"))
        yield channel, message(foreign, 5, 500.0)
        yield channel, message(bytes(len(good)), 5, 500.0)
        yield channel, message(lead(self.epoch, "view", "logger"), 5, 500.0)
        yield channel, whole[:-1]
        yield channel, whole + b"\0"
        yield channel, good + b"\0"
        yield channel, good + bytes(len(CDR_HEADER)) + whole[len(good) + len(CDR_HEADER) :]
        yield channel, message(good, 0, 500.0)
        yield channel, message(good, 0, float("nan"))
        yield channel, message(good, 2**40, 500.0)
        yield channel, message(good, 2**64 - 1, float("inf"))

    def _numbered(self, channel: str) -> Iterator[tuple[str, bytes]]:
        good = lead(self.epoch, channel, SENDERS[channel])
        foreign = lead(new_epoch(), channel, SENDERS[channel])
        body = {
            "order": b'{"order": "stop"}', "record": os.urandom(64),
            "status": b'{"role": "driver", "event": "failed", "reason": "it was me"}',
        }[channel]  # fmt: skip
        yield channel, b"\0"
        yield channel, body
        yield channel, os.urandom(60_000)
        yield channel, numbered(foreign, 1, body)
        yield channel, numbered(foreign, 2**63, body)
        yield channel, good
        yield channel, good + b"\1"
        yield channel, numbered(good, 0, body)
        yield channel, numbered(good, 1, body)
        yield channel, numbered(good, 2**64 - 1, body)

    def flood(self, number: int) -> None:
        """Send this many messages of another trial on every channel, in turns."""
        foreign = {name: numbered(lead(new_epoch(), name, sender), 1, bytes(50)) for name, sender in SENDERS.items()}
        for _ in range(number // BURST):
            for channel, message in foreign.items():
                self.send(channel, message, BURST)

    def leave(self) -> None:
        """Leave the bus; the trial must not have ended before, or not everything was received."""
        alive = [role for role, process in self.processes.items() if process.is_running()]
        self.bus.close()
        assert alive == list(self.processes), alive
