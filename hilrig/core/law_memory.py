"""Rules for a law's memory: every field is an array that is recorded under its name."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from hilrig.core.errors import PluginError

RECORDED = (
    "tick", "time", "position", "velocity", "force",
    "reference_position", "reference_velocity", "reference_acceleration", "reference_force",
)  # fmt: skip
"""The names of what is recorded for every law, before the fields of its own memory"""

_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
"""Names that ROS 2 allows for message fields, https://design.ros2.org/articles/legacy_interface_definition.html"""


def memory_sizes(memory: Any, controller: str) -> dict[str, int]:
    """Return the length of every field of a law's memory, by name. Raises PluginError if it cannot be recorded."""
    problems = memory_problems(memory)
    if problems:
        raise PluginError(f"controller '{controller}': {'; '.join(problems.values())}")
    return {name: value.size for name, value in zip(getattr(memory, "_fields", ()), memory, strict=True)}


def memory_problems(memory: Any) -> dict[str, str]:
    """Return why a law's memory cannot be recorded, by field; under "" if it has no fields at all."""
    names = getattr(type(memory), "_fields", None)
    if names is None:
        message = f"the law's memory is a {type(memory).__name__}; make it a NamedTuple of arrays"
        return {} if memory == () else {"": message}
    found = {name: name_problem(name) or _array_problem(name, value) for name, value in zip(names, memory, strict=True)}
    return {name: problem for name, problem in found.items() if problem}


def name_problem(name: str) -> str:
    """Return why this name is not allowed for a field of a law's memory, and what is; "" if it is allowed."""
    if name in RECORDED:
        return f"the memory field '{name}' has a name that is reserved for the record (reserved: {', '.join(RECORDED)})"
    if _NAME.fullmatch(name):
        return ""
    lower = re.sub(r"_+", "_", re.sub(r"[^a-z0-9_]", "", name.lower())).strip("_0123456789")
    example = f", such as '{lower}'" if _NAME.fullmatch(lower) and lower not in RECORDED else ""
    return (
        f"the memory field '{name}' has a name that ROS 2 does not allow; use lower-case letters, digits and single "
        f"underscores between them, starting with a letter{example}"
    )


def _array_problem(name: str, value: Any) -> str:
    if isinstance(value, np.ndarray) and value.dtype == np.float64 and value.size:
        return ""
    array = isinstance(value, np.ndarray)
    found = f"an array of {value.dtype} with {value.size} entries" if array else f"a {type(value).__name__}"
    return (
        f"the memory field '{name}' is {found}; "
        "every field must be an array of float64 with at least one entry, which step writes in place"
    )
