from __future__ import annotations

import re
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hilrig.core.errors import PluginError
from hilrig.core.law_memory import RECORDED, memory_sizes, name_problem
from hilrig.loop.rows import InternalsRows

ROS_2 = re.compile(r"^(?!.*__)(?!.*_$)[a-z][a-z0-9_]*$")
"""As in rosidl_adapter/parser.py, VALID_FIELD_NAME_PATTERN"""


class Memory(NamedTuple):
    a: Any
    b: Any = np.zeros(1)


@given(st.from_regex(r"[A-Za-z_θ0-9]{1,6}", fullmatch=True) | st.text(max_size=6))
def test_a_name_is_allowed_where_ros_2_allows_it(name: str) -> None:
    allowed = ROS_2.match(name) is not None and not name.endswith("\n")
    assert (name_problem(name) == "") == (allowed and name not in RECORDED)


@pytest.mark.parametrize(("name", "example"), [("Kp", "'kp'"), ("x__y_", "'x_y'"), ("2x", "'x'")])
def test_a_name_like_it_is_proposed(name: str, example: str) -> None:
    assert f"such as {example}" in name_problem(name)


def test_a_name_of_the_record_is_refused() -> None:
    assert (*RECORDED, "memory") == InternalsRows._fields
    assert "reserved for the record" in name_problem("position")


def test_sizes_are_by_name() -> None:
    assert memory_sizes(Memory(np.zeros(2), np.zeros((2, 3))), "mine") == {"a": 2, "b": 6}
    assert memory_sizes((), "mine") == {}


@pytest.mark.parametrize(
    ("memory", "words"),
    [
        ([1.0], "the law's memory is a list; make it a NamedTuple"),
        (Memory(1.0), "'a' is a float"),
        (Memory(np.zeros(2, np.float32)), "'a' is an array of float32 with 2 entries"),
        (Memory(np.zeros(0)), "with 0 entries"),
    ],
)
def test_what_cannot_be_recorded_is_refused(memory: Any, words: str) -> None:
    with pytest.raises(PluginError, match="controller 'mine': ") as caught:
        memory_sizes(memory, "mine")
    assert words in str(caught.value)
