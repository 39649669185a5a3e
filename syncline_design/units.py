"""Text with a unit to SI and back: the one place that knows units.

Grammar: `NUMBER UNIT`, as in `10 ns` or `77.9 deg/s`; where a tolerance is allowed also
`NUMBER UNIT +/- NUMBER UNIT`, `NUMBER UNIT +/- NUMBER %` and `NUMBER UNIT .. NUMBER UNIT`.
The table is closed: what it does not list is refused, with the nearest entry as a suggestion.
Factors are the exact ones of the SI brochure (9th edition, tables 5 to 8); the degree uses pi
to 60 digits.
"""

from __future__ import annotations

import math
import re
from enum import Enum
from fractions import Fraction
from typing import Any, NoReturn

PI = Fraction("3.141592653589793238462643383279502884197169399375105820974945")

# Magnitudes outside this span (SI, zero excepted) are slips of the pen, and their squares and
# products would leave the range of a float.
SMALLEST, LARGEST = Fraction(1, 10**30), Fraction(10**30)
MAX_NUMBER_LENGTH = 60


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
_DEG = PI / 180
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
    **_prefixed(_D.ANGLE, "deg", ("m", ""), _DEG),
    "arcmin": (_D.ANGLE, _DEG / 60),
    "arcsec": (_D.ANGLE, _DEG / 3600),
    **_prefixed(_D.SPEED, "m/s", (*_MICRO, "m", "c", "", "k")),
    "km/h": (_D.SPEED, Fraction(1000, 3600)),
    "kn": (_D.SPEED, Fraction(1852, 3600)),
    **_prefixed(_D.ANGULAR_RATE, "rad/s", (*_MICRO, "m", "")),
    **_prefixed(_D.ANGULAR_RATE, "deg/s", ("m", ""), _DEG),
    "deg/min": (_D.ANGULAR_RATE, _DEG / 60),
    "deg/h": (_D.ANGULAR_RATE, _DEG / 3600),
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
    _D.DIMENSIONLESS: "1.0",
}

# Spellings people use, for suggestions only.
_SPELLINGS = {
    "meter": "m", "metre": "m", "meters": "m", "metres": "m", "sec": "s", "second": "s",
    "seconds": "s", "msec": "ms", "usec": "us", "nsec": "ns", "hr": "h", "hours": "h",
    "degree": "deg", "degrees": "deg", "\u00b0": "deg", "\u00b0/s": "deg/s", "dps": "deg/s",
    "degps": "deg/s", "radian": "rad", "radians": "rad", "radps": "rad/s", "mps": "m/s",
    "kmh": "km/h", "kph": "km/h", "knot": "kn", "knots": "kn", "kt": "kn", "gram": "g",
    "grams": "g", "kilogram": "kg", "watt": "W", "watts": "W", "hz": "Hz", "euro": "EUR",
    "euros": "EUR", "\u20ac": "EUR", "$": "USD", "\u00a3": "GBP", "percent": "%",
}  # fmt: skip

_NUMBER = re.compile(r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_EXPONENT = re.compile(r"[eE]([-+]?[0-9]+)$")
_LEADING_ZERO = re.compile(r"[-+]?0[0-9]")
_TOLERANCE = re.compile(r"(?P<nominal>.+?)\s*(?:\+/-|\u00b1)\s*(?P<spread>.+)")
_RANGE = re.compile(r"(?P<low>.+?)\s+\.\.\s+(?P<high>.+)")


class UnitError(ValueError):
    """A figure that cannot be read; `expected`, `found` and `hint` are for the message."""

    def __init__(self, message: str, expected: str = "", found: str = "", hint: str = "") -> None:
        self.message, self.expected, self.found, self.hint = message, expected, found, hint
        parts = [message]
        if expected:
            parts.append(f"expected {expected}" + (f", found {found}" if found else ""))
        if hint:
            parts.append(hint)
        super().__init__("; ".join(parts))


class Quantity(float):
    """A figure as a float in SI that remembers how it was written.

    text: as written.  exact: the SI value as a fraction (decimal text taken literally; degrees
    with pi to 60 digits).  low, high: tolerance bounds in SI, the value itself when none.
    currency: of money, else None.
    """

    __slots__ = ("currency", "exact", "high", "low", "text")
    text: str
    exact: Fraction
    low: float
    high: float
    currency: str | None

    def __new__(
        cls,
        exact: Fraction,
        text: str,
        bounds: tuple[Fraction, Fraction] | None = None,
        currency: str | None = None,
    ) -> Quantity:
        self = super().__new__(cls, float(exact))
        low, high = bounds or (exact, exact)
        for name, value in (
            ("text", text),
            ("exact", exact),
            ("low", float(low)),
            ("high", float(high)),
            ("currency", currency),
        ):
            object.__setattr__(self, name, value)
        return self

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"a Quantity is read-only: {name}")

    def __reduce__(self) -> tuple[type[Quantity], tuple[object, ...]]:
        bounds = (Fraction(self.low), Fraction(self.high)) if self.has_tolerance else None
        return Quantity, (self.exact, self.text, bounds, self.currency)

    @property
    def has_tolerance(self) -> bool:
        """Whether the figure was written with a tolerance or as a range."""
        return self.low != self.high


