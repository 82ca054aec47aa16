"""The three processes of one trial, and the bus that connects them with the supervisor."""

from __future__ import annotations

import json
import os
import shutil
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any

from hilrig.experiment.trial import Trial
from hilrig.recording.run_directory import trial_directory
from hilrig.rig.bus import Bus
from hilrig.rig.child import Orders
from hilrig.rig.cores import cores_for
from hilrig.rig.frames import new_epoch
from hilrig.rig.live import Live
from hilrig.rig.processes import READY_TIMEOUT_S, TERM_TIMEOUT_S, ChildProcess, kill_all, log_of
from hilrig.rig.socket_folder import endpoint, make_socket_folder

ROLES = ("driver", "controller", "logger")


class Rig:
    """The three processes of one trial, and the bus that connects them with the supervisor."""

    def __init__(self, run: Path, trial: Trial, slot: int, live: Live | None) -> None:
        self.run, self.trial = run, trial
        self.directory = trial_directory(run, trial.id)
        self._cores = cores_for(slot, trial.clock == "realtime")
        self._live = live
        self.children: dict[str, ChildProcess] = {}

    def __enter__(self) -> Rig:
        self._sockets = make_socket_folder()
        try:
            low_latency = self.trial.rig.low_latency_link or self.trial.clock == "lockstep"
            epoch = new_epoch()
            self.bus = Bus(self.trial.id, "supervisor", [self._endpoint("supervisor")], [], low_latency, epoch)
            self._orders = self.bus.outbox("order", blocking=True)
            self.statuses = self.bus.inbox("status", ROLES)
            self.bus.announce()
            for role, listens, connects in (
                ("driver", ["driver"], ["supervisor"]),
                ("controller", ["controller"], ["supervisor", "driver"]),
                ("logger", ["logger"], ["supervisor", "driver", "controller"]),
            ):
                self.children[role] = self._start(role, listens, connects, epoch)
            if self._live:
                self._live.begin(self.trial.id, self._endpoint("logger"), self._cores["logger"], epoch)
        except BaseException:
            self._clean_up()
            raise
        return self

    def _endpoint(self, name: str) -> str:
        return endpoint(self._sockets, name)

    def _start(self, role: str, listens: list[str], connects: list[str], epoch: bytes) -> ChildProcess:
        orders = Orders(
            role, str(self.run.resolve()), self.trial.id, epoch.hex(), self._sockets,
            tuple(map(self._endpoint, listens)), tuple(map(self._endpoint, connects)),
            self._cores[role], self.trial.clock == "realtime", asdict(self.trial.rig), READY_TIMEOUT_S, os.getpid(),
        )  # fmt: skip
        return ChildProcess.start(
            f"the {role} process", f"hilrig.rig.{role}_process", orders.to_json(), log_of(self.directory, role)
        )

    def order(self, order: str, **details: Any) -> None:
        """Send an order to all children."""
        self._orders.put(json.dumps({"order": order, **details}).encode())

    def how_it_ended(self, role: str) -> str:
        """Return one line on how a process ended that did not report its end."""
        log = log_of(self.directory, role)
        return f"{self.children[role].how_it_ended(log)} (see {log})"

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._clean_up()

    def _clean_up(self) -> None:
        # In reverse order; each step is taken even if an earlier one fails.
        with ExitStack() as steps:
            if self._live:
                steps.callback(self._live.end, self.trial.id)
            steps.callback(shutil.rmtree, self._sockets, ignore_errors=True)
            if hasattr(self, "bus"):
                steps.callback(self.bus.close)
            steps.callback(kill_all, self.children.values())
            steps.callback(self._let_go)

    @property
    def stop_time_s(self) -> float:
        """How long the driver may take to hold and close its plant: nobody kills it before"""
        return self.trial.driver.capabilities.stop_time

    def _let_go(self) -> None:
        """End the driver if it still runs, with the time that it needs to hold its plant."""
        if "driver" in self.children:
            self.children["driver"].end(0.0, self.stop_time_s + TERM_TIMEOUT_S)
