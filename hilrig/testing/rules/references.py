"""Rules for references: three arrays, which are a signal and its first two derivatives."""

from __future__ import annotations

import numpy as np

from hilrig import Array, ReferenceSignal, Samples, Span
from hilrig.testing.rule import require, rule, same

SPAN = Span(2.0, 6.0, 0.3)
STEP = 1e-5
"""s between the times of a central difference"""
JUMPS = 0.05
"""Fraction of the times at which a rate may jump"""


@rule("references", first=True)
def samples_are_three_finite_arrays(signal: ReferenceSignal) -> None:
    """`sample` must return value, rate and acceleration as finite float64 arrays, one entry for each time."""
    for times in (_times(), _times()[:1], _times()[:0]):
        samples = signal.sample(times, SPAN)
        for name, part in zip(Samples._fields, samples, strict=True):
            require(isinstance(part, np.ndarray), f"its {name} is a {type(part).__name__}")
            require(part.shape == times.shape, f"for {times.size} times its {name} is an array {part.shape}")
            require(part.dtype == np.float64, f"its {name} is an array of {part.dtype}")
            where = np.flatnonzero(~np.isfinite(part))
            require(not where.size, f"its {name} at t = {times[where[:1]]} s is not finite")


@rule("references")
def rates_are_the_derivatives(signal: ReferenceSignal) -> None:
    """The rate must be the derivative of the value, and the acceleration that of the rate.

    Checked by central differences, where forward and backward differences agree: a rate may jump at single instants.
    """
    times = np.sort(np.random.default_rng(2).uniform(2.01, 5.99, 400))
    behind, at, ahead = (signal.sample(times + shift, SPAN) for shift in (-STEP, 0.0, STEP))
    for low, high in (("value", "rate"), ("rate", "acceleration")):
        first, middle, last = (getattr(samples, low) for samples in (behind, at, ahead))
        slope, given = (last - first) / (2 * STEP), getattr(at, high)
        scale = 1.0 + np.abs(slope) + np.abs(given)
        smooth = np.abs((last - middle) - (middle - first)) / STEP < 1e-2 * scale
        wrong = np.abs(slope - given) > 1e-4 * scale
        share = np.mean(wrong | ~smooth)
        k = int(np.flatnonzero(wrong)[0]) if wrong.any() else 0
        require(
            not (wrong & smooth).any() and share <= JUMPS,
            f"at t = {times[k]:.4f} s the {low} changes by {slope[k]:.6g} a second, and its {high} is {given[k]:.6g}",
        )


@rule("references")
def a_sample_does_not_depend_on_the_others(signal: ReferenceSignal) -> None:
    """The sample at a time must not depend on the other times requested with it."""
    times = _times()
    for name, whole, single in zip(
        Samples._fields, signal.sample(times, SPAN), signal.sample(times[37:38], SPAN), strict=True
    ):
        require(
            whole[37] == single[0],
            f"its {name} at t = {times[37]:g} s is {single[0]!r} alone and {whole[37]!r} among others",
        )


@rule("references")
def times_are_only_read(signal: ReferenceSignal) -> None:
    """`sample` must only read the times."""
    times = _times()
    signal.sample(times, SPAN)
    require(same(times, _times()), "it changed them")


@rule("references")
def samples_belong_to_the_caller(signal: ReferenceSignal) -> None:
    """The arrays that `sample` returns must belong to the caller, who may change them."""
    times = _times()
    expected = [part.copy() for part in signal.sample(times, SPAN)]
    for i, name in enumerate(Samples._fields):
        samples = signal.sample(times, SPAN)
        samples[i][:] = 9.0
        others = [samples[j] for j in range(3) if j != i]
        require(same(times, _times()), f"its {name} is the array of the times")
        for other, was in zip(others, expected[:i] + expected[i + 1 :], strict=True):
            require(same(other, was), f"its {name} shares its memory with another of the three")
        again = signal.sample(times, SPAN)[i]
        require(same(again, expected[i]), "after a change of its {} it gave {}, ... at the next call", name, again[:3])


def _times() -> Array:
    return np.arange(SPAN.start, SPAN.end, 1e-2)
