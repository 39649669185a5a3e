"""Figures as people read them in reports; their units from `model/unit_table`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Final, Protocol

from syncline_design.model import figure_text
from syncline_design.model.figure_text import (
    format_duration,
    format_estimate,
    format_quantity,
    to_digits,
    to_places,
)
from syncline_design.model.quantity import Dimension
from syncline_design.model.written import beside, limit_as_written

if TYPE_CHECKING:
    from syncline_design.verdict.tree import MissionHorizon

MISSING: Final = "\N{EM DASH}"
_TYPOGRAPHIC = (
    (" us", " \N{MICRO SIGN}s"),
    (" um", " \N{MICRO SIGN}m"),
    (" uW", " \N{MICRO SIGN}W"),
    ("m/s^2", "m/s\N{SUPERSCRIPT TWO}"),
    ("-", "\N{MINUS SIGN}"),
)


class Limited(Protocol):
    """What holds a requirement's limit: in SI, and as the spec has it where it has a unit."""

    @property
    def limit(self) -> float: ...
    @property
    def unit(self) -> str: ...
    @property
    def limit_written(self) -> str | None: ...


def finite(value: Any) -> float | None:
    """The value as a float; None when it is missing, not a number or infinite."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) else None


def _shown(value: Any, dimension: Dimension, digits: int, currency: str = "EUR") -> str:
    number = finite(value)
    if number is None:
        return MISSING
    text = format_quantity(number, dimension, digits, currency)
    if dimension is Dimension.MONEY:
        return text.replace(" ", "\N{NO-BREAK SPACE}")
    return typeset(text)


def length(value: Any, digits: int = 4) -> str:
    """Metres as `18.13 mm`."""
    return _shown(value, Dimension.LENGTH, digits)


def rounded_up(value_m: float, limit: Limited | None) -> str:
    """A length rounded up to four figures: an accuracy that the printed price does buy.

    In the unit of the limit that it is held against, where there is one.
    """
    if not value_m > 0.0 or not math.isfinite(value_m):
        return error(value_m, limit)
    scale = Fraction(10) ** (3 - math.floor(math.log10(value_m)))
    return error(float(math.ceil(Fraction(value_m) * scale) / scale), limit)


def time(value: Any, digits: int = 4) -> str:
    """Seconds as `12 us`, typeset."""
    return _shown(value, Dimension.TIME, digits)


def duration(seconds: float) -> str:
    """A time of operation: `202 s`, `1.5 h`."""
    return typeset(format_duration(seconds))


def drive_time(minutes: float) -> str:
    """`5.3 s`, `2.8 min`, `130 min`, `12 h`."""
    if minutes < 1.0:
        return time(60.0 * minutes, 2)
    if minutes >= 600.0:
        return typeset(f"{places(minutes / 60.0, 0)} h")
    shown = places(minutes, 0) if minutes >= 10.0 else number(minutes, 2)
    return typeset(f"{shown} min")


def drive_times(minutes: Sequence[float | None]) -> list[str]:
    """Lengths of drives beside one another, in one unit; empty where there is none."""
    told = [value for value in minutes if value is not None]
    if not told or max(told) < 1.0 or min(told) >= 600.0:
        return ["" if value is None else drive_time(value) for value in minutes]

    def in_minutes(value: float) -> str:
        return count(value) if value >= 10.0 else number(value, 2)

    return ["" if v is None else typeset(f"{in_minutes(v)} min") for v in minutes]


def from_to(from_s: float, to_s: float) -> str:
    """Two moments of a log, `120 s to 130 s`; to a hundredth of what lies between them at least."""
    between = abs(to_s - from_s)
    lost = sum(abs(float(to_digits(end, 4)) - end) for end in (from_s, to_s))
    if lost <= 0.01 * between or not math.isfinite(between):
        return f"{si_quantity(from_s, 's')} to {si_quantity(to_s, 's')}"
    places = max(2 - math.floor(math.log10(between)), 0)
    return " to ".join(typeset(f"{to_places(end, places)} s") for end in (from_s, to_s))


def like(shown: str, value: float, digits: int = 4) -> str:
    """A figure [SI] in the unit of a shown one: a change beside what has changed."""
    return typeset(figure_text.format_like(shown, value, digits))


def horizon(entry: MissionHorizon) -> str:
    """`1 h, extent 1 km, tilt 10 deg`."""
    extent, tilt = length(entry.extent_m), angle(entry.tilt_rad)
    return f"{format_duration(entry.duration_s)}, extent {extent}, tilt {tilt}"


def time_limit(value: Any, digits: int = 4) -> str:
    """A tau_crit: null means that motion does not matter, so nothing limits it."""
    return "unlimited" if value is None or value == math.inf else time(value, digits)


def speed(value: Any, digits: int = 4) -> str:
    """Metres per second."""
    return _shown(value, Dimension.SPEED, digits)


def angle(value: Any, digits: int = 4) -> str:
    """Radians, shown in degrees."""
    return _shown(value, Dimension.ANGLE, digits)


def mass(value: Any, digits: int = 4) -> str:
    """Kilograms."""
    return _shown(value, Dimension.MASS, digits)


def power(value: Any, digits: int = 4) -> str:
    """Watts."""
    return _shown(value, Dimension.POWER, digits)


def money(value: Any, currency: str) -> str:
    """An amount with thousands grouped, `38 400 EUR`; cents where there are any: `412.50 EUR`."""
    return _shown(value, Dimension.MONEY, 4, currency)


def number(value: Any, digits: int = 4) -> str:
    """A plain number."""
    return _shown(value, Dimension.DIMENSIONLESS, digits)


def places(value: float, decimals: int, sign: bool = False) -> str:
    """So many decimals, typeset: figures of a column, or of one unit, beside one another."""
    return typeset(to_places(value, decimals, sign))


def signed(value: float, digits: int = 4) -> str:
    """A plain number with its sign, typeset."""
    return typeset(figure_text.signed(value, digits))


def count(value: Any) -> str:
    """A whole number with thousands grouped."""
    amount = finite(value)
    return MISSING if amount is None else f"{amount:,.0f}".replace(",", "\N{NO-BREAK SPACE}")


def counted(some: int, noun: str) -> str:
    """`1 leg`, `12 legs`."""
    return f"{count(some)}\N{NO-BREAK SPACE}{noun}{'' if some == 1 else 's'}"


def share_of(some: int, whole: int) -> str:
    """`1 608 of 4 000`, which no line tears."""
    return f"{count(some)}\N{NO-BREAK SPACE}of\N{NO-BREAK SPACE}{count(whole)}"


def percent(fraction: Any, digits: int = 3) -> str:
    """0.124 as `12.4 %`."""
    amount = finite(fraction)
    if amount is None:
        return MISSING
    return typeset(figure_text.percent(amount, digits))


def times(factor: float) -> str:
    """`17 600 times`; from a thousand million on by a power of ten."""
    if factor >= 1e9:
        return typeset(f"{figure_text.to_power(factor, 3)} times")
    return f"{count(figure_text.rounded(factor, 3))}\N{NO-BREAK SPACE}times"


def in_unit(value: Any, unit: str, digits: int = 4) -> str:
    """A requirement's figure: lengths, times, masses and powers by their ladder, else as it is."""
    match unit:
        case "m":
            return length(value, digits)
        case "s":
            return time(value, digits)
        case "kg":
            return mass(value, digits)
        case "W":
            return power(value, digits)
        case "" | "1" | "ratio":
            return number(value, digits)
        case _:
            return money(value, unit)


