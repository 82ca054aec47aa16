"""Rules for kinds of every group: parameters that people, files and plans can handle."""

from __future__ import annotations

import dataclasses
import inspect
import json
from pathlib import Path
from typing import Any

import numpy as np

from hilrig.core.errors import PluginError
from hilrig.core.quantities import quantity
from hilrig.experiment.schema import Context, InvalidError, describe_kind, read_record
from hilrig.kinds.registry import dump, name_of, restore
from hilrig.testing.rule import GROUPS, Broken, require, rule
from hilrig.testing.subject import Subject, parameters


@rule(*GROUPS, whole=True)
def says_what_it_is(subject: Subject) -> None:
    """The file and the class must have a docstring.

    `hilrig kinds` lists the first line of the file's docstring, and shows the class's, with the equation, for one kind.
    """
    module, cls = inspect.getmodule(subject.cls), subject.cls
    require(inspect.getdoc(module), "the file has none")
    written = cls.__doc__ or ""
    require(written and not written.startswith(f"{cls.__name__}("), f"the class {cls.__name__} has none")


@rule(*GROUPS, whole=True)
def parameters_have_a_unit_a_meaning_and_bounds(subject: Subject) -> None:
    """Every number among the parameters must state its unit, meaning and bounds in a Parameter."""
    for name, (_, parameter) in parameters(subject.cls).items():
        values = [value for variant in subject.variants for value in _numbers(getattr(variant, name))]
        if not values:
            continue  # words, yes or no, a part with its own parameters, or nothing
        if parameter is None:
            raise Broken(f"'{name}' has none: annotate it as Annotated[float, Parameter(unit, meaning, low, high)]")
        require(parameter.meaning, f"the Parameter of '{name}' has no meaning")
        require(parameter.low < parameter.high, f"the bounds of '{name}' are {parameter.low:g} and {parameter.high:g}")
        _check_unit(name, parameter.unit)
        for value in values:
            inside = parameter.low <= value <= parameter.high
            require(inside, f"'{name}' is {value:g}, outside of [{parameter.low:g}, {parameter.high:g}]")


@rule("controllers", whole=True)
def parameters_can_be_searched(subject: Subject) -> None:
    """Every number among the parameters of a controller must have two finite bounds.

    A search for good gains needs both.
    """
    for name, (_, parameter) in parameters(subject.cls).items():
        if parameter is not None and any(_numbers(getattr(variant, name)) for variant in subject.variants):
            bounds = (parameter.low, parameter.high)
            require(np.isfinite(bounds).all(), f"those of '{name}' are {bounds[0]:g} and {bounds[1]:g}")


@rule(*GROUPS, whole=True)
def parameters_can_be_shown(subject: Subject) -> None:
    """`hilrig kinds` must be able to show each parameter."""
    shown = {row.name.split(".")[0] for row in describe_kind(subject.group, subject.kind)}
    missing = set(parameters(subject.cls)) - shown
    require(not missing, f"it does not show {', '.join(sorted(missing))}")


@rule(*GROUPS)
def parameters_can_be_read_from_an_experiment(kind: Any) -> None:
    """An experiment file must be able to give each parameter."""
    names = parameters(type(kind))
    document = {name: value for name, value in dump(kind).items() if name in names}
    try:
        found = read_record(type(kind), document, Context(Path()))
    except (InvalidError, PluginError) as error:
        raise Broken(f"{document} is refused: {error}") from error
    for name in names:
        there, wanted = getattr(found, name), getattr(kind, name)
        require(there == wanted, f"'{name}' = {wanted!r} is read back as {there!r}")


@rule(*GROUPS)
def can_be_written_into_a_plan_and_read_back(kind: Any) -> None:
    """What is written into a run's plan must give an equal kind when it is read back.

    Each process of a trial creates its kinds from the plan.
    """
    again = restore(name_of(type(kind))[0], json.loads(json.dumps(dump(kind))))
    require(again == kind, f"{kind!r} came back as {again!r}")


@rule("metrics", whole=True)
def every_parameter_has_a_default(subject: Subject) -> None:
    """Every parameter of a metric must have a default.

    A report uses all installed metrics without asking for parameters.
    """
    needed = [f.name for f in dataclasses.fields(subject.cls) if f.default is f.default_factory is dataclasses.MISSING]
    require(not needed, f"{', '.join(needed)} has none")


def _numbers(value: Any) -> list[float]:
    """Return the numbers in a parameter's value."""
    parts = value if isinstance(value, tuple) else (value,)
    return [part for part in parts if isinstance(part, (int, float)) and not isinstance(part, bool)]


def _check_unit(name: str, unit: str) -> None:
    for one in unit.split("|") if unit else ():
        try:
            quantity(f"1 {one}", one)
        except ValueError as error:
            raise Broken(f"the unit of '{name}': {error}") from error
