"""The quantities that figures show over time, by name, with their values, references and units."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from hilrig.core.signals import Array
from hilrig.kinds.metrics._record import PhaseRecord

CurvesByAxis = dict[str, Array]
"""Values (N,) by the axis they belong to"""


class Quantity(NamedTuple):
    """A quantity with a value at every tick, for some or all axes."""

    title: str
    """Title of a figure"""
    label: str
    """Label of a panel's vertical axis"""
    unit: str
    values: Callable[[PhaseRecord], CurvesByAxis]
    """Values in `unit`"""
    reference: Callable[[PhaseRecord], CurvesByAxis] | None = None
    """The reference for the values, in `unit`"""


def _by_axis(values: Array, record: PhaseRecord, sigma: int | None = None) -> CurvesByAxis:
    """Return the columns of `values` (N, m) for the axes with this sigma; for all axes if None."""
    return {axis: values[:, i] for i, axis in enumerate(record.axes) if sigma is None or record.sigma[i] == sigma}


QUANTITIES: Mapping[str, Quantity] = {
    "position": Quantity(
        "Position tracking", "position", "m",
        lambda r: _by_axis(r.position, r, 1), lambda r: _by_axis(r.reference_position, r, 1),
    ),
    "position_error": Quantity(
        "Position error", "position error", "mm",
        lambda r: {axis: 1e3 * error for axis, error in r.position_error().items()},
    ),
    "force": Quantity(
        "Force tracking", "force", "N", lambda r: _by_axis(r.force, r, 0), lambda r: _by_axis(r.reference_force, r, 0)
    ),
    "force_error": Quantity("Force error", "force error", "N", lambda r: r.force_error()),
    "auxiliary_error": Quantity(
        "Auxiliary error, eq. (25)", "auxiliary error", "N", lambda r: _by_axis(r.auxiliary_error(), r)
    ),
}  # fmt: skip
"""In page order"""
