"""What the three processes of a trial have in common: how they start, speak to the supervisor, and end."""

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

from hilrig.core.errors import RigError, Stopped, describe
from hilrig.experiment.rig_settings import RigSettings
from hilrig.experiment.trial import Trial
from hilrig.recording.run_directory import read_trial
from hilrig.rig.background_sender import BackgroundSender
from hilrig.rig.bus import Bus
from hilrig.rig.resume_monitor import ResumeMonitor
from hilrig.rig.setup import Report, as_wanted, prepare, refusals, settle

PR_SET_PDEATHSIG = 1
REHEARSALS = 3
PAUSE = 0.03
"""s: once in a session, the first message after a pause of 20 ms takes zenoh 5 ms of the processor"""


@dataclass(frozen=True)
class Orders:
    """What a child is told on its command line, as JSON."""

    role: str
    run: str
    """The run directory"""
    trial: str
    """The trial's id"""
    sockets: str
    """Directory of the bus's sockets"""
    listen: tuple[str, ...]
    connect: tuple[str, ...]
    cores: tuple[int, ...]
    realtime: bool
    settings: dict[str, Any]
    """The fields of RigSettings"""
    patience: float
    """s that the others are given to join"""
    parent: int

    def to_json(self) -> str:
        """Return the orders as one argument."""
        return json.dumps(asdict(self))


class Child:
    """A process of a trial: its orders, its trial and its place on the bus."""

    def __init__(self, orders: Orders) -> None:
        self.orders = orders
        self.role = orders.role
        self.run = Path(orders.run)
        self.settings = RigSettings(**orders.settings)
        self.setup: Report = {}
        """What came of the settings in this process"""
        self._bus: Bus | None = None
        self._courier: BackgroundSender | None = None
        self.resume_monitor = ResumeMonitor()

    def read_trial(self) -> Trial:
        """Return the trial that this rig is to run."""
        return read_trial(self.run, self.orders.trial)

    @property
    def bus(self) -> Bus:
        """The child's place on the bus, taken when it is first asked for.

        By then kernels are compiled, on any core; the bus's threads keep to the cores that the process has then.
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
        """Return what sends packets to the logger; in real time it never waits."""
        put = self.bus.outbox("record", blocking=True).put
        if not self.orders.realtime:
            return put
        self._courier = BackgroundSender(put)
        return self._courier.send

    def finish_record(self) -> None:
        """Wait until all packets have been sent."""
        if self._courier is not None:
            self._courier.finish()

    def leave(self) -> None:
        """Leave the bus, if on it."""
        if self._bus is not None:
            self._bus.close()

    def tell(self, event: str, **details: Any) -> None:
        """Tell the supervisor."""
        assert self.bus is not None
        self._status.put(json.dumps({"role": self.role, "event": event, **details}).encode())

    def ready(
        self, peers: tuple[str, ...], rehearse: Callable[[], None] | None = None, **details: Any
    ) -> dict[str, Any]:
        """Join the others and wait for the order to go; return what the order carries.

        `rehearse` does beside the trial what costs more at its first time, when all has been set up.
        """
        self.bus.announce()
        missing = self.bus.wait_for((*peers, "supervisor"), timeout=self.orders.patience)
        if missing:
            raise RigError(f"waited {self.orders.patience:g} s for {', '.join(sorted(missing))}")
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
            raise Stopped("told to stop before the start")

    def _rehearse(self, rehearse: Callable[[], None]) -> None:
        put = self.bus.outbox("record", blocking=True).put
        for _ in range(REHEARSALS):
            rehearse()
            put(b"")
            if self._courier is not None:
                self._courier.rest()
            time.sleep(PAUSE)

    def told_to_stop(self) -> bool:
        """Whether the supervisor wants the trial to end."""
        payload = self._orders.poll()
        return payload is not None and json.loads(payload)["order"] == "stop"


class Signals:
    """How a child is told to end: SIGTERM by the supervisor, SIGHUP by the kernel when the supervisor is gone.

    The kernel sends SIGHUP when the thread that started the child ends, and again for each thread that inherits the
    child, so it comes several times, and before `getppid` tells that the process is gone. Only the first signal raises.
    """

    def __init__(self) -> None:
        self.orphaned = False
        self._told = False

    def listen(self, parent: int) -> None:
        """Take signals from now on. Raises Stopped here or anywhere later, once."""
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
        """Raise no more: the child is leaving."""
        self._told = True


def main(work: Callable[[Child], None]) -> None:
    """Run one role from the command line. Exit code 0: it ended as it should, whatever the trial's outcome."""
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
    except (Exception, SystemExit) as error:
        traceback.print_exc()
        code = 1
        if child is not None:
            child.tell("failed", reason=describe(error))
    finally:
        signals.enough()
        if child is not None:
            child.leave()
        if signals.orphaned:
            shutil.rmtree(orders.sockets, ignore_errors=True)
    sys.exit(code)
