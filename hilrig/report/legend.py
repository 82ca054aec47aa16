"""The legend above the panels: the number of rows that its names need, and their height."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hilrig.report.plotting import Figure, FontProperties, Line2D, TextPath
from hilrig.report.style import RC, REFERENCE, Style

MOST_ENTRIES = 6
"""Most names in a row"""
SPACING, PAD = 1.6, 0.8
"""Space between two columns, and between a line and its name, in font heights"""
ROW = 1.5 * RC["legend.fontsize"] / 72
"""Height of a row, inches"""


class Legend(NamedTuple):
    """The names in a figure's legend, and its number of columns."""

    styles: dict[str, Style]
    """By name"""
    reference: bool
    """Whether the reference is included, as the first name"""
    columns: int

    @property
    def further(self) -> float:
        """Height of the rows beyond the first, inches"""
        return (-(-(len(self.styles) + self.reference) // self.columns) - 1) * ROW


def legend_of(styles: dict[str, Style], reference: bool, width: float) -> Legend:
    """Return the legend with the most columns that fit into `width` inches, at least one."""
    names = ["reference"] * reference + list(styles)
    for columns in range(min(MOST_ENTRIES, len(names)), 1, -1):
        if _width(names, columns) <= width:
            return Legend(styles, reference, columns)
    return Legend(styles, reference, 1)


def _width(names: Sequence[str], columns: int) -> float:
    """Return the width of a legend with this many columns, which are filled one after the other, inches."""
    size = float(RC["legend.fontsize"])
    # Matplotlib splits the names in the same way. An object array keeps the full length of every name.
    parts = np.array_split(np.array(names, dtype=object), columns)
    widest = sum(max(_text_width(name, size) for name in part) for part in parts)
    return (widest + columns * (RC["legend.handlelength"] + PAD) * size + (columns - 1) * SPACING * size) / 72


def _text_width(text: str, size: float) -> float:
    """Return the width of a text, points."""
    font = FontProperties(family=RC["font.family"], size=size)
    return float(TextPath((0, 0), text, prop=font).get_extents().width)


def draw_legend(figure: Figure, legend: Legend, left: float) -> None:
    """Draw the legend above the panels, starting at `left`, a fraction of the figure's width."""
    handles = [Line2D([], [], color=s.colour, linestyle=s.dash, label=name) for name, s in legend.styles.items()]
    if legend.reference:
        handles.insert(0, Line2D([], [], color=REFERENCE, linewidth=0.7, label="reference"))
    height = figure.get_size_inches()[1]
    figure.legend(handles=handles, loc="upper left", ncols=legend.columns, borderaxespad=0, handletextpad=PAD,
                  bbox_to_anchor=(left, 1 - 0.06 / height), columnspacing=SPACING)  # fmt: skip
