"""The fields of a dataclass that a file may set."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from hilrig.core.errors import PluginError
from hilrig.core.parameters import Parameter


def settable(cls: type) -> list[tuple[dataclasses.Field[Any], Any, Parameter]]:
    """Return (field, its annotation, its parameter) for every field of `cls` that a file may set.

    Raises PluginError.
    """
    try:
        hints = get_type_hints(cls, include_extras=True)
    except NameError as error:
        raise PluginError(f"a field of {cls.__name__} has an annotation that is not defined: {error}") from error
    result = []
    for field in dataclasses.fields(cls):
        if not field.metadata.get("filled"):
            hint = hints[field.name]
            notes = getattr(hint, "__metadata__", ())
            parameter = next((note for note in notes if isinstance(note, Parameter)), Parameter(""))
            result.append((field, hint, parameter))
    return result


def names(cls: type) -> list[str]:
    """Return the names of the fields that a file may set."""
    return [field.name for field, _, _ in settable(cls)]


def bare(annotation: Any) -> Any:
    """Return an annotation without its notes."""
    return get_args(annotation)[0] if get_origin(annotation) is Annotated else annotation


def meaning(cls: type, name: str) -> str:
    """Return what a field means, in brackets; empty if that is not written."""
    text = next(parameter.meaning for field, _, parameter in settable(cls) if field.name == name)
    return f" ({text})" if text else ""