def parse_number(text: str) -> Fraction:
    """A decimal number, exactly; UnitError says what is wrong with anything else."""
    _refuse_look_alikes(text)
    if not _NUMBER.fullmatch(text):
        raise UnitError("not a number", "a number such as 1.5 or 2e-3", _shown(text))
    if len(text) > MAX_NUMBER_LENGTH:
        raise UnitError(f"a number of {len(text)} characters", f"at most {MAX_NUMBER_LENGTH}")
    if _LEADING_ZERO.match(text):
        raise UnitError(
            "a number with a leading zero", hint=f"write {text.lstrip('+-').lstrip('0') or '0'}"
        )
    exponent = _EXPONENT.search(text)
    if exponent and (len(exponent[1]) > 4 or abs(int(exponent[1])) > 300):
        raise UnitError("a number outside the range of a float", found=_shown(text))
    return Fraction(text)


def _refuse_look_alikes(text: str) -> None:
    if "\u2212" in text or "\u2013" in text:
        raise UnitError("a dash where a minus sign is due", "- (ASCII)", _shown(text))
    if re.fullmatch(r"[-+]?[0-9]+,[0-9]+", text):
        raise UnitError("a decimal comma", "a decimal point", _shown(text), _write(text))
    if re.fullmatch(r"[-+]?[0-9]+(:[0-9]+)+", text):
        raise UnitError("not a number", "a number such as 1.5", _shown(text))
    if re.fullmatch(r"[-+]?\.?(inf|nan|infinity)", text, re.IGNORECASE):
        raise UnitError("not a finite number", "a finite number", _shown(text))


def _write(text: str) -> str:
    return f"write {text.replace(',', '.')}"


def _shown(text: str) -> str:
    """Text for a message: shortened, quoted, control characters escaped."""
    short = text if len(text) <= 40 else text[:37] + "..."
    return repr(short)


def parse_quantity(value: Any, dimension: Dimension, *, tolerance: bool = True) -> Quantity:
    """Read `NUMBER UNIT` of the wanted dimension into SI."""
    if dimension is _D.DIMENSIONLESS and not isinstance(value, str):
        return plain_number(value)
    if not isinstance(value, str):
        raise _not_text(value, dimension)
    text = value.strip(" ")
    if found := _RANGE.fullmatch(text):
        return _with_range(text, found["low"], found["high"], dimension, tolerance)
    if found := _TOLERANCE.fullmatch(text):
        return _with_spread(text, found["nominal"], found["spread"], dimension, tolerance)
    exact, unit = _single(text, dimension)
    return Quantity(exact, text, currency=unit if dimension is _D.MONEY else None)


def expected_text(dimension: Dimension) -> str:
    """`a length such as 1.5 m`: what a message says it expected."""
    article = "an" if dimension.value[0] in "aeiou" else "a"
    return f"{article} {dimension.value} such as {EXAMPLES[dimension]}"


def _not_text(value: Any, dimension: Dimension) -> UnitError:
    expected = expected_text(dimension)
    if isinstance(value, bool):
        return UnitError("not a quantity", expected, str(value).lower())
    if isinstance(value, int | float):
        shown = getattr(value, "text", None) or repr(value)
        return UnitError("a number without a unit", expected, _shorten(shown), "add the unit")
    kind = {type(None): "nothing (null)", dict: "a mapping"}.get(type(value), "a list")
    return UnitError("not a quantity", expected, kind)


def _shorten(text: str) -> str:
    return text if len(text) <= 40 else text[:37] + "..."


