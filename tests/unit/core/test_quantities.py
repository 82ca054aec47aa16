from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction

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
    # as people type and print them
    ("1 μm", "m", 1e-6),
    ("20 N·s/m", "N*s/m", 20.0),
    ("20 N⋅s/m", "N*s/m", 20.0),
    ("20 N×s/m", "N*s/m", 20.0),
    ("20 N.s/m", "N*s/m", 20.0),
    ("20 Ns/m", "N*s/m", 20.0),
    ("20\u202fN\u00a0s/m", "N*s/m", 20.0),
    ("2 Nm", "N*m", 2.0),
    ("2 kNm", "N*m", 2000.0),
    ("1 nm", "m", 1e-9),
    ("3 Nms/rad", "N*m*s/rad", 3.0),
    ("9.81 m/s²", "m/s^2", 9.81),
    ("−9.81 m·s⁻²", "m/s^2", -9.81),
    ("9.81 m/s**2", "m/s^2", 9.81),
    ("9.81 m/s ^ 2", "m/s^2", 9.81),
    ("9.81 m/s/s", "m/s^2", 9.81),
    ("2 kg m²", "kg*m^2", 2.0),
    ("90°", "rad", math.pi / 2),
    ("90 º", "rad", math.pi / 2),
    ("180 °/s", "rad/s", math.pi),
    ("5%", "", 0.05),
    ("5/s", "1/s", 5.0),
    ("5 s⁻¹", "1/s", 5.0),
    ("5 ms", "s", 5e-3),
    ("2 seconds", "s", 2.0),
    ("1e-999999999 m", "m", 0.0),
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
    ("1e400 m", "m", "'1e400 m' is not a finite number"),
    ("1e308 km", "m", "'1e308 km' is not a finite number"),
    ("1e999999999 m", "m", "not a finite number"),
    ("9" * 5000 + " m", "m", "not a finite number"),
    (10**400, "s", "a whole number of 401 digits is not a finite number; this needs a time"),
    (-(16**100_000), "s", "digits is not a finite number"),
    ("1 hz", "Hz", "'hz' is not a unit that hilrig knows; did you mean 'Hz'?"),
    ("1 KG", "kg", "did you mean 'kg'?"),
    ("1 °C", "rad", "'°C' is not a unit"),
    ("1,5 N", "N", "decimals take a point, not a comma"),
    ("1 m²²", "m", "not a unit"),
]


@pytest.mark.parametrize(("value", "unit", "words"), WRONG, ids=range(len(WRONG)))
def test_what_is_no_quantity_is_refused_in_one_line(value: object, unit: str, words: str) -> None:
    with pytest.raises(ValueError, match=r"needs|not a unit|decimals") as caught:
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


PREFIXES = {"n": -9, "u": -6, "µ": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9}


@given(
    st.decimals(allow_nan=False, allow_infinity=False, min_value=-(10**9), max_value=10**9),
    st.sampled_from([*PREFIXES]),
)
def test_a_conversion_is_exact_and_rounded_once(number: Decimal, prefix: str) -> None:
    exact = Fraction(number) * Fraction(10) ** PREFIXES[prefix]
    assert quantity(f"{number} {prefix}s", "s") == float(exact)


@given(st.text(max_size=30) | st.from_regex(r"[0-9.eE+-]{1,8} [A-Za-zµ°·²⁻¹*/^. ]{1,12}", fullmatch=True))
def test_any_text_is_a_finite_number_or_a_value_error(text: str) -> None:
    try:
        value = quantity(text, "m")
    except ValueError:
        return
    assert math.isfinite(value)
