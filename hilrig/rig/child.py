"""The common part of a trial's three processes: how they start, talk to the supervisor, and end."""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import signal
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hilrig.core.errors import RigError, Stopped, describe_error
from hilrig.experiment.rig_settings import RigSettings
from hilrig.experiment.trial import Trial
from hilrig.recording.run_directory import read_trial
from hilrig.rig.background_sender import BackgroundSender
from hilrig.rig.bus import Bus
from hilrig.rig.resume_monitor import ResumeMonitor
from hilrig.rig.setup import Report, as_wanted, prepare, refusals, settle

PR_SET_PDEATHSIG = 1
REHEARSALS = 3
PAUSE_S = 0.03
"""After a rehearsal: once per session, the first message after a 20 ms pause costs zenoh 5 ms of processor time"""


@dataclass(frozen=True)
class Orders:
    """The orders that a child gets on its command line, as JSON."""

    role: str
    run: str
    """The run directory"""
    trial: str
    """The trial's id"""
    sockets: str
    """Directory of the bus's sockets"""
    listen: tuple[str, ...]
    """Endpoints on the bus that the child opens"""
    connect: tuple[str, ...]
    """Endpoints of others that it connects to"""
    cores: tuple[int, ...]
    realtime: bool
    settings: dict[str, Any]
    """The fields of RigSettings"""
    ready_timeout_s: float
    """How long the others may take to join the bus"""
    parent: int
    """Process id of the supervisor"""

    def to_json(self) -> str:
        """Return the orders as one argument."""
        return json.dumps(asdict(self))


class Child:
    """A process of a trial, from the inside: its orders, its trial, and its connection to the bus."""

    def __init__(self, orders: Orders) -> None:
        self.orders = orders
        self.role = orders.role
        self.run = Path(orders.run)
        self.settings = RigSettings(**orders.settings)
        self.setup: Report = {}
        """The settings that were applied in this process, and why others were not"""
        self._bus: Bus | None = None
        self._sender: BackgroundSender | None = None
        self.resume_monitor = ResumeMonitor()

    def read_trial(self) -> Trial:
        """Return the trial that this process belongs to."""
        return read_trial(self.run, self.orders.trial)

    @property
    def bus(self) -> Bus:
        """The child's connection to the bus, opened at first use.

        Kernels are compiled before that, on any core. The bus's threads inherit the cores that the process has at that
        time.
        """
        if self._bus is None:
            self.setup = prepare(self.settings, self.role, self.orders.cores, self.orders.realtime)
            self.resume_monitor.listen()
            low_latency = self.settings.low_latency_link or not self.orders.realtime
            self.setup["low_latency_link"] = as_wanted("on" if low_latency else "off")
            self._bus = Bus(self.orders.trial, self.role, self.orders.listen, self.orders.connect, low_latency)
            self._status = self._bus.outbox("status", blocking=True)
            self._orders = self._bus.inbox("order")
        return self._bus

    def record(self) -> Callable[[bytes], None]:
        """Return a function that sends a packet to the logger; in real time it never waits."""
        put = self.bus.outbox("record", blocking=True).put
        if not self.orders.realtime:
            return put
        self._sender = BackgroundSender(put)
        return self._sender.send

    def finish_record(self) -> None:
        """Wait until all packets have been sent."""
        if self._sender is not None:
            self._sender.finish()

    def leave(self) -> None:
        """Leave the bus, if connected."""
        if self._bus is not None:
            self._bus.close()

    def tell(self, event: str, **details: Any) -> None:
        """Report an event to the supervisor."""
        assert self.bus is not None
        self._status.put(json.dumps({"role": self.role, "event": event, **details}).encode())

    def ready(
        self, peers: tuple[str, ...], rehearse: Callable[[], None] | None = None, **details: Any
    ) -> dict[str, Any]:
        """Report that this process is ready, wait for the order to go, and return that order.

        Before that, `rehearse` is called once everything is set up: it runs what costs more the first time.
        """
        self.bus.announce()
        timeout_s = self.orders.ready_timeout_s
        missing = self.bus.wait_for((*peers, "supervisor"), timeout_s)
        if missing:
            raise RigError(f"not on the bus after {timeout_s:g} s: {', '.join(sorted(missing))}")
        self.setup |= settle(self.settings, self.role, self.orders.realtime)
        if rehearse is not None and self.orders.realtime:
            self._rehearse(rehearse)
        for line in refusals(self.setup):
            print(line, flush=True)
        self.tell("ready", setup=self.setup, **details)
        while True:
            order = json.loads(self._orders.take())
            if order["order"] == "go":
                return order
            raise Stopped("stopped before the first tick")

    def _rehearse(self, rehearse: Callable[[], None]) -> None:
        put = self.bus.outbox("record", blocking=True).put
        for _ in range(REHEARSALS):
            rehearse()
            put(b"")
            if self._sender is not None:
                self._sender.flush()
            time.sleep(PAUSE_S)

    def told_to_stop(self) -> bool:
        """Return whether the supervisor has ordered the trial to end."""
        payload = self._orders.poll()
        return payload is not None and json.loads(payload)["order"] == "stop"


class Signals:
    """The signals that end a child: SIGTERM from the supervisor, SIGHUP from the kernel when the supervisor is gone.

    The kernel sends SIGHUP when the thread that started the child ends, and again for each thread that inherits the
    child. So it arrives several times, and before `getppid` shows that the parent is gone. Only the first signal
    raises.
    """

    def __init__(self) -> None:
        self.orphaned = False
        self._told = False

    def listen(self, parent: int) -> None:
        """Handle signals from now on: the first one raises Stopped wherever the main thread is then."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, self._stop)
        signal.signal(signal.SIGHUP, self._stop)
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGHUP)
        if os.getppid() != parent:
            self._stop(signal.SIGHUP, None)

    def _stop(self, number: int, _frame: Any) -> None:
        self.orphaned |= number == signal.SIGHUP
        if not self._told:
            self._told = True
            raise Stopped("the supervisor is gone" if self.orphaned else "terminated")

    def enough(self) -> None:
        """Ignore further signals, because the child is about to end."""
        self._told = True


def main(work: Callable[[Child], None]) -> None:
    """Run one role, as ordered on the command line.

    Exit code 0: the process ended properly, whatever the outcome of the trial.
    """
    orders = Orders(**json.loads(sys.argv[1]))
    signals = Signals()
    code = 0
    child: Child | None = None
    try:
        signals.listen(orders.parent)
        child = Child(orders)
        work(child)
    except Stopped as stop:
        print(f"stopped: {stop}", flush=True)
    except BaseException as error:  # whatever a law raises; Ctrl-C reaches a child as a signal that it handles
        traceback.print_exc()
        code = 1
        if child is not None:
            child.tell("failed", reason=describe_error(error))
    finally:
        signals.enough()
        if child is not None:
            child.leave()
        if signals.orphaned:
            shutil.rmtree(orders.sockets, ignore_errors=True)
    sys.exit(code)
