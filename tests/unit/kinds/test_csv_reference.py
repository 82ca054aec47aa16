"""A CSV table is read as its author meant it, or it is refused with file, line and column."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hilrig.core.interfaces import Span
from hilrig.kinds.references.csv import Csv
from hilrig.kinds.references.waypoints import Waypoints

SPAN = Span(2.0, 6.0, None)
TIME = np.linspace(SPAN.start, SPAN.end, 401)
STRAIGHT = ((0.0, 1.0, 2.0), (0.5, -0.25, 2e-3))


def test_a_table_is_the_curve_through_its_rows() -> None:
    table = Csv("a.csv", "x").filled("time, x\n0, 0\n1, 0.5\n2, 0.25\n")
    same = Waypoints((0.0, 1.0, 2.0), (0.0, 0.5, 0.25)).sample(TIME, SPAN)
    for found, wanted in zip(table.sample(TIME, SPAN), same, strict=True):
        np.testing.assert_array_equal(found, wanted)


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=20), st.sampled_from(["\n", "\r\n", "\r"]), st.booleans())
def test_what_csv_writes_is_read_to_the_last_bit(numbers: list[float], ending: str, quoted: bool) -> None:
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator=ending, quoting=csv.QUOTE_ALL if quoted else csv.QUOTE_MINIMAL)
    writer.writerows([("note, if any", "time", "x"), *(("a, b", i, value) for i, value in enumerate(numbers))])
    table = Csv("a.csv", "x").filled(stream.getvalue())
    assert table.values == tuple(numbers)
    assert table.times == tuple(map(float, range(len(numbers))))


@pytest.mark.parametrize(
    "text",
    [
        "time,x\n0,0.5\n1,-0.25\n2,2e-3",
        "time,x\r\n0,0.5\r\n1,-.25\r\n2,2E-3\r\n",
        "time,x\r0,0.5\r1,-0.25\r2,0.002\r",
        " time , x \n 0 , 0.5 \n 1 , -0.25 \n 2. , +2e-3 \n",
        'time,x\n"0","0.5"\n"1", "-0.25"\n"2","2e-3"\n',
        "\ntime,x\n0,0.5\n   \n1,-0.25\n\n2,2e-3\n\n",
        "x,other,time\n0.5,,0\n-0.25,1_0,1\n2e-3,nan,2\n",
        "time,x,\n0,0.5,\n1,-0.25,\n2,2e-3,\n",
    ],
    ids=["no last newline", "CRLF", "CR", "blanks", "quotes", "blank lines", "other columns", "a column without name"],
)
def test_these_are_tables(text: str) -> None:
    table = Csv("a.csv", "x").filled(text)
    assert (table.times, table.values) == STRAIGHT


REFUSED = {
    "empty": ("", "a.csv: the table is empty; the first line must name the columns"),
    "blank": ("\n \n", "the table is empty"),
    "header alone": ("time,x\n", "at least two points; this one has 0"),
    "one row": ("time,x\n0,1\n", "at least two points; this one has 1"),
    "no header": ("0,1\n1,2\n", "line 1 holds numbers, but the first line must name the columns"),
    "units below the header": ("time,x\ns,m\n0,1\n", "line 2, column 'time': 's' is not a number"),
    "units in the header": ("time [s],x\n0,1\n", "no column 'time' (columns: time [s], x); did you mean 'time [s]'?"),
    "a title first": ("my table\ntime,x\n0,1\n", "line 1: there is no column 'time' (columns: my table)"),
    "another column": ("time,y\n0,1\n", "line 1: there is no column 'x' (columns: time, y)"),
    "a name twice": ("time,x,x\n0,1,2\n1,1,2\n", "line 1: the columns 2 and 3 have the same name, 'x'"),
    "semicolons": ("time;x\n0;1\n", "no column 'time' (columns: time;x); separate fields with commas, not with ';'"),
    "tabs": ("time\tx\n0\t1\n", "not with tabs"),
    "a semicolon in one row": ("time,x\n0,1\n1;2\n", "line 3: found 1 fields where the header has 2; separate fields"),
    "decimal commas": ("time,x\n0,0,00\n1,0,02\n", "line 2: found 3 fields where the header has 2; write decimals"),
    "a quoted decimal comma": ('time,x\n0,"0,5"\n', "line 2, column 'x': '0,5' is not a number"),
    "a comma too many": ("time,x\n0,1,\n", "line 2: found 3 fields where the header has 2; remove the comma"),
    "a field too few": ("time,x\n0,1\n1\n", "line 3: found 1 fields where the header has 2"),
    "an empty field": ("time,x\n0,1\n1,\n", "line 3, column 'x': the field is empty"),
    "an open quote": ('time,x\n0,1\n1,"2\n2,3\n', "line 3: a quote is not closed"),
    "an open quote in a long table": ('time,x\n0,"1\n' + "1,0.02\n" * 30_000, "line 2: a quote is not closed"),
    "two open quotes": ('time,x\n0,1\n1,"2\n2,"3\n', "line 3: a quote is not closed"),
    "a quote for inches": ('time,x\n0,1\n1,2"\n', "line 3, column 'x': '2\"' is not a number"),
    "after a field of two lines": ('time,x,note\n0,1,"a\nb"\n1,z,c\n', "line 4, column 'x': 'z' is not a number"),
    "underscores": ("time,x\n0,1_000\n", "line 2, column 'x': '1_000' is not a number"),
    "NaN": ("time,x\n0,1\n1,nan\n", "line 3, column 'x': nan is not a finite number"),
    "infinity": ("time,x\n0,-Inf\n", "-Inf is not a finite number"),
    "beyond all numbers": ("time,x\n0,1e999\n", "1e999 is too large"),
    "digits of another script": ("time,x\n0,\u0663\n", "is not a number"),
    "a typeset minus": ("time,x\n0,\u22120.5\n", "is not a number"),
    "a unit": ("time,x\n0,0.5 m\n", "'0.5 m' is not a number"),
    "a date": ("time,x\n2026-01-01T00:00:00,1\n", "line 2, column 'time': '2026-01-01T00:00:00' is not a number"),
    "a time twice": ("time,x\n0,1\n1,1\n1,2\n", "line 4: the time 1 s follows 1 s; times must rise"),
    "time runs back": ("time,x\n\n1,1\n0,1\n", "line 4: the time 0 s follows 1 s; times must rise"),
    "a negative time": ("time,x\n-1,1\n0,1\n", "line 2: the time -1 s is before the start of the phase"),
    "UTF-16 without a mark": ("t\0i\0m\0e\0,\0x\0", "line 1 holds a NUL character"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "words"), REFUSED.values(), ids=REFUSED)
def test_tables_that_are_not_what_they_seem_are_refused(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=r"^a\.csv: ") as caught:
        Csv("a.csv", "x").filled(text)
    assert words in str(caught.value)
