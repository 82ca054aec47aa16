"""The parts of a comparison figure: panels over time, enlarged intervals, the legend, the caption."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hilrig.core.signals import Array
from hilrig.report.curves import Curve, curve_window, limits, thin
from hilrig.report.dataset import TrialEntry, TrialSignals
from hilrig.report.legend import Legend, draw_legend, legend_of
from hilrig.report.plotting import Axes, Figure, withStroke
from hilrig.report.style import MUTED, REFERENCE, TWO_COLUMNS, Style, styles

TOP, BOTTOM, LEFT, RIGHT = 0.42, 0.42, 0.62, 0.1
"""Margins, inches"""
MARK = 9.0
"""Height of a row of marks, points"""
OUTLINE = (withStroke(linewidth=1.6, foreground="#ffffff"),)
"""Outline of the letters of a mark, so that it stays readable over curves and hides little of them"""


@dataclass(frozen=True)
class Drawn:
    """The trials of one condition that the figures show, one per controller."""

    trials: dict[str, tuple[TrialEntry, TrialSignals]]
    controllers: tuple[str, ...]
    """All controllers of the experiment, so that each has the same colour in every figure"""

    @property
    def some(self) -> TrialSignals:
        """Signals of one of the trials, for everything that all have in common"""
        return next(iter(self.trials.values()))[1]

    @property
    def end(self) -> float:
        """Last time shown, s"""
        return max(float(s.record.time[-1]) + s.record.period for _, s in self.trials.values())

    @property
    def phases(self) -> list[Any]:
        """The experiment's phases, as in the plan"""
        return next(iter(self.trials.values()))[0].document["phases"]


@dataclass(frozen=True)
class PanelPicture:
    """A finished figure."""

    name: str
    title: str
    caption: str
    figure: Figure


def controller_curves(drawn: Drawn, pick: Callable[[TrialSignals], Array]) -> list[Curve]:
    """Return one curve per drawn controller; the noisiest first, so that it hides no other."""
    looks = styles(drawn.controllers)
    curves = [Curve(name, s.record.time, pick(s), looks[name]) for name, (_, s) in drawn.trials.items()]
    return sorted(curves, key=lambda curve: -float(np.nanstd(np.diff(curve.values))))


def zoom_windows(phases: list[Any], end: float) -> list[tuple[str, float, float]]:
    """Return (title, from, to) of the enlarged intervals: the start, each change of phase, and the end."""
    first, last = (phase["end"] - phase["start"] for phase in (phases[0], phases[-1]))
    windows = [("start", 0.0, min(2.0, first / 4, end))]
    for before, after in itertools.pairwise(phases):
        if after["start"] < end:
            lead = min(0.5, (before["end"] - before["start"]) / 4)
            tail = min(2.5, (after["end"] - after["start"]) / 2)
            windows.append((f"{before['name']} → {after['name']}", after["start"] - lead, after["start"] + tail))
    return [*windows, ("end", max(0.0, end - min(2.0, last / 4)), end)]


