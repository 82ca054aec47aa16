"""The section "Bounds": what the paper's bounds say of the run's controllers, from the plan and the record."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hilrig.core.signals import Array
from hilrig.report.dataset import RunData

_TITLES = {
    "delay_printed": "delay bound (24), as printed (nu)",
    "delay_derived": "delay bound (24), as derived (kappa)",
    "delay_best": "delay bound (24), as derived, best kappa",
    "inertia_lower": "Mhat, lower edge (empirical)",
    "inertia_upper": "Mhat, upper edge",
    "mismatch": "condition (9), |M_t⁻¹ Mhat − I|",
    "joint_speed": "joint speed in free flight",
}


@dataclass(frozen=True)
class BoundRow:
    """One value against one limit, as people read it; None for a number that is not finite."""

    bound: str
    value: float | None
    limit: float | None
    unit: str
    must: str
    margin: float | None
    kept: bool
    remark: str


@dataclass(frozen=True)
class MeasuredDelay:
    """The loop delay of a controller's trials in real time: the age of the command in effect."""

    p50: float
    """ms"""
    p99: float
    """ms"""
    max: float
    """ms"""
    over: float
    """Share of the periods whose delay was over the derived bound with the best kappa"""
    over_paper: float
    """The same with the paper's kappa"""


@dataclass(frozen=True)
class BoundGroup:
    """A controller with time delay estimation."""

    controller: str
    period: float
    """ms"""
    delay_set: float
    """Actuation delay, ms"""
    measured: MeasuredDelay | None
    """None in lockstep, and where nothing was recorded"""
    rows: list[BoundRow]
    unknown: list[str]


@dataclass(frozen=True)
class FlightRow:
    """A force-controlled axis in free flight."""

    axis: str
    phase: str
    force: float
    speed: float | None
    time_constant: float | None
    joints: BoundRow


@dataclass(frozen=True)
class BoundsSection:
    """What the section shows."""

    known: bool
    """Whether the plan has bounds; one made before they were written down has none"""
    realtime: bool
    groups: list[BoundGroup]
    flights: list[FlightRow]


def bounds_section(run: RunData, ages: Mapping[str, Sequence[Array]]) -> BoundsSection:
    """Return the section; `ages` are those of the commands in effect, (K,) s, by controller and trial in real time."""
    found = run.bounds
    periods = {trial.controller: trial.document for trial in run.trials}
    groups = [
        _group(name, estimator, periods[name], ages.get(name, ()))
        for name, estimator in found.get("estimators", {}).items()
    ]
    flights = [
        FlightRow(f["axis"], f["phase"], f["force"], f["speed"], f["time_constant"], _row(f["joints"]))
        for f in found.get("flights", ())
    ]
    return BoundsSection(bool(found), run.manifest.get("clock") == "realtime", groups, flights)


def _group(name: str, estimator: Mapping[str, Any], trial: Mapping[str, Any], ages: Sequence[Array]) -> BoundGroup:
    checks = estimator["checks"]
    limits = {check["bound"]: check["limit"] for check in checks}
    all_ages = np.concatenate(ages) if ages else np.zeros(0)
    return BoundGroup(
        name, 1e3 * trial["period"], 1e3 * trial["actuation_delay"] * trial["period"], _measured(all_ages, limits),
        [_row(check) for check in checks], list(estimator["unknown"]),
    )  # fmt: skip


def _measured(ages: Array, limits: Mapping[str, float]) -> MeasuredDelay | None:
    if ages.size == 0:
        return None
    p50, p99, most = (1e3 * float(value) for value in np.percentile(ages, [50, 99, 100]))
    shares = [float(np.mean(ages > limits.get(bound, math.inf))) for bound in ("delay_best", "delay_derived")]
    return MeasuredDelay(p50, p99, most, *shares)


def _row(check: Mapping[str, Any]) -> BoundRow:
    factor, unit = (1e3, "ms") if check["unit"] == "s" else (1.0, check["unit"].replace("x Mhat", "× Mhat"))
    value, limit = (None if check[key] is None else factor * check[key] for key in ("value", "limit"))
    kappa = "" if check["kappa"] is None else f"kappa = {check['kappa']:.3g}"
    remark = "; ".join(part for part in (kappa, check["where"]) if part)
    return BoundRow(
        _TITLES[check["bound"]], value, limit, unit, check["must"], check["margin"], check["kept"], remark
    )  # fmt: skip
