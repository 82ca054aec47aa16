"""The fields of a dataclass that a file may set, and the object made from them."""

from __future__ import annotations

import dataclasses
import sys
import types
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from hilrig.core.errors import PluginError, raised
from hilrig.core.parameters import Parameter, plain
from hilrig.kinds.user_files import code_of, place_of


def settable(cls: type) -> list[tuple[dataclasses.Field[Any], Any, Parameter]]:
    """Return (field, its annotation, its parameter) for every field of `cls` that a file may set.

    Raises PluginError, naming the line, if an annotation cannot be evaluated.
    """
    try:
        hints = get_type_hints(cls, include_extras=True)
    except Exception as error:
        raise PluginError(_which_annotation(cls, error)) from error
    result = []
    for field in dataclasses.fields(cls):
        if field.init and not field.metadata.get("filled"):
            hint = hints[field.name]
            result.append((field, hint, _parameter(hint) or Parameter("")))
    return result


def _parameter(hint: Any) -> Parameter | None:
    """Return the `Parameter` of an annotation; of a union or a tuple without one, that of its members."""
    own = next((note for note in getattr(hint, "__metadata__", ()) if isinstance(note, Parameter)), None)
    if own is not None or get_origin(bare(hint)) not in (Union, types.UnionType, tuple):
        return own
    return next(filter(None, map(_parameter, get_args(bare(hint)))), None)


def _which_annotation(cls: type, error: Exception) -> str:
    for field in dataclasses.fields(cls):
        try:
            if isinstance(field.type, str):
                eval(field.type, dict(vars(sys.modules[cls.__module__])))
        except Exception as found:
            return f"{place_of(cls, field.name)}: the annotation of '{field.name}' cannot be evaluated: {raised(found)}"
    return f"{place_of(cls)}: an annotation of {cls.__name__} cannot be evaluated: {raised(error)}"


def made(cls: type, values: dict[str, Any]) -> Any:
    """Return a `cls` with these values and defaults for the rest, both in built-in types. Raises PluginError."""
    with code_of(cls):
        absent = [field for field in dataclasses.fields(cls) if field.init and field.name not in values]
        return cls(**values, **{field.name: default(field) for field in absent if not is_required(field)})


def default(field: dataclasses.Field[Any]) -> Any:
    """Return the default of a field that has one."""
    if field.default_factory is dataclasses.MISSING:
        return plain(field.default)
    return plain(field.default_factory())


def is_required(field: dataclasses.Field[Any]) -> bool:
    """Return whether a field has no default."""
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def bare(annotation: Any) -> Any:
    """Return an annotation without its Annotated metadata."""
    return get_args(annotation)[0] if get_origin(annotation) is Annotated else annotation
