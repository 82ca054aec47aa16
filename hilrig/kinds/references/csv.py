"""A curve through the rows of a table."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar

from hilrig.core.errors import nearest
from hilrig.core.interfaces import Samples, Span
from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array
from hilrig.kinds.references._curve import Interpolation, check_points, curve


@dataclass(frozen=True)
class Csv:
    """r(t) passes through the points in two columns of a CSV file, named by its first row; SI units.

    Time (s) counts from the start of the phase. Interpolation and ends as for waypoints. The points are read
    when the experiment is, and become part of the trial: a run does not depend on the file any more.
    """

    reads: ClassVar[str] = "file"
    """The field that names a file; whoever makes the reference passes the file's text to `filled`"""

    file: Annotated[str, Parameter("", "path of the file, from the experiment file's folder")]
    column: Annotated[str, Parameter("", "column with the values, in m or N")]
    time: Annotated[str, Parameter("", "column with the times, in s")] = "time"
    interpolation: Interpolation = "cubic"
    times: tuple[float, ...] = field(default=(), repr=False, metadata={"filled": True})
    values: tuple[float, ...] = field(default=(), repr=False, metadata={"filled": True})

    def filled(self, text: str) -> Csv:
        """Return the reference with the points of the file's `text`.

        Raises ValueError naming line and column.
        """
        reader = csv.DictReader(io.StringIO(text), skipinitialspace=True)
        rows = [(reader.line_num, row) for row in reader]
        times, values = (self._numbers(rows, reader.fieldnames or (), name) for name in (self.time, self.column))
        try:
            check_points(times, values)
        except ValueError as error:
            raise ValueError(f"{self.file}: {error}") from error
        return replace(self, times=times, values=values)

    def _numbers(self, rows: list[tuple[int, dict[str, str]]], names: Sequence[str], column: str) -> tuple[float, ...]:
        if column not in names:
            there = ", ".join(names) or "none"
            raise ValueError(f"{self.file} has no column '{column}'{nearest(column, names)} (columns: {there})")
        return tuple(self._number(row[column], column, line) for line, row in rows)

    def _number(self, text: str | None, column: str, line: int) -> float:
        try:
            return float(text or "")
        except ValueError as error:
            raise ValueError(f"{self.file}: line {line}, column '{column}': '{text or ''}' is not a number") from error

    def sample(self, time: Array, span: Span) -> Samples:
        """Return the curve at `time` (N,) s."""
        return curve(self.times, self.values, self.interpolation, time - span.start)
