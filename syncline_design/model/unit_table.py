"""The closed table of units: what each measures, and its exact SI value.

Factors are those of the SI brochure (9th edition, tables 5 to 8); the degree uses pi to 60 digits.
"""

from __future__ import annotations

from enum import Enum
from fractions import Fraction

PI = Fraction("3.141592653589793238462643383279502884197169399375105820974945")


class Dimension(Enum):
    """What a figure measures; the value is the word for people."""

    LENGTH = "length"
    TIME = "time"
    ANGLE = "angle"
    SPEED = "speed"
    ANGULAR_RATE = "angular rate"
    MASS = "mass"
    POWER = "power"
    MONEY = "amount of money"
    RATIO = "ratio"
    FREQUENCY = "frequency"
    ACCELERATION = "acceleration"
    ANGULAR_ACCELERATION = "angular acceleration"
    TEMPERATURE = "temperature"
    DIMENSIONLESS = "plain number"


_D = Dimension
_PREFIX = {
    prefix: Fraction(10) ** power
    for prefix, power in {
        "p": -12, "n": -9, "u": -6, "\u00b5": -6, "\u03bc": -6, "m": -3, "c": -2, "": 0, "k": 3,
        "M": 6, "G": 9,
    }.items()
}  # fmt: skip
_MICRO = ("u", "\u00b5", "\u03bc")  # ASCII, the micro sign and the Greek letter
DEG = PI / 180
CURRENCIES = ("EUR", "USD", "GBP", "NOK", "SEK", "DKK", "CHF", "CAD", "AUD", "JPY")


def _prefixed(
    dimension: Dimension, unit: str, prefixes: tuple[str, ...], factor: Fraction = Fraction(1)
) -> dict[str, tuple[Dimension, Fraction]]:
    return {prefix + unit: (dimension, _PREFIX[prefix] * factor) for prefix in prefixes}


# unit -> (dimension, SI value of one unit)
UNITS: dict[str, tuple[Dimension, Fraction]] = {
    **_prefixed(_D.LENGTH, "m", ("n", *_MICRO, "m", "c", "", "k")),
    "nmi": (_D.LENGTH, Fraction(1852)),
    **_prefixed(_D.TIME, "s", ("p", "n", *_MICRO, "m", "")),
    "min": (_D.TIME, Fraction(60)),
    "h": (_D.TIME, Fraction(3600)),
    "d": (_D.TIME, Fraction(86400)),
    **_prefixed(_D.ANGLE, "rad", (*_MICRO, "m", "")),
    **_prefixed(_D.ANGLE, "deg", ("m", ""), DEG),
    "arcmin": (_D.ANGLE, DEG / 60),
    "arcsec": (_D.ANGLE, DEG / 3600),
    **_prefixed(_D.SPEED, "m/s", (*_MICRO, "m", "c", "", "k")),
    "km/h": (_D.SPEED, Fraction(1000, 3600)),
    "kn": (_D.SPEED, Fraction(1852, 3600)),
    **_prefixed(_D.ANGULAR_RATE, "rad/s", (*_MICRO, "m", "")),
    **_prefixed(_D.ANGULAR_RATE, "deg/s", ("m", ""), DEG),
    "deg/min": (_D.ANGULAR_RATE, DEG / 60),
    "deg/h": (_D.ANGULAR_RATE, DEG / 3600),
    **_prefixed(_D.MASS, "g", ("m", "", "k"), Fraction(1, 1000)),
    **_prefixed(_D.POWER, "W", (*_MICRO, "m", "", "k")),
    **{currency: (_D.MONEY, Fraction(1)) for currency in CURRENCIES},
    "%": (_D.RATIO, Fraction(1, 100)),
    "ppm": (_D.RATIO, Fraction(1, 10**6)),
    "ppb": (_D.RATIO, Fraction(1, 10**9)),
    **_prefixed(_D.RATIO, "s/s", ("n", *_MICRO, "m")),
    **_prefixed(_D.FREQUENCY, "Hz", ("m", "", "k", "M", "G")),
    "m/s^2": (_D.ACCELERATION, Fraction(1)),
    "m/s2": (_D.ACCELERATION, Fraction(1)),
    **{
        f"{prefix}{angle}/{square}": (_D.ANGULAR_ACCELERATION, _PREFIX[prefix] * size)
        for prefix in ("m", "")
        for angle, size in (("rad", Fraction(1)), ("deg", DEG))
        for square in ("s^2", "s2")
    },
    "degC": (_D.TEMPERATURE, Fraction(1)),  # stays Celsius: only ever compared
}

