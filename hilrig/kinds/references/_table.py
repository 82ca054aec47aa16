"""Columns of numbers from the text of a CSV table. Anything that is not clearly a number is rejected, with its line."""

from __future__ import annotations

import csv
import io
import math
import re
import reprlib
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from hilrig.core.errors import nearest

OTHER_SEPARATORS = {";": "';'", "\t": "tabs", "|": "'|'"}

# float() also accepts 1_000, nan, and digits of other scripts.
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.IGNORECASE)


class Columns(NamedTuple):
    """Some columns of a table, row by row."""

    lines: tuple[int, ...]
    """Line of the file on which each row begins, counted from 1"""
    values: tuple[tuple[float, ...], ...]
    """For each requested column, one number per row"""


def read_columns(text: str, names: Sequence[str]) -> Columns:
    """Return the columns with these names; the first line of `text` is the header.

    Fields are separated by commas and may be quoted; blank lines are skipped. Raises ValueError, with the line, if a
    row has more or fewer fields than the header, a quote is not closed, or a field of these columns is not a number.
    """
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise ValueError(f"line {line} holds a NUL character; a table is text in UTF-8")
    rows = _rows(text)
    first, header = next(rows, (1, []))
    header = [name.strip() for name in header]
    places = [_place_of(name, header, first) for name in names]
    lines: list[int] = []
    values: list[list[float]] = [[] for _ in names]
    for line, row in rows:
        if len(row) != len(header):
            counts = f"found {len(row)} fields where the header has {len(header)}"
            raise ValueError(f"line {line}: {counts}{_advice(row, len(header))}")
        lines.append(line)
        for name, place, column in zip(names, places, values, strict=True):
            column.append(_number(row[place].strip(), f"line {line}, column '{name}'"))
    return Columns(tuple(lines), tuple(map(tuple, values)))


def _rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield each row that is not blank, with the line on which it begins."""
    # newline=None: accepts the line ends of any system, also within quoted fields that span several lines.
    reader = csv.reader(io.StringIO(text, newline=None), strict=True, skipinitialspace=True)
    while True:
        line = reader.line_num + 1
        try:
            row = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            raise ValueError(f"line {line}: a quote is not closed, or stands inside a field ({error})") from error
        if len(row) > 1 or "".join(row).strip():
            yield line, row


def _place_of(name: str, header: Sequence[str], line: int) -> int:
    """Return the index of the column's field in a row."""
    if not header:
        raise ValueError("the table is empty; the first line must name the columns, such as 'time,x'")
    if all(_NUMBER.fullmatch(field) for field in header):
        raise ValueError(f"line {line} holds numbers, but the first line must name the columns, such as 'time,x'")
    if name not in header:
        advice = _advice(header, len(header)) or nearest(name, header)
        raise ValueError(f"line {line}: there is no column '{name}' (columns: {', '.join(header)}){advice}")
    if header.count(name) > 1:
        places = " and ".join(str(i) for i, field in enumerate(header, start=1) if field == name)
        raise ValueError(f"line {line}: the columns {places} have the same name, '{name}'")
    return header.index(name)


def _advice(row: Sequence[str], wanted: int) -> str:
    """Return advice for a row that was split in the wrong places; an empty string if there is none."""
    for separator, shown in OTHER_SEPARATORS.items():
        if any(separator in field for field in row):
            return f"; separate fields with commas, not with {shown}"
    if len(row) <= wanted:
        return ""
    return "; write decimals with a point: 0.02, not 0,02" if row[-1] else "; remove the comma at the end of the line"


def _number(text: str, where: str) -> float:
    if not text:
        raise ValueError(f"{where}: the field is empty; it needs a number")
    if _NOT_FINITE.fullmatch(text):
        raise ValueError(f"{where}: {text} is not a finite number")
    if not _NUMBER.fullmatch(text):
        raise ValueError(f"{where}: {reprlib.repr(text)} is not a number; write numbers such as 0.02 or -2e-3")
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{where}: {text} is too large")
    return value
