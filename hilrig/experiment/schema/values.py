"""Numeric parameter values: one or several, with unit and bounds."""

from __future__ import annotations

import dataclasses
import math
import types
from typing import Any, NamedTuple, Union, get_args, get_origin

from hilrig.core.parameters import Parameter
from hilrig.core.quantities import described, quantity, shown

LARGEST = 2**63 - 1
"""Largest whole number: compiled code and ROS 2 messages use 64 bits"""


class NumericForm(NamedTuple):
    """How many numbers a parameter takes, and of which type."""

    single: bool
    """A single number is accepted"""
    several: bool
    """A list is accepted"""
    length: int | None
    """Length of the list; None for any"""
    whole: bool
    """Whole numbers only"""
    optional: bool
    """`null` is accepted"""


def numeric_form(annotation: Any) -> NumericForm | None:
    """Return the form of int, float, tuples of them, and unions of these with None; None for others."""
    if annotation in (int, float):
        return NumericForm(True, False, None, annotation is int, False)
    if annotation is types.NoneType:
        return NumericForm(False, False, None, False, True)
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is tuple and set(arguments) <= {int, float, Ellipsis}:
        length = None if Ellipsis in arguments else len(arguments)
        return NumericForm(False, True, length, int in arguments, False)
    if origin in (Union, types.UnionType):
        forms = [numeric_form(argument) for argument in arguments]
        found = [form for form in forms if form is not None]
        if len(found) == len(forms) and any(form.single or form.several for form in found):
            return _either(found)
    return None


def _either(forms: list[NumericForm]) -> NumericForm:
    return NumericForm(
        any(form.single for form in forms),
        any(form.several for form in forms),
        next((form.length for form in forms if form.several), None),
        any(form.whole for form in forms),
        any(form.optional for form in forms),
    )


def read_number(value: Any, form: NumericForm, parameter: Parameter) -> Any:
    """Return `value` as a float, int, tuple or None.

    Raises ValueError, naming the value and what is allowed.
    """
    if value is None and form.optional:
        return None
    if isinstance(value, list):
        if not form.several:
            raise ValueError(f"{shown(value)} is not one value; this needs {_described(form, parameter)}")
        if form.length not in (None, len(value)):
            raise ValueError(f"{shown(value)} is not allowed; this needs a list of {form.length}")
        if not value:
            raise ValueError("the list is empty")
        return tuple(_one(item, form, parameter) for item in value)
    if not form.single:
        count = "" if form.length is None else f"{form.length} "
        raise ValueError(f"{shown(value)} is one value; this needs a list of {count}such as [..., ...]")
    return _one(value, form, parameter)


def _one(value: Any, form: NumericForm, parameter: Parameter) -> float | int:
    if form.whole:
        if isinstance(value, bool) or not isinstance(value, int):
            raise ValueError(f"{shown(value)} is not a whole number; this needs {_described(form, parameter)}")
        number: float | int = value
        low, high = max(parameter.low, -LARGEST), min(parameter.high, LARGEST)
    else:
        number, low, high = quantity(value, parameter.unit), parameter.low, parameter.high
    for bound in (low, high):
        # "135 deg" differs by one rounding from a bound that was computed as 3 / 4 * pi.
        if isinstance(number, float) and math.isclose(number, bound, rel_tol=1e-15):
            number = float(bound)
    if not low <= number <= high:
        allowed = dataclasses.replace(parameter, low=low, high=high)
        raise ValueError(f"{shown(value)} is not allowed; this needs {_described(form, allowed)}")
    return number


def _described(form: NumericForm, parameter: Parameter) -> str:
    what = "a whole number" if form.whole else described(parameter.unit)
    bounds = bounds_text(parameter)
    return f"{what} ({bounds})" if bounds else what


def bounds_text(parameter: Parameter) -> str:
    """Return the bounds in words, such as "from 0 to 10 m"; empty if there are none."""
    unit = f" {parameter.unit}" if parameter.unit else ""
    low, high = parameter.low, parameter.high
    if abs(low) < float("inf") and abs(high) < float("inf"):
        return f"from {low:g} to {high:g}{unit}"
    if abs(low) < float("inf"):
        return f"{low:g}{unit} or more"
    return f"{high:g}{unit} or less" if abs(high) < float("inf") else ""


def number_schema(form: NumericForm, parameter: Parameter) -> dict[str, Any]:
    """Return the JSON Schema of the values that `read_number` takes."""
    number: dict[str, Any] = {"type": "integer" if form.whole else "number"}
    if parameter.low > -float("inf"):
        number["minimum"] = parameter.low
    if parameter.high < float("inf"):
        number["maximum"] = parameter.high
    text = {
        "type": "string",
        "description": f"a number with its unit; {described(parameter.unit.split('|')[0])}",
    }
    one = number if form.whole else {"anyOf": [number, text]}
    several: dict[str, Any] = {"type": "array", "items": one, "minItems": form.length or 1}
    if form.length is not None:
        several["maxItems"] = form.length
    choices = [one] * form.single + [several] * form.several + [{"type": "null"}] * form.optional
    return choices[0] if len(choices) == 1 else {"anyOf": choices}
