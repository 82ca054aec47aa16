"""The figure of a control law's memory: one small panel for each field."""

from __future__ import annotations

import ast
import inspect
import itertools
import re

from hilrig.core.errors import HilrigError
from hilrig.kinds import registry as plugins
from hilrig.report.curves import Curve, limits
from hilrig.report.dataset import TrialEntry, TrialSignals
from hilrig.report.panels import PanelPicture, canvas, draw
from hilrig.report.plotting import Axes, figure_style
from hilrig.report.style import COLOURS, Style

INTERNALS_COLUMNS = 3
NAMED_FIELDS = 6
"""Up to this many components are named in a panel; if there are more, all are drawn and their number is given"""

_DOCUMENTED = re.compile(r"^.*,\s*\([^()]*\)\s*(?P<unit>.*)$", re.DOTALL)


def memory_documents(kind: str) -> dict[str, str]:
    """Return the docstring below each field of the class `Memory` in a controller's source, by field.

    A kind that builds on another uses the other's class, unless its own file has one. Empty if the kind can no longer
    be loaded or has no such class.
    """
    try:
        modules = dict.fromkeys(
            inspect.getmodule(cls) for cls in inspect.getmro(plugins.load_kind("controllers", kind))
        )
        trees = [ast.parse(inspect.getsource(module)) for module in modules if module and module.__name__ != "builtins"]
    except (HilrigError, OSError, TypeError, SyntaxError):
        return {}
    nodes = [node for tree in trees for node in tree.body]
    bodies = [node.body for node in nodes if isinstance(node, ast.ClassDef) and node.name == "Memory"]
    pairs = [pair for body in bodies[:1] for pair in itertools.pairwise(body)]
    return {
        field.target.id: inspect.cleandoc(text.value.value)
        for field, text in pairs
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
        and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant) and isinstance(text.value.value, str)
    }  # fmt: skip


def unit_of(document: str) -> str | None:
    """Return the unit at the end of "meaning, (shape,) unit"; "" for a pure number, None if none is stated."""
    match = _DOCUMENTED.match(document)
    return match["unit"].strip().rstrip(".") if match else None


def internals_figure(trial: TrialEntry, signals: TrialSignals) -> PanelPicture | None:
    """Return a figure with one panel for every field of the law's memory; None if the law has none."""
    fields = signals.internals
    if not fields:
        return None
    documents = memory_documents(trial.document["controller"]["kind"])
    with figure_style():
        rows = -(-len(fields) // INTERNALS_COLUMNS)
        figure, grid = canvas(rows, INTERNALS_COLUMNS, 1.25, 1.25, top=0.25, between=0.42)
        notes: list[str] = []
        for k, name in enumerate(fields):
            axes = figure.add_subplot(grid[k // INTERNALS_COLUMNS, k % INTERNALS_COLUMNS])
            notes += _memory_panel(axes, name, signals, documents.get(name, ""))
    shown = f"All {len(fields)} fields" if len(fields) > 1 else "The only field"
    caption = f"Repeat {trial.repeat}. {shown} of the law's memory."
    text = " ".join([caption, *(f"{note}." for note in notes)])
    return PanelPicture(f"internals_{trial.controller}", f"Internals of {trial.controller}", text, figure)


def _memory_panel(axes: Axes, name: str, signals: TrialSignals, document: str) -> tuple[str, ...]:
    """Draw all components of one field."""
    record, values = signals.record, signals.internals[name]
    count = values.shape[1]
    labels = record.axes if count == len(record.axes) else [str(i + 1) for i in range(count)]
    curves = [
        Curve(f"{name} {label}", record.time, values[:, i], Style(COLOURS[i % len(COLOURS)], "-"))
        for i, label in enumerate(labels)
    ]
    for depth, curve in enumerate(curves):
        draw(axes, curve, 3 + depth)
    unit = unit_of(document)
    # The components of one law: none is cut off to show the others, as a runaway controller would be.
    bounds = limits([Curve(name, record.time, values.ravel(), curves[0].style)], unit or "")
    low, high = bounds.low, bounds.high
    axes.set(xlim=(record.time[0], record.time[-1]), ylim=(low, high))
    axes.set_ylabel(f"[{unit}]" if unit else "[–]" if unit == "" else "[SI, not stated]", labelpad=2)
    axes.set_xlabel("time [s]", labelpad=1.5)
    many = f" ({count} components)" if count > NAMED_FIELDS else ""
    axes.set_title(name.replace("_", " ") + many, loc="left", pad=3)
    _name_components(axes, list(labels))
    return bounds.notes


def _name_components(axes: Axes, labels: list[str]) -> None:
    """Label the components at the panel's upper right, in their colours, if there are few."""
    if not 1 < len(labels) <= NAMED_FIELDS:
        return
    for i, label in enumerate(reversed(labels)):
        axes.annotate(label, (1.0, 1.0), xycoords="axes fraction", xytext=(-10 * i, 3), textcoords="offset points",
                      ha="right", va="bottom", fontsize=7, color=COLOURS[len(labels) - 1 - i])  # fmt: skip
