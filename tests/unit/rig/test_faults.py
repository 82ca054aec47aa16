"""Faults: at which ticks they occur, what the injector does and logs, and what happens to delayed messages."""

from __future__ import annotations

import itertools
import math
import signal
import threading
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.builders import TIME, applied, trial
from helpers.patience import wait_for
from hypothesis import given
from hypothesis import strategies as st

from hilrig.kinds.disturbances._fault_times import spread
from hilrig.kinds.disturbances.bus_delay import BusDelay
from hilrig.kinds.disturbances.bus_loss import BusLoss
from hilrig.kinds.disturbances.force_pulse import ForcePulse
from hilrig.kinds.disturbances.slow_controller import SlowController
from hilrig.kinds.disturbances.stall import Stall
from hilrig.recording.fault_log import InjectedFault, add_faults, read_faults
from hilrig.rig.faults import Injector
from hilrig.rig.faulty_outbox import FaultyOutbox
from hilrig.rig.frames import LEAD_BYTES
from hilrig.rig.stopping import Stopper


@given(st.integers(1, 20), st.integers(1, 9), st.integers(0, 50), st.integers(0, 2**32 - 1))
def test_random_ticks_keep_their_distance(count: int, spacing: int, more: int, seed: int) -> None:
    size = (count - 1) * spacing + 1 + more
    ticks = spread(count, size, spacing, np.random.default_rng(seed))
    assert ticks.size == count
    assert ticks[0] >= 0
    assert ticks[-1] < size
    assert (np.diff(ticks) >= spacing).all()


def test_every_choice_of_ticks_is_equally_likely() -> None:
    """Two ticks of six, two apart or more: there are C(5, 2) = 10 such choices."""
    random, draws = np.random.default_rng(3), 10_000
    found = Counter(tuple(spread(2, 6, 2, random).tolist()) for _ in range(draws))
    assert len(found) == math.comb(5, 2)
    assert max(abs(n - draws / 10) for n in found.values()) < 5 * math.sqrt(draws * 0.1 * 0.9)


def test_a_time_selects_the_tick_at_or_after_it() -> None:
    stalls = applied(Stall(process="driver", duration=2e-3, at=(1.0, 0.1 + 0.2, 0.0005))).faults.driver_stall
    assert np.flatnonzero(stalls).tolist() == [1, 300, 1000]
    assert set(stalls[[1, 300, 1000]]) == {2e-3}


def test_each_process_and_kind_of_stall_has_its_own_field() -> None:
    stop = applied(Stall(process="controller", duration=1e-3, by="stop", at=1.0)).faults
    assert [name for name, part in stop._asdict().items() if part.any()] == ["controller_stop"]


def test_durations_are_drawn_between_their_bounds() -> None:
    busy = applied(SlowController(duration=(1e-3, 3e-3), within=(1.0, 3.0))).faults.controller_busy
    assert np.flatnonzero(busy).tolist() == list(range(1000, 3000))
    drawn = busy[1000:3000]
    assert drawn.min() >= 1e-3
    assert drawn.max() <= 3e-3
    # Uniform: mean 2 ms, standard deviation 2 ms / sqrt(12).
    assert abs(drawn.mean() - 2e-3) < 5 * 2e-3 / math.sqrt(12 * 2000)
    assert drawn.std() == pytest.approx(2e-3 / math.sqrt(12), rel=0.05)


def test_a_probability_applies_to_each_tick() -> None:
    lost = applied(BusLoss(channel="state", probability=0.1)).faults.state_loss
    assert set(lost) == {0.0, 1.0}
    assert abs(lost.sum() - 0.1 * TIME.size) < 5 * math.sqrt(TIME.size * 0.1 * 0.9)


