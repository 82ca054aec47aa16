"""The parameters of kinds: unit, bounds and meaning, put on the fields of their dataclasses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

if TYPE_CHECKING:  # the signals load numba; what only reads settings does without
    from hilrig.core.signals import Array


@dataclass(frozen=True)
class Parameter:
    """Metadata of a parameter, put on a dataclass field as Annotated[float, Parameter(...)].

    `unit` is the SI unit ("" for a pure number), `low` and `high` the allowed range (inclusive), `meaning` one line for
    people. `scale` is how a search should treat it: "log" by factors; where `low` is 0, zero switches the term off.
    """

    unit: str
    meaning: str = ""
    low: float = -np.inf
    high: float = np.inf
    scale: Literal["linear", "log"] = "linear"


PerAxis = float | tuple[float, ...]
"""A parameter given once for all axes, or once per axis."""


def per_axis(value: PerAxis | Array, size: int, name: str) -> Array:
    """Return the parameter `name` as an array (size,); a single number counts for all of them.

    Raises ValueError, naming it, if a list has another length.
    """
    array = np.atleast_1d(np.asarray(value, dtype=np.float64))
    if array.size not in (1, size):
        raise ValueError(f"{name}: {array.size} values where there must be 1 or {size}")
    return np.ascontiguousarray(np.broadcast_to(array, (size,)))


def plain(value: Any) -> Any:
    """Return a parameter's value in Python's own types: a NumPy scalar as a number, an array as a tuple of them."""
    if isinstance(value, np.floating):
        return float(value)
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    return tuple(plain(item) for item in value) if isinstance(value, (tuple, list)) else value
