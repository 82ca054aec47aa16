"""A law that fails in its own way at a random call."""

from __future__ import annotations

import os
import random
import signal
import time
from dataclasses import dataclass
from typing import Annotated, Literal

from hilrig import Array, Law, Parameter, Reference, State, Task


@dataclass(frozen=True)
class FailingLaw:
    """tau = tau(0), until it fails"""

    way: Annotated[Literal["killed", "stopped", "asleep", "busy"], Parameter("", "how its process fails")] = "killed"
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
    elif way == "asleep":
        time.sleep(3600.0)
    while way == "busy":
        pass
