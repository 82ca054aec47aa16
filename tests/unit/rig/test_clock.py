from __future__ import annotations

import time

import pytest

from hilrig.rig import clock
from hilrig.rig.clock import Pacer


def test_in_lockstep_a_tick_is_due_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clock, "sleep_until", lambda moment: pytest.fail("it sleeps"))
    pacer = Pacer(period=1e-3, realtime=False, spin=1e-4)
    for tick in (0, 1, 500):
        before = time.monotonic_ns()
        due = pacer.wait(tick)
        assert before <= due <= time.monotonic_ns()


def test_in_real_time_tick_k_is_due_k_periods_after_the_first_and_never_begins_earlier() -> None:
    pacer, dues, asked = Pacer(period=2e-3, realtime=True, spin=1e-4), [], time.monotonic_ns()
    for tick in (0, 1, 2, 5):
        dues.append(pacer.wait(tick))
        assert time.monotonic_ns() >= dues[-1]
    assert dues[0] >= asked
    assert [due - dues[0] for due in dues] == [0, 2_000_000, 4_000_000, 10_000_000]


def test_a_tick_that_is_overdue_keeps_its_due_time() -> None:
    pacer = Pacer(period=1e-3, realtime=True, spin=1e-4)
    first = pacer.wait(0)
    pacer.wait(5)
    assert pacer.wait(2) == first + 2_000_000
