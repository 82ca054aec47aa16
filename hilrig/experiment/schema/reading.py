"""Data in, dataclasses out: the frozen dataclasses with annotated parameters become pydantic models.

Kinds and the parts of an experiment are plain dataclasses and know nothing of pydantic. Here each becomes a
model that forbids other keys, takes quantities with units, and keeps the bounds of its parameters.
"""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Mapping
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, PlainValidator, ValidationError, create_model
from pydantic_core import PydanticCustomError

from hilrig.core.errors import Place, PluginError, nearest
from hilrig.core.parameters import Parameter
from hilrig.core.quantities import shown
from hilrig.core.text import NotUtf8Error, decoded
from hilrig.experiment.document import Keys
from hilrig.experiment.schema.fields import bare, meaning, names, settable
from hilrig.experiment.schema.leaves import (
    Reader,
    Schema,
    choice_reader,
    number_reader,
    plain_reader,
    read_mapping,
    read_sequence,
)
from hilrig.experiment.schema.terms import ONLY_AXIS, ByAxis, Context, Finding, InvalidError, Later
from hilrig.experiment.schema.values import numeric_form
from hilrig.kinds import registry as plugins

MAX_TABLE_BYTES = 64 << 20


def read(cls: type, data: Any, context: Context) -> Any:
    """Return an instance of the dataclass `cls` made from `data`. Raises InvalidError."""
    if not isinstance(data, dict):
        raise InvalidError(
            [Finding((), f"{shown(data)} is not a mapping; this needs one with {', '.join(names(cls))}")]
        )
    model = model_of(cls)
    try:
        values = model.model_validate(data, context={"hilrig": context})
    except ValidationError as error:
        raise InvalidError(_findings(error, cls)) from error
    try:
        return cls(**{name: getattr(values, name) for name in values.model_fields_set})
    except ValueError as error:
        raise InvalidError([Finding((), str(error))]) from error


def _kind(group: str, allowed: type | None, data: Any, context: Context) -> Any:
    """Return the kind of `group` that `data`, a mapping with `kind` and parameters, describes.

    Raises InvalidError.
    """
    known = plugins.kinds(group)
    if not isinstance(data, dict) or "kind" not in data:
        found = "'kind' is missing" if isinstance(data, dict) else f"{shown(data)} is not a mapping with 'kind'"
        raise InvalidError([Finding((), f"{found}; kinds of {group}: {', '.join(known)}")])
    kind = data["kind"]
    if not isinstance(kind, str):
        raise InvalidError([Finding(("kind",), f"{shown(kind)} is not a kind of {group} (known: {', '.join(known)})")])
    try:
        cls = plugins.load(group, kind, context.base)
    except PluginError as error:
        raise InvalidError([Finding(("kind",), str(error))]) from error
    if allowed is not None and not issubclass(cls, allowed):
        raise InvalidError(
            [Finding(("kind",), f"{kind!r} does not do here; this needs '{plugins.name_of(allowed)[1]}'")]
        )
    try:
        made = read(cls, {key: item for key, item in data.items() if key != "kind"}, context)
    except PluginError as error:  # a field of a type that no file can give
        raise InvalidError([Finding(("kind",), f"{kind}: {error}")]) from error
    return _filled(made, context.base) if hasattr(cls, "reads") else made


def _filled(kind: Any, base: Path) -> Any:
    """Return a kind that takes its data from a file, with these data."""
    field = type(kind).reads
    path = base / getattr(kind, field)
    try:
        if path.stat().st_size > MAX_TABLE_BYTES:
            raise ValueError(f"{path} is larger than {MAX_TABLE_BYTES >> 20} MiB")
        return kind.filled(decoded(path.read_bytes()))
    except OSError as error:
        raise InvalidError([Finding((field,), f"{path} cannot be read: {error.strerror}")]) from error
    except NotUtf8Error as error:
        raise InvalidError([Finding((field,), f"{Place(str(path), error.line, error.column)}: {error}")]) from error
    except ValueError as error:
        raise InvalidError([Finding((field,), str(error))]) from error


@cache
def model_of(cls: type) -> type[BaseModel]:
    """Return the pydantic model of a dataclass."""
    fields: dict[str, Any] = {}
    for field, annotation, parameter in settable(cls):
        required = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
        note = Field(... if required else None, description=parameter.meaning or None)
        fields[field.name] = (_type(annotation, parameter), note)
    config = ConfigDict(extra="forbid", strict=True, frozen=True, protected_namespaces=())
    return create_model(cls.__name__, __config__=config, **fields)


@dataclasses.dataclass(frozen=True)
class _JsonSchema:
    """Tells pydantic the JSON Schema of a field that it cannot know."""

    make: Schema

    def __get_pydantic_json_schema__(self, core_schema: Any, handler: Any) -> dict[str, Any]:
        return self.make()