def _single(text: str, dimension: Dimension) -> tuple[Fraction, str]:
    """SI value and unit of one `NUMBER UNIT`."""
    expected = expected_text(dimension)
    if not text:
        raise UnitError("an empty quantity", expected)
    number, _, unit = text.partition(" ")
    unit = unit.strip(" ")
    if not unit:
        _refuse_unitless(number, dimension, expected)
    value = parse_number(number)
    if re.match(r"[-+.]?[0-9]", unit):
        raise UnitError("two numbers", expected, _shown(text), "a quantity is one number, one unit")
    exact = value * _factor(unit, dimension)
    if exact and not SMALLEST <= abs(exact) <= LARGEST:
        raise UnitError("a magnitude outside 1e-30 to 1e30 in SI units", expected, _shown(text))
    return exact, unit


def _refuse_unitless(text: str, dimension: Dimension, expected: str) -> NoReturn:
    if joined := re.fullmatch(rf"({_NUMBER.pattern})([^0-9.,eE\s].*)", text):
        if joined[2] in UNITS:
            raise UnitError("no space before the unit", f"{joined[1]} {joined[2]}", _shown(text))
        raise UnitError("not a quantity", expected, _shown(text))
    parse_number(text)  # says what is wrong with the number itself, if anything is
    raise UnitError("a number without a unit", expected, _shown(text), "add the unit")


def _factor(unit: str, dimension: Dimension) -> Fraction:
    entry = UNITS.get(unit)
    if entry is None:
        nearest = suggest_unit(unit, dimension)
        hint = f"did you mean {nearest}?" if nearest else ""
        known = ", ".join(u for u, (d, _) in UNITS.items() if d is dimension and u.isascii())
        raise UnitError("unknown unit", f"one of {known}", _shown(unit), hint)
    if entry[0] is not dimension:
        raise UnitError(
            f"wrong dimension: {unit} is a unit of {entry[0].value}",
            f"{dimension.value} ({EXAMPLES[dimension]})",
            entry[0].value,
        )
    return entry[1]


def suggest_unit(unit: str, dimension: Dimension) -> str | None:
    """The unit most likely meant, of the wanted dimension first."""
    spelled = _SPELLINGS.get(unit.lower())
    if spelled:
        return spelled
    wanted = [u for u, (d, _) in UNITS.items() if d is dimension and u.isascii()]
    for candidates in (wanted, [u for u in UNITS if u.isascii()]):
        for candidate in candidates:
            if candidate.lower() == unit.lower():
                return candidate
    from difflib import get_close_matches

    return next(iter(get_close_matches(unit, wanted, 1, 0.5)), None)


def _allow(tolerance: bool, text: str) -> None:
    if not tolerance:
        raise UnitError("a tolerance where none is taken", "one figure", _shown(text))


def _with_range(
    text: str, low_text: str, high_text: str, dimension: Dimension, tolerance: bool
) -> Quantity:
    _allow(tolerance, text)
    (low, unit), (high, high_unit) = _single(low_text, dimension), _single(high_text, dimension)
    if dimension is _D.MONEY and unit != high_unit:
        raise UnitError("two currencies in one range", found=_shown(text))
    if low > high:
        raise UnitError("a range with its ends swapped", "LOW .. HIGH", _shown(text))
    currency = unit if dimension is _D.MONEY else None
    return Quantity((low + high) / 2, text, (low, high), currency)


def _with_spread(
    text: str, nominal_text: str, spread_text: str, dimension: Dimension, tolerance: bool
) -> Quantity:
    _allow(tolerance, text)
    nominal, unit = _single(nominal_text, dimension)
    if spread_text.endswith("%"):
        spread = abs(nominal) * parse_number(spread_text[:-1].rstrip(" ")) / 100
    else:
        spread = _single(spread_text, dimension)[0]
    if spread < 0:
        raise UnitError("a negative tolerance", "0 or more after +/-", _shown(text))
    currency = unit if dimension is _D.MONEY else None
    return Quantity(nominal, text, (nominal - spread, nominal + spread), currency)


def plain_number(value: Any) -> Quantity:
    """A dimensionless figure, written bare."""
    expected = "a number such as 1.0"
    if isinstance(value, bool):
        raise UnitError("not a number", expected, str(value).lower())
    if isinstance(value, str):
        parse_number(value)
        raise UnitError("a number in quotes", expected, _shown(value), "unquote it")
    if not isinstance(value, int | float):
        raise _not_text(value, _D.DIMENSIONLESS)
    text = getattr(value, "text", None) or repr(value)
    exact = parse_number(text)
    if exact and not SMALLEST <= abs(exact) <= LARGEST:
        raise UnitError("a magnitude outside 1e-30 to 1e30", expected, _shorten(text))
    return Quantity(exact, text)


