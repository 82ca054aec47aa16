"""Ends a trial in this process if its law hangs, so that one SIGTERM or Ctrl-C is enough to end the run."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from hilrig.core.errors import Stopped
from hilrig.rig.processes import TERM_TIMEOUT_S

LOOK_S = 0.5
"""Time between two checks of whether the run must end"""


@contextmanager
def unless_hung(stop: threading.Event, timeout_s: float = TERM_TIMEOUT_S) -> Iterator[None]:
    """Raise Stopped in the body if it is still running `timeout_s` after `stop` was set.

    The body checks `stop` itself between ticks; it is interrupted only if it hangs within a tick. Compiled code cannot
    be interrupted. Does nothing outside the main thread, because only the main thread handles signals.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    done, main = threading.Event(), threading.get_ident()

    def watch() -> None:
        while not done.wait(LOOK_S):
            if stop.is_set():
                if not done.wait(timeout_s):
                    signal.pthread_kill(main, signal.SIGALRM)
                return

    def interrupt(_number: int, _frame: Any) -> None:
        if not done.is_set():
            raise Stopped(f"interrupted; the law had not returned for {timeout_s:g} s")

    before = signal.signal(signal.SIGALRM, interrupt)
    thread = threading.Thread(target=watch, name="hung law", daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()
        signal.signal(signal.SIGALRM, before)