def _type(annotation: Any, parameter: Parameter) -> Any:
    """Return the pydantic type that reads a field so annotated."""
    reader, schema = _reader(annotation, parameter)

    def validate(value: Any, info: Any) -> Any:
        try:
            return reader(value, info.context["hilrig"])
        except InvalidError as error:
            raise PydanticCustomError("findings", "see findings", {"findings": error.findings}) from error

    return Annotated[Any, PlainValidator(validate), _JsonSchema(schema)]


def _reader(annotation: Any, parameter: Parameter) -> tuple[Reader, Schema]:
    """Return what reads a value of this annotation, and what makes its JSON Schema."""
    notes = getattr(annotation, "__metadata__", ())
    if any(isinstance(note, ByAxis) for note in notes):
        return _by_axis(next(note for note in notes if isinstance(note, ByAxis)))
    inner = bare(annotation)
    if inner == Later:
        return lambda value, context: value, lambda: {"type": ["number", "string"]}
    form = numeric_form(inner)
    if form is not None:
        return number_reader(form, parameter)
    if get_origin(inner) in (Union, types.UnionType):
        return _optional(inner, parameter)
    if get_origin(inner) is Literal:
        return choice_reader(get_args(inner))
    return plain_reader(inner) if inner in (bool, str) else _structure(inner, parameter)


def _structure(annotation: Any, parameter: Parameter) -> tuple[Reader, Schema]:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is tuple:
        inner, schema = _reader(arguments[0], parameter)
        return partial(read_sequence, inner), lambda: {"type": "array", "items": schema()}
    if isinstance(origin, type) and issubclass(origin, Mapping):
        inner, schema = _reader(arguments[1], parameter)
        return partial(read_mapping, inner), lambda: {"type": "object", "additionalProperties": schema()}
    group = plugins.group_of(annotation)
    if group is not None:
        allowed = None if annotation is plugins.PROTOCOLS[group] else annotation
        return partial(_kind, group, allowed), lambda: kinds_schema(group, allowed)
    if dataclasses.is_dataclass(annotation) and isinstance(annotation, type):
        return partial(read, annotation), lambda: model_of(annotation).model_json_schema()
    raise PluginError(f"a parameter cannot be of the type {annotation}")


def kinds_schema(group: str, allowed: type | None = None) -> dict[str, Any]:
    """Return the JSON Schema of a mapping with `kind`: one choice for each kind that can be loaded."""
    choices: list[dict[str, Any]] = []
    for kind in plugins.kinds(group):
        try:
            cls = plugins.load(group, kind)
        except PluginError:  # an optional package is missing; its kinds cannot be used either
            continue
        if allowed is None or issubclass(cls, allowed):
            choices.append(_kind_schema({"const": kind}, cls))
    by_path = {
        "type": "object",
        "required": ["kind"],
        "properties": {"kind": {"type": "string", "pattern": r"\.py$"}},
    }
    return {"oneOf": [*choices, by_path] if allowed is None else choices}


def _kind_schema(kind: dict[str, Any], cls: type) -> dict[str, Any]:
    schema = model_of(cls).model_json_schema()
    return {
        **schema,
        "description": (cls.__doc__ or "").strip(),
        "properties": {"kind": kind, **schema.get("properties", {})},
        "required": ["kind", *schema.get("required", [])],
    }


def _optional(annotation: Any, parameter: Parameter) -> tuple[Reader, Schema]:
    (inner,) = [choice for choice in get_args(annotation) if choice is not types.NoneType]
    reader, schema = _reader(inner, parameter)
    return (
        lambda value, context: None if value is None else reader(value, context),
        lambda: {"anyOf": [schema(), {"type": "null"}]},
    )


def _by_axis(mark: ByAxis) -> tuple[Reader, Schema]:
    def by_axis(value: Any, context: Context) -> dict[str, Any]:
        reference = partial(_kind, "references", None)
        if isinstance(value, dict) and "kind" not in value:
            return read_mapping(reference, value, context._replace(unit=mark.unit))
        return {ONLY_AXIS: reference(value, context._replace(unit=mark.unit))}

    def schema() -> dict[str, Any]:
        one = kinds_schema("references")
        return {"anyOf": [one, {"type": "object", "additionalProperties": one}]}

    return by_axis, schema


def _findings(error: ValidationError, cls: type) -> list[Finding]:
    """Return what a model found wrong, in the words of this project."""
    allowed_names = names(cls)
    result: list[Finding] = []
    for item in error.errors():
        path: Keys = item["loc"]
        if item["type"] == "findings":
            result += [found._replace(path=(*path, *found.path)) for found in item.get("ctx", {})["findings"]]
        elif item["type"] == "extra_forbidden":
            key = str(path[-1])
            allowed = f" (allowed: {', '.join(allowed_names)})" if allowed_names else " (there are none)"
            result.append(Finding(path, f"unknown key '{key}'{nearest(key, allowed_names)}{allowed}", on_key=True))
        elif item["type"] == "missing":
            result.append(Finding(path[:-1], f"'{path[-1]}' is missing{meaning(cls, str(path[-1]))}"))
        else:
            result.append(Finding(path, item["msg"]))
    return result
