"""The page of a report: one self-contained HTML file."""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import pandas as pd
from jinja2 import Environment, StrictUndefined

from hilrig.core.text import write_text
from hilrig.experiment.expecting import ended_early
from hilrig.recording.run_directory import INVALID, reason_of
from hilrig.report.bounds_section import BoundsSection
from hilrig.report.comparison import Verdict
from hilrig.report.dataset import RunData
from hilrig.report.expectations import Expected
from hilrig.report.limits_section import LimitsSection
from hilrig.report.measures import all_metrics
from hilrig.report.timing_section import TimingSection
from hilrig.report.verdict_table import Cell, answer_question, metric_title, verdict_tables

STYLE = resources.files("hilrig.report").joinpath("page.css").read_text("utf-8")
"""The style of every page: CSS"""


@dataclass(frozen=True)
class Shown:
    """A picture on the page."""

    name: str
    title: str
    caption: str
    source: str
    """Data URI of the picture; "" if there is none, in which case the caption says why"""
    file: str
    """Name of its files in figures/, without the suffix"""


@dataclass(frozen=True)
class Content:
    """The content of the page."""

    run: RunData
    metrics: pd.DataFrame
    summary: pd.DataFrame
    verdicts: Mapping[Cell, Verdict]
    expected: list[Expected]
    figures: Mapping[str, list[Shown]]
    """By condition, in page order"""
    animation: Shown
    sources: list[str]
    """Source of positions and forces: "truth", "measurement" or both"""
    folder: Path
    """Folder of the report"""
    bounds: BoundsSection
    limits: LimitsSection
    timing: TimingSection
    timing_figures: list[Shown]


def write_page(content: Content) -> Path:
    """Write index.html into the report's folder and return its path."""
    path = content.folder / "index.html"
    write_text(path, render_page(content))
    return path


def render_page(content: Content) -> str:
    """Return the page as HTML."""
    environment = Environment(autoescape=True, undefined=StrictUndefined)
    environment.filters["number"] = number
    environment.filters["reason"] = reason_of
    environment.filters["metric"] = metric_title
    template = environment.from_string(resources.files("hilrig.report").joinpath("page.html.j2").read_text("utf-8"))
    run, manifest = content.run, content.run.manifest
    return template.render(
        style=STYLE,
        run=run,
        manifest=manifest,
        name=manifest.get("name") or run.path.resolve().name,
        run_name=run.path.resolve().name,
        question=run.experiment.get("question") or manifest.get("question") or "No question was stated",
        answer=_answer(content),
        completed=[trial for trial in run.trials if trial.counts],
        excluded=[trial for trial in run.trials if not trial.counts],
        early=ended_early([trial.ending for trial in run.trials if run.as_expected(trial)]),
        invalid=[trial for trial in run.trials if trial.ending == INVALID],
        repeats=len({trial.repeat for trial in run.trials}),
        expected=content.expected,
        sources=content.sources,
        tables=verdict_tables(content.summary, content.verdicts, run.controllers),
        figures=content.figures,
        animation=content.animation,
        bounds=content.bounds,
        limits=content.limits,
        timing=content.timing,
        timing_figures=content.timing_figures,
        repeat_command=manifest.get("command", "not recorded"),
        definitions=[(kind, inspect.getdoc(type(metric)) or "") for kind, metric in all_metrics().items()],
    )


def _answer(content: Content) -> list[str]:
    """Return the sentences of the answer, or one that says why there is none."""
    if not content.verdicts:
        invalid = any(trial.ending == INVALID for trial in content.run.trials)
        none = "No trial completed within its timing budget" if invalid else "No trial completed"
        return [f"{none}, so there is nothing to compare."]
    return answer_question(content.verdicts, content.summary, content.run.controllers)


def number(value: float | None, digits: int = 3) -> str:
    """Return `value` with `digits` significant digits, in plain notation; "–" for None and NaN, "∞" if infinite."""
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value == 0:
        return "0"
    # The exponent after rounding: 9.999 to three digits is 10.0.
    size = int(f"{value:.{digits - 1}e}".partition("e")[2])
    if size >= 6 or size < -5:
        mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
        return f"{mantissa}e{int(exponent)}".replace("-", "−")
    return f"{value:.{max(0, digits - 1 - size)}f}".replace("-", "−")
