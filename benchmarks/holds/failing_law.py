"""A law that fails in its own way at a random call."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import socket
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from hilrig import Array, Law, Parameter, Reference, State, Task


@dataclass(frozen=True)
class FailingLaw:
    """tau = tau(0), until it fails"""

    way: Annotated[
        Literal["killed", "stopped", "asleep", "busy", "cut", "orphaned"], Parameter("", "how its process fails")
    ] = "killed"
    first: Annotated[int, Parameter("", "first call that may fail", 1, 1_000_000)] = 100
    last: Annotated[int, Parameter("", "last call that may fail", 1, 1_000_000)] = 900

    def start(self, task: Task, state: State) -> Law:
        """Draw the call. The draw is not seeded: each trial has its own."""
        left = [random.SystemRandom().randint(self.first, self.last)]

        def step(parameters: Array, memory: tuple[()], seen: State, wanted: Reference) -> Array:
            left[0] -= 1
            if left[0] == 0:
                _fail(self.way)
            return parameters

        return Law(step, state.torque.copy(), ())


def _fail(way: str) -> None:
    if way in ("killed", "stopped"):
        os.kill(os.getpid(), signal.SIGKILL if way == "killed" else signal.SIGSTOP)
    elif way == "cut":
        _cut_the_bus()
    elif way == "orphaned":
        os.kill(os.getppid(), signal.SIGKILL)  # the program; the processes of the trial are left alone
    elif way == "asleep":
        time.sleep(3600.0)
    while way == "busy":
        pass


def _cut_the_bus() -> None:
    """Remove the bus's sockets, and end every connection of this process: the law goes on, and nobody hears it.

    A socket that listens stays open, without a name that anybody could connect to: zenoh would accept on a dead one in
    a loop, beside the driver.
    """
    shutil.rmtree(json.loads(sys.argv[1])["sockets"], ignore_errors=True)
    for file in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            if os.readlink(file).startswith("socket:"):
                with socket.socket(fileno=os.dup(int(file.name))) as end:
                    if not end.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN):
                        end.shutdown(socket.SHUT_RDWR)
