"""Overrides: values given on the command line, such as "repeats=1" or "controllers.pd.stiffness=100 N/m"."""

from __future__ import annotations

import copy
from dataclasses import fields
from typing import Any

from hilrig.core.errors import ExperimentError, Place, Problem, nearest
from hilrig.experiment import document
from hilrig.experiment.document import Document, Keys
from hilrig.experiment.model import Experiment

SECTIONS = tuple(field.name for field in fields(Experiment) if field.name != "source")
"""Sections that an experiment file may have"""
USER_NAMED = (("controllers",), ("conditions",))
"""Mappings with names chosen by the user: an override can change entries, but not add any"""


def override(source: Document, text: str) -> Document:
    """Return the document with `text`, "dotted.path=value", applied; the value is read as YAML.

    Items of a list are selected by their `name` or by their index from 0. Raises ExperimentError if the path
    does not exist.
    """
    file = f"--set {text}"
    path_text, equals, value_text = text.partition("=")
    if not equals or not path_text.strip():
        raise _error(file, f"'{text}' is not an override; write path=value, such as repeats=1")
    value = document.parse(value_text, file)
    data = copy.deepcopy(source.data)
    path = _resolved(data, path_text.strip().split("."), file)
    parent = data
    for key in path[:-1]:
        parent = parent[key]
    parent[path[-1]] = value.data
    return _merged(source, data, path, value)


def _resolved(data: Any, names: list[str], file: str) -> Keys:
    """Return the path that `names` stand for in `data`; sections that are missing there are added as mappings."""
    path: Keys = ()
    for depth, name in enumerate(names):
        if isinstance(data, list):
            index = _index(data, name, file)
            data, path = data[index], (*path, index)
        elif isinstance(data, dict):
            last = depth == len(names) - 1
            if depth == 0 and name not in SECTIONS:
                raise _error(file, f"there is no '{name}' in an experiment{nearest(name, SECTIONS)}")
            if name not in data and path in USER_NAMED:
                there = ", ".join(data) or "nothing"
                message = f"there is no '{name}' in {_dotted(path)}{nearest(name, data)} (known: {there})"
                raise _error(file, message)
            if not last and data.get(name) is None:  # an optional section, left out or empty
                data[name] = {}
            data, path = data.get(name), (*path, name)
        else:
            raise _error(file, f"{_dotted(path)} is a single value; it has no '{name}'")
    return path


def _index(items: list[Any], name: str, file: str) -> int:
    names = [str(item.get("name", i)) if isinstance(item, dict) else str(i) for i, item in enumerate(items)]
    if name in names:
        return names.index(name)
    if name.isdecimal() and int(name) < len(items):
        return int(name)
    raise _error(file, f"there is no item '{name}'{nearest(name, names)} (known: {', '.join(names)})")


def _merged(source: Document, data: Any, path: Keys, value: Document) -> Document:
    """Return the document in which replaced values have the places of the override."""

    def merge(old: dict[Keys, Any], new: dict[Keys, Any]) -> dict[Keys, Any]:
        kept = {key: item for key, item in old.items() if key[: len(path)] != path}
        return {**kept, **{(*path, *key): item for key, item in new.items()}}

    here = Place(value.file)
    keys = merge(source.keys, dict.fromkeys([(), *value.keys], here))
    sections = {path[:depth]: here for depth in range(1, len(path)) if path[:depth] not in source.values}
    return Document(
        source.file,
        data,
        {**merge(source.values, dict.fromkeys([(), *value.values], here)), **sections},
        {**keys, **sections},
        merge(source.written, value.written),
    )


def _error(file: str, message: str) -> ExperimentError:
    return ExperimentError([Problem(Place(file), message)])


def _dotted(path: Keys) -> str:
    return f"'{'.'.join(map(str, path))}'"
