"""What stamps cost, from the stamps that were taken: against trials whose ticks take a known time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.alternation import costs
from hilrig.experiment.rig_settings import BLOCK, RigSettings


def stamps(ticks: int, stamped: int, bare: int) -> tuple[np.ndarray, np.ndarray]:
    """Return tick and moment of the stamped ticks of a trial, where each takes `stamped` or `bare` ns."""
    every = np.arange(ticks)
    on = every & RigSettings(certificate_alternates=True).unstamped == 0
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
    on = every & BLOCK == 0
    assert np.abs(costs(every[on], began[on])).max() < 1e-3


def test_without_alternation_every_tick_is_stamped() -> None:
    assert RigSettings().unstamped == 0
    assert costs(*stamps(100, 10, 10)).size == 0