def limit(row: Limited) -> str:
    """A requirement's limit as the spec has it, `0.30 m`; by its ladder where it has no unit."""
    written = limit_as_written(row.limit_written, row.limit, row.unit)
    return in_unit(row.limit, row.unit) if written is None else typeset(written)


def held(value: Any, row: Limited, digits: int = 4) -> str:
    """A figure that stands beside a requirement's limit, in the unit of that limit."""
    written, amount = limit_as_written(row.limit_written, row.limit, row.unit), finite(value)
    if written is None or amount is None:
        return in_unit(value, row.unit, digits)
    return typeset(beside(written, amount, row.unit, digits))


def error(value: Any, limit: Limited | None, digits: int = 4) -> str:
    """An error [m] in the unit of the limit that it is held against, where there is one."""
    return length(value, digits) if limit is None else held(value, limit, digits)


def nats(value: float, digits: int = 3) -> str:
    """A gain of likelihood, `160 000 nat`, typeset."""
    return typeset(figure_text.format_nats(value, digits))


_DIMENSIONS: Final = {
    "m": Dimension.LENGTH,
    "s": Dimension.TIME,
    "rad": Dimension.ANGLE,
    "m/s": Dimension.SPEED,
    "rad/s": Dimension.ANGULAR_RATE,
    "m/s^2": Dimension.ACCELERATION,
    "rad/s^2": Dimension.ANGULAR_ACCELERATION,
}


def si_quantity(value: Any, unit: str, digits: int = 4) -> str:
    """A figure in an SI unit by that unit's ladder; other units are appended as they are."""
    dimension = _DIMENSIONS.get(unit)
    if dimension is not None:
        return _shown(value, dimension, digits)
    return in_unit(value, unit, digits) if unit in ("", "kg", "W") else f"{number(value)} {unit}"


def with_uncertainty(value: float, uncertainty: float | None, unit: str) -> str:
    """An SI estimate and its standard uncertainty in one unit, `87.1 ± 0.3 ms`, typeset."""
    return typeset(format_estimate(value, uncertainty, unit))


def typeset(text: str) -> str:
    """A figure and its unit as pages print them: micro sign, minus, no break before the unit.

    A line may end between the two ends of an interval, so that none is torn where it is narrow.
    """
    for plain, printed in _TYPOGRAPHIC:
        text = text.replace(plain, printed)
    gap = "\N{NO-BREAK SPACE}"
    return text.replace(" ", gap).replace(f"{gap}to{gap}", f"{gap}to ")
