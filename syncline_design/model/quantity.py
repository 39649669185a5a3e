"""Text with a unit to SI and back: the one place that knows units.

Grammar: `NUMBER UNIT`, as in `10 ns` or `77.9 deg/s`; where a tolerance is allowed also
`NUMBER UNIT +/- NUMBER UNIT`, `NUMBER UNIT +/- NUMBER %` and `NUMBER UNIT .. NUMBER UNIT`.
The table is closed: what it does not list is refused, with the nearest entry as a suggestion.
"""

from __future__ import annotations

import functools
import re
from fractions import Fraction
from typing import Any, NoReturn

from syncline_design.model.unit_table import CURRENCIES as CURRENCIES
from syncline_design.model.unit_table import EXAMPLES as EXAMPLES
from syncline_design.model.unit_table import PI as PI
from syncline_design.model.unit_table import SI_SUFFIX, SPELLINGS, SUFFIXES
from syncline_design.model.unit_table import UNITS as UNITS
from syncline_design.model.unit_table import Dimension as Dimension

# Magnitudes outside this span (SI, zero excepted) are slips of the pen, and their squares and
# products would leave the range of a float.
SMALLEST, LARGEST = Fraction(1, 10**30), Fraction(10**30)
MAX_NUMBER_LENGTH = 60
MOST_KEPT = 4096  # quantities that were read
MAX_TEXT_LENGTH = 300  # a quantity is echoed in reports; two numbers, a unit each, room for spaces


_NUMBER = re.compile(r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_EXPONENT = re.compile(r"[eE]([-+]?[0-9]+)$")
_LEADING_ZERO = re.compile(r"[-+]?0[0-9]")
_PLUS_MINUS = re.compile(r"\+/-|\u00b1")
_TO = re.compile(r"\s\.\.\s")


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
    if dimension is Dimension.DIMENSIONLESS and not isinstance(value, str):
        return plain_number(value)
    if not isinstance(value, str):
        raise _not_text(value, dimension)
    text = value.strip(" ")
    read = _read(text, dimension, tolerance)
    if len(text) > MAX_TEXT_LENGTH:
        length = f"a quantity of {len(text)} characters"
        raise UnitError(length, f"at most {MAX_TEXT_LENGTH}", _shown(text))
    return read


@functools.lru_cache(maxsize=MOST_KEPT)
def _read(text: str, dimension: Dimension, tolerance: bool) -> Quantity:
    """Kept, for a study reads the same figures in every case; a quantity is read-only."""
    if ends := _split(text, _TO):
        return _with_range(text, *ends, dimension, tolerance)
    if parts := _split(text, _PLUS_MINUS):
        return _with_spread(text, *parts, dimension, tolerance)
    exact, unit = _single(text, dimension)
    return Quantity(exact, text, currency=unit if dimension is Dimension.MONEY else None)


def _split(text: str, mark: re.Pattern[str]) -> tuple[str, str] | None:
    """What stands before and after the first mark that has something on both sides."""
    for found in mark.finditer(text):
        before, after = text[: found.start()].rstrip(), text[found.end() :].lstrip()
        if before:
            return (before, after) if after else None
    return None


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
            spaced = f"{_shorten(joined[1])} {joined[2]}"
            raise UnitError("no space before the unit", spaced, _shown(text))
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
    spelled = SPELLINGS.get(unit.lower())
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
    if dimension is Dimension.MONEY and unit != high_unit:
        raise UnitError("two currencies in one range", found=_shown(text))
    if low > high:
        raise UnitError("a range with its ends swapped", "LOW .. HIGH", _shown(text))
    currency = unit if dimension is Dimension.MONEY else None
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
    currency = unit if dimension is Dimension.MONEY else None
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
        raise _not_text(value, Dimension.DIMENSIONLESS)
    text = getattr(value, "text", None) or repr(value)
    exact = parse_number(text)
    if exact and not SMALLEST <= abs(exact) <= LARGEST:
        raise UnitError("a magnitude outside 1e-30 to 1e30", expected, _shorten(text))
    return Quantity(exact, text)


def split_suffix(name: str) -> tuple[str, str]:
    """Stem and unit suffix of a name; the suffix is empty when there is none."""
    stem, underscore, tail = name.rpartition("_")
    suffix = underscore + tail
    return (stem, suffix) if stem and suffix in SUFFIXES else (name, "")


def suffix_unit(name: str) -> tuple[float, Dimension]:
    """Factor to SI and dimension that a name's suffix says: `roll_deg` -> (pi/180, ANGLE)."""
    _, suffix = split_suffix(name)
    if not suffix:
        return 1.0, Dimension.DIMENSIONLESS
    dimension, factor = UNITS[SUFFIXES[suffix]]
    return float(factor), dimension


def si_name(name: str) -> str:
    """The name with the SI suffix of its dimension: `latency_ms` -> `latency_s`."""
    stem, suffix = split_suffix(name)
    if not suffix:
        return name
    return stem + SI_SUFFIX.get(UNITS[SUFFIXES[suffix]][0], suffix if suffix != "_ppm" else "")
