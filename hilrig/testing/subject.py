"""A kind under test, with the instances that the rules check."""

from __future__ import annotations

import dataclasses
import inspect
import itertools
import types
import typing
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from hilrig import Parameter
from hilrig.core.errors import PluginError
from hilrig.kinds.registry import PROTOCOLS, group_of, is_path, load_kind
from hilrig.kinds.robots.planar_2r import Planar2r
from hilrig.testing.values import read_values

MOST_VARIANTS = 64
"""Maximum number of combinations of a kind's choices; further ones are not checked"""
ALL_CHOICES = ("controllers", "references", "disturbances", "metrics")
"""Groups whose kinds are tested with each choice. A robot or a plant may offer one that is wrong on purpose"""
ZEROS = ("references",)
"""Groups whose kinds are also tested with another value of each number whose default is 0"""
TABLE = "time,value\n0,0\n1,0.8\n2,0.9\n3,0.1\n4,-0.8\n"
"""File text for a reference that reads a file: five points, roughly a sine"""


@dataclasses.dataclass(frozen=True)
class Subject:
    """A kind under test."""

    group: str
    kind: str
    """Its name, or the full path of its file"""
    name: str
    """Its name in messages: "pd", or "my_controller.py\""""
    cls: type
    file: str
    """The file that defines its class"""
    variants: tuple[Any, ...]
    """Instances, one per combination of its choices; at least one"""
    given: bool
    """Whether the author gave values to test with"""

    def choice(self, variant: Any) -> str:
        """Return how a variant differs from the first, such as " with target='direct'"; empty if it does not."""
        first = self.variants[0]
        names = [f.name for f in dataclasses.fields(self.cls)]
        differing = [name for name in names if getattr(variant, name) != getattr(first, name)]
        return f" with {', '.join(f'{name}={getattr(variant, name)!r}' for name in differing)}" if differing else ""


def subject_of(group: str, kind: str, base: Path, values: Mapping[str, Any], file_text: str = TABLE) -> Subject:
    """Return a kind with its instances; `values`, as an author gives them, go to the fields of these names.

    `base` is the folder that a path starts from; `file_text` is given to a reference that reads a file. Raises
    PluginError if there is no such kind, and TypeError or ValueError if no instance can be made.
    """
    cls = load_kind(group, kind, base)
    values = read_values(cls, values, base)
    variants = (
        list(itertools.islice(_variants(cls, values, group in ZEROS), MOST_VARIANTS))
        if group in ALL_CHOICES
        else [example(cls, **values)]
    )
    if hasattr(cls, "reads"):
        variants = [variant.filled(file_text) for variant in variants]
    whole, name = (str(base / kind), Path(kind).name) if is_path(kind) else (kind, kind)
    return Subject(group, whole, name, cls, inspect.getsourcefile(cls) or "", tuple(variants), bool(values))


def example(cls: type, **values: Any) -> Any:
    """Return an instance of a dataclass; `values` go to the fields of these names.

    A field without a value and a default gets one by its type: a number is 1.5, moved into its bounds; a list of
    numbers is 0, 1, 2; a robot has two links of 1.5 m; a text is "z" if the field is named `axis`. Raises TypeError for
    any other type.
    """
    hints = _hints(cls)
    given: dict[str, Any] = {}
    for item in dataclasses.fields(cls):
        if item.name in values:
            given[item.name] = values[item.name]
        elif item.default is dataclasses.MISSING and item.default_factory is dataclasses.MISSING:
            given[item.name] = _value(item.name, hints[item.name])
    return cls(**given)


def parameter_of(hint: Any) -> Parameter | None:
    """Return the Parameter in an annotation, if there is one."""
    return next((part for part in getattr(hint, "__metadata__", ()) if isinstance(part, Parameter)), None)


def parameters(cls: type) -> dict[str, tuple[Any, Parameter | None]]:
    """Return the bare annotation and the Parameter of each field that an experiment file may set, by name."""
    hints = _hints(cls)
    fields = [field.name for field in dataclasses.fields(cls) if not field.metadata.get("filled")]
    return {name: (_bare(hints[name]), parameter_of(hints[name])) for name in fields}


def _hints(cls: type) -> dict[str, Any]:
    try:
        return typing.get_type_hints(cls, include_extras=True)
    except NameError as error:
        raise PluginError(f"a field of {cls.__name__} has an annotation that is not defined: {error}") from error


def _bare(hint: Any) -> Any:
    return hint.__origin__ if hasattr(hint, "__metadata__") else hint


def _variants(cls: type, values: Mapping[str, Any], zeros: bool) -> Iterator[Any]:
    """Yield an instance for each combination of a kind's choices; the defaults come first."""
    choices = _choices(cls, values, zeros)
    for combination in itertools.product(*choices.values()):
        chosen = dict(zip(choices, combination, strict=True))
        try:
            yield example(cls, **{**values, **chosen})
        except ValueError:
            continue  # a number that does not fit the others


def _choices(cls: type, values: Mapping[str, Any], zeros: bool) -> dict[str, tuple[Any, ...]]:
    """Return what there is to choose from for the fields that are not among `values`: the default, and what else.

    These are the fields that are a choice between words and, with `zeros`, numbers whose default is 0, which may hide
    what depends on them.
    """
    first = example(cls, **values)
    found: dict[str, tuple[Any, ...]] = {}
    for name, (hint, parameter) in parameters(cls).items():
        now = getattr(first, name)
        if name in values:
            continue
        if typing.get_origin(hint) is typing.Literal:
            found[name] = (now, *(word for word in typing.get_args(hint) if word != now))
        elif zeros and type(now) in (int, float) and now == 0:
            found[name] = (now, type(now)(_number(parameter) or _number(parameter, -1.5)))
    return found


_NAMED = {"axis": "z", "file": "table.csv", "column": "value"}
_NUMBERS = (0.0, 1.0, 2.0)
_ROBOT = Planar2r((1.5, 1.5), (1.5, 1.5))


def _value(name: str, hint: Any) -> Any:
    """Return a value for the field `name` with this annotation."""
    kind = _bare(hint)
    if typing.get_origin(kind) in (typing.Union, types.UnionType):
        kind = next(part for part in typing.get_args(kind) if part is not types.NoneType)
    number = _number(parameter_of(hint))
    of_a_robot = group_of(kind) == "robots"
    if of_a_robot and (kind is PROTOCOLS["robots"] or kind is Planar2r):
        return _ROBOT
    if typing.get_origin(kind) is typing.Literal:
        return typing.get_args(kind)[0]
    if typing.get_origin(kind) is tuple:
        parts = typing.get_args(kind)
        return _NUMBERS if parts[-1] is Ellipsis else (number,) * len(parts)
    if kind in (float, int):
        return kind(number)
    if kind is bool:
        return False
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        return example(kind)
    if name in _NAMED:
        return _NAMED[name]
    raise TypeError(f"its field '{name}' has no default and takes {hint}; give the test a value, as in {name}=...")


def _number(parameter: Parameter | None, wanted: float = 1.5) -> float:
    """Return the number that is wanted, moved into the bounds of its parameter."""
    return float(min(max(wanted, parameter.low), parameter.high)) if parameter else wanted
