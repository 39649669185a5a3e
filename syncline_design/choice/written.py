"""Figures as a user writes them: rounded in the unit of the spec, read back to exactly that."""

from __future__ import annotations

import math
from fractions import Fraction

from syncline_design.model.quantity import UNITS, Dimension, Quantity

DIGITS = 3
USUAL = {
    Dimension.LENGTH: "m",
    Dimension.MASS: "kg",
    Dimension.POWER: "W",
    Dimension.SPEED: "m/s",
    Dimension.ANGULAR_RATE: "deg/s",
}


def in_unit_of(
    written: str, value: Fraction, dimension: Dimension, *, up: bool, digits: int = DIGITS
) -> Quantity:
    """A figure in the unit that the user wrote, such as `5 cm`, rounded up or down in it."""
    unit = written.partition(" ")[2].strip()
    if unit not in UNITS or UNITS[unit][0] is not dimension:
        unit = USUAL[dimension]
    factor = Fraction(UNITS[unit][1])
    number = rounded(value / factor, up=up, digits=digits)
    return Quantity(number * factor, f"{decimal_text(number)} {unit}")


def plain(value: Fraction, *, up: bool, digits: int = DIGITS) -> Quantity:
    """A figure without unit."""
    number = rounded(value, up=up, digits=digits)
    return Quantity(number, decimal_text(number))


def money(value: Fraction, rate: Fraction, currency: str) -> Quantity:
    """An amount in whole units of a currency, rounded up; rate: the spec's currency per unit."""
    whole = Fraction(math.ceil(value / rate))
    return Quantity(whole, f"{int(whole)} {currency}", None, currency)


def rounded(value: Fraction, *, up: bool, digits: int = DIGITS) -> Fraction:
    """So many significant figures, rounded up or down."""
    if value == 0:
        return value
    power = digits - 1 - _magnitude(abs(value))
    scaled = value * Fraction(10) ** power
    whole = math.ceil(scaled) if up else math.floor(scaled)
    return Fraction(whole) / Fraction(10) ** power


def _magnitude(value: Fraction) -> int:
    """Largest power of ten that is no larger, as its exponent."""
    guess = math.floor(math.log10(value.numerator) - math.log10(value.denominator))
    while Fraction(10) ** guess > value:
        guess -= 1
    while Fraction(10) ** (guess + 1) <= value:
        guess += 1
    return guess


def decimal_text(value: Fraction) -> str:
    """A fraction with a finite decimal expansion in full, as `0.0125`."""
    places = 0
    while (value * 10**places).denominator != 1:
        places += 1
    digits = str(abs(int(value * 10**places))).rjust(places + 1, "0")
    sign = "-" if value < 0 else ""
    if not places:
        return sign + digits
    return f"{sign}{digits[:-places]}.{digits[-places:]}"
