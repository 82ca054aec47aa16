"""Turns data into dataclasses, by the annotations of their fields.

Kinds and the parts of an experiment are plain frozen dataclasses. A mapping in the file has no keys other than their
fields, quantities may have units, and every value must be within the bounds of its `Parameter`.
"""

from __future__ import annotations

import dataclasses
import types
import unicodedata
from collections.abc import Mapping
from functools import cache, partial
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin

from hilrig.core.errors import Place, PluginError, nearest
from hilrig.core.parameters import Parameter
from hilrig.core.quantities import shortened, shown
from hilrig.core.text import NotUtf8Error, decoded
from hilrig.experiment.schema.fields import bare, is_required, made, settable
from hilrig.experiment.schema.leaves import (
    choice_reader,
    fixed_list_reader,
    list_reader,
    mapping_reader,
    number_reader,
    optional_reader,
    plain_reader,
)
from hilrig.experiment.schema.terms import (
    ONLY_AXIS,
    ByAxis,
    Context,
    InvalidError,
    Later,
    Reader,
    SchemaFinding,
    invalid,
)
from hilrig.experiment.schema.values import numeric_form
from hilrig.kinds import registry as plugins
from hilrig.kinds.user_files import code_of, place_of, read_bytes

PARAMETER_TYPES = "float, int, bool, str, Literal, these or None, tuple, Mapping, a frozen dataclass, or a kind"
"""Annotations that a parameter may have"""


def read_record(cls: type, data: Any, context: Context) -> Any:
    """Return an instance of the dataclass `cls` made from `data`. Raises InvalidError with all problems."""
    readers = readers_of(cls)
    if not isinstance(data, dict):
        raise invalid(f"{shown(data)} is not a mapping; this needs one with {', '.join(readers)}")
    values: dict[str, Any] = {}
    findings: list[SchemaFinding] = []
    given: set[str] = set()
    for key, item in data.items():
        name = unicodedata.normalize("NFKC", key)  # as Python does with the names of fields
        try:
            if name not in readers or name in given:
                findings.append(SchemaFinding((key,), _refused_key(key, tuple(readers)), on_key=True))
            else:
                values[name] = readers[name].read(item, context)
        except InvalidError as error:
            findings += error.below(key)
        given.add(name)
    for field, _, parameter in settable(cls):
        if is_required(field) and field.name not in given:
            meaning = f" ({parameter.meaning})" if parameter.meaning else ""
            findings.append(SchemaFinding((), f"'{field.name}' is missing{meaning}"))
    if findings:
        raise InvalidError(findings)
    try:
        return made(cls, values)
    except PluginError as error:
        raise invalid(str(error)) from error


def _refused_key(key: str, known: tuple[str, ...]) -> str:
    if unicodedata.normalize("NFKC", key) in known:
        return f"the key '{key}' appears twice, in two spellings"
    return f"unknown key '{key}'{nearest(key, known)}" + (f" (allowed: {', '.join(known)})" if known else "")


@cache
def readers_of(cls: type) -> dict[str, Reader]:
    """Return the reader of each field of a dataclass. Raises PluginError for a type that cannot come from a file."""
    found: dict[str, Reader] = {}
    for field, annotation, parameter in settable(cls):
        try:
            found[field.name] = _reader(annotation, parameter)
        except TypeError as error:
            message = f"the type of parameter '{field.name}' cannot come from a file: {error}; use {PARAMETER_TYPES}"
            raise PluginError(f"{place_of(cls, field.name)}: {message}") from error
    return found


def _reader(annotation: Any, parameter: Parameter) -> Reader:
    """Return the reader for a value with this annotation. Raises TypeError for a type that cannot come from a file."""
    by_axis = next((note for note in getattr(annotation, "__metadata__", ()) if isinstance(note, ByAxis)), None)
    if by_axis is not None:
        return _by_axis_reader(by_axis.unit)
    inner = bare(annotation)
    if inner == Later:
        return Reader(lambda value, context: value, lambda: {"type": ["number", "string"]})
    form = numeric_form(inner)
    if form is not None:
        return number_reader(form, parameter)
    if get_origin(inner) in (Union, types.UnionType):
        choices = [choice for choice in get_args(inner) if choice is not types.NoneType]
        if len(choices) == 1:
            return optional_reader(_reader(choices[0], parameter))
    if get_origin(inner) is Literal:
        return choice_reader(get_args(inner))
    return plain_reader(inner) if inner in (bool, str) else _structure_reader(inner, parameter)


def _structure_reader(annotation: Any, parameter: Parameter) -> Reader:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is tuple and len(arguments) == 2 and arguments[1] is Ellipsis:
        return list_reader(_reader(arguments[0], parameter))
    if origin is tuple and arguments:
        return fixed_list_reader(tuple(_reader(item, parameter) for item in arguments))
    if isinstance(origin, type) and issubclass(origin, Mapping) and arguments[0] is str:
        return mapping_reader(_reader(arguments[1], parameter))
    group = plugins.group_of(annotation)
    if group is not None:
        allowed = None if annotation is plugins.PROTOCOLS[group] else annotation
        return Reader(partial(_read_kind, group, allowed), partial(_kinds_schema, group, allowed))
    if dataclasses.is_dataclass(annotation) and isinstance(annotation, type):
        return Reader(partial(read_record, annotation), partial(record_schema, annotation))
    raise TypeError(getattr(annotation, "__name__", annotation))


