"""Measures a run: each bag is read once, and metrics and expectations follow. Draws nothing."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from hilrig.recording.run_directory import DAMAGED
from hilrig.report.dataset import RunData, TrialEntry, TrialSignals, align, load_run, read_channels
from hilrig.report.expectations import Expected, judge
from hilrig.report.loop_delay import loop_delays
from hilrig.report.measures import all_metrics, measure, table
from hilrig.signals import Array

Drawn = Mapping[str, Mapping[str, TrialEntry]]
"""Trials to be drawn: condition -> controller -> trial"""


@dataclass(frozen=True)
class Kept:
    """What is kept of the bag of a trial that is to be drawn."""

    signals: TrialSignals
    joints: Any
    """Joint positions, (N, n) rad"""


@dataclass(frozen=True)
class Measured:
    """A run in numbers."""

    data: RunData
    metrics: pd.DataFrame
    """The tidy table of the completed trials"""
    expected: list[Expected]
    sources: list[str]
    """Where positions and forces come from: "truth", "measurement" or both; empty if no trial left a usable bag"""
    drawn: Drawn
    kept: Mapping[str, Kept]
    """By trial id, of those in `drawn` that left a usable bag"""
    loop_delays: Mapping[str, list[Array]]
    """By controller, of each completed trial in real time, (K,) s; in lockstep they are what was set"""


@dataclass(frozen=True)
class _Read:
    rows: list[tuple[Any, ...]]
    source: str
    kept: Kept | None
    loop_delays: Array | None


def measure_run(run: Path, to_draw: bool = False) -> Measured:
    """Measure the completed trials of a run, and judge what was expected of them; keep signals if they are `to_draw`.

    Writes metrics.csv into the run directory, unless a record has been damaged since, or the run can only be read.
    Raises RunDirectoryError if `run` is not one.
    """
    data = load_run(run)
    drawn = _first_repeats(data) if to_draw else {}
    reads = _read_all(data, {trial.id for trials in drawn.values() for trial in trials.values()})
    metrics = table([row for read in reads.values() for row in read.rows])
    if reads and os.access(run, os.W_OK) and not any(trial.outcome["outcome"] == DAMAGED for trial in data.trials):
        metrics.to_csv(run / "metrics.csv", index=False)
    return Measured(
        data=data,
        metrics=metrics,
        expected=judge(data.experiment.get("expect") or [], metrics, data.trials),
        sources=sorted({read.source for read in reads.values()}),
        drawn=drawn,
        kept={name: read.kept for name, read in reads.items() if read.kept is not None},
        loop_delays=_loop_delays(data, reads),
    )


def _loop_delays(data: RunData, reads: Mapping[str, _Read]) -> dict[str, list[Array]]:
    found: dict[str, list[Array]] = {}
    for trial in data.trials:
        if trial.completed and trial.id in reads and (delays := reads[trial.id].loop_delays) is not None:
            found.setdefault(trial.controller, []).append(delays)
    return found


def _first_repeats(data: RunData) -> Drawn:
    """Return the first completed repeat of each condition and controller, or its first at all."""
    chosen: dict[str, dict[str, TrialEntry]] = {condition: {} for condition in data.conditions}
    for trial in sorted(data.trials, key=lambda trial: (not trial.completed, trial.repeat)):
        chosen[trial.condition].setdefault(trial.controller, trial)
    return {
        condition: {name: trials[name] for name in data.controllers if name in trials}
        for condition, trials in chosen.items()
    }


def _read_all(data: RunData, kept: Collection[str]) -> dict[str, _Read]:
    """Read the bags one after the other; return what they hold, by trial id, of each trial that left something."""
    reads = {t.id: _read(t, t.id in kept) for t in data.trials if t.completed or t.id in kept}
    return {name: read for name, read in reads.items() if read is not None}


def _read(trial: TrialEntry, keep: bool) -> _Read | None:
    channels = read_channels(trial)
    signals = align(channels, trial.document)
    if signals is None:
        return None
    rows = measure(trial, signals, all_metrics()) if trial.completed else []
    joints = channels["truth" if "truth" in channels else "state"]["joint_position"]
    delays = None
    if trial.document.get("clock") == "realtime" and "driver_timing" in channels:
        delays = loop_delays(channels["driver_timing"])
    return _Read(rows, signals.source, Kept(signals, joints) if keep else None, delays)
