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
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hilrig.core.errors import RigError, Stopped, describe_error
from hilrig.experiment.rig_settings import RigSettings
from hilrig.experiment.trial import Trial
from hilrig.recording.run_directory import read_trial
from hilrig.rig.background_sender import BackgroundSender
from hilrig.rig.bus import Bus
from hilrig.rig.order_receiver import OrderReceiver
from hilrig.rig.resume_monitor import ResumeMonitor
from hilrig.rig.setup import Report, as_wanted, prepare, refusals, settle

PR_SET_PDEATHSIG = 1
REHEARSALS = 3
HALTED = "halted by hilrig halt"
PROGRAM = "HILRIG_PROGRAM"
"""Environment variable with the process id of the program that runs the trials: what outlives a trial ends with it"""
REASONS = {
    signal.SIGTERM: "terminated", signal.SIGHUP: "the supervisor is gone", signal.SIGUSR1: HALTED,
}  # fmt: skip
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
    epoch: str
    """The epoch of the trial's messages, in hexadecimal"""
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

    def __init__(self, orders: Orders, signals: Signals) -> None:
        self.orders, self.signals = orders, signals
        self.role = orders.role
        self.run = Path(orders.run)
        self.settings = RigSettings(**orders.settings)
        self.setup: Report = {}
        """The settings that were applied in this process, and why others were not"""
        self._bus: Bus | None = None
        self._senders: list[BackgroundSender] = []
        self._record_sender: BackgroundSender | None = None
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
            self._bus = Bus(
                self.orders.trial, self.role, self.orders.listen, self.orders.connect, low_latency,
                bytes.fromhex(self.orders.epoch),
            )  # fmt: skip
            self._put_status = self._unblocked(self._bus.outbox("status", blocking=True).put)
            self._orders = OrderReceiver(self._bus.inbox("order", ["supervisor"]))
        return self._bus

    def record(self) -> Callable[[bytes], None]:
        """Return a function that sends a packet to the logger; in real time it never waits."""
        put = self._unblocked(self.bus.outbox("record", blocking=True).put)
        self._record_sender = self._senders[-1] if self.orders.realtime else None
        return put

    def _unblocked(self, put: Callable[[bytes], None]) -> Callable[[bytes], None]:
        """Return a function that does the same without waiting, in real time."""
        if not self.orders.realtime:
            return put
        self._senders.append(BackgroundSender(put))
        return self._senders[-1].send

    def finish_record(self) -> None:
        """Wait until all packets have been sent, but not for ever."""
        if self._record_sender is not None:
            self._record_sender.finish()

    @property
    def refused_orders(self) -> dict[str, int]:
        """Number of messages on the channel of the orders that were refused, by reason"""
        return self._orders.refused

    def leave(self) -> None:
        """Leave the bus, if connected."""
        for sender in self._senders:
            sender.finish()
        if self._bus is not None:
            self._bus.close()

    def tell(self, event: str, **details: Any) -> None:
        """Report an event to the supervisor."""
        assert self.bus is not None
        self._put_status(json.dumps({"role": self.role, "event": event, **details}).encode())

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
        order = self._orders.take()
        if order["order"] != "go":
            raise Stopped("stopped before the first tick")
        return order

    def _rehearse(self, rehearse: Callable[[], None]) -> None:
        put = self.bus.outbox("record", blocking=True).put
        for _ in range(REHEARSALS):
            rehearse()
            put(b"")
            if self._record_sender is not None:
                self._record_sender.flush()
            time.sleep(PAUSE_S)

    def told_to_stop(self) -> bool:
        """Return whether the supervisor has ordered the trial to end."""
        return self._orders.poll().get("order") == "stop"


class Signals:
    """The signals that end a child: SIGTERM from the supervisor, SIGHUP from the kernel when the supervisor is gone,
    SIGUSR1 from `hilrig halt`.

    The kernel sends SIGHUP when the thread that started the child ends, and again for each thread that inherits the
    child. So it arrives several times, and before `getppid` shows that the parent is gone. Only the first signal
    raises, and none does while `raising` is off: nothing may interrupt a plant's code.
    """

    def __init__(self) -> None:
        self.raising = True
        """Whether the first signal raises Stopped wherever the main thread is; otherwise it is only noted"""
        self.told = ""
        """Why the child must end; empty if it must not"""
        self.orphaned = False
        self._raised = False

    def listen(self, parent: int) -> None:
        """Handle signals from now on."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1):
            signal.signal(number, self._stop)
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGHUP)
        if os.getppid() != parent:
            self._stop(signal.SIGHUP, None)

    def _stop(self, number: int, _frame: Any) -> None:
        self.orphaned |= number == signal.SIGHUP
        self.told = self.told or REASONS[signal.Signals(number)]
        if self.raising:
            self.check()

    def check(self) -> None:
        """Raise Stopped if a signal has come, once."""
        if self.told and not self._raised:
            self._raised = True
            raise Stopped(self.told)

    def enough(self) -> None:
        """Ignore further signals, because the child is about to end."""
        self._raised = True


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
        os.environ[PROGRAM] = str(orders.parent)
        child = Child(orders, signals)
        work(child)
    except Stopped as stop:
        print(f"stopped: {stop}", flush=True)
    except BaseException as error:  # whatever a law raises; Ctrl-C reaches a child as a signal that it handles
        traceback.print_exc()
        code = 1
        if child is not None:
            with suppress(Exception):  # the bus may be what failed
                child.tell("failed", reason=describe_error(error))
    finally:
        signals.enough()
        if child is not None:
            with suppress(Exception):
                child.leave()
        if signals.orphaned:
            shutil.rmtree(orders.sockets, ignore_errors=True)
    sys.exit(code)