EXAMPLES: dict[Dimension, str] = {
    _D.LENGTH: "1.5 m",
    _D.TIME: "10 ns",
    _D.ANGLE: "0.1 deg",
    _D.SPEED: "21 m/s",
    _D.ANGULAR_RATE: "77.9 deg/s",
    _D.MASS: "3 kg",
    _D.POWER: "12 W",
    _D.MONEY: "400 EUR",
    _D.RATIO: "20 ppm",
    _D.FREQUENCY: "10 Hz",
    _D.ACCELERATION: "9.81 m/s^2",
    _D.ANGULAR_ACCELERATION: "30 deg/s^2",
    _D.TEMPERATURE: "20 degC",
    _D.DIMENSIONLESS: "1.0",
}

# Spellings people use, for suggestions only.
SPELLINGS = {
    "meter": "m", "metre": "m", "meters": "m", "metres": "m", "sec": "s", "second": "s",
    "seconds": "s", "msec": "ms", "usec": "us", "nsec": "ns", "hr": "h", "hours": "h",
    "degree": "deg", "degrees": "deg", "\u00b0": "deg", "\u00b0/s": "deg/s", "dps": "deg/s",
    "degps": "deg/s", "radian": "rad", "radians": "rad", "radps": "rad/s", "mps": "m/s",
    "kmh": "km/h", "kph": "km/h", "knot": "kn", "knots": "kn", "kt": "kn", "gram": "g",
    "grams": "g", "kilogram": "kg", "watt": "W", "watts": "W", "hz": "Hz", "euro": "EUR",
    "euros": "EUR", "\u20ac": "EUR", "$": "USD", "\u00a3": "GBP", "percent": "%", "c": "degC",
    "\u00b0c": "degC", "celsius": "degC", "lines/s": "Hz", "fps": "Hz",
}  # fmt: skip

# Units that a result is shown in, smallest first.
LADDERS: dict[Dimension, tuple[str, ...]] = {
    _D.LENGTH: ("nm", "um", "mm", "m", "km"),
    _D.TIME: ("ps", "ns", "us", "ms", "s"),
    _D.ANGLE: ("deg",),
    _D.SPEED: ("um/s", "mm/s", "m/s"),
    _D.ANGULAR_RATE: ("deg/s",),
    _D.MASS: ("mg", "g", "kg"),
    _D.POWER: ("uW", "mW", "W", "kW"),
    _D.RATIO: ("ppb", "ppm", "%"),
    _D.FREQUENCY: ("mHz", "Hz", "kHz", "MHz", "GHz"),
    _D.ACCELERATION: ("m/s^2",),
    _D.ANGULAR_ACCELERATION: ("deg/s^2",),
    _D.TEMPERATURE: ("degC",),
}

# how tables of figures in SI name each dimension
SI_UNITS = {
    Dimension.LENGTH: "m", Dimension.TIME: "s", Dimension.ANGLE: "rad", Dimension.SPEED: "m/s",
    Dimension.ANGULAR_RATE: "rad/s", Dimension.MASS: "kg", Dimension.POWER: "W",
    Dimension.RATIO: "1", Dimension.DIMENSIONLESS: "1", Dimension.FREQUENCY: "Hz",
    Dimension.ACCELERATION: "m/s^2", Dimension.ANGULAR_ACCELERATION: "rad/s^2",
    Dimension.TEMPERATURE: "degC",
}  # fmt: skip

# Suffixes of column and parameter names; the first is the SI one of its dimension.
SUFFIXES: dict[str, str] = {
    "_s": "s",
    "_ms": "ms",
    "_us": "us",
    "_ns": "ns",
    "_m": "m",
    "_mm": "mm",
    "_cm": "cm",
    "_rad": "rad",
    "_deg": "deg",
    "_mps": "m/s",
    "_radps": "rad/s",
    "_degps": "deg/s",
    "_mps2": "m/s^2",
    "_ppm": "ppm",
}
SI_SUFFIX = {
    _D.TIME: "_s",
    _D.LENGTH: "_m",
    _D.ANGLE: "_rad",
    _D.SPEED: "_mps",
    _D.ANGULAR_RATE: "_radps",
    _D.ACCELERATION: "_mps2",
}