def test_another_seed_selects_other_ticks() -> None:
    loss = BusLoss(channel="command", count=50, distance=15e-3)
    one, other = (np.flatnonzero(applied(loss, seed=seed).faults.command_loss) for seed in (1, 2))
    assert one.size == other.size == 50
    assert not np.array_equal(one, other)
    assert (np.diff(one) >= 15).all()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({}, "say when: give 'at', 'count' or 'probability', or 'within' alone"),
        ({"at": 1.0, "count": 3}, "'at' and 'count' are two ways to say when"),
        ({"at": 1.0, "within": (0.0, 2.0)}, "'within' is for random ticks"),
        ({"probability": 0.5, "distance": 0.1}, "'distance' is for 'count'"),
        ({"at": 9.0}, "at: 9 s is after the last tick, at 3.999 s"),
        ({"at": (1.0, 1.0)}, "at: two times fall on the tick at 1 s"),
        ({"within": (2.0, 1.0)}, r"it would end \(1 s\) before it begins \(2 s\)"),
        ({"within": (5.0, 6.0)}, r"within: \[5 s, 6 s\] contains no tick; the last one is at 3.999 s"),
        ({"count": 5, "distance": 1.0}, "5 faults, 1000 ticks apart, do not fit into 4000 ticks; at most 4 do"),
    ],
)
def test_unclear_times_are_refused(words: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        applied(BusLoss(channel="state", **words))


@pytest.mark.parametrize("duration", [(3e-3, 1e-3), (1e-3,), (1e-3, 2e-3, 3e-3)])
def test_a_duration_is_one_time_or_two_in_ascending_order(duration: tuple[float, ...]) -> None:
    for make in (Stall, BusDelay, SlowController):
        more = {Stall: {"process": "driver"}, BusDelay: {"channel": "state"}}.get(make, {})
        with pytest.raises(ValueError, match=r"give one time, or \[least, most\]"):
            make(duration=duration, at=1.0, **more)


def test_a_process_without_faults_has_no_injector() -> None:
    pulse, stall = ForcePulse(1.0, "x", 0.0, 0.1), Stall(process="driver", duration=1e-3, at=0.01)
    assert Injector.of(trial(disturbances=(pulse,)), "driver") is None
    assert Injector.of(trial(disturbances=(pulse, stall)), "controller") is None
    injector = Injector.of(trial(disturbances=(pulse, stall)), "driver")
    assert injector is not None
    assert injector.planned == 1


def test_an_injector_injects_and_logs_the_faults_of_each_tick(tmp_path: Path) -> None:
    made = trial(
        disturbances=(
            Stall(process="controller", duration=4e-3, at=0.01),
            Stall(process="controller", duration=4e-3, by="stop", at=0.02),
            SlowController(duration=4e-3, at=0.03),
        )
    )
    injector = Injector.of(made, "controller")
    assert injector is not None
    for tick in range(40):
        injector.stall(tick)
        before = time.thread_time_ns()
        injector.compute(tick)
        if tick == 30:  # whoever sleeps uses no processor
            assert time.thread_time_ns() - before > 1e6
    injector.end(tmp_path)
    found = read_faults(tmp_path)
    assert [(fault.tick, fault.kind) for fault in found] == [
        (10, "controller_stall"), (20, "controller_stop"), (30, "controller_busy"),
    ]  # fmt: skip
    assert all(fault.end - fault.begin >= 4_000_000 for fault in found)


def test_a_stopped_process_stops_all_its_threads_and_resumes() -> None:
    """Another thread takes no time stamps meanwhile, and the handler of SIGCONT runs."""
    stopper, times, continued, over = Stopper(), [0], [], threading.Event()

    def watch() -> None:
        while not over.is_set():
            times.append(time.monotonic_ns())
            time.sleep(1e-4)

    before = signal.signal(signal.SIGCONT, lambda number, frame: continued.append(time.monotonic_ns()))
    thread = threading.Thread(target=watch)
    thread.start()
    while len(times) < 3:
        time.sleep(1e-4)
    try:
        begin = time.monotonic_ns()
        stopper.stop(60_000_000)
        end = time.monotonic_ns()
        while times[-1] < end:
            time.sleep(1e-4)
    finally:
        over.set()
        thread.join()
        signal.signal(signal.SIGCONT, before)
    assert end - begin >= 60_000_000
    assert max(np.diff(times[1:])) >= 50_000_000, "the other thread was stopped too"
    assert begin < continued[0] <= end


def test_a_stop_that_comes_after_its_sigcont_ends_anyway(monkeypatch: pytest.MonkeyPatch) -> None:
    """The process may be delayed between the two; then the signal is sent again."""
    kill = signal.pthread_kill
    monkeypatch.setattr(signal, "pthread_kill", lambda thread, number: (time.sleep(5e-3), kill(thread, number)))
    begin = time.monotonic_ns()
    Stopper().stop(1_000_000)
    assert time.monotonic_ns() - begin >= 5_000_000


class Sent:
    """A stand-in for an outbox that keeps what was sent, and when."""

    def __init__(self) -> None:
        self.lead = b"lead"
        self.payloads: list[bytes] = []
        self.times: list[int] = []

    def put(self, payload: bytes) -> None:
        self.payloads.append(bytes(payload))
        self.times.append(time.monotonic_ns())

    def end(self) -> None:
        self.put(b"")


def message(tick: int) -> bytes:
    return bytes(LEAD_BYTES) + b"head" + tick.to_bytes(8, "little") + b"body"


def test_a_delayed_message_delays_those_behind_it_and_none_is_lost_or_changed() -> None:
    sent, noted = Sent(), []
    outbox = FaultyOutbox(sent, {2: 30_000_000, 4: 5_000_000}, {}, lambda *fault: noted.append(fault))  # pyright: ignore
    began = time.monotonic_ns()
    buffer = bytearray(message(0))
    for tick in range(7):
        buffer[:] = message(tick)  # a sender may use its buffer again
        outbox.put(buffer)  # pyright: ignore
    put = time.monotonic_ns()
    outbox.end()
    assert sent.payloads == [*map(message, range(7)), b""]
    assert sent.times[1] <= put, "a message before a delayed one is sent at once"
    assert sent.times[2] - began >= 30_000_000
    assert [(tick, what) for tick, what, _, _ in noted] == [(2, "delay"), (4, "delay")]
    assert all(end - begin >= least for (_, _, begin, end), least in zip(noted, (30e6, 5e6), strict=True))


def test_after_a_delay_messages_are_sent_at_once_again() -> None:
    sent = Sent()
    outbox = FaultyOutbox(sent, {0: 1_000_000}, {}, lambda *fault: None)  # pyright: ignore
    outbox.put(message(0))
    wait_for(lambda: sent.payloads)
    ticks = itertools.count(1)

    def at_once() -> bool:
        """Send the next message; return whether it is on its way when `put` returns."""
        outbox.put(message(tick := next(ticks)))
        return sent.payloads[-1] == message(tick)

    wait_for(at_once)
    outbox.end()
    assert sent.payloads == [*map(message, range(next(ticks))), b""]


def test_a_lost_message_is_never_sent_and_is_logged() -> None:
    sent, noted = Sent(), []
    outbox = FaultyOutbox(sent, {}, {1: 1}, lambda *fault: noted.append(fault[:2]))  # pyright: ignore
    for tick in range(3):
        outbox.put(message(tick))
    outbox.end()
    assert sent.payloads == [message(0), message(2), b""]
    assert noted == [(1, "loss")]


def test_both_processes_write_one_log(tmp_path: Path) -> None:
    assert read_faults(tmp_path) == []
    logs = [[InjectedFault(tick, role, f"{role}_stall", tick, tick + 5) for tick in range(start, 40, 2)]
            for role, start in (("driver", 0), ("controller", 1))]  # fmt: skip
    threads = [threading.Thread(target=add_faults, args=(tmp_path, log)) for log in logs]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert read_faults(tmp_path) == sorted([*logs[0], *logs[1]])
