"""A curve through the rows of a table."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar

from hilrig.core.interfaces import Samples, Span
from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array
from hilrig.kinds.references._curve import Interpolation, check_points, curve, cut_off
from hilrig.kinds.references._table import read_columns


@dataclass(frozen=True)
class Csv:
    """r(t) passes through the points in two columns of a CSV file, named by its first line; SI units.

    The file is UTF-8 text: fields separated by commas, decimals with a point. Times (s) count from the start of the
    phase. Interpolation and ends are as for waypoints. The points are read with the experiment and become part of the
    trial, so a run no longer depends on the file.
    """

    reads: ClassVar[str] = "file"
    """The field that names a file; the file's text is passed to `filled`"""

    file: Annotated[str, Parameter("", "path of the file, from the experiment file's folder")]
    column: Annotated[str, Parameter("", "column with the values, in m or N")]
    time: Annotated[str, Parameter("", "column with the times, in s")] = "time"
    interpolation: Interpolation = "cubic"
    times: tuple[float, ...] = field(default=(), repr=False, metadata={"filled": True})
    values: tuple[float, ...] = field(default=(), repr=False, metadata={"filled": True})

    def filled(self, text: str) -> Csv:
        """Return the reference with the points of the file's `text`. Raises ValueError with the file and the line."""
        try:
            lines, (times, values) = read_columns(text, (self.time, self.column))
            check_points(times, values, [f"line {line}" for line in lines])
        except ValueError as error:
            raise ValueError(f"{self.file}: {error}") from error
        return replace(self, times=times, values=values)

    def sample(self, time: Array, span: Span) -> Samples:
        """Return the curve at `time` (N,) s. Raises ValueError if it begins after its phase has ended."""
        return curve(self.times, self.values, self.interpolation, time, span)

    def warnings(self, span: Span) -> list[str]:
        """Return a warning if the phase ends before the curve does."""
        return cut_off(self.times, span)
