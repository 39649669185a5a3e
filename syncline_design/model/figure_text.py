"""Figures as text for people: the one place that rounds; `report/numbers` typesets what it says."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction

from syncline_design.model.unit_table import DEG, LADDERS, UNITS, Dimension

# units of an estimate and what one of each is in SI, largest first
_ESTIMATE_LADDERS: dict[str, tuple[tuple[str, float], ...]] = {
    "s": (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)),
    "m": (("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("um", 1e-6)),
    "rad": (("deg", math.pi / 180.0),),
    "rad/s": (("deg/s", math.pi / 180.0), ("deg/h", math.pi / 648e3)),
    "m/(m/s2)": (("m/(m/s2)", 1.0), ("mm/(m/s2)", 1e-3)),
    "": (("", 1.0), ("ppm", 1e-6)),
}
_VECTORS = (("x", "y", "z"), ("north", "east", "down"), ("roll", "pitch", "yaw"))  # first words
_LEAST_SHARE = 1e-6  # that is told as a figure


def format_quantity(
    si_value: float, dimension: Dimension, digits: int = 4, currency: str = "EUR"
) -> str:
    """`2.5 ms` for 0.0025 s: the largest unit that leaves a figure of 1 or more, `digits` figures.

    The figure is rounded before the unit is picked, so 999.96 us reads 1 ms.  Money keeps two
    decimals at most and groups thousands by a space; infinity reads `unlimited`.
    """
    if not math.isfinite(si_value):
        return _not_finite(si_value)
    if dimension is Dimension.MONEY:
        return f"{si_value:,.2f}".removesuffix(".00").replace(",", " ") + f" {currency}"
    if dimension is Dimension.DIMENSIONLESS:
        return to_digits(si_value, digits)
    ladder = LADDERS[dimension]
    chosen = ladder[-1] if si_value == 0.0 else ladder[0]
    for unit in ladder:
        scaled = abs(si_value) / float(UNITS[unit][1])
        if float(f"{scaled:.{digits - 1}e}") >= 1.0:
            chosen = unit
    if si_value == 0.0:
        chosen = next(u for u in reversed(ladder) if UNITS[u][1] in (1, DEG, Fraction(1, 10**6)))
    return f"{to_digits(si_value / float(UNITS[chosen][1]), digits)} {chosen}"


def format_like(written: str, si_value: float, digits: int = 4) -> str:
    """A figure in the unit in which another one was written: `0.04 deg` beside `0.05 deg +/- 20 %`.

    Text without a known unit gives the bare figure.
    """
    parts = written.replace("\N{MICRO SIGN}", "u").split()
    unit = next((part for part in parts if part in UNITS and part != "%"), None)
    if unit is None:
        return to_digits(si_value, digits)
    return f"{to_digits(si_value / float(UNITS[unit][1]), digits)} {unit}"


def format_duration(duration_s: float) -> str:
    """`1.5 h`, `100 s`, `100 min`: the first of h, min and s that gives a short multiple of a half.

    Else in the largest of them that is reached, to four figures; below a second as other times.
    """
    units = [one for one in (("h", 3600.0), ("min", 60.0), ("s", 1.0)) if duration_s >= one[1]]
    for unit, size in units:
        if (duration_s / size) % 0.5 == 0.0 and duration_s < 1e4 * size:
            return f"{to_digits(duration_s / size)} {unit}"
    if not units:
        return format_quantity(duration_s, Dimension.TIME)
    unit, size = units[0]
    return f"{to_digits(duration_s / size, 4)} {unit}"


def format_estimate(value: float, uncertainty: float | None = None, unit: str = "") -> str:
    """`87.1 ± 0.3 ms`: the uncertainty to one or two figures (GUM 7.2.6), the value to the same
    place, both in the unit that reads best for the larger of them.
    """
    return _estimate(value, uncertainty, *_rung(_larger(value, uncertainty), unit))


def _larger(value: float, uncertainty: float | None) -> float:
    """What decides the unit of both: a value within its uncertainty says no more than that."""
    known = uncertainty is not None and math.isfinite(uncertainty)
    return max(abs(value), uncertainty) if known and uncertainty else abs(value)


def _estimate(value: float, uncertainty: float | None, name: str, scale: float) -> str:
    shown = value / scale
    if uncertainty is None or not uncertainty > 0.0 or not math.isfinite(uncertainty):
        return f"{to_digits(shown, 4)} {name}".strip()
    spread = uncertainty / scale
    places = _places(spread)
    return f"{to_places(shown, places)} ± {to_places(spread, places)} {name}".strip()


def _places(spread: float) -> int:
    """Decimals that an uncertainty is told to: two figures of 1.0 to 2.9, else one."""
    mantissa, exponent = f"{spread:.1e}".split("e")
    return max(0, (1 if float(mantissa) < 3.0 else 0) - int(exponent))


def format_interval(
    value: float, uncertainty: float, ends: tuple[float, float], unit: str = ""
) -> str:
    """`1.35 ms to 1.74 ms`: the ends of an interval in the unit and to the place in which
    `format_estimate` tells the value; without an uncertainty to four figures each."""
    name, scale = _rung(_larger(value, uncertainty), unit)
    spread = uncertainty / scale
    known = spread > 0.0 and math.isfinite(spread)
    texts = [to_places(end / scale, _places(spread)) if known else to_digits(end / scale, 4)
             for end in ends]  # fmt: skip
    return " to ".join(f"{text} {name}".strip() for text in texts)


def format_estimates(
    column: Sequence[tuple[float, float | None]], unit: str = ""
) -> tuple[str, ...]:
    """Values with their uncertainties in one unit, that of the largest, to be compared."""
    name, scale = _rung(max((_larger(*one) for one in column), default=0.0), unit)
    return tuple(_estimate(value, spread, name, scale) for value, spread in column)


def format_components(
    figures: Mapping[str, tuple[float, float | None, str]],
) -> dict[str, str]:
    """Parameters (value, uncertainty, unit) by name; the components of one vector in the unit of
    its largest: `-0.16 ± 0.21 cm forward, 17.67 ± 0.28 cm right`."""
    shown = {name: format_estimate(*one) for name, one in figures.items()}
    for axes in _VECTORS:
        parts = [name for name in figures if name.split("_")[0] in axes]
        units = {figures[name][2] for name in parts}
        if len(units) == 1:
            told = format_estimates([figures[name][:2] for name in parts], units.pop())
            shown |= zip(parts, told, strict=True)
    return shown


def _rung(size: float, unit: str) -> tuple[str, float]:
    ladder = _ESTIMATE_LADDERS.get(unit, ((unit, 1.0),))
    for name, scale in ladder:
        if size >= scale:
            return name, scale
    return ladder[-1] if size > 0.0 else ladder[0]


def to_digits(value: float, digits: int = 6) -> str:
    """`digits` significant figures without exponent where that stays readable, zeros trimmed."""
    if not math.isfinite(value):
        return _not_finite(value)
    rounded = float(f"{value:.{digits - 1}e}")
    if rounded == 0.0:
        return "0"
    power = math.floor(math.log10(abs(rounded)))
    if not -4 <= power < 9:
        mantissa, exponent = f"{rounded:.{digits - 1}e}".split("e")
        return f"{_trimmed(mantissa)}e{exponent}"
    text = f"{rounded:.{max(0, digits - 1 - power)}f}"
    return _trimmed(text)


def to_power(value: float, digits: int = 2) -> str:
    """`digits` significant figures and a power of ten: `1.1e+05`."""
    return f"{value:.{digits - 1}e}" if math.isfinite(value) else _not_finite(value)


def _trimmed(text: str) -> str:
    return text.rstrip("0").rstrip(".") if "." in text else text


def _not_finite(value: float) -> str:
    if math.isnan(value):
        return "not a number"
    return "unlimited" if value > 0 else "-unlimited"


def signed(value: float, digits: int = 6) -> str:
    """The same with its sign, `+0.5`; 0 has none."""
    text = to_digits(value, digits)
    return text if text == "0" or text.startswith(("-", "n", "u")) else f"+{text}"


def rounded(value: float, digits: int) -> float:
    """A value to so many significant figures."""
    return float(f"{value:.{digits}g}")


def to_places(value: float, places: int, sign: bool = False) -> str:
    """So many decimals, zeros kept: figures of a column, or of one unit, beside one another."""
    if not math.isfinite(value):
        return _not_finite(value)
    return f"{value:{'+' if sign else ''}z.{places}f}"  # z: what rounds to zero has no sign


def format_chance(log10_p: float | None) -> str:
    """`3e-05`: a chance by its decimal logarithm, to one figure; None: none at all."""
    if log10_p is None or log10_p <= -300.0:
        return "less than 1e-300"
    power = math.floor(log10_p)
    digit = round(10.0 ** (log10_p - power))
    return f"{digit}e{power:03d}" if digit < 10 else f"1e{power + 1:03d}"


def grouped(count: int) -> str:
    """`10 000`: a whole number with thousands grouped."""
    return f"{count:,}".replace(",", " ")


def format_nats(nats: float, digits: int | None = None) -> str:
    """`13 436.0 nat`: thousands grouped; one decimal, or so many significant figures."""
    text = to_places(nats, 1) if digits is None else to_digits(nats, digits)
    whole, point, rest = text.partition(".")
    if whole.isdigit():
        whole = grouped(int(whole))
    return f"{whole}{point}{rest} nat"


def percent(share: float, digits: int = 3) -> str:
    """0.124 as `12.4 %`; what would need an exponent as `< 0.0001 %`."""
    if 0.0 < abs(share) < _LEAST_SHARE:
        least = to_digits(100.0 * _LEAST_SHARE)
        return f"< {least} %" if share > 0.0 else f"> -{least} %"
    return f"{to_digits(100.0 * share, digits)} %"
