"""Notes when a process resumes after a stop (SIGSTOP, Ctrl-Z), which leaves no other trace in the process."""

from __future__ import annotations

import signal
import time
from threading import Thread


class ResumeMonitor:
    """Notes when this process resumes. Create it before any other thread: threads inherit the mask of blocked signals.

    A thread waits for SIGCONT and gets it at once. A signal handler would run only when the main thread next executes
    Python code.
    """

    def __init__(self) -> None:
        self.last = 0
        """When the process last resumed, CLOCK_MONOTONIC in ns; 0: it was never stopped"""
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGCONT})

    def listen(self) -> None:
        """Start listening. Call it after the scheduling of the process is set, because the thread inherits it."""
        Thread(target=self._listen, name="resume_monitor", daemon=True).start()

    def _listen(self) -> None:
        while True:
            signal.sigwait({signal.SIGCONT})
            self.last = time.monotonic_ns()
