"""The style of figures: print sizes, and colours that colour-blind readers can tell apart, each with a line style."""

from __future__ import annotations

from typing import Any, NamedTuple

TWO_COLUMNS = 7.16
"""Width of a figure across both columns of a paper, inches"""

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#6B4C1E", "#8A8A8A")
"""Okabe and Ito's palette without yellow, which is hard to see on white, then brown and grey"""

DASHES: tuple[Any, ...] = (
    "-",
    (0, (5, 1.4)),
    (0, (5, 1.2, 1, 1.2)),
    (0, (1.4, 1)),
    (0, (8, 2)),
    (0, (3, 1, 1, 1, 1, 1)),
)

REFERENCE = "#1a1a1a"
MUTED = "#8c8c8c"

RC: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "axes.linewidth": 0.6,
    "xtick.color": "#333333",
    "ytick.color": "#333333",
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "lines.linewidth": 1.0,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "figure.dpi": 100,
    "svg.hashsalt": "hilrig",
    "path.simplify": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-5, 5),
    "axes.formatter.use_mathtext": False,
}


class Style(NamedTuple):
    """Colour and dash pattern of one line."""

    colour: str
    dash: Any


def styles(names: tuple[str, ...]) -> dict[str, Style]:
    """Return a style for each name, by its position; colours and dashes repeat with different cycle lengths."""
    return {name: Style(COLOURS[i % len(COLOURS)], DASHES[i % len(DASHES)]) for i, name in enumerate(names)}
