"""What an experiment should be warned of: its margins in words, with the place in its file."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from hilrig.core.errors import Problem
from hilrig.experiment.document import Keys
from hilrig.experiment.plan.margins import Check, Estimator, Flight, Margins
from hilrig.experiment.plan.reference_warnings import of_references
from hilrig.kinds.delay_bounds import PAPER_KAPPA, PAPER_NU

if TYPE_CHECKING:
    from hilrig.experiment import Experiment


def warnings(experiment: Experiment, found: Margins) -> list[Problem]:
    """Return a warning for every bound that is not kept, and for what cannot be judged; the experiment runs anyway."""
    spoken = [*of_references(experiment), *_of_controllers(found.estimators), *_of_flights(found.flights)]
    return [Problem(experiment.place(*path), message) for path, message in spoken]


def _of_controllers(estimators: dict[str, Estimator]) -> Iterator[tuple[Keys, str]]:
    """Yield each warning once, at the first of the controllers that it is for."""
    names: dict[tuple[Keys, str], list[str]] = {}
    for name, estimator in estimators.items():
        for below, text in _of_estimator(estimator):
            names.setdefault((below, text), []).append(name)
    for (below, text), mine in names.items():
        who = "controller" if len(mine) == 1 else "controllers"
        listed = ", ".join(f"'{name}'" for name in mine)
        yield ("controllers", mine[0], *below), f"{who} {listed}: {text}"


def _of_estimator(estimator: Estimator) -> Iterator[tuple[Keys, str]]:
    broken = {check.bound: check for check in estimator.checks if not check.kept}
    if "delay_derived" in broken:
        best = next(check for check in estimator.checks if check.bound == "delay_best")
        yield (), _delay(broken["delay_derived"], best)
    for bound, words in (("inertia_lower", _too_small), ("inertia_upper", _too_large), ("mismatch", _mismatch)):
        if bound in broken:
            yield ("inertia_estimate",), words(broken[bound])
    for reason in estimator.unknown:
        yield (), reason


def _delay(given: Check, best: Check) -> str:
    where = f" in {given.where}" if given.where else ""
    delay = f"the delay of {_ms(given.value)}{where}"
    paper = f"nu = {PAPER_NU:g}, kappa = {PAPER_KAPPA:g}"
    if best.kept:
        return (
            f"{delay} is over the {_ms(given.limit)} of the delay bound (24) with the paper's {paper}; "
            f"with kappa = {best.kappa:.3g} the bound is {_ms(best.limit)}, and it is kept"
        )
    return (
        f"{delay} is over the delay bound (24): {_ms(best.limit)} with the best kappa, {best.kappa:.3g}, and "
        f"{_ms(given.limit)} with the paper's {paper}; the paper's proof does not cover this loop"
    )


def _too_small(check: Check) -> str:
    return (
        f"{_estimate(check, 'below', 'small')}, the lower edge 2 lambda_max(M_t) l k_p/k_d at {check.where}; under "
        "this edge, which was found by simulation, expect a limit cycle"
    )


def _too_large(check: Check) -> str:
    return (
        f"{_estimate(check, 'above', 'large')}, the upper edge for a stable estimation loop with this delay and "
        f"velocity filter, at {check.where}"
    )


def _estimate(check: Check, side: str, size: str) -> str:
    """Return "Mhat = 0.5 kg is above 0.36 kg"; where Mhat differs between axes, by which factor it is off."""
    if check.unit == "kg":
        return f"Mhat = {check.value:.3g} kg is {side} {check.limit:.3g} kg"
    return f"Mhat is too {size}, by a factor of {1 / check.margin:.3g}"


def _mismatch(check: Check) -> str:
    return (
        f"condition (9) is not kept: |M_t^-1 Mhat - I| is {check.value:.3g}, not below 1, at {check.where}; "
        "for stability it is neither necessary nor sufficient, the window of Mhat is what counts"
    )


def _of_flights(flights: tuple[Flight, ...]) -> Iterator[tuple[Keys, str]]:
    for flight in flights:
        if not flight.joints.kept:
            yield ("task", "impedance", "damping"), _too_fast(flight)


def _too_fast(flight: Flight) -> str:
    if math.isinf(flight.speed):
        return f"the damping B_d along {flight.axis} is 0: without contact nothing bounds the speed of the tip"
    return (
        f"without contact the tip may reach F_d/B_d = {flight.speed:.3g} m/s along {flight.axis} "
        f"(F_d = {flight.force:.3g} N, phase '{flight.phase}'); a joint would turn at {flight.joints.value:.3g} rad/s, "
        f"over the safety limit of {flight.joints.limit:.3g} rad/s, at {flight.joints.where}"
    )


def _ms(seconds: float) -> str:
    return f"{seconds * 1e3:.3g} ms"
