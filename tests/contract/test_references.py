"""What every reference keeps to: three arrays that are a signal and its two derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.builders import example

from hilrig.core.interfaces import ReferenceSignal, Span
from hilrig.kinds.registry import dump, kinds, load, restore

SPAN = Span(2.0, 6.0, 0.3)
STEP = 1e-5
TABLE = "time,r\n" + "".join(f"{t},{np.sin(t)}\n" for t in range(5))


@pytest.fixture(params=kinds("references"))
def signal(request: pytest.FixtureRequest) -> ReferenceSignal:
    cls = load("references", request.param)
    made = example(cls, file="table.csv", column="r")
    return made.filled(TABLE) if hasattr(cls, "reads") else made


def test_shapes(signal: ReferenceSignal) -> None:
    time = np.arange(2.0, 6.0, 1e-2)
    for part in signal.sample(time, SPAN):
        assert part.shape == time.shape
        assert part.dtype == np.float64
        assert np.isfinite(part).all()


def test_rates_are_the_derivatives(signal: ReferenceSignal) -> None:
    """By central differences, away from instants at which a rate may jump."""
    time = np.random.default_rng(2).uniform(2.01, 5.99, 200)
    time = np.sort(time[np.abs(time - np.round(time)) > 1e-3])
    at, ahead, behind = (signal.sample(time + shift, SPAN) for shift in (0.0, STEP, -STEP))
    np.testing.assert_allclose(at.rate, (ahead.value - behind.value) / (2 * STEP), atol=1e-6)
    np.testing.assert_allclose(at.acceleration, (ahead.rate - behind.rate) / (2 * STEP), atol=1e-5)


def test_a_sample_does_not_depend_on_the_others(signal: ReferenceSignal) -> None:
    time = np.arange(2.0, 6.0, 1e-2)
    for whole, single in zip(signal.sample(time, SPAN), signal.sample(time[37:38], SPAN), strict=True):
        assert whole[37] == single[0]


def test_times_are_only_read(signal: ReferenceSignal) -> None:
    time = np.arange(2.0, 6.0, 1e-2)
    before = time.copy()
    for part in signal.sample(time, SPAN):
        part[:] = 9.0
    np.testing.assert_array_equal(time, before)
    assert not (signal.sample(time, SPAN).value == 9.0).any(), "samples are the caller's own"


def test_it_survives_being_written_down(signal: ReferenceSignal) -> None:
    assert restore("references", dump(signal)) == signal
