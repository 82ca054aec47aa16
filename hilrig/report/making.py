"""The pipeline of a report: read each trial once, measure it, draw what is compared, write the page."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from hilrig.errors import RunDirectoryError
from hilrig.recording.run_directory import DAMAGED, make_directory, write_json
from hilrig.report.animation import animation
from hilrig.report.comparison import Verdict, summarise, verdicts
from hilrig.report.dataset import RunData, TrialEntry, TrialSignals, align, load_run, read_channels
from hilrig.report.expectations import Expected, judge
from hilrig.report.figures import comparison_figures
from hilrig.report.internals import internals_figure
from hilrig.report.measures import all_metrics, measure, table
from hilrig.report.page import Content, Shown, write_page
from hilrig.report.panels import Drawn
from hilrig.report.saving import save

REPORTS = Path("reports")


@dataclass(frozen=True)
class _Read:
    """What is kept of one trial's bag: its metrics, and for a trial that is drawn its signals."""

    rows: list[tuple[Any, ...]]
    signals: TrialSignals | None
    joints: Any
    """Joint positions, (N, n) rad, of a trial that is drawn"""
    source: str


def make_report(run: Path, out: Path | None = None) -> Path:
    """Make the report of a run from its directory alone; return the path of its page.

    Writes index.html, figures/, metrics.csv and summary.json into `out` (default reports/<name of the run>), and
    metrics.csv into the run directory. Raises RunDirectoryError if `run` is not one, if it has nothing to report, or if
    `out` cannot be made.
    """
    data = load_run(run)
    folder = out or REPORTS / data.path.resolve().name
    drawn = _first_repeats(data)
    reads = _read_all(data, drawn)
    metrics = table([row for trial in data.trials if trial.id in reads for row in reads[trial.id].rows])
    if not reads:
        raise RunDirectoryError(f"{run}: no trial left a usable bag; see: hilrig show {run}")
    with suppress(FileExistsError):
        make_directory(folder / "figures")
    metrics.to_csv(folder / "metrics.csv", index=False)
    _keep_in_run(data, metrics)
    judged, expected = verdicts(metrics), judge(data.experiment.get("expect") or [], metrics, data.trials)
    content = Content(
        data, metrics, summarise(metrics), judged, expected, _figures(data, drawn, reads, folder),
        animation(_scene(drawn, reads), folder), sorted({read.source for read in reads.values()}), folder,
    )  # fmt: skip
    write_json(folder / "summary.json", _summary(data, content.summary, judged, expected))
    return write_page(content)


def _keep_in_run(data: RunData, metrics: pd.DataFrame) -> None:
    """Write the run's own metrics.csv, unless a record has been damaged since, or the run can only be read."""
    if os.access(data.path, os.W_OK) and not any(trial.outcome["outcome"] == DAMAGED for trial in data.trials):
        metrics.to_csv(data.path / "metrics.csv", index=False)


def _first_repeats(data: RunData) -> dict[str, dict[str, TrialEntry]]:
    """Return which trials are drawn: condition -> controller -> its first completed repeat, or its first at all."""
    chosen: dict[str, dict[str, TrialEntry]] = {condition: {} for condition in data.conditions}
    for trial in sorted(data.trials, key=lambda trial: (not trial.completed, trial.repeat)):
        chosen[trial.condition].setdefault(trial.controller, trial)
    return {
        condition: {name: trials[name] for name in data.controllers if name in trials}
        for condition, trials in chosen.items()
    }


def _read_all(data: RunData, drawn: Mapping[str, Mapping[str, TrialEntry]]) -> dict[str, _Read]:
    """Read the bags one after the other; return what is kept of each trial that left something."""
    shown = {trial.id for trials in drawn.values() for trial in trials.values()}
    found: dict[str, _Read] = {}
    for trial in data.trials:
        if trial.completed or trial.id in shown:
            read = _read(trial, trial.id in shown)
            if read is not None:
                found[trial.id] = read
    return found


def _read(trial: TrialEntry, keep: bool) -> _Read | None:
    channels = read_channels(trial)
    signals = align(channels, trial.document)
    if signals is None:
        return None
    rows = measure(trial, signals, all_metrics()) if trial.completed else []
    joints = channels["truth" if "truth" in channels else "state"]["joint_position"] if keep else None
    return _Read(rows, signals if keep else None, joints, signals.source)


def _figures(
    data: RunData, drawn: Mapping[str, Mapping[str, TrialEntry]], reads: Mapping[str, _Read], folder: Path
) -> dict[str, list[Shown]]:
    """Draw and save the figures; return them by condition."""
    shown: dict[str, list[Shown]] = {}
    for condition, trials in drawn.items():
        pairs = {name: (trial, _signals(reads[trial.id])) for name, trial in trials.items() if trial.id in reads}
        if not pairs:
            continue
        pictures = comparison_figures(Drawn(pairs, data.controllers))
        pictures += [p for pair in pairs.values() if (p := internals_figure(*pair)) is not None]
        shown[condition] = [save(picture, condition, folder) for picture in pictures]
    return shown


def _signals(read: _Read) -> TrialSignals:
    assert read.signals is not None, "a trial that is drawn keeps its signals"
    return read.signals


def _scene(drawn: Mapping[str, Mapping[str, TrialEntry]], reads: Mapping[str, _Read]) -> tuple[TrialEntry, Any] | None:
    """Return the trial to animate, the first that is drawn and completed, with its joint positions."""
    for trials in drawn.values():
        for trial in trials.values():
            if trial.completed and trial.id in reads:
                return trial, reads[trial.id].joints
    return None


def _summary(
    data: RunData,
    summary: pd.DataFrame,
    judged: Mapping[tuple[str, str, str, str], Verdict],
    expected: list[Expected],
) -> dict[str, Any]:
    """Return the report's numbers for programs."""
    cells = [
        {"condition": cell[0], "phase": cell[1], "metric": cell[2], "axis": cell[3], **vars(verdict)}
        for cell, verdict in judged.items()
    ]
    values = json.loads(summary.to_json(orient="records") or "[]")
    outcomes = [{"trial": trial.id, **trial.outcome} for trial in data.trials]
    return {
        "name": data.manifest.get("name"), "question": data.experiment.get("question"), "verdicts": cells,
        "values": values, "expectations": [vars(item) for item in expected], "outcomes": outcomes,
    }  # fmt: skip
