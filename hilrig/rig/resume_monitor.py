"""When a process was stopped and went on: a stop by a signal shows nowhere else than in the clock."""

from __future__ import annotations

import signal
import time
from threading import Thread


class ResumeMonitor:
    """Notes when the process goes on after a stop. To be made before any other thread, which inherit what is blocked.

    The signal goes to a thread that waits for it, at once; a handler would run when the main thread next comes by.
    """

    def __init__(self) -> None:
        self.last = 0
        """CLOCK_MONOTONIC, ns; 0: never"""
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGCONT})

    def listen(self) -> None:
        """TrialStart; to be called when the process has its scheduling, which the thread inherits."""
        Thread(target=self._listen, name="resume_monitor", daemon=True).start()

    def _listen(self) -> None:
        while True:
            signal.sigwait({signal.SIGCONT})
            self.last = time.monotonic_ns()
