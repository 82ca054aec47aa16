"""What stamps cost, computed from the stamps that were taken: for trials whose ticks take a known time."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks import alternating_rig
from benchmarks.alternating_process import PACKETS, alternating
from benchmarks.alternation import costs

BLOCK = 128


def stamps(ticks: int, stamped: int, bare: int) -> tuple[np.ndarray, np.ndarray]:
    """Return tick and time of the stamped ticks of a trial in which each tick takes `stamped` or `bare` ns."""
    every = np.arange(ticks)
    on = every // BLOCK % 2 == 0
    began = np.concatenate([[0], np.cumsum(np.where(on, stamped, bare))[:-1]])
    return every[on], began[on]


@given(
    bare=st.integers(10_000, 200_000), more=st.integers(-2_000, 20_000), pairs=st.integers(1, 4),
    rest=st.integers(1, BLOCK),
)  # fmt: skip
def test_the_cost_is_what_a_stamped_tick_takes_more(bare: int, more: int, pairs: int, rest: int) -> None:
    found = costs(*stamps(2 * pairs * BLOCK + rest, bare + more, bare))
    assert found.shape == (pairs - (rest < BLOCK),)
    assert found == pytest.approx(np.full(found.shape, more / (bare + more)), abs=1e-9)


def test_a_drift_of_the_machine_costs_nothing() -> None:
    """Ticks that become slower all the time: the neighbours before and after make up for it."""
    every = np.arange(9 * BLOCK)
    began = 50_000 * every + every**2 // 10
    on = every // BLOCK % 2 == 0
    assert np.abs(costs(every[on], began[on])).max() < 1e-3


def test_a_trial_stamped_throughout_has_no_blocks_to_compare() -> None:
    every = np.arange(9 * BLOCK)
    assert costs(every, 10 * every).size == 0


def test_stamping_changes_after_so_many_packets() -> None:
    sent, stamping, stamped = [], [True], []
    put = alternating(sent.append, stamping)
    for number in range(3 * PACKETS):
        stamped.append(bool(stamping))
        put(bytes([number]))
    assert stamped == [True] * PACKETS + [False] * PACKETS + [True] * PACKETS
    assert sent == [bytes([number]) for number in range(3 * PACKETS)]


@pytest.mark.parametrize(
    ("module", "started"), [("hilrig.rig.driver_process", True), ("hilrig.rig.logger_process", False)]
)
def test_driver_and_controller_are_replaced_and_nothing_else(module: str, started: bool) -> None:
    child = alternating_rig.Popen([sys.executable, "-c", "", "-m", module])
    assert child.wait() == 0
    assert (alternating_rig.STAND_IN in child.args) is started
    assert (module in child.args) is not started
