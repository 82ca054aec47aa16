"""Quantities as people write them: a bare SI number, or a number with its unit such as "180 N/m".

Angle is a dimension here, and Hz means turns per second: "1 Hz" is 2 pi rad/s, and a torque is not a joint
stiffness. Conversions are exact and rounded once: "100 us", "0.1 ms" and 1e-4 are the same number.
"""

from __future__ import annotations

import math
import re
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING, Any

from hilrig.core.errors import nearest

if TYPE_CHECKING:
    import pint

_DEFINITIONS = """
nano- = 1e-9 = n-
micro- = 1e-6 = µ- = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
kilo- = 1e3 = k-
mega- = 1e6 = M-
giga- = 1e9 = G-
meter = [length] = m
second = [time] = s
gram = [mass] = g
radian = [angle] = rad
minute = 60 * second = min
turn = 6.28318530717958647692528676655900577 * radian
degree = 0.0174532925199432957692369076848861271 * radian = deg = °
hertz = turn / second = Hz
rpm = turn / minute
newton = kilogram * meter / second ** 2 = N
newton_meter = newton * meter = Nm
newton_second = newton * second = Ns
newton_meter_second = newton * meter * second = Nms
joule = newton * meter = J
watt = joule / second = W
percent = 0.01 = %
byte = [memory] = B
"""
_KNOWN = (
    "m",
    "kg",
    "g",
    "s",
    "min",
    "N",
    "Nm",
    "Ns",
    "Nms",
    "rad",
    "deg",
    "°",
    "turn",
    "Hz",
    "rpm",
    "W",
    "J",
    "%",
    "B",
)
"""The units that messages list"""

_NAMES = {
    "s": "a time", "m": "a length", "kg": "a mass", "rad": "an angle", "N": "a force", "m/s": "a speed",
    "m/s^2": "an acceleration", "rad/s": "an angular speed", "rad/s^2": "an angular acceleration",
    "N/m": "a stiffness", "N*s/m": "a damping", "N*m": "a torque or energy", "N*m/rad": "a joint stiffness",
    "N*m*s/rad": "a joint damping", "kg*m^2": "a moment of inertia", "W": "a power", "1/s": "a rate",
    "B": "a memory size", "": "a pure number",
}  # fmt: skip
"""Common name for a quantity with a unit's dimension."""

_EXAMPLES = {
    "s": "1 ms", "m": "0.1 m", "kg": "3 kg", "rad": "90 deg", "N": "3.5 N", "m/s": "0.1 m/s",
    "rad/s": "1 rad/s", "Hz": "100 Hz", "N/m": "800 N/m", "N*s/m": "20 N*s/m", "N*m": "2 N*m", "B": "2 GB", "": "0.5",
}  # fmt: skip

_AS_TYPED = str.maketrans({
    "μ": "µ",  # from the Greek letter, which Unicode prefers, to the sign on keyboards
    "−": "-",
    "·": "*", "⋅": "*", "∙": "*", "×": "*", "º": "°",
    "\u00a0": " ", "\u2009": " ", "\u202f": " ",
})  # fmt: skip
"""Typographic characters, and what to read them as"""
_NUMBER = re.compile(r"\s*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*(.*?)\s*")
_UNIT = re.compile(r"(?:[A-Za-zµ°%1()*/. ]|(?:\^|\*\*) ?-?[1-9](?!\d)|⁻?[¹²³⁴⁵⁶⁷⁸⁹](?![⁰¹²³⁴⁵⁶⁷⁸⁹])){0,40}")
"""Units may contain names, products, quotients and one-digit powers: nothing that is expensive to evaluate."""


def quantity(value: Any, unit: str) -> float:
    """Return `value` as a number in `unit`: a bare number is taken as is, a string is converted.

    Raises ValueError, with a message for the user, for anything that is not a finite quantity of that dimension.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"{shown(value)} is not a quantity; this needs {described(unit)}")
    try:
        number = _converted(value, unit) if isinstance(value, str) else float(value)
    except OverflowError:  # an integer or fraction too large for a float
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"{shown(value)} is not a finite number; this needs {described(unit)}")
    return number


def described(unit: str) -> str:
    """Return the name of a quantity in `unit`, with an example, such as "a time, e.g. '1 ms'"."""
    name = _NAMES.get(unit) or _name_of(_registry().parse_units(unit))
    return f"{name}, e.g. '{_EXAMPLES[unit]}'" if unit in _EXAMPLES else f"{name} in {unit}"


def shown(value: Any) -> str:
    """Return a value from the experiment file as shown in messages."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int) and value.bit_length() > 200:
        return f"a whole number of {math.ceil(value.bit_length() * math.log10(2))} digits"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str):
        return f"'{shortened(value)}'"
    return "a mapping" if isinstance(value, dict) else f"a list of {len(value)}"


def shortened(text: str) -> str:
    """Return `text`, cut to 60 characters for use in a message."""
    return text if len(text) <= 60 else text[:57] + "..."


def _converted(text: str, unit: str) -> float:
    match = _NUMBER.fullmatch(text.translate(_AS_TYPED))
    if match is None:
        raise ValueError(f"{shown(text)} is not a quantity; this needs {described(unit)}")
    digits, written = match.groups()
    if written.startswith(","):
        raise ValueError(f"{shown(text)}: decimals take a point, not a comma")
    if not written:
        return float(digits)
    given, wanted = _parsed(text, written), _registry().parse_units(unit)
    if given.dimensionality != wanted.dimensionality:
        raise ValueError(f"{shown(text)} is {_name_of(given)} [{written}]; this needs {described(unit)}")
    number = float(digits)
    if not math.isfinite(number) or number == 0:
        return number
    # Round first if there are so many digits that exact arithmetic would be slow.
    exact = Fraction(digits) if len(digits) <= 200 else Fraction(number)
    return float(exact * Fraction(_registry().Quantity(Fraction(1), given).to(wanted).magnitude))


def _parsed(text: str, unit: str) -> pint.Unit:
    if not _UNIT.fullmatch(unit):
        raise ValueError(f"{shown(text)}: '{unit}' is not a unit")
    try:
        return _registry().parse_units(("1" * unit.startswith("/") + unit).replace(".", "*"))
    except Exception as error:  # pint raises many types, some of them from Python's own tokenizer
        unknown = next((name for name in re.findall(r"[A-Za-zµ°%]+", unit) if name not in _registry()), unit)
        alike = [name for name in _KNOWN if name.casefold() == unknown.casefold()]
        hint = f"; did you mean '{alike[0]}'?" if alike else nearest(unknown, _KNOWN)
        raise ValueError(
            f"{shown(text)}: '{unknown}' is not a unit that hilrig knows{hint} (known: {', '.join(_KNOWN)})"
        ) from error


def _name_of(unit: pint.Unit) -> str:
    """Return the name of a quantity with the unit's dimension."""
    for known, name in _NAMES.items():
        if _registry().parse_units(known).dimensionality == unit.dimensionality:
            return name
    return "a quantity"


@cache
def _registry() -> pint.UnitRegistry:
    import pint  # takes as long to import as everything else here, and many calls do not need it

    registry: pint.UnitRegistry = pint.UnitRegistry(None, non_int_type=Fraction)  # pyright: ignore[reportArgumentType]
    for line in _DEFINITIONS.strip().splitlines():
        registry.define(line)
    return registry
