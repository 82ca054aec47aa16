"""The bounds of a law with time delay estimation, in words: delay bound (24), window of Mhat and condition (9).

docs/bounds.md has the equations, and the measurements on both sides of each bound.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from hilrig.core.assessment import Assessment, Bound, Setting
from hilrig.core.parameters import PerAxis, per_axis
from hilrig.core.signals import Array
from hilrig.kinds.controllers._delay_bound import (
    PAPER_KAPPA,
    PAPER_NU,
    BestBound,
    ErrorDynamics,
    best_delay_bound,
    delay_bound,
    error_dynamics,
    lyapunov_matrix,
)
from hilrig.kinds.controllers._inertia_window import (
    estimation_mismatch,
    highest_ratio,
    inertia_ratios,
    lowest_ratio,
)

NOTE = (
    "(24) is sufficient in the paper's proof, not necessary: a loop that exceeds it may work. The form with kappa "
    "follows from the paper's own inequalities, and the proof needs only one kappa, so the best one counts. (9) is "
    "neither necessary nor sufficient for stability. The window of Mhat decides: above its upper edge the estimation "
    "loop is unstable, below its lower edge limit cycles were found."
)


class Estimation(NamedTuple):
    """The parameters of a law with time delay estimation that its bounds depend on, one for each of m axes."""

    inertia_estimate: Array
    """Mhat, (m,) kg"""
    position_gain: Array
    """k_p, (m,) 1/s^2"""
    velocity_gain: Array
    """k_d, (m,) 1/s"""


def assess_delay_estimation(
    setting: Setting, inertia_estimate: PerAxis | Array, position_gain: PerAxis | Array, velocity_gain: PerAxis | Array
) -> Assessment:
    """Return the bounds of tau = J^T [Mhat (a_d + k_d e' + k_p e) + J^-T tau_l - Mhat x''_l] in this setting.

    Mhat = `inertia_estimate` (kg), k_p = `position_gain` (1/s^2), k_d = `velocity_gain` (1/s), each once or per axis.
    Raises ValueError, naming the parameter, if one does not fit the axes, or if Mhat is not above 0.
    """
    axes = len(setting.task.axes)
    law = Estimation(
        per_axis(inertia_estimate, axes, "inertia_estimate"),
        per_axis(position_gain, axes, "position_gain"),
        per_axis(velocity_gain, axes, "velocity_gain"),
    )
    if not (np.isfinite(law.inertia_estimate).all() and (law.inertia_estimate > 0).all()):
        raise ValueError(f"inertia_estimate is {law.inertia_estimate}; it must be above 0 kg")
    dynamics = error_dynamics(law.position_gain, law.velocity_gain, axes)
    try:
        lyapunov_matrix(dynamics.undelayed)
    except ValueError as error:
        return Assessment((), (f"no bound is known for its gains k_p, k_d: {error}",), NOTE)
    delays = tuple(_delay_bounds(dynamics, setting))
    mobilities = [path.mobility for path in setting.paths if path.mobility is not None]
    if not mobilities:
        unknown = "the window of Mhat and condition (9) are not known: the robot's model has no M to invert"
        return Assessment(delays, (unknown,), NOTE)
    return Assessment((*delays, *_window(law, setting, mobilities), _mismatch(law, setting, mobilities)), (), NOTE)


def _delay_bounds(dynamics: ErrorDynamics, setting: Setting) -> Iterator[Bound]:
    """Yield the delay against (24): as printed and as derived with the paper's kappa, and with the best kappa.

    The proof needs only one kappa, so only the best one decides whether it covers the loop.
    """
    slowest = max(setting.paths, key=lambda path: path.delay)
    # Even without extra samples the estimate is one period old.
    delay = max(slowest.delay, 1) * setting.task.period
    condition = f"condition '{slowest.condition}'" if len({path.delay for path in setting.paths}) > 1 else ""
    bound = partial(Bound, value=delay, must="below", unit="s", where=condition, recorded_as="command_age")
    given, best = delay_bound(dynamics), best_delay_bound(dynamics)
    printed, basis = delay_bound(dynamics, "printed"), f"kappa = {PAPER_KAPPA:g}"
    yield bound("delay bound (24), as printed (nu)", limit=printed, warning="", basis=basis)
    yield bound("delay bound (24), as derived (kappa)", limit=given, warning="", basis=basis)
    yield bound(
        "delay bound (24), as derived, best kappa", limit=best.delay, basis=f"kappa = {best.kappa:.3g}",
        warning=_too_slow(delay, condition, given, best),
    )  # fmt: skip


def _window(law: Estimation, setting: Setting, mobilities: list[Array]) -> Iterator[Bound]:
    """Yield Mhat against both edges of its window; if Mhat differs between axes, as a factor on the given values."""
    estimate = law.inertia_estimate
    value, unit = (float(estimate[0]), "kg") if np.ptp(estimate) == 0 else (1.0, "x Mhat")
    bound = partial(Bound, value=value, unit=unit, about=("inertia_estimate",))
    ratios = [inertia_ratios(mobility, estimate) for mobility in mobilities]
    lowest, place = setting.lowest([ratio[:, 0] for ratio in ratios])
    least = lowest_ratio(setting.task.period, law.position_gain, law.velocity_gain)
    edge = value * least / lowest if lowest > 0 else np.inf
    yield bound(
        "Mhat, lower edge (empirical)", must="above", limit=edge, where=place,
        warning=_too_small(value, edge, unit, place),
    )  # fmt: skip
    room, place = setting.lowest([
        highest_ratio(path.delay, setting.velocity_smoothing) / ratio[:, -1]
        for path, ratio in zip(setting.paths, ratios, strict=True)
    ])  # fmt: skip
    edge = value * room
    yield bound(
        "Mhat, upper edge", must="below", limit=edge, where=place, warning=_too_large(value, edge, unit, place)
    )  # fmt: skip


def _mismatch(law: Estimation, setting: Setting, mobilities: list[Array]) -> Bound:
    size, place = setting.highest([estimation_mismatch(mobility, law.inertia_estimate) for mobility in mobilities])
    warning = (
        f"condition (9) is not kept: |M_t^-1 Mhat - I| is {size:.3g}, not below 1, at {place}; the paper's proof does "
        "not cover this loop, but (9) is neither necessary nor sufficient for stability: the window of Mhat decides"
    )
    return Bound(
        "condition (9), |M_t⁻¹ Mhat − I|", size, "below", 1.0, "", warning, place, about=("inertia_estimate",)
    )  # fmt: skip


def _too_slow(delay: float, condition: str, given: float, best: BestBound) -> str:
    where = f" in {condition}" if condition else ""
    return (
        f"the delay of {_ms(delay)}{where} is over the delay bound (24): {_ms(best.delay)} with the best kappa, "
        f"{best.kappa:.3g}, and {_ms(given)} with the paper's nu = {PAPER_NU:g}, kappa = {PAPER_KAPPA:g}; "
        "the paper's proof does not cover this loop"
    )


def _too_small(value: float, edge: float, unit: str, place: str) -> str:
    return (
        f"{_estimate(value, edge, unit, 'below', 'small')}, the lower edge 2 lambda_max(M_t) l k_p/k_d at {place}; "
        "expect a limit cycle below this edge, which was found by simulation"
    )


def _too_large(value: float, edge: float, unit: str, place: str) -> str:
    return (
        f"{_estimate(value, edge, unit, 'above', 'large')}, the upper edge for a stable estimation loop with this "
        f"delay and velocity filter, at {place}"
    )


def _estimate(value: float, edge: float, unit: str, side: str, size: str) -> str:
    """Return "Mhat = 0.5 kg is above 0.36 kg"; if Mhat differs between axes, the factor by which it is off."""
    if unit == "kg":
        return f"Mhat = {value:.3g} kg is {side} {edge:.3g} kg"
    return f"Mhat is too {size}, by a factor of {max(value / edge, edge / value):.3g}"


def _ms(seconds: float) -> str:
    return f"{seconds * 1e3:.3g} ms"
