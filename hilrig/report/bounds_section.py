"""The section "Bounds": the planned bounds of controllers and task, and the measured loop delay."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hilrig.core.signals import Array
from hilrig.recording.certificate.histogram import quantiles
from hilrig.report.dataset import RunData


@dataclass(frozen=True)
class BoundRow:
    """One value and its limit, for display; None for a number that is not finite."""

    bound: str
    value: float | None
    limit: float | None
    unit: str
    must: str
    margin: float | None
    kept: bool
    decides: bool
    """Whether breaking the bound is a problem; otherwise it is shown for comparison only"""
    remark: str


@dataclass(frozen=True)
class LoopDelay:
    """The delay from measurement to command in effect in a controller's trials, ms."""

    period: float
    planned: float
    p50: float | None
    """As measured in real time, as are the two below; None in lockstep, or if nothing was recorded"""
    p99: float | None
    max: float | None


@dataclass(frozen=True)
class BoundGroup:
    """What is known about one controller, or about the task."""

    title: str
    delay: LoopDelay | None
    """None if no bound limits the loop delay"""
    rows: list[BoundRow]
    unknown: list[str]


@dataclass(frozen=True)
class BoundsSection:
    """What the section shows."""

    known: bool
    """Whether the plan lists its bounds; plans of older hilrig versions do not, or use another form"""
    realtime: bool
    notes: list[str]
    """Notes on the bounds for readers, each listed once"""
    groups: list[BoundGroup]


def bounds_section(run: RunData, ages: Mapping[str, Sequence[Array]]) -> BoundsSection:
    """Return the section; `ages` are the ages of the commands in effect, (K,) s, by controller and real-time trial."""
    found: Mapping[str, Any] = run.bounds.get("controllers", {})
    task = run.bounds.get("task")
    trials = {trial.controller: trial.document for trial in run.trials}
    groups = [_group(name, said, trials[name], ages.get(name, ())) for name, said in found.items()]
    said = [*found.values(), *([task] if task else [])]
    if task and (task["bounds"] or task["unknown"]):
        groups.append(BoundGroup("Task", None, [_row(bound) for bound in task["bounds"]], list(task["unknown"])))
    notes = list(dict.fromkeys(item["note"] for item in said if item["note"]))
    return BoundsSection(task is not None, run.manifest.get("clock") == "realtime", notes, groups)


def _group(name: str, said: Mapping[str, Any], trial: Mapping[str, Any], ages: Sequence[Array]) -> BoundGroup:
    bounds, measured = said["bounds"], np.concatenate(ages) if ages else np.zeros(0)
    on_delay = any(bound["recorded_as"] == "command_age" for bound in bounds)
    delay = _delay(trial, measured) if on_delay else None
    return BoundGroup(name, delay, [_row(bound, measured) for bound in bounds], list(said["unknown"]))


def _delay(trial: Mapping[str, Any], ages: Array) -> LoopDelay:
    period, planned = 1e3 * trial["period"], 1e3 * trial["actuation_delay"] * trial["period"]
    if ages.size == 0:
        return LoopDelay(period, planned, None, None, None)
    found = quantiles(ages)
    return LoopDelay(period, planned, *(1e3 * found[name] for name in ("p50", "p99", "max")))


def _row(bound: Mapping[str, Any], ages: Array | None = None) -> BoundRow:
    ends = (bound["value"], bound["limit"])
    in_ms = bound["unit"] == "s" and all(abs(number) < 1.0 for number in ends if number is not None)
    value, limit = (None if number is None else number * (1e3 if in_ms else 1.0) for number in ends)
    unit = "ms" if in_ms else bound["unit"].replace("x Mhat", "× Mhat")
    return BoundRow(
        bound["name"], value, limit, unit, bound["must"], bound["margin"], bound["kept"], bound["decides"],
        "; ".join(_remarks(bound, ages)),
    )  # fmt: skip


def _remarks(bound: Mapping[str, Any], ages: Array | None) -> Iterator[str]:
    yield from (bound[key] for key in ("basis", "where") if bound[key])
    if bound["recorded_as"] == "command_age" and bound["limit"] is not None and ages is not None and ages.size:
        off = ages >= bound["limit"] if bound["must"] == "below" else ages <= bound["limit"]
        yield f"as measured, not kept in {100 * float(np.mean(off)):.3g} % of the periods"
