from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hilrig.core.errors import ExperimentError, Place
from hilrig.experiment.document import parse, read_document

TEXT = """\
a: 1
b:
  - x: 1e-3
    y: [true, ~, "1 ms"]
c: &anchor {d: no}
e: *anchor
"""


def test_data_follow_yaml_1_2() -> None:
    data = parse(TEXT, "f").data
    assert data == {
        "a": 1,
        "b": [{"x": 1e-3, "y": [True, None, "1 ms"]}],
        "c": {"d": "no"},
        "e": {"d": "no"},
    }


def test_places_of_keys_and_values() -> None:
    document = parse(TEXT, "f")
    assert document.place("a") == Place("f", 1, 4)
    assert document.place("a", key=True) == Place("f", 1, 1)
    assert document.place("b", 0, "y", 2) == Place("f", 4, 18)
    assert document.place("b", 0, "y", key=True) == Place("f", 4, 5)
    assert document.place("e", "d") == Place("f", 5, 16)  # where the aliased value is written


def test_the_place_of_what_is_not_there_is_that_of_what_is_around_it() -> None:
    document = parse(TEXT, "f")
    assert document.place("b", 0, "z", "zz") == document.place("b", 0)
    assert document.place("z") == document.place()


def test_scalars_are_kept_as_written() -> None:
    assert parse(TEXT, "f").written["b", 0, "x"] == "1e-3"


def test_an_alias_is_a_copy() -> None:
    data = parse(TEXT, "f").data
    data["c"]["d"] = "changed"
    assert data["e"]["d"] == "no"


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0x10", 16),
        ("0o17", 15),
        ("1_000", 1000),
        ("010", 10),
        ("1e3", 1000.0),
        ("-.inf", float("-inf")),
        ("on", "on"),
        ("2020-01-01", "2020-01-01"),
        ("'1'", "1"),
        ("!!float '3'", 3.0),
        ("!!str 3", "3"),
    ],
)
def test_scalars(text: str, value: object) -> None:
    found = parse(text, "f").data
    assert found == value
    assert type(found) is type(value)


def test_every_problem_of_a_document_is_reported() -> None:
    with pytest.raises(ExperimentError) as caught:
        parse("a: 1\na: 2\nb: !x 1\n", "f")
    assert [problem.place for problem in caught.value.problems] == [Place("f", 2, 1), Place("f", 3, 4)]


def test_a_byte_order_mark_does_not_count(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1\n")
    assert read_document(path).data == {"a": 1}
    assert read_document(path).place("a", key=True).column == 1


@given(st.text(max_size=60))
def test_any_text_is_data_or_an_experiment_error(text: str) -> None:
    try:
        parse(text, "f")
    except ExperimentError as error:
        assert error.problems  # noqa: PT017
