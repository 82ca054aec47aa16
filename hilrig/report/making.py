"""Makes the report of a measured run: draws the figures, and writes the page and its numbers."""

from __future__ import annotations

import dataclasses
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

from hilrig.core.errors import RunDirectoryError
from hilrig.recording.certificate.attribution import attribute
from hilrig.recording.run_directory import make_directory, write_json
from hilrig.recording.timing import terms_of
from hilrig.report.animation import animation
from hilrig.report.bounds_section import bounds_section
from hilrig.report.comparison import summarise_metrics, verdicts
from hilrig.report.dataset import TrialEntry
from hilrig.report.figures import comparison_figures
from hilrig.report.internals import internals_figure
from hilrig.report.limits_section import limits_section
from hilrig.report.measuring import Measured, measure_run
from hilrig.report.page import Content, Shown, write_page
from hilrig.report.panels import Drawn
from hilrig.report.saving import save
from hilrig.report.timing_figures import Stamped, lateness_figure, tail_figure
from hilrig.report.timing_section import timing_section

REPORTS = Path("reports")


def make_report(run: Path, out: Path | None = None) -> Path:
    """Measure a run and write its report, using only the run's directory; return the page's path."""
    return write_report(measure_run(run, to_draw=True), out)


def write_report(measured: Measured, out: Path | None = None) -> Path:
    """Write the report of a run that was measured `to_draw`; return the path of its page.

    Writes index.html, figures/, metrics.csv and summary.json into `out` (default reports/<name of the run>). Raises
    RunDirectoryError if no trial left anything to report, or if `out` cannot be made.
    """
    data, metrics = measured.data, measured.metrics
    if not measured.sources:
        raise RunDirectoryError(
            f"{data.path}: no trial left a usable bag; to see how they ended: hilrig show {data.path}"
        )
    folder = out or REPORTS / data.path.resolve().name
    with suppress(FileExistsError):
        make_directory(folder / "figures")
    metrics.to_csv(folder / "metrics.csv", index=False)
    judged = verdicts(metrics)
    content = Content(
        data, metrics, summarise_metrics(metrics), judged, measured.expected, _figures(measured, folder),
        animation(_scene(measured), folder), measured.sources, folder, bounds_section(data, measured.command_ages),
        limits_section(data, measured.limited), timing_section(data), _timing_figures(measured, folder),
    )  # fmt: skip
    write_json(folder / "summary.json", _summary(content))
    return write_page(content)


def _figures(measured: Measured, folder: Path) -> dict[str, list[Shown]]:
    """Draw and save the figures; return them by condition."""
    shown: dict[str, list[Shown]] = {}
    for condition, trials in measured.drawn.items():
        kept = measured.kept
        pairs = {name: (trial, kept[trial.id].signals) for name, trial in trials.items() if trial.id in kept}
        if not pairs:
            continue
        pictures = comparison_figures(Drawn(pairs, measured.data.controllers))
        pictures += [p for pair in pairs.values() if (p := internals_figure(*pair)) is not None]
        shown[condition] = [save(picture, condition, folder) for picture in pictures]
    return shown


def _timing_figures(measured: Measured, folder: Path) -> list[Shown]:
    """Draw and save the figures of the certificate; none in lockstep."""
    pictures = []
    for condition, trials in measured.most_late.items():
        kept = {
            name: (trial, measured.kept[trial.id].table) for name, trial in trials.items() if trial.id in measured.kept
        }
        stamped = {
            name: Stamped(trial, table, attribute(table, terms_of(trial.document)))
            for name, (trial, table) in kept.items() if table is not None
        }  # fmt: skip
        pictures += [lateness_figure(condition, stamped)] if stamped else []
    all_trials = tail_figure(measured.data.trials, measured.data.controllers)
    return [save(picture, "certificate", folder) for picture in (*pictures, *([all_trials] if all_trials else []))]


def _scene(measured: Measured) -> tuple[TrialEntry, Any] | None:
    """Return the trial to animate (the first one drawn and compared) and its joint positions (N, n), rad."""
    for trials in measured.drawn.values():
        for trial in trials.values():
            if trial.counts and trial.id in measured.kept:
                return trial, measured.kept[trial.id].joints
    return None


def _summary(content: Content) -> dict[str, Any]:
    """Return the report's numbers in machine-readable form."""
    data = content.run
    cells = [
        {"condition": cell[0], "phase": cell[1], "metric": cell[2], "axis": cell[3], **vars(verdict)}
        for cell, verdict in content.verdicts.items()
    ]
    values = json.loads(content.summary.to_json(orient="records") or "[]")
    outcomes = [{"trial": trial.id, **trial.outcome, "ending": trial.ending} for trial in data.trials]
    return {
        "name": data.manifest.get("name"), "question": data.experiment.get("question"), "verdicts": cells,
        "values": values, "expectations": [vars(item) for item in content.expected],
        "bounds": dataclasses.asdict(content.bounds), "limits": dataclasses.asdict(content.limits),
        "timing": dataclasses.asdict(content.timing),
        "outcomes": outcomes,
    }  # fmt: skip
