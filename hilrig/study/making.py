"""Makes a reproduction: reads the runs, measures, draws the figures, judges the claims and writes the pages."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pandas as pd

from hilrig.recording.run_directory import make_directory, write_json
from hilrig.report.dataset import RunData, TrialEntry, TrialSignals, load_run, read_signals
from hilrig.report.expectations import Expected, judge_expectations
from hilrig.report.measures import METRIC_COLUMNS, all_metrics, table
from hilrig.report.saving import write_figure
from hilrig.study.drawing import draw_figure
from hilrig.study.evidence import Judged, judge_claims
from hilrig.study.loading import Loaded
from hilrig.study.measuring import measure_all, memory_field
from hilrig.study.model import FigureSpec, Study
from hilrig.study.pages import Page, PagePicture, write_pages
from hilrig.study.rows import claim_rows, summary

DIGITS = "%.9g"
"""Digits of the numbers in the tables: more than readers need, but few enough to be the same on every machine"""


@dataclass(frozen=True)
class _Read:
    """The data kept from the run of one experiment."""

    data: RunData
    metrics: pd.DataFrame
    drawn: Mapping[str, tuple[TrialEntry, TrialSignals]]
    """The trials that the figures show, by id"""


@dataclass(frozen=True)
class Made:
    """The result of a reproduction."""

    judged: list[Judged]
    """The judged claims"""
    expected: dict[str, list[Expected]]
    """The judged expectations of each experiment, by name"""
    ended_well: bool
    """Whether every trial completed and is valid, or ended as expected"""

    @property
    def expectations(self) -> int:
        """Number of expectations"""
        return sum(map(len, self.expected.values()))


def make_reproduction(
    loaded: Loaded, runs: Mapping[str, Path], out: Path, command: str, overrides: Sequence[str] = (), jobs: int = 1
) -> Made:
    """Write the reproduction into `out` from a run of each experiment, and return its result.

    Writes index.html, README.md, figures/, claims.csv, metrics.csv and summary.json. They depend only on the runs'
    signals and the study's file: the same trials give the same bytes. `jobs` processes read the signals. Raises
    RunDirectoryError if a directory in `runs` is not a run, or if `out` cannot be made.
    """
    with suppress(FileExistsError):
        make_directory(out / "figures")
    with _readers(jobs) as each:
        reads = {name: _read(loaded.study, name, load_run(runs[name]), each) for name in loaded.experiments}
    tables = {name: read.metrics for name, read in reads.items()}
    data = {name: read.data for name, read in reads.items()}
    trials = {name: run.trials for name, run in data.items()}
    judged = judge_claims(loaded.study.claims, tables, trials)
    expected = {
        name: judge_expectations(run.experiment.get("expect") or [], tables[name], run.trials)
        for name, run in data.items()
    }
    pictures = [_picture(spec, reads[spec.experiment], out) for spec in loaded.study.figures]
    claims = pd.DataFrame(claim_rows(judged))
    claims.to_csv(out / "claims.csv", index=False, float_format=DIGITS)
    _all_metrics(tables).to_csv(out / "metrics.csv", index=False, float_format=DIGITS)
    write_json(out / "summary.json", summary(loaded, judged, expected, data, overrides))
    write_pages(Page(loaded, judged, pictures, expected, data, command, tuple(overrides)), out)
    return Made(judged, expected, all(t.counts or run.as_expected(t) for run in data.values() for t in run.trials))


def _all_metrics(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Return one table for all experiments, whose first column names the experiment."""
    named = [found.assign(experiment=name) for name, found in tables.items()]
    return pd.concat(named).reindex(columns=["experiment", *METRIC_COLUMNS])


Each = Callable[..., Iterable[Any]]
"""Works like `map`"""


@contextmanager
def _readers(jobs: int) -> Iterator[Each]:
    """Yield a function like `map` that processes items one after the other, or in `jobs` processes."""
    if jobs == 1:
        yield map
        return
    # Fresh processes, because forking a process with threads is not safe.
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield pool.map


def _read(study: Study, name: str, data: RunData, each: Each) -> _Read:
    """Read the bags of one run; keep the metrics, and the signals that the figures show."""
    wanted = {part.metric for claim in study.claims for part in claim.parts if part.experiment == name}
    memory = sorted(metric for metric in wanted if memory_field(metric) is not None)
    shown = {trial.id for spec in study.figures if spec.experiment == name for trial in _drawn(spec, data)}
    needed = [trial for trial in data.trials if trial.counts or trial.id in shown]
    found = list(each(partial(_read_trial, memory, shown), needed))
    drawn = {t.id: (t, signals) for t, (_, signals) in zip(needed, found, strict=True) if signals is not None}
    return _Read(data, table([row for rows, _ in found for row in rows]), drawn)


def _read_trial(
    memory: Sequence[str], shown: Collection[str], trial: TrialEntry
) -> tuple[list[tuple[Any, ...]], TrialSignals | None]:
    """Return the metric rows of a trial, if it is compared, and its signals, if a figure shows them."""
    signals = read_signals(trial)
    if signals is None:
        return [], None
    rows = measure_all(trial, signals, all_metrics(), memory) if trial.counts else []
    return rows, signals if trial.id in shown else None


def _drawn(spec: FigureSpec, data: RunData) -> list[TrialEntry]:
    """Return the trials that a figure shows: per controller the first completed repeat, or else the first one."""
    chosen: dict[str, TrialEntry] = {}
    for trial in sorted(data.trials, key=lambda trial: (not trial.counts, trial.repeat)):
        if trial.condition == spec.condition and trial.controller in spec.controllers:
            chosen.setdefault(trial.controller, trial)
    return [chosen[name] for name in spec.controllers if name in chosen]


def _picture(spec: FigureSpec, read: _Read, out: Path) -> PagePicture:
    """Draw and save one figure."""
    trials = [read.drawn[trial.id] for trial in _drawn(spec, read.data) if trial.id in read.drawn]
    pairs: dict[str, Any] = {trial.controller: (trial, signals) for trial, signals in trials}
    if not pairs:
        return PagePicture(spec, "", "", f"No trial of {spec.experiment} has a record of this.")
    figure, notes = draw_figure(spec, pairs, read.data.controllers)
    stem = out / "figures" / f"fig{spec.figure.zfill(2)}"
    return PagePicture(spec, stem.name, write_figure(figure, stem), _caption(spec, trials, notes))


def _caption(spec: FigureSpec, trials: Sequence[tuple[TrialEntry, TrialSignals]], notes: Sequence[str]) -> str:
    """Return the caption: which trials are shown, from which source, and what was cut off."""
    numbers = sorted({trial.repeat for trial, _ in trials})
    repeats = f"repeat{'s' * (len(numbers) > 1)} {', '.join(map(str, numbers))}"
    sources = " and ".join(sorted({"true" if signals.source == "truth" else "measured" for _, signals in trials}))
    of = f"Condition {spec.condition}, {repeats}; "
    what = "memory of the law." if spec.quantity.startswith("memory.") else f"{sources} signals of the plant."
    zoom = "The grey interval is enlarged below." if spec.zoom else ""
    return " ".join(text for text in (spec.caption, of + what, zoom, *(f"{note}." for note in notes)) if text)
