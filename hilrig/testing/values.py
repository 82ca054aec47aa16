"""The values that an author gives to test with, read as an experiment file reads them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from hilrig.core.errors import nearest
from hilrig.experiment.schema import Context, InvalidError, Reader, readers_of

UNITS = ("m", "N")
"""What the unit "m|N" of a reference may stand for"""


def read_values(cls: type, values: Mapping[str, Any], base: Path) -> dict[str, Any]:
    """Return those of `values` that a kind has a field for, by name, read as an experiment file reads them.

    What a file cannot hold, such as a robot or a tuple, is taken as it is. Relative paths start from `base`. Raises
    ValueError, naming the field, for a value that a file could not give it.
    """
    names = [field.name for field in dataclasses.fields(cls)]
    return {name: _read(cls, name, value, base) for name, value in values.items() if name in names}


def check_values(group: str, classes: Iterable[type], values: Mapping[str, Any], base: Path) -> None:
    """Raise TypeError for a value that none of the classes has a field for, and ValueError for one it does not take."""
    loaded = list(classes)
    names = {field.name for cls in loaded for field in dataclasses.fields(cls)}
    for name in values if loaded else ():
        if name not in names:
            listed = ", ".join(sorted(names)) or "none"
            raise TypeError(f"there is no field '{name}' of {group}{nearest(name, names)} (fields: {listed})")
    for cls in loaded:
        read_values(cls, values, base)


def _read(cls: type, name: str, value: Any, base: Path) -> Any:
    reader = readers_of(cls).get(name) if _from_a_file(value) else None
    if reader is None:
        return value
    try:
        return _in_a_unit(reader, value, base)
    except InvalidError as error:
        problems = [f"{'.'.join(map(str, finding.path))}: {finding.message}" for finding in error.below(name)]
        raise ValueError("; ".join(problems)) from error


def _in_a_unit(reader: Reader, value: Any, base: Path) -> Any:
    """Return what is read with "m|N" as m, or else as N: a test does not know whether it is a position or a force."""
    try:
        return reader.read(value, Context(base, UNITS[0]))
    except InvalidError as error:
        try:
            return reader.read(value, Context(base, UNITS[1]))
        except InvalidError:
            raise error from None


def _from_a_file(value: Any) -> bool:
    """Return whether an experiment file could hold a value: a number, a text, yes or no, nothing, or some of them."""
    if isinstance(value, dict):
        return all(map(_from_a_file, value.values()))
    if isinstance(value, list):
        return all(map(_from_a_file, value))
    return value is None or type(value) in (bool, int, float, str)
