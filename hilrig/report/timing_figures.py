"""The figures of the timing certificate: lateness over time with the late ticks, and the tails of the distributions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hilrig.recording.certificate.attribution import Attribution
from hilrig.recording.certificate.causes import CAUSES
from hilrig.recording.certificate.histogram import tail
from hilrig.recording.certificate.table import StampTable
from hilrig.report.curves import thin
from hilrig.report.dataset import TrialEntry
from hilrig.report.legend import legend_of
from hilrig.report.panels import LEFT, RIGHT, TOP, PanelPicture, canvas, name_curves
from hilrig.report.plotting import Axes, LogLocator, NullFormatter, figure_style
from hilrig.report.style import MUTED, TWO_COLUMNS, Style, styles

CAUSE_COLOURS = dict(zip(CAUSES, ("#0072B2", "#E69F00", "#D55E00", "#8A8A8A"), strict=True))
"""Colours of late ticks, by cause"""
LEAST = 0.1
"""us; lower values are drawn here on a logarithmic axis"""
LINE_COLOUR = "#4d4d4d"
FINE = (1.0, 2.0, 5.0)
"""Tick labels in a decade of an axis that has few decades"""
FEW_DECADES = 100.0
"""Ratio of upper to lower limit below which an axis has few decades"""
WIDTH = TWO_COLUMNS - LEFT - RIGHT


class Stamped(NamedTuple):
    """A trial with the time stamps of its ticks."""

    trial: TrialEntry
    table: StampTable
    found: Attribution


def lateness_figure(condition: str, trials: Mapping[str, Stamped]) -> PanelPicture:
    """Return lateness over time, one panel per controller, with the late ticks in the colours of their causes."""
    with figure_style():
        named = legend_of({f"late: {name}": Style(colour, "-") for name, colour in CAUSE_COLOURS.items()}, False, WIDTH)
        figure, grid = canvas(len(trials), 1, 1.3, 1.3, top=TOP + named.further)
        for row, (name, stamped) in enumerate(trials.items()):
            axes = figure.add_subplot(grid[row, 0])
            _over_time(axes, stamped)
            axes.set_title(f"{name}, repeat {stamped.trial.repeat}", loc="left", color="#444444", pad=3)
        name_curves(figure, named)
    text = (
        f"Condition {condition}; for each controller the repeat with the most late ticks. Lateness is the time from "
        "when a tick was due to when the driver woke. Marks at the top: late ticks, one row and one colour per cause. "
        "Dashed line: one period."
    )
    return PanelPicture(f"lateness_{condition}", "Lateness", text, figure)


def _over_time(axes: Axes, stamped: Stamped) -> None:
    own, period = stamped.table.driver, stamped.trial.document["period"]
    time = own.tick * period
    lateness = np.maximum((own.woke - own.due) / 1e3, LEAST)
    axes.plot(*thin(time, lateness), color=LINE_COLOUR, linewidth=0.6)
    axes.axhline(1e6 * period, color=MUTED, linewidth=0.7, linestyle=(0, (4, 2)))
    axes.set_yscale("log")
    low, high = LEAST, max(float(lateness.max(initial=0.0)), 1e6 * period)
    # Leave a quarter of the panel free above the curve for the marks.
    axes.set_ylim(max(low, float(lateness.min(initial=high)) / 2), high * (high / max(low, 1.0)) ** 0.35)
    for number, colour in enumerate(CAUSE_COLOURS.values()):
        at = time[stamped.found.cause == number]
        height = np.full(at.size, 0.95 - 0.06 * number)
        axes.plot(at, height, "|", color=colour, markersize=5, transform=axes.get_xaxis_transform(), zorder=5)
    axes.set_xlim(0, max(float(time[-1]), period) if time.size else period)
    axes.set_ylabel("lateness [µs]")
    axes.set_xlabel("time [s]", labelpad=1.5)


def tail_figure(trials: Sequence[TrialEntry], controllers: tuple[str, ...]) -> PanelPicture | None:
    """Return the share of ticks at or above each lateness and command age; None if no trial has histograms."""
    told = [trial for trial in trials if trial.timing.get("histograms", {}).get("lateness")]
    if not told:
        return None
    looks = styles(controllers)
    shown = {name: looks[name] for name in controllers if any(trial.controller == name for trial in told)}
    with figure_style():
        named = legend_of(shown, False, WIDTH)
        figure, grid = canvas(1, 2, 2.2, 0.0, top=TOP + named.further)
        period = told[0].document["period"]
        limits = {"lateness": period, "command_age": told[0].timing["budget"]["command_age_p99"]}
        for column, (name, limit) in enumerate(limits.items()):
            axes = figure.add_subplot(grid[0, column])
            for trial in told:
                _tail(axes, trial.timing["histograms"].get(name, []), looks[trial.controller])
            axes.axvline(1e6 * limit, color=MUTED, linewidth=0.7, linestyle=(0, (4, 2)))
            axes.set_xscale("log")
            low, high = axes.get_xlim()
            axes.xaxis.set_major_locator(LogLocator(subs=FINE if high / low < FEW_DECADES else (1.0,)))
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.set_yscale("log")
            axes.set_xlabel(f"{name.replace('_', ' ')} [µs]", labelpad=1.5)
            axes.set_ylabel("share of ticks at or above")
        name_curves(figure, named)
    text = (
        "One line per trial, from the histograms in timing.json. Dashed line: one period for the lateness, and the "
        "budget's limit on the 99th percentile for the command age."
    )
    return PanelPicture("timing_tail", "Tails of lateness and command age", text, figure)


def _tail(axes: Axes, bins: list[list[int]], look: Style) -> None:
    if bins:
        edges, shares = tail(bins)
        axes.step(np.maximum(edges / 1e3, LEAST), shares, where="pre", color=look.colour, linestyle=look.dash,
                  linewidth=0.8, alpha=0.85)  # fmt: skip
