"""Figures with many controllers: all names can be read, no mark lies on another, and few names look as ever."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import pytest
from helpers.report_builders import make_run
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from hilrig.report.dataset import load_run, read_signals
from hilrig.report.figures import comparison_figures
from hilrig.report.legend import legend_of
from hilrig.report.panels import LEFT, RIGHT, Drawn
from hilrig.report.style import TWO_COLUMNS, styles

MANY = (
    "as_read", "no_preload", "printed_lyapunov", "printed_lyapunov_narrow", "printed_signs", "printed_estimator",
    "printed_adaptation", "all_as_printed",
)  # fmt: skip
FEW = ("proposed", "pd", "adaptive", "sliding_mode")
WIDTH = TWO_COLUMNS - LEFT - RIGHT


def drawn(folder: Path, names: tuple[str, ...], failed: tuple[str, ...] = ()) -> list[Figure]:
    """Return the first and the last figure of a run with one trial of each controller; some tripped half-way."""
    sizes = {name: 1.0 + i for i, name in enumerate(names)}
    run = load_run(make_run(folder, sizes, repeats=1, seconds=0.2, failed=tuple(f"{name}.quiet.0" for name in failed)))
    trials: dict[str, Any] = {trial.controller: (trial, read_signals(trial)) for trial in run.trials}
    figures = [picture.figure for picture in comparison_figures(Drawn(trials, run.controllers))]
    return [figures[0], figures[-1]]


def boxes(figure: Figure, artists: list[Any]) -> list[Bbox]:
    """Return where artists are once all is drawn: a legend is laid out when it is drawn."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return [artist.get_window_extent(canvas.get_renderer()) for artist in artists]


def apart(found: list[Bbox]) -> bool:
    return not any(Bbox.intersection(a, b) for a, b in itertools.combinations(found, 2))


@pytest.mark.parametrize("names", [MANY, FEW, tuple("abcdefghijklmnop"), ("x" * 50, "y" * 50, "z")], ids=len)
def test_every_name_is_on_the_figure_and_on_nothing_else(tmp_path: Path, names: tuple[str, ...]) -> None:
    for figure in drawn(tmp_path / "run", names):
        (legend,) = figure.legends
        texts = legend.get_texts()
        assert {text.get_text() for text in texts} - {"reference"} == set(names)
        phases = [text for text in figure.axes[0].texts if text.get_text() in ("before", "after")]
        assert len(phases) == 2
        found = boxes(figure, [*texts, *phases, figure.axes[0]])
        assert all(figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1 for box in found)
        assert all(box.y1 <= figure.bbox.y1 for box in found)
        assert apart(found)


def test_marks_of_trials_that_tripped_lie_apart_and_in_the_panel(tmp_path: Path) -> None:
    for figure in drawn(tmp_path / "run", MANY, failed=MANY[2:7]):
        marks = [text for text in figure.axes[0].texts if text.get_text().endswith(" tripped")]
        assert [mark.get_text() for mark in marks] == [f"{name} tripped" for name in MANY[2:7]]
        panel, *found = boxes(figure, [figure.axes[0].patch, *marks])
        assert apart(found)
        assert all(panel.x0 <= box.x0 and box.x1 <= panel.x1 and box.y1 <= panel.y1 for box in found)


def test_a_mark_at_the_end_stays_in_the_panel(tmp_path: Path) -> None:
    """All tripped: the axis ends where the trials do."""
    for figure in drawn(tmp_path / "run", FEW, failed=FEW):
        marks = [text for text in figure.axes[0].texts if text.get_text().endswith(" tripped")]
        panel, *found = boxes(figure, [figure.axes[0].patch, *marks])
        assert all(panel.x0 <= box.x0 and box.x1 <= panel.x1 for box in found)


def test_few_names_are_one_row_and_many_make_the_figure_higher() -> None:
    few, many = legend_of(styles(FEW), True, WIDTH), legend_of(styles(MANY), True, WIDTH)
    assert (few.columns, few.further) == (5, 0.0)
    assert many.columns < 6
    rows = -(-9 // many.columns)
    assert many.further == pytest.approx((rows - 1) * 1.5 * 8 / 72)
