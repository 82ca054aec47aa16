"""What of a law's memory is recorded."""

from __future__ import annotations

from typing import Any

import numpy as np

from hilrig.core.errors import PluginError
from hilrig.loop.rows import InternalsRows


def memory_sizes(memory: Any, controller: str) -> dict[str, int]:
    """Return the length of every field of a law's memory, by name. Raises PluginError if it cannot be recorded."""
    if memory == ():
        return {}
    names = getattr(type(memory), "_fields", None)
    if names is None:
        raise PluginError(
            f"controller '{controller}': the law's memory is a {type(memory).__name__}; make it a NamedTuple of arrays"
        )
    for name, value in zip(names, memory, strict=True):
        if name in _TAKEN:
            raise PluginError(
                f"controller '{controller}': memory field '{name}' has a name that the record needs for itself "
                f"(these are: {', '.join(_TAKEN)})"
            )
        if not isinstance(value, np.ndarray) or value.dtype != np.float64 or value.size == 0:
            raise PluginError(
                f"controller '{controller}': memory field '{name}' is {value!r}; "
                "every field is an array of float64, with one entry or more, that step writes in place"
            )
    return {name: value.size for name, value in zip(names, memory, strict=True)}


_TAKEN = tuple(name for name in InternalsRows._fields if name != "memory")
"""What the record says of every law, before the law's own memory"""
