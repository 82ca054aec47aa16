"""What begins a tick: the rig's timer, which leaves overdue ticks out, or the plant's samples."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hilrig.rig import clock
from hilrig.rig.clock import Pacer, Samples, Timer

PERIOD = 0.01
NS = 1_000_000_000


class World:
    """Time that passes only when somebody waits, and a plant that gives samples at its own times, s."""

    def __init__(self, samples: Any = ()) -> None:
        self.now, self.samples, self._next = 50.0, np.asarray(samples, dtype=float) + 50.0, 0

    def monotonic_ns(self) -> int:
        return round(self.now * NS)

    def sleep_until(self, moment: int) -> None:
        self.now = max(self.now, moment / NS)

    def await_sample(self, timeout_s: float) -> float | None:
        """Wait for a sample newer than the last one that was given; several that are there count as one."""
        deadline = self.now + timeout_s
        if self._next < self.samples.size and self.samples[self._next] <= deadline:
            self.now = max(self.now, self.samples[self._next])
            while self._next < self.samples.size and self.samples[self._next] <= self.now:
                self._next += 1
            return float(self.samples[self._next - 1])
        self.now = deadline
        return None


@pytest.fixture
def use(monkeypatch: pytest.MonkeyPatch) -> Any:
    def put(world: World) -> World:
        monkeypatch.setattr(clock, "time", world)
        monkeypatch.setattr(clock, "sleep_until", world.sleep_until)
        return world

    return put


def test_a_timer_leaves_out_what_is_overdue(use: Any) -> None:
    world = use(World())
    timer = Timer(Pacer(PERIOD, True, 0.0), PERIOD)
    begun = [timer.wait(0), timer.wait(1)]
    world.now += 0.0499  # not a whole five periods
    begun.append(timer.wait(2))
    world.now += 0.0151
    begun.append(timer.wait(begun[-1].tick + 1))
    assert [found.tick for found in begun] == [0, 1, 5, 7]
    start = begun[0].due
    assert all(found.due == start + round(found.tick * PERIOD * NS) for found in begun)


def ticks_of(world: World, count: int) -> list[tuple[int, bool]]:
    """Return the ticks that the samples begin, and whether each has one."""
    pacer, tick, found = Samples(world.await_sample, PERIOD, 1.0), 0, []
    for _ in range(count):
        begun = pacer.wait(tick)
        assert begun.tick >= tick
        tick = begun.tick + 1
        found.append((begun.tick, begun.sampled > 0))
    return found


@settings(max_examples=50, deadline=None)
@given(
    st.integers(0, 2**32), st.floats(0.0, 0.3), st.floats(0.0, 0.2), st.floats(-0.01, 0.01),
)  # fmt: skip
def test_every_sample_begins_its_own_tick(seed: int, jitter: float, lost: float, drift: float) -> None:
    """With jitter up to 0.3 periods, losses up to 20 % and a clock up to 1 % off; the period is the plant's."""
    random = np.random.default_rng(seed)
    times = np.arange(400) * PERIOD * (1 + drift) + random.uniform(-jitter, jitter, 400) * PERIOD / 2
    there = random.uniform(size=400) >= lost
    there[0] = True
    with pytest.MonkeyPatch.context() as patch:
        world = World(times[there])
        patch.setattr(clock, "time", world)
        found = ticks_of(world, 380)
    fresh = [tick for tick, sampled in found if sampled]
    assert fresh == np.flatnonzero(there)[: len(fresh)].tolist()
    assert [tick for tick, _ in found] == list(range(380))


def test_without_samples_the_ticks_go_on(use: Any) -> None:
    """Half a period after a sample was expected, the tick begins without it."""
    world = use(World([0.0, 0.01]))
    assert ticks_of(world, 6) == [(0, True), (1, True), (2, False), (3, False), (4, False), (5, False)]
    assert world.now == pytest.approx(50.0 + 0.055)


def test_after_a_standstill_the_tick_is_that_of_the_newest_sample(use: Any) -> None:
    world = use(World(np.arange(100) * PERIOD))
    pacer = Samples(world.await_sample, PERIOD, 1.0)
    assert [pacer.wait(0).tick, pacer.wait(1).tick] == [0, 1]
    world.now += 0.303
    begun = pacer.wait(2)
    assert begun.tick in (31, 32)
