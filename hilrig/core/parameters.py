"""The parameters of kinds: unit, bounds and meaning, put on the fields of their dataclasses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

if TYPE_CHECKING:  # signals import numba, which code that only reads settings does not need
    from hilrig.core.signals import Array


@dataclass(frozen=True)
class Parameter:
    """Metadata of a parameter, put on a dataclass field as Annotated[float, Parameter(...)].

    `unit` is the SI unit ("" for a pure number), `low` and `high` the allowed range (inclusive), `meaning` a one-line
    description. `scale` is how a search should vary it: "log" by factors; where `low` is 0, zero switches the term off.
    """

    unit: str
    meaning: str = ""
    low: float = -np.inf
    high: float = np.inf
    scale: Literal["linear", "log"] = "linear"


PerAxis = float | tuple[float, ...]
"""A parameter given once for all axes, or once per axis."""


def per_axis(value: PerAxis | Array, size: int, name: str) -> Array:
    """Return the parameter `name` as an array (size,); a single number applies to all entries.

    Raises ValueError, naming the parameter, if a list has another length.
    """
    array = np.atleast_1d(np.asarray(value, dtype=np.float64))
    if array.size not in (1, size):
        raise ValueError(f"{name}: {array.size} values given; this needs 1 or {size}")
    return np.ascontiguousarray(np.broadcast_to(array, (size,)))


def plain(value: Any) -> Any:
    """Return a parameter's value in built-in types: a NumPy scalar as a number, an array as a tuple of numbers."""
    if isinstance(value, np.floating):
        return float(value)
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    return tuple(plain(item) for item in value) if isinstance(value, (tuple, list)) else value
