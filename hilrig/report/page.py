"""The page: what the report found, laid out as one HTML file that needs no other."""

from __future__ import annotations

import base64
import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from typing import Any, NamedTuple

import pandas as pd
from jinja2 import Environment, StrictUndefined

from hilrig.interfaces import Metric
from hilrig.report.animation import Animation
from hilrig.report.answer import Expectation, Verdicts
from hilrig.report.dataset import ALL_PHASES, RunData, TrialEntry
from hilrig.report.words import metric_name, number, scale, spread

QUANTILES = ("p50", "p99", "p99.9", "max")
TIMINGS = ("lateness_us", "round_trip_us", "compute_us")


class Card(NamedTuple):
    """One figure on the page."""

    title: str
    caption: str
    kind: str
    """"svg" or "png" """
    data: bytes
    files: str
    """Path of its files relative to the page, without the ending"""

    @property
    def source(self) -> str:
        """The figure as a data URI."""
        return _data_uri("image/svg+xml" if self.kind == "svg" else "image/png", self.data)


class Section(NamedTuple):
    """The figures of one condition."""

    condition: str
    figures: tuple[Card, ...]
    internals: tuple[Card, ...]
    silent: tuple[str, ...] = ()
    """Controllers that published nothing of their own"""


@dataclass(frozen=True)
class Content:
    """All that the page shows."""

    run: RunData
    summary: pd.DataFrame
    verdicts: Verdicts
    answers: list[str]
    expectations: list[Expectation]
    sections: tuple[Section, ...]
    animation: Animation | str
    metrics: Mapping[str, Metric]


class Cell(NamedTuple):
    """One entry of the verdict table."""

    mean: str
    spread: str
    mark: str
    """"best", "lowest" or "" """


class Line(NamedTuple):
    """One row of the verdict table."""

    name: str
    rows: int
    """How many rows the name stands for; 0 if it was written in a row above"""
    phase: str
    unit: str
    cells: tuple[Cell, ...]
    basis: str


def render_page(content: Content) -> str:
    """Return the whole page as HTML."""
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(resources.files(__package__).joinpath("page.html.j2").read_text("utf-8"))
    run = content.run
    moving = content.animation
    return template.render(
        c=content,
        run=run,
        manifest=run.manifest,
        question=run.manifest.get("question") or run.experiment.get("question", ""),
        name=run.manifest.get("name") or run.path.resolve().name,
        tables=[(condition, verdict_lines(content, condition)) for condition in run.conditions],
        excluded=[trial for trial in run.trials if not trial.completed],
        trials=[(trial, lost(trial)) for trial in run.trials],
        timings=[(trial, [_quantiles(trial.timing.get(key)) for key in TIMINGS]) for trial in run.trials if trial.timing],
        definitions=[(kind, metric.unit or "–", _definition(metric)) for kind, metric in content.metrics.items()],
        gif=_data_uri("image/gif", moving.gif) if isinstance(moving, Animation) else "",
        strip=_data_uri("image/png", moving.strip) if isinstance(moving, Animation) else "",
        facts=facts(run),
        number=number,
    )


def verdict_lines(content: Content, condition: str) -> list[Line]:
    """Return the rows of one condition's table: for each metric and axis its phases, then the whole trial."""
    table = content.summary[content.summary["condition"] == condition]
    single = table["phase"].nunique() <= 2
    table = table[table["phase"] != ALL_PHASES] if single else table
    lines: list[Line] = []
    for (metric, axis), group in sorted(table.groupby(["metric", "axis"], sort=False), key=lambda item: item[0]):
        phases = list(group["phase"].unique())
        for k, phase in enumerate(phases):
            rows = group[group["phase"] == phase].set_index("controller")
            lines.append(_line(content, condition, phase, (metric, axis), rows, len(phases) if k == 0 else 0))
    return lines


def _line(
    content: Content, condition: str, phase: str, key: tuple[str, str], rows: pd.DataFrame, spanned: int
) -> Line:
    verdict = content.verdicts[condition, phase, *key]
    factor, unit = scale(str(rows["unit"].iloc[0]), list(rows["mean"]))
    cells = []
    for controller in content.run.controllers:
        if controller not in rows.index:
            cells.append(Cell("–", "", ""))
            continue
        mean, deviation = (factor * float(rows.at[controller, what]) for what in ("mean", "sd"))
        mark = "best" if controller == verdict.best else "lowest" if controller == verdict.lowest else ""
        cells.append(Cell(number(mean), spread(deviation, mean), mark))
    return Line(metric_name(*key), spanned, phase, unit, tuple(cells), verdict.basis)


def lost(trial: TrialEntry) -> str:
    """Return "0 of 4 channels" worth of loss in words: which channels lost how many messages."""
    channels = trial.outcome.get("channels") or {}
    parts = [f"{name}: {counts['lost']}" for name, counts in channels.items() if counts.get("lost")]
    return ", ".join(parts) if parts else "none" if channels else "–"


def facts(run: RunData) -> list[tuple[str, str]]:
    """Return what the manifest says about where the run comes from, as (name, words)."""
    m = run.manifest
    host: Mapping[str, Any] = m.get("host") or {}
    versions: Mapping[str, str] = m.get("versions") or {}
    commit = m.get("commit") or "not in a repository"
    known = {
        "command": m.get("command"),
        "overrides": ", ".join(m.get("overrides") or []) or "none",
        "commit": commit + (" with uncommitted changes" if m.get("dirty") else ""),
        "seed": m.get("seed"),
        "clock": m.get("clock"),
        "transport": m.get("transport"),
        "started": m.get("started"),
        "finished": m.get("finished") or "not finished",
        "wall time": f"{m['wall_s']:.1f} s" if m.get("wall_s") is not None else None,
        "host": ", ".join(f"{key} {value}" for key, value in host.items()),
        "hilrig": m.get("hilrig"),
        "python": m.get("python"),
        "packages": ", ".join(f"{package} {version}" for package, version in versions.items()),
        "run": run.path.resolve().name,
    }
    return [(name, str(value)) for name, value in known.items() if value not in (None, "")]


def _quantiles(times: Mapping[str, float] | None) -> list[str]:
    return [number(float(times[q])) if times else "–" for q in QUANTILES]


def _definition(metric: Metric) -> tuple[str, str, str]:
    """Return (first line, the rest, parameters) of a metric's definition."""
    first, _, rest = (inspect.getdoc(type(metric)) or "").partition("\n")
    values = ", ".join(f"{name} = {value:g}" for name, value in vars(metric).items())
    return first, rest.strip(), values


def _data_uri(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"
