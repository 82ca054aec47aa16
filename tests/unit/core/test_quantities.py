from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hilrig.core.quantities import quantity

numbers = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e12, max_value=1e12)

CONVERSIONS = [
    ("1 ms", "s", 1e-3),
    ("2 min", "s", 120.0),
    ("180 N/m", "N/m", 180.0),
    ("20 N*s/m", "N*s/m", 20.0),
    ("20 N s/m", "N*s/m", 20.0),
    ("3 g", "kg", 3e-3),
    ("5 mm", "m", 5e-3),
    ("1 nm", "m", 1e-9),
    ("1 µm", "m", 1e-6),
    ("1 um", "m", 1e-6),
    ("1 cm", "m", 1e-2),
    ("1 MN", "N", 1e6),
    ("1 GN", "N", 1e9),
    ("90 deg", "rad", math.pi / 2),
    ("1 turn", "rad", 2 * math.pi),
    ("1 Hz", "rad/s", 2 * math.pi),
    ("2 kHz", "Hz", 2000.0),
    ("1 rad/s", "Hz", 1 / (2 * math.pi)),
    ("60 rpm", "Hz", 1.0),
    ("5 %", "", 0.05),
    ("2 1/s^2", "1/s^2", 2.0),
    ("1 kN*m", "N m", 1000.0),
    ("1 J", "N*m", 1.0),
    ("1 W", "N*m/s", 1.0),
    ("-2.5e-3 m", "m", -2.5e-3),
    ("4", "kg", 4.0),
]


@pytest.mark.parametrize(("text", "unit", "value"), CONVERSIONS)
def test_conversion(text: str, unit: str, value: float) -> None:
    assert quantity(text, unit) == pytest.approx(value, rel=1e-14)


WRONG = [
    ("3 kg", "s", "'3 kg' is a mass [kg]; this needs a time, e.g. '1 ms'"),
    ("1 rad", "", "'1 rad' is an angle [rad]; this needs a pure number"),
    ("15 N*m", "N*m/rad", "a torque or energy"),
    ("1 1/s", "rad/s", "an angular speed"),
    ("3 foo", "m", "'foo' is not a unit"),
    ("m", "m", "'m' is not a quantity"),
    ("", "m", "'' is not a quantity"),
    ("1 m 2", "m", "not a unit"),
    ("1 m^99", "m", "not a unit"),
    ("1 m**m", "m", "not a unit"),
    ("1 __import__('os')", "m", "not a unit"),
    ("1e999 m", "m", "not a finite number"),
    ("nan", "m", "'nan' is not a quantity"),
    (float("nan"), "m", "not a finite number"),
    (float("inf"), "m", "not a finite number"),
    (True, "m", "true is not a quantity"),
    (None, "m", "nothing is not a quantity"),
    ([1.0], "m", "a list of 1 is not a quantity"),
    ({}, "m", "a mapping is not a quantity"),
]


@pytest.mark.parametrize(("value", "unit", "words"), WRONG)
def test_what_is_no_quantity_is_refused_in_one_line(value: object, unit: str, words: str) -> None:
    with pytest.raises(ValueError, match=r"needs|not a unit") as caught:
        quantity(value, unit)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@given(numbers)
def test_a_bare_number_is_taken_as_it_is(value: float) -> None:
    assert quantity(value, "N/m") == value
    assert quantity(repr(value), "N/m") == value


@given(numbers)
def test_a_number_in_the_wanted_unit_is_exact(value: float) -> None:
    assert quantity(f"{value!r} N*s/m", "N*s/m") == value


@given(st.text(max_size=30))
def test_any_text_is_a_finite_number_or_a_value_error(text: str) -> None:
    try:
        value = quantity(text, "m")
    except ValueError:
        return
    assert math.isfinite(value)
