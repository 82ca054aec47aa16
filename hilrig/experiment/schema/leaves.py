"""Readers of single values, lists and mappings."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

from hilrig.core.errors import nearest
from hilrig.core.parameters import Parameter
from hilrig.core.quantities import shown
from hilrig.experiment.schema.terms import Context, InvalidError, Reader, SchemaFinding, invalid
from hilrig.experiment.schema.values import NumericForm, number_schema, read_number


def number_reader(form: NumericForm, parameter: Parameter) -> Reader:
    """Return the reader for numbers of this form, with unit and bounds."""

    def number(value: Any, context: Context) -> Any:
        unit = (context.unit or "m") if parameter.unit == "m|N" else parameter.unit
        try:
            return read_number(value, form, dataclasses.replace(parameter, unit=unit))
        except ValueError as error:
            raise invalid(str(error)) from error

    return Reader(number, lambda: number_schema(form, parameter))


def choice_reader(choices: tuple[Any, ...]) -> Reader:
    """Return the reader for one of several values."""

    def choice(value: Any, context: Context) -> Any:
        if any(value == item and type(value) is type(item) for item in choices):
            return value
        allowed = ", ".join(shown(item) for item in choices)
        raise invalid(f"{shown(value)} is not allowed{nearest(str(value), choices)} (allowed: {allowed})")

    return Reader(choice, lambda: {"enum": list(choices)})


def plain_reader(wanted: type) -> Reader:
    """Return the reader for a bool or a str."""
    name, schema = ("true or false", "boolean") if wanted is bool else ("text; put it in quotes", "string")

    def plain(value: Any, context: Context) -> Any:
        if not isinstance(value, wanted):
            raise invalid(f"{shown(value)} is not {name}")
        return value

    return Reader(plain, lambda: {"type": schema})


def list_reader(inner: Reader) -> Reader:
    """Return the reader for a list of any length."""
    return Reader(
        lambda value, context: tuple(_each(enumerate(_list(value)), inner.read, context).values()),
        lambda: {"type": "array", "items": inner.schema()},
    )


def fixed_list_reader(inner: tuple[Reader, ...]) -> Reader:
    """Return the reader for a list with one item for each of these readers."""

    def items(value: Any, context: Context) -> tuple[Any, ...]:
        if len(_list(value)) != len(inner):
            raise invalid(f"{shown(value)} is not allowed; this needs a list of {len(inner)}")
        pairs = enumerate(zip(inner, value, strict=True))
        return tuple(_each(pairs, lambda pair, context: pair[0].read(pair[1], context), context).values())

    def schema() -> dict[str, Any]:
        first = [one.schema() for one in inner]
        return {"type": "array", "prefixItems": first, "items": False, "minItems": len(first)}

    return Reader(items, schema)


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise invalid(f"{shown(value)} is not a list; write [...], or one '- ' per line")
    return value


def mapping_reader(inner: Reader) -> Reader:
    """Return the reader for a mapping from names to values."""

    def mapping(value: Any, context: Context) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise invalid(f"{shown(value)} is not a mapping of names to values")
        return _each(value.items(), inner.read, context)

    return Reader(mapping, lambda: {"type": "object", "additionalProperties": inner.schema()})


def optional_reader(inner: Reader) -> Reader:
    """Return the reader for what `inner` reads, or null."""
    return Reader(
        lambda value, context: None if value is None else inner.read(value, context),
        lambda: {"anyOf": [inner.schema(), {"type": "null"}]},
    )


def _each(items: Any, read: Callable[[Any, Context], Any], context: Context) -> dict[Any, Any]:
    """Return what `read` returns for each item; the problems of all items are raised together."""
    result: dict[Any, Any] = {}
    findings: list[SchemaFinding] = []
    for key, item in items:
        try:
            result[key] = read(item, context)
        except InvalidError as error:
            findings += error.below(key)
    if findings:
        raise InvalidError(findings)
    return result
