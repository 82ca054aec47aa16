"""The figures of one condition: tracking, errors and effort, with one curve per controller."""

from __future__ import annotations

from hilrig.report.panels import (
    TOP,
    Drawn,
    PanelPicture,
    canvas,
    caption,
    controller_curves,
    legend,
    mark_phases,
    name_curves,
    panel,
    with_zoom,
)
from hilrig.report.plotted import QUANTITIES
from hilrig.report.plotting import figure_style


def comparison_figures(drawn: Drawn) -> list[PanelPicture]:
    """Return the figures that compare the controllers, in the order of the page."""
    with figure_style():
        return [*(picture for name in QUANTITIES for picture in _over_time(name, drawn)), _effort(drawn)]


def _over_time(name: str, drawn: Drawn) -> list[PanelPicture]:
    """Return the figures of one quantity, one per axis."""
    title, label, unit, values, reference = QUANTITIES[name]
    longest = max((signals.record for _, signals in drawn.trials.values()), key=lambda record: record.time.size)
    desired = reference(longest) if reference else {}
    return [
        with_zoom(
            drawn, f"{name}_{axis}", f"{title}, {axis}", f"{label} {axis}", unit,
            controller_curves(drawn, lambda signals, axis=axis: values(signals.record)[axis]),
            (longest.time, desired[axis]) if axis in desired else None,
        )
        for axis in values(drawn.some.record)
    ]  # fmt: skip


def _effort(drawn: Drawn) -> PanelPicture:
    """Return the figure of the commanded torque, with one panel per joint."""
    joints = drawn.some.record.torque.shape[1]
    named = legend(drawn, False)
    figure, grid = canvas(joints, 1, 1.3, 1.3, top=TOP + named.further)
    notes: list[str] = []
    for joint in range(joints):
        axes = figure.add_subplot(grid[joint, 0])
        curves = controller_curves(drawn, lambda s, joint=joint: s.record.torque[:, joint])
        notes += panel(axes, curves, None, f"joint {joint + 1} torque [N m]", "N m", (0.0, drawn.end))
        mark_phases(axes, drawn)
        axes.set_xlabel("time [s]", labelpad=1.5)
    name_curves(figure, named)
    return PanelPicture(
        "effort", "Control effort", caption(drawn, "Commanded joint torque, after limits.", notes), figure
    )
