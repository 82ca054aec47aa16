"""What a file may contain: rows for users, JSON Schema for editors."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple, get_args

from hilrig.experiment.schema.fields import bare, default, is_required, settable
from hilrig.experiment.schema.reading import record_schema
from hilrig.kinds import registry as plugins
from hilrig.kinds.user_files import code_of


class ParameterRow(NamedTuple):
    """One parameter of a kind."""

    name: str
    """With dots for nested parameters, as in "surface.stiffness\""""
    unit: str
    default: str
    """As written in a file; "required" if there is none"""
    low: float
    high: float
    scale: str
    meaning: str


def describe_kind(group: str, kind: str) -> tuple[ParameterRow, ...]:
    """Return the parameters of a kind, including nested ones. Raises PluginError if there is no such kind."""
    return describe_record(plugins.load_kind(group, kind))


def describe_record(cls: type) -> tuple[ParameterRow, ...]:
    """Return what a dataclass takes from a file, including nested ones."""
    return tuple(_rows(cls, "", ()))


def records_in(cls: type) -> dict[str, type]:
    """Return the fields of a dataclass that are mappings with keys of their own, and the dataclass of each."""
    found = ((field.name, bare(annotation)) for field, annotation, _ in settable(cls))
    return {name: inner for name, inner in found if dataclasses.is_dataclass(inner) and isinstance(inner, type)}


def _rows(cls: type, prefix: str, within: tuple[type, ...]) -> list[ParameterRow]:
    """Return the rows of a dataclass; `within` are the ones around it, of which it may have one again as a part."""
    rows: list[ParameterRow] = []
    for field, annotation, parameter in settable(cls):
        name, inner = prefix + field.name, bare(annotation)
        if dataclasses.is_dataclass(inner) and isinstance(inner, type) and inner not in (cls, *within):
            rows += _rows(inner, name + ".", (cls, *within))
            continue
        meaning = parameter.meaning or _choices(inner)
        unit = parameter.unit.replace("|", " or ")
        rows.append(
            ParameterRow(name, unit, _default(field, cls), parameter.low, parameter.high, parameter.scale, meaning)
        )
    return rows


def _choices(annotation: Any) -> str:
    return " | ".join(str(choice) for choice in get_args(annotation) if isinstance(choice, str))


def _default(field: dataclasses.Field[Any], cls: type) -> str:
    if is_required(field):
        return "required"
    with code_of(cls):
        return _written(default(field))


def _written(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    return f"[{', '.join(_written(item) for item in value)}]" if isinstance(value, tuple) else str(value)


def json_schema(cls: type) -> dict[str, Any]:
    """Return the JSON Schema of the mappings that `read_record` turns into a `cls`, with every known kind."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **record_schema(cls)}