def _by_axis_reader(unit: str) -> Reader:
    one = Reader(partial(_read_kind, "references", None), partial(_kinds_schema, "references", None))
    each = mapping_reader(one)

    def by_axis(value: Any, context: Context) -> dict[str, Any]:
        context = context._replace(unit=unit)
        if isinstance(value, dict) and "kind" not in value:
            return each.read(value, context)
        return {ONLY_AXIS: one.read(value, context)}

    return Reader(by_axis, lambda: {"anyOf": [one.schema(), each.schema()]})


def _read_kind(group: str, allowed: type | None, data: Any, context: Context) -> Any:
    """Return the kind of `group` that `data`, a mapping with `kind` and parameters, describes. Raises InvalidError."""
    known = ", ".join(plugins.kind_names(group))
    if not isinstance(data, dict) or "kind" not in data:
        such = f", such as {{kind: {shortened(data)}}}" if isinstance(data, str) else ""
        found = "'kind' is missing" if isinstance(data, dict) else f"{shown(data)} is not a mapping with 'kind'{such}"
        raise invalid(f"{found}; kinds of {group}: {known}")
    kind = data["kind"]
    if not isinstance(kind, str):
        raise invalid(f"{shown(kind)} is not a kind of {group} (known: {known})", "kind")
    try:
        cls = plugins.load_kind(group, kind, context.base)
        if allowed is not None and not issubclass(cls, allowed):
            raise PluginError(f"'{kind}' cannot be used here; this needs '{plugins.name_of(allowed)[1]}'")
        result = read_record(cls, {key: item for key, item in data.items() if key != "kind"}, context)
        _check_record(group, result)
    except PluginError as error:
        raise invalid(str(error), "kind") from error
    return _filled(result, context.base) if hasattr(cls, "reads") else result


def _check_record(group: str, kind: Any) -> None:
    """Raise PluginError unless the processes of a trial, which read the kind from a file, get the same kind."""
    cls = type(kind)
    for field in dataclasses.fields(kind):
        try:
            plugins.dump(getattr(kind, field.name), field.name)
        except PluginError as error:
            raise PluginError(f"{place_of(cls, field.name)}: {error}") from error
    document = plugins.dump(kind)
    again = plugins.dump(plugins.restore(group, document))
    for name, value in document.items():
        if again[name] != value:
            before, after = shortened(repr(value)), shortened(repr(again[name]))
            message = f"the parameter '{name}' is {before} here but would be {after} in the processes of a trial"
            raise PluginError(f"{place_of(cls, name)}: {message}; __post_init__ must not change a value twice")


def _filled(kind: Any, base: Path) -> Any:
    """Return a kind that takes its data from a file, with these data filled in."""
    field = type(kind).reads
    try:
        with code_of(kind):
            text = _text(base / getattr(kind, field))
            return kind.filled(text)
    except PluginError as error:
        raise invalid(str(error), field) from error


def _text(path: Path) -> str:
    try:
        return decoded(read_bytes(path))
    except NotUtf8Error as error:
        raise PluginError(f"{Place(str(path), error.line, error.column)}: {error}") from error


def record_schema(cls: type) -> dict[str, Any]:
    """Return the JSON Schema of the mappings that `read_record` turns into a `cls`."""
    readers, properties, required = readers_of(cls), {}, []
    for field, _, parameter in settable(cls):
        described = {"description": parameter.meaning} if parameter.meaning else {}
        properties[field.name] = {**readers[field.name].schema(), **described}
        required += [field.name] if is_required(field) else []
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": False}


def _kinds_schema(group: str, allowed: type | None) -> dict[str, Any]:
    """Return the JSON Schema of a mapping with `kind`: one choice for each kind that can be loaded."""
    choices: list[dict[str, Any]] = []
    classes, _ = plugins.load_kinds(group)  # a kind that cannot be loaded cannot be used either
    for kind, cls in classes.items():
        if allowed is None or issubclass(cls, allowed):
            choices.append(_kind_schema({"const": kind}, record_schema(cls), cls.__doc__ or ""))
    anything = {"type": "object", "properties": {}, "required": []}
    choices.append(_kind_schema({"type": "string", "pattern": r"(\.py$)|/"}, anything, "A file of your own."))
    return {"oneOf": choices}


def _kind_schema(kind: dict[str, Any], record: dict[str, Any], text: str) -> dict[str, Any]:
    properties, required = {"kind": kind, **record["properties"]}, ["kind", *record["required"]]
    return {**record, "description": text.strip(), "properties": properties, "required": required}