def with_zoom(
    drawn: Drawn,
    name: str,
    title: str,
    quantity: str,
    unit: str,
    curves: list[Curve],
    reference: tuple[Array, Array] | None,
) -> PanelPicture:
    """Return a figure with the whole trial above and the enlarged intervals below."""
    stretches = zoom_windows(drawn.phases, drawn.end)
    columns = min(3, len(stretches))
    rows = -(-len(stretches) // columns)
    named = legend(drawn, reference is not None)
    figure, grid = canvas(1 + rows, columns, 1.75, 1.35, top=TOP + named.further)
    whole = figure.add_subplot(grid[0, :])
    notes = list(panel(whole, curves, reference, f"{quantity} [{unit}]", unit, (0.0, drawn.end)))
    mark_phases(whole, drawn)
    for k, (label, start, end) in enumerate(stretches):
        axes = figure.add_subplot(grid[1 + k // columns, k % columns])
        cut = [curve_window(curve, start, end) for curve in curves]
        notes += panel(axes, cut, reference, f"{quantity} [{unit}]" if k % columns == 0 else "", unit, (start, end))
        axes.set_title(f"{label}", loc="left", color="#444444", pad=3)
        whole.axvspan(start, end, color="#000000", alpha=0.045, linewidth=0)
    for axes in figure.axes:
        axes.set_xlabel("time [s]", labelpad=1.5)
    name_curves(figure, named)
    return PanelPicture(name, title, caption(drawn, "The grey intervals are enlarged below.", notes), figure)


def panel(
    axes: Axes,
    curves: list[Curve],
    reference: tuple[Array, Array] | None,
    label: str,
    unit: str,
    span: tuple[float, float],
) -> tuple[str, ...]:
    """Draw curves over `span`; return notes on what the limits cut off, which are also written on the panel."""
    wanted = None
    if reference is not None:
        wanted = curve_window(Curve("", *reference, Style(REFERENCE, "-")), *span)
        axes.plot(*thin(wanted.time, wanted.values), color=REFERENCE, linewidth=0.7, zorder=2)
    for depth, curve in enumerate(curves):
        draw(axes, curve, 3 + depth)
    bounds = limits(curves, unit, None if wanted is None else wanted.values)
    axes.set_ylim(bounds.low, bounds.high)
    axes.set_xlim(*span)
    axes.set_ylabel(label)
    for row, note in enumerate(bounds.notes):
        axes.text(0.99, 0.97 - 0.12 * row, note, transform=axes.transAxes, ha="right", va="top", fontsize=7,
                  color="#a00000", zorder=50)  # fmt: skip
    return bounds.notes


def draw(axes: Axes, curve: Curve, depth: float) -> None:
    """Draw one thinned curve."""
    style = curve.style
    axes.plot(*thin(curve.time, curve.values), color=style.colour, linestyle=style.dash, zorder=depth)


def canvas(
    rows: int, columns: int, first: float, other: float, top: float = TOP, between: float = 0.24
) -> tuple[Figure, Any]:
    """Return a two-column figure and its grid.

    `first`, `other` and `top` are the heights of the first row, of each other row and of the margin at the top, inches;
    `between` is the gap between columns, as a fraction of their width.
    """
    gap = 0.52
    height = top + BOTTOM + first + (rows - 1) * (other + gap)
    figure = Figure(figsize=(TWO_COLUMNS, height))
    inner = (height - top - BOTTOM) / rows - gap * (rows - 1) / rows
    grid = figure.add_gridspec(
        rows, columns, left=LEFT / TWO_COLUMNS, right=1 - RIGHT / TWO_COLUMNS, top=1 - top / height,
        bottom=BOTTOM / height, hspace=gap / inner, wspace=between,
        height_ratios=[first, *[other] * (rows - 1)],
    )  # fmt: skip
    return figure, grid


def mark_phases(axes: Axes, drawn: Drawn) -> None:
    """Mark where phases begin, and where trials that are not compared ended."""
    for phase in drawn.phases:
        if phase["start"] < drawn.end:
            axes.annotate(phase["name"], (phase["start"], 1.0), xycoords=("data", "axes fraction"), xytext=(3, 2),
                          textcoords="offset points", fontsize=7, color="#666666")  # fmt: skip
        if 0 < phase["start"] < drawn.end:
            axes.axvline(phase["start"], color=MUTED, linewidth=0.6, linestyle=(0, (2, 2)))
    looks = styles(drawn.controllers)
    early = {name: signals for name, (trial, signals) in drawn.trials.items() if not trial.counts}
    for row, (name, signals) in enumerate(early.items()):
        ended, outcome = float(signals.record.time[-1]), drawn.trials[name][0].ending
        axes.axvline(ended, color=looks[name].colour, linewidth=0.8, zorder=40)
        # Each mark has its own row and points to the middle, so none covers another or leaves the panel.
        side = 1 if ended <= 0.6 * drawn.end else -1
        axes.annotate(f"{name} {outcome}", (ended, 0.02), xycoords=("data", "axes fraction"),
                      xytext=(3 * side, 2 + MARK * row), textcoords="offset points", fontsize=7, zorder=45,
                      ha="left" if side > 0 else "right", color=looks[name].colour, path_effects=OUTLINE)  # fmt: skip


def legend(drawn: Drawn, reference: bool) -> Legend:
    """Return the legend of the controllers drawn, laid out across the figure."""
    looks = {name: look for name, look in styles(drawn.controllers).items() if name in drawn.trials}
    return legend_of(looks, reference, TWO_COLUMNS - LEFT - RIGHT)


def name_curves(figure: Figure, named: Legend) -> None:
    """Name the curves above the panels."""
    draw_legend(figure, named, LEFT / TWO_COLUMNS)


def caption(drawn: Drawn, text: str, notes: list[str]) -> str:
    """Return the caption: which repeats are shown, from which source, and what was cut off."""
    repeats = {name: trial.repeat for name, (trial, _) in drawn.trials.items()}
    which = f"Repeat {next(iter(repeats.values()))} of each controller"
    if len(set(repeats.values())) > 1:
        which = "Repeat " + ", ".join(f"{repeat} of {name}" for name, repeat in repeats.items())
    sources = sorted({signals.source for _, signals in drawn.trials.values()})
    signals = "true signals of the plant" if sources == ["truth"] else f"signals: {' and '.join(sources)}"
    return " ".join([f"{which}; {signals}.", text, *(f"{note}." for note in dict.fromkeys(notes))])
