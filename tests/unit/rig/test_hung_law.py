"""A trial in this process that hangs is ended some time after the run was told to end, any other is left alone."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable

import pytest

from hilrig.core.errors import Stopped
from hilrig.rig.hung_law import unless_hung

LONG_S = 60.0


def asleep() -> None:
    time.sleep(LONG_S)


def busy() -> None:
    deadline = time.monotonic() + LONG_S
    while time.monotonic() < deadline:
        pass


@pytest.mark.parametrize("hang", [asleep, busy])
def test_a_body_that_hangs_after_stop_was_set_is_ended(hang: Callable[[], None]) -> None:
    stop = threading.Event()
    threading.Timer(0.2, stop.set).start()
    before, deadline = signal.getsignal(signal.SIGALRM), time.monotonic() + LONG_S
    with pytest.raises(Stopped, match=r"interrupted; the law had not returned for 0.1 s"), unless_hung(stop, 0.1):
        hang()
    assert stop.is_set()
    assert time.monotonic() < deadline
    assert signal.getsignal(signal.SIGALRM) == before


@pytest.mark.parametrize("told", [False, True])
def test_a_body_that_returns_is_left_alone(told: bool) -> None:
    stop = threading.Event()
    if told:
        stop.set()
    with unless_hung(stop, timeout_s=0.3):
        time.sleep(0.2)
    time.sleep(0.3)
    assert not [thread for thread in threading.enumerate() if thread.name == "hung law"]


def test_outside_the_main_thread_nothing_is_done() -> None:
    stop, ended = threading.Event(), threading.Event()
    stop.set()

    def body() -> None:
        with unless_hung(stop, timeout_s=0.0):
            time.sleep(0.3)
        ended.set()

    thread = threading.Thread(target=body)
    thread.start()
    thread.join(LONG_S)
    assert ended.is_set()
