"""A process of the probe: the driver sends a message at every tick, and the controller answers at once."""

from __future__ import annotations

import json
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hilrig.core.errors import RigError
from hilrig.experiment.rig_settings import RigSettings
from hilrig.rig.bus import Bus
from hilrig.rig.child import PAUSE_S, REHEARSALS, Signals
from hilrig.rig.clock import Pacer
from hilrig.rig.setup import Report, prepare, settle
from hilrig.rig.socket_folder import endpoint

PAYLOAD_BYTES = 140
"""Size of the state message of an arm with two joints"""
JOIN_TIMEOUT_S = 30.0
"""How long the other process may take to join the bus"""
LAST_ANSWERS_S = 1.0
"""How long to wait for the last answers"""
OTHER = {"driver": "controller", "controller": "driver"}


def main() -> None:
    """Run as ordered on the command line; write the applied settings to <role>.json, next to the sockets."""
    orders = json.loads(sys.argv[1])
    role, settings = orders["role"], RigSettings(**orders["settings"])
    signals = Signals()
    signals.listen(orders["parent"])
    report = prepare(settings, role, orders["cores"], realtime=True)
    with _bus(role, orders["sockets"], settings.low_latency_link) as bus:
        report |= ask(bus, orders, settings) if role == "driver" else answer_probe(bus, settings)
    signals.enough()
    (Path(orders["sockets"]) / f"{role}.json").write_text(json.dumps(report))


def _bus(role: str, sockets: str, low_latency: bool) -> Bus:
    driver = [endpoint(sockets, "driver")]
    listen, connect = (driver, []) if role == "driver" else ([], driver)
    return Bus("doctor", role, listen, connect, low_latency)


def _join(bus: Bus, role: str, settings: RigSettings) -> Report:
    """Wait for the other process, and settle."""
    bus.announce()
    if bus.wait_for([OTHER[role]], JOIN_TIMEOUT_S):
        raise RigError(f"the {OTHER[role]} did not join the bus within {JOIN_TIMEOUT_S:g} s")
    return settle(settings, role, realtime=True)


def ask(bus: Bus, orders: dict[str, Any], settings: RigSettings) -> Report:
    """Send a message at every tick and stamp the answers as they come in; save the stamps, int64 (4, N) ns."""
    ticks, period_ns = orders["ticks"], orders["period_ns"]
    asked, answers = bus.outbox("asked", blocking=False), bus.inbox("answered", ["controller"], complete=False)
    stamps = np.zeros((4, ticks), dtype=np.int64)
    padding = bytes(PAYLOAD_BYTES - 8)
    report = _join(bus, "driver", settings)
    # As before a trial: the controller may still be settling, and the first messages on the bus are slow.
    for _ in range(REHEARSALS):
        asked.put(bytes(8) + padding)
        answers.take()
        time.sleep(PAUSE_S)
    # As in a trial, a thread stamps the answers, because the loop itself sleeps until the next tick.
    listener = threading.Thread(target=_listen, args=(answers, stamps[3]), daemon=True)
    listener.start()
    pacer = Pacer(period_ns * 1e-9, realtime=True, spin=settings.spin)
    for tick in range(ticks):
        due = pacer.wait(tick)
        woke = time.monotonic_ns()
        asked.put(tick.to_bytes(8, "little") + padding)
        stamps[:3, tick] = due, woke, time.monotonic_ns()
    time.sleep(LAST_ANSWERS_S)
    asked.put(b"")
    listener.join(JOIN_TIMEOUT_S)
    np.save(Path(orders["sockets"]) / "stamps.npy", stamps)
    return report


def _listen(answers: Any, received: NDArray[np.int64]) -> None:
    while payload := answers.take():
        received[int.from_bytes(payload[:8], "little")] = time.monotonic_ns()


def answer_probe(bus: Bus, settings: RigSettings) -> Report:
    """Send every message back until an empty one comes, which is the last."""
    asked, answers = bus.inbox("asked", ["driver"], complete=False), bus.outbox("answered", blocking=False)
    report = _join(bus, "controller", settings)
    while payload := asked.take():
        answers.put(payload)
    answers.put(b"")
    return report


if __name__ == "__main__":
    main()
