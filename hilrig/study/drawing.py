"""The figures of a reproduction: one quantity in one panel, one column wide, as in the publication."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from hilrig.core.signals import Array
from hilrig.report.curves import Curve, curve_window, limits, thin
from hilrig.report.dataset import TrialEntry, TrialSignals
from hilrig.report.internals import memory_documents, unit_of
from hilrig.report.panels import draw
from hilrig.report.plotted import QUANTITIES
from hilrig.report.plotting import Axes, Figure, Line2D, figure_style
from hilrig.report.style import COLOURS, MUTED, REFERENCE, Style, styles
from hilrig.study.measuring import components
from hilrig.study.model import FigureSpec

WIDTH, PANEL, GAP = 3.5, 1.75, 0.5
"""Width of a column in a paper, height of a panel, and gap between two panels, inches"""
TOP, BOTTOM, LEFT, RIGHT = 0.4, 0.4, 0.75, 0.1
"""Margins, inches"""
MEMORY = "memory."

DrawnTrials = Mapping[str, tuple[TrialEntry, TrialSignals]]
"""The trial that is drawn for each controller, by the controller's name"""


class FigureContent(NamedTuple):
    """What a figure shows."""

    curves: list[Curve]
    """In the order of the legend"""
    references: list[Curve]
    label: str
    """Label of the vertical axis, with its unit"""
    unit: str
    one_law: bool
    """Whether the curves are components of one controller's quantity, in which case none is cut off to show the
    others"""


def draw_figure(spec: FigureSpec, trials: DrawnTrials, everyone: tuple[str, ...]) -> tuple[Figure, tuple[str, ...]]:
    """Return the figure, and notes on what its limits leave out.

    `everyone` lists all controllers of the experiment, so that each has the same colour in every figure.
    """
    content = _content(spec, trials, everyone)
    end = max(float(signals.record.time[-1]) + signals.record.period for _, signals in trials.values())
    spans = [(0.0, end), *([spec.zoom] if spec.zoom else [])]
    height = TOP + BOTTOM + len(spans) * PANEL + (len(spans) - 1) * GAP
    with figure_style():
        figure = Figure(figsize=(WIDTH, height))
        grid = figure.add_gridspec(
            len(spans), 1, left=LEFT / WIDTH, right=1 - RIGHT / WIDTH, top=1 - TOP / height, bottom=BOTTOM / height,
            hspace=GAP / PANEL,
        )  # fmt: skip
        notes: list[str] = []
        for row, span in enumerate(spans):
            axes = figure.add_subplot(grid[row, 0])
            notes += _panel(axes, content, span)
        if spec.zoom:
            figure.axes[0].axvspan(*spec.zoom, color="#000000", alpha=0.06, linewidth=0)
        _mark(figure.axes[0], trials, everyone)
        _legend(figure, content, height)
    return figure, tuple(dict.fromkeys(notes))


def _content(spec: FigureSpec, trials: DrawnTrials, everyone: tuple[str, ...]) -> FigureContent:
    """Return the curves of the figure: one per controller, or one per component of a single controller."""
    looks = styles(everyone)
    found = {name: _series(spec, trial, signals) for name, (trial, signals) in trials.items()}
    first = next(iter(found.values()))
    curves = [
        Curve(name if len(trials) > 1 or len(series.values) == 1 else part, signals.record.time, values,
              looks[name] if len(series.values) == 1 else Style(COLOURS[i % len(COLOURS)], "-"))
        for (name, (_, signals)), series in zip(trials.items(), found.values(), strict=True)
        for i, (part, values) in enumerate(series.values.items())
    ]  # fmt: skip
    name, (_, longest) = max(trials.items(), key=lambda item: item[1][1].record.time.size)
    references = [
        Curve("reference", longest.record.time, values, Style(REFERENCE, "-"))
        for values in found[name].references.values()
    ]
    return FigureContent(curves, references, first.label, first.unit, len(trials) == 1)


class _Series(NamedTuple):
    """A quantity of one trial, by axis or component."""

    values: dict[str, Array]
    references: dict[str, Array]
    label: str
    unit: str


