"""Readers of single values, lists and mappings, each with what makes its JSON Schema."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

from hilrig.core.errors import nearest
from hilrig.core.parameters import Parameter
from hilrig.core.quantities import shown
from hilrig.experiment.schema.terms import Context, Finding, InvalidError
from hilrig.experiment.schema.values import Form, number_schema, read_number

Reader = Callable[[Any, Context], Any]
Schema = Callable[[], dict[str, Any]]
"""JSON Schemas are made when they are asked for: reading a file must not load every kind there is."""


def number_reader(form: Form, parameter: Parameter) -> tuple[Reader, Schema]:
    """Return the reader of numbers of a form, with unit and bounds."""

    def number(value: Any, context: Context) -> Any:
        unit = (context.unit or "m") if parameter.unit == "m|N" else parameter.unit
        try:
            return read_number(value, form, dataclasses.replace(parameter, unit=unit))
        except ValueError as error:
            raise InvalidError([Finding((), str(error))]) from error

    return number, lambda: number_schema(form, parameter)


def choice_reader(choices: tuple[Any, ...]) -> tuple[Reader, Schema]:
    """Return the reader of one of several values."""

    def choice(value: Any, context: Context) -> Any:
        if any(value == item and type(value) is type(item) for item in choices):
            return value
        allowed = ", ".join(shown(item) for item in choices)
        raise InvalidError(
            [Finding((), f"{shown(value)} is not allowed{nearest(str(value), choices)} (allowed: {allowed})")]
        )

    return choice, lambda: {"enum": list(choices)}


def plain_reader(wanted: type) -> tuple[Reader, Schema]:
    """Return the reader of a bool or a str."""
    name, schema = ("true or false", "boolean") if wanted is bool else ("a text", "string")

    def plain(value: Any, context: Context) -> Any:
        if not isinstance(value, wanted):
            raise InvalidError([Finding((), f"{shown(value)} is not {name}")])
        return value

    return plain, lambda: {"type": schema}


def read_sequence(reader: Reader, value: Any, context: Context) -> tuple[Any, ...]:
    """Return a list's items as `reader` reads them. Raises InvalidError."""
    if not isinstance(value, list):
        raise InvalidError([Finding((), f"{shown(value)} is not a list; write [...], or one '- ' a line")])
    return tuple(_each(enumerate(value), reader, context).values())


def read_mapping(reader: Reader, value: Any, context: Context) -> dict[str, Any]:
    """Return a mapping with its values as `reader` reads them. Raises InvalidError."""
    if not isinstance(value, dict):
        raise InvalidError([Finding((), f"{shown(value)} is not a mapping of names to values")])
    return _each(value.items(), reader, context)


def _each(items: Any, reader: Reader, context: Context) -> dict[Any, Any]:
    """Return what `reader` makes of each item; all that is wrong with any of them is raised together."""
    result, findings = {}, []
    for key, item in items:
        try:
            result[key] = reader(item, context)
        except InvalidError as error:
            findings += [finding._replace(path=(key, *finding.path)) for finding in error.findings]
    if findings:
        raise InvalidError(findings)
    return result
