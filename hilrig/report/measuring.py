"""Measures a run: reads each bag once, computes the metrics and judges the expectations. It draws nothing."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from hilrig.core.signals import Array
from hilrig.recording.certificate.durations import command_age
from hilrig.recording.certificate.table import NS, StampTable
from hilrig.recording.run_directory import DAMAGED
from hilrig.recording.timing import terms_of
from hilrig.report.dataset import RunData, TrialEntry, TrialSignals, align, load_run, read_channels, timing_table
from hilrig.report.expectations import Expected, judge_expectations
from hilrig.report.limits_section import limited_ticks
from hilrig.report.measures import all_metrics, measure_trial, table, without

MeasuredRun = Mapping[str, Mapping[str, TrialEntry]]
"""Trials to be drawn: condition -> controller -> trial"""


@dataclass(frozen=True)
class Kept:
    """The data kept from the bag of a trial that will be drawn."""

    signals: TrialSignals
    joints: Any
    """Joint positions, (N, n) rad"""
    table: StampTable | None
    """The time stamps of its ticks in real time; None if there are none"""


@dataclass(frozen=True)
class Measured:
    """A run in numbers."""

    data: RunData
    metrics: pd.DataFrame
    """The tidy table of the trials that are compared"""
    failed_metrics: Mapping[str, str]
    """Metrics that failed, which the table leaves out: kind -> reason"""
    expected: list[Expected]
    sources: list[str]
    """Source of positions and forces: "truth", "measurement" or both; empty if no trial left a usable bag"""
    drawn: MeasuredRun
    most_late: MeasuredRun
    """The repeats with the most late ticks, whose lateness is drawn; empty in lockstep"""
    kept: Mapping[str, Kept]
    """By trial id, for those in `drawn` and `most_late` that left a usable bag"""
    command_ages: Mapping[str, list[Array]]
    """By controller, for each compared real-time trial, (K,) s; in lockstep the delay is the configured one"""
    limited: Mapping[str, Mapping[str, int]]
    """What `limited_ticks` says of each bag that tells it, by trial id"""


@dataclass(frozen=True)
class _Read:
    rows: list[tuple[Any, ...]]
    source: str
    kept: Kept | None
    command_ages: Array | None
    limited: Mapping[str, int] | None


def measure_run(run: Path, to_draw: bool = False) -> Measured:
    """Measure the compared trials of a run and judge its expectations; `to_draw`: keep the signals that figures need.

    Writes metrics.csv into the run directory, unless a bag is damaged or the directory is read-only. Raises
    RunDirectoryError if `run` is not a run directory.
    """
    data = load_run(run)
    drawn = _first_repeats(data) if to_draw else {}
    most_late = _most_late(data) if to_draw else {}
    shown = (trials.values() for trials in (*drawn.values(), *most_late.values()))
    failed: dict[str, str] = {}
    reads = _read_all(data, {trial.id for some in shown for trial in some}, failed)
    metrics = table(without(failed, [row for read in reads.values() for row in read.rows]))
    if reads and os.access(run, os.W_OK) and not any(trial.outcome["outcome"] == DAMAGED for trial in data.trials):
        metrics.to_csv(run / "metrics.csv", index=False)
    return Measured(
        data=data,
        metrics=metrics,
        failed_metrics=failed,
        expected=judge_expectations(data.experiment.get("expect") or [], metrics, data.trials),
        sources=sorted({read.source for read in reads.values()}),
        drawn=drawn,
        most_late=most_late,
        kept={name: read.kept for name, read in reads.items() if read.kept is not None},
        command_ages=_command_ages(data, reads),
        limited={name: read.limited for name, read in reads.items() if read.limited is not None},
    )


def _command_ages(data: RunData, reads: Mapping[str, _Read]) -> dict[str, list[Array]]:
    found: dict[str, list[Array]] = {}
    for trial in data.trials:
        if trial.counts and trial.id in reads and (ages := reads[trial.id].command_ages) is not None:
            found.setdefault(trial.controller, []).append(ages)
    return found


def _first_repeats(data: RunData) -> MeasuredRun:
    """Return, for each condition and controller, the first repeat that is compared, or else the first repeat."""
    chosen: dict[str, dict[str, TrialEntry]] = {condition: {} for condition in data.conditions}
    for trial in sorted(data.trials, key=lambda trial: (not trial.counts, trial.repeat)):
        chosen[trial.condition].setdefault(trial.controller, trial)
    return {
        condition: {name: trials[name] for name in data.controllers if name in trials}
        for condition, trials in chosen.items()
    }


def _most_late(data: RunData) -> MeasuredRun:
    """Return, for each condition and controller in real time, the repeat with the most late ticks."""
    chosen: dict[str, dict[str, TrialEntry]] = {}
    for trial in sorted(data.trials, key=lambda trial: (-trial.timing.get("late", 0), trial.repeat)):
        if trial.timing.get("ticks") and terms_of(trial.document).realtime:
            chosen.setdefault(trial.condition, {}).setdefault(trial.controller, trial)
    return {
        condition: {name: chosen[condition][name] for name in data.controllers if name in chosen[condition]}
        for condition in data.conditions if condition in chosen
    }  # fmt: skip


def _read_all(data: RunData, kept: Collection[str], failed: dict[str, str]) -> dict[str, _Read]:
    """Read the bags one after the other; return the content of each usable one, by trial id.

    Those of a trial that a limit ended are read for a report too, which tells how often commands were limited.
    """
    wanted = (t for t in data.trials if t.counts or t.id in kept or (kept and t.ending == "tripped"))
    reads = {t.id: _read(t, t.id in kept, failed) for t in wanted}
    return {name: read for name, read in reads.items() if read is not None}


def _read(trial: TrialEntry, keep: bool, failed: dict[str, str]) -> _Read | None:
    channels = read_channels(trial)
    signals = align(channels, trial.document)
    if signals is None:
        return None
    rows = measure_trial(trial, signals, all_metrics(), failed) if trial.counts else []
    limited = limited_ticks(channels)
    joints = channels["truth" if "truth" in channels else "state"]["joint_position"]
    realtime = terms_of(trial.document).realtime
    stamps = timing_table(channels, trial.timing.get("one_clock", True)) if realtime else None
    ages = None if stamps is None else command_age(stamps) / NS
    return _Read(rows, signals.source, Kept(signals, joints, stamps) if keep else None, ages, limited)