def _series(spec: FigureSpec, trial: TrialEntry, signals: TrialSignals) -> _Series:
    """Return what a figure shows of one trial. Raises KeyError for an axis or a field that does not exist."""
    if spec.quantity.startswith(MEMORY):
        field = spec.quantity.removeprefix(MEMORY)
        document = memory_documents(trial.document["controller"]["kind"]).get(field, "")
        unit = unit_of(document)
        values, references, label = components(signals.internals[field], signals.record.axes), {}, field
    else:
        quantity = QUANTITIES[spec.quantity]
        unit, label = quantity.unit, quantity.label
        values = quantity.values(signals.record)
        references = quantity.reference(signals.record) if quantity.reference else {}
    if spec.axis is not None:
        values = {spec.axis: values[spec.axis]}
        references = {axis: curve for axis, curve in references.items() if axis == spec.axis}
    name = label.replace("_", " ") + (f" {spec.axis}" if spec.axis else "")
    shown = "SI, not stated" if unit is None else unit or "–"
    return _Series(values, references, f"{name} [{shown}]", unit or "")


def _panel(axes: Axes, content: FigureContent, span: tuple[float, float]) -> tuple[str, ...]:
    """Draw the curves over `span`; return notes on what the limits cut off, which are also written on the panel."""
    curves = [curve_window(curve, *span) for curve in content.curves]
    references = [curve_window(curve, *span) for curve in content.references]
    for curve in references:
        axes.plot(*thin(curve.time, curve.values), color=REFERENCE, linewidth=0.7, zorder=2)
    # The noisiest first, so that it hides no other.
    for depth, curve in enumerate(sorted(curves, key=lambda curve: -float(np.nanstd(np.diff(curve.values))))):
        draw(axes, curve, 3 + depth)
    if content.one_law:
        curves = [curves[0]._replace(values=np.concatenate([curve.values for curve in curves]))]
    wanted = np.concatenate([curve.values for curve in references]) if references else None
    bounds = limits(curves, content.unit, wanted)
    axes.set(xlim=span, ylim=(bounds.low, bounds.high), ylabel=content.label)
    axes.set_xlabel("time [s]", labelpad=1.5)
    for row, note in enumerate(bounds.notes):
        axes.text(0.99, 0.97 - 0.1 * row, note, transform=axes.transAxes, ha="right", va="top", fontsize=6,
                  color="#a00000", zorder=50)  # fmt: skip
    return bounds.notes


def _mark(axes: Axes, trials: DrawnTrials, everyone: tuple[str, ...]) -> None:
    """Mark where phases begin, and where trials that are not compared ended."""
    looks = styles(everyone)
    for phase in next(iter(trials.values()))[0].document["phases"][1:]:
        axes.axvline(phase["start"], color=MUTED, linewidth=0.5, linestyle=(0, (2, 2)), zorder=1)
    for name, (trial, signals) in trials.items():
        if not trial.counts:
            ended = float(signals.record.time[-1])
            axes.axvline(ended, color=looks[name].colour, linewidth=0.8, zorder=40)
            axes.annotate(f"{name} {trial.ending}", (ended, 0.02), xycoords=("data", "axes fraction"),
                          xytext=(3, 2), textcoords="offset points", fontsize=6, color=looks[name].colour)  # fmt: skip


def _legend(figure: Figure, content: FigureContent, height: float) -> None:
    """Name the curves above the panels."""
    handles = [
        Line2D([], [], color=curve.style.colour, linestyle=curve.style.dash, label=curve.label)
        for curve in content.curves
    ]
    if content.references:
        handles.insert(0, Line2D([], [], color=REFERENCE, linewidth=0.7, label="reference"))
    figure.legend(handles=handles, loc="upper left", ncols=min(3, len(handles)), borderaxespad=0, fontsize=7,
                  bbox_to_anchor=(LEFT / WIDTH, 1 - 0.05 / height), columnspacing=1.0, handlelength=2.0)  # fmt: skip
