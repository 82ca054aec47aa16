"""A process of the probe: the driver's half asks at every tick, the controller's half answers at once."""

from __future__ import annotations

import json
import sys
import threading
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hilrig.core.errors import RigError
from hilrig.experiment.rig_settings import RigSettings
from hilrig.rig.bus import Bus
from hilrig.rig.child import PAUSE, REHEARSALS, Signals
from hilrig.rig.clock import Pacer
from hilrig.rig.setup import Report, prepare, settle

PAYLOAD = 140
"""bytes of a State of an arm with two joints"""
PATIENCE = 30.0
"""s that the other half is given to join"""
LAST_ANSWER = 1.0
"""s that the last answers are given to come in"""
OTHER = {"driver": "controller", "controller": "driver"}


def main() -> None:
    """Run one half as told on the command line; print what came of the settings, as JSON."""
    orders = json.loads(sys.argv[1])
    role, settings = orders["role"], RigSettings(**orders["settings"])
    signals = Signals()
    signals.listen(orders["parent"])
    report = prepare(settings, role, orders["cores"], realtime=True)
    with _bus(role, orders["sockets"], settings.low_latency_link) as bus:
        report |= ask(bus, orders, settings) if role == "driver" else answer(bus, settings)
    signals.enough()
    print(json.dumps(report))


def _bus(role: str, sockets: str, low_latency: bool) -> Bus:
    endpoint = f"unixsock-stream/{sockets}/d.sock"
    listen, connect = ([endpoint], []) if role == "driver" else ([], [endpoint])
    return Bus("doctor", role, listen, connect, low_latency)


def _join(bus: Bus, role: str, settings: RigSettings) -> Report:
    """Wait for the other half, and settle."""
    bus.announce()
    if bus.wait_for([OTHER[role]], PATIENCE):
        raise RigError(f"waited {PATIENCE:g} s for the {OTHER[role]}")
    return settle(settings, role, realtime=True)


def ask(bus: Bus, orders: dict[str, Any], settings: RigSettings) -> Report:
    """Send a message at every tick, and stamp the answers as they come in; save the stamps, int64 (4, N)."""
    ticks, period = orders["ticks"], orders["period"]
    asked, answers = bus.outbox("asked", blocking=False), bus.inbox("answered")
    stamps = np.zeros((4, ticks), dtype=np.int64)
    padding = bytes(PAYLOAD - 8)
    report = _join(bus, "driver", settings)
    # As before a trial: the other half may still be setting itself up, and the bus is slow at its first messages.
    for _ in range(REHEARSALS):
        asked.put(bytes(8) + padding)
        answers.take()
        time.sleep(PAUSE)
    # As in the driver's process, a thread stamps them: the loop itself is busy with the next tick.
    listener = threading.Thread(target=_listen, args=(answers, stamps[3]), daemon=True)
    listener.start()
    pacer = Pacer(period * 1e-9, realtime=True, spin=settings.spin)
    for tick in range(ticks):
        due = pacer.wait(tick)
        woke = time.monotonic_ns()
        asked.put(tick.to_bytes(8, "little") + padding)
        stamps[:3, tick] = due, woke, time.monotonic_ns()
    time.sleep(LAST_ANSWER)
    asked.end()
    listener.join(PATIENCE)
    np.save(orders["out"], stamps)
    return report


def _listen(answers: Any, received: NDArray[np.int64]) -> None:
    while payload := answers.take():
        received[int.from_bytes(payload[:8], "little")] = time.monotonic_ns()


def answer(bus: Bus, settings: RigSettings) -> Report:
    """Send back what comes in, until the empty message that ends it."""
    asked, answers = bus.inbox("asked"), bus.outbox("answered", blocking=False)
    report = _join(bus, "controller", settings)
    while payload := asked.take():
        answers.put(payload)
    answers.end()
    return report


if __name__ == "__main__":
    main()