# Units that a result is shown in, smallest first.
_LADDERS: dict[Dimension, tuple[str, ...]] = {
    _D.LENGTH: ("nm", "um", "mm", "m", "km"),
    _D.TIME: ("ps", "ns", "us", "ms", "s"),
    _D.ANGLE: ("mdeg", "deg"),
    _D.SPEED: ("um/s", "mm/s", "m/s"),
    _D.ANGULAR_RATE: ("mdeg/s", "deg/s"),
    _D.MASS: ("mg", "g", "kg"),
    _D.POWER: ("uW", "mW", "W", "kW"),
    _D.RATIO: ("ppb", "ppm", "%"),
    _D.FREQUENCY: ("mHz", "Hz", "kHz", "MHz", "GHz"),
    _D.ACCELERATION: ("m/s^2",),
}


def format_quantity(
    si_value: float, dimension: Dimension, digits: int = 4, currency: str = "EUR"
) -> str:
    """`2.5 ms` for 0.0025 s: the largest unit that leaves a figure of 1 or more, `digits` figures.

    The figure is rounded before the unit is picked, so 999.96 us reads 1 ms.  Money keeps two
    decimals at most and groups thousands by a space; infinity reads `unlimited`.
    """
    if math.isnan(si_value):
        return "not a number"
    if math.isinf(si_value):
        return "unlimited" if si_value > 0 else "-unlimited"
    if dimension is _D.MONEY:
        return f"{si_value:,.2f}".removesuffix(".00").replace(",", " ") + f" {currency}"
    if dimension is _D.DIMENSIONLESS:
        return _figure(si_value, digits)
    ladder = _LADDERS[dimension]
    chosen = ladder[-1] if si_value == 0.0 else ladder[0]
    for unit in ladder:
        scaled = abs(si_value) / float(UNITS[unit][1])
        if float(f"{scaled:.{digits - 1}e}") >= 1.0:
            chosen = unit
    if si_value == 0.0:
        chosen = next(u for u in reversed(ladder) if UNITS[u][1] in (1, _DEG, Fraction(1, 10**6)))
    return f"{_figure(si_value / float(UNITS[chosen][1]), digits)} {chosen}"


def _figure(value: float, digits: int) -> str:
    """`digits` significant figures without exponent where that stays readable, zeros trimmed."""
    rounded = float(f"{value:.{digits - 1}e}")
    if rounded == 0.0:
        return "0"
    power = math.floor(math.log10(abs(rounded)))
    if not -4 <= power < 9:
        return f"{rounded:.{digits - 1}e}"
    text = f"{rounded:.{max(0, digits - 1 - power)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


# Suffixes of column and parameter names; the first is the SI one of its dimension.
_SUFFIXES: dict[str, str] = {
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
_SI_SUFFIX = {
    _D.TIME: "_s",
    _D.LENGTH: "_m",
    _D.ANGLE: "_rad",
    _D.SPEED: "_mps",
    _D.ANGULAR_RATE: "_radps",
    _D.ACCELERATION: "_mps2",
}


def split_suffix(name: str) -> tuple[str, str]:
    """Stem and unit suffix of a name; the suffix is empty when there is none."""
    stem, underscore, tail = name.rpartition("_")
    suffix = underscore + tail
    return (stem, suffix) if stem and suffix in _SUFFIXES else (name, "")


def suffix_unit(name: str) -> tuple[float, Dimension]:
    """Factor to SI and dimension that a name's suffix says: `roll_deg` -> (pi/180, ANGLE)."""
    _, suffix = split_suffix(name)
    if not suffix:
        return 1.0, Dimension.DIMENSIONLESS
    dimension, factor = UNITS[_SUFFIXES[suffix]]
    return float(factor), dimension


def si_name(name: str) -> str:
    """The name with the SI suffix of its dimension: `latency_ms` -> `latency_s`."""
    stem, suffix = split_suffix(name)
    if not suffix:
        return name
    return stem + _SI_SUFFIX.get(UNITS[_SUFFIXES[suffix]][0], suffix if suffix != "_ppm" else "")
