"""From the figures that data sheets print to one standard deviation per axis: one table.

Errors are taken as normal and, where several axes stand behind one figure, as independent and
equal; `max` and `resolution` are read as the ends of a uniform distribution (GUM 4.3.7).  What a
source does not say is not made smaller: `unstated` and `typical` count as one sigma as printed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from syncline_design.model.figure_text import percent, to_places
from syncline_design.model.quantity import Dimension, Quantity, UnitError, parse_quantity


@dataclass(frozen=True, slots=True)
class Conversion:
    """One standard deviation per axis is `factor` times the printed figure; why, in words."""

    factor: float
    formula: str


def normal_quantile(p: float) -> float:
    """z with P(Z <= z) = p for a standard normal Z; dimensionless."""
    from statistics import NormalDist

    return NormalDist().inv_cdf(p)


def within(share: float) -> Conversion:
    """`95 %` on one axis: |error| <= figure with that probability.

    figure = z sigma, z = Phi^-1((1 + share) / 2).
    """
    z = normal_quantile((1.0 + share) / 2.0)
    return Conversion(
        1.0 / z, f"one axis, {percent(share, 6)} within the figure: / {to_places(z, 4)}"
    )


def circular(share: float) -> Conversion:
    """Circular error probable: the level error's length (Rayleigh) is below the figure.

    figure = sigma sqrt(-2 ln(1 - share)), sigma per axis.
    """
    k = math.sqrt(-2.0 * math.log1p(-share))
    return Conversion(
        1.0 / k, f"radius of a circle that holds {percent(share, 6)}: / {to_places(k, 4)}"
    )


# P(|r| <= k sigma) = 0.5 of three equal independent axes (Maxwell): k = sqrt(chi2^-1(0.5; 3)).
_SPHERICAL_50 = 1.5381722544550522
_HALF_NORMAL_50 = 0.6744897501960817  # Phi^-1(0.75)
_HALF_POWER = 2.0 * math.sqrt(2.0 * math.log(2.0))

_FIXED: Final[Mapping[str, Conversion]] = {
    "1 sigma": Conversion(1.0, "as printed"),
    "std": Conversion(1.0, "as printed"),
    "rms": Conversion(1.0, "as printed, on each axis"),
    "2 sigma": Conversion(1.0 / 2.0, "/ 2"),
    "3 sigma": Conversion(1.0 / 3.0, "/ 3"),
    "drms": Conversion(math.sqrt(0.5), "root mean square of the level distance: / sqrt(2)"),
    "2drms": Conversion(math.sqrt(0.125), "twice the drms: / (2 sqrt(2))"),
    "mrse": Conversion(math.sqrt(1.0 / 3.0), "root mean square of the distance: / sqrt(3)"),
    "sep50": Conversion(
        1.0 / _SPHERICAL_50, f"radius of a sphere that holds 50 %: / {to_places(_SPHERICAL_50, 4)}"
    ),
    "median": Conversion(
        1.0 / _HALF_NORMAL_50, f"half of all on one axis: / {to_places(_HALF_NORMAL_50, 4)}"
    ),
    "max": Conversion(math.sqrt(1.0 / 3.0), "ends of a uniform error, +/- figure: / sqrt(3)"),
    "resolution": Conversion(math.sqrt(1.0 / 12.0), "step of a uniform error: / sqrt(12)"),
    "beam width": Conversion(
        1.0 / _HALF_POWER, f"full width at half power of a Gaussian beam: / "
                           f"{to_places(_HALF_POWER, 4)}"
    ),
    "1/e2 width": Conversion(1.0 / 4.0, "full width at 1/e^2 of a Gaussian beam: / 4"),
    "typical": Conversion(1.0, "not stated more precisely: taken as one sigma"),
    "unstated": Conversion(1.0, "not stated: taken as one sigma"),
}  # fmt: skip
_SHARE = re.compile(r"([0-9]{1,2}(?:\.[0-9]+)?) %")
_CIRCLE = re.compile(r"cep([0-9]{2})")
# What else a figure may be that is no accuracy: a price, a mass, a range.
PLAIN_KINDS: Final = ("listed", "average", "nominal", "capability", "by type")


def conversion_of(kind: str) -> Conversion | None:
    """How a kind of figure becomes one sigma; None: it says nothing on that."""
    if kind in _FIXED:
        return _FIXED[kind]
    if circle := _CIRCLE.fullmatch(kind):
        return circular(int(circle[1]) / 100.0) if int(circle[1]) else None
    if share := _SHARE.fullmatch(kind):
        return within(float(share[1]) / 100.0) if float(share[1]) else None
    return None


def kinds() -> tuple[str, ...]:
    """The kinds that a figure may have; `NN %` and `cepNN` stand for every share."""
    return (*_FIXED, "95 %", "cep50", "cep95", *PLAIN_KINDS)


_PREFIX = re.compile(r"(?:<=?|\+/-|about|up to) +")
_SUM = re.compile(r" \+ (?=[0-9.])")


def printed_value(text: str, dimension: Dimension, over: float | None) -> float:
    """A printed figure in SI: `0.01 m`, `0.01 m + 1 ppm`, `0.5 %` (of a length `over`, in m).

    A ratio alone where an angle is due is that angle in radians: 1 % of the slant range across
    the line of sight is 0.01 rad.
    """
    parts = _SUM.split(_PREFIX.sub("", text, count=1))
    return sum(_part(part, dimension, over) for part in parts)


def _part(text: str, dimension: Dimension, over: float | None) -> float:
    unit = text.rpartition(" ")[2]
    if unit not in ("%", "ppm", "ppb"):
        return float(parse_quantity(text, dimension, tolerance=False))
    ratio: Quantity = parse_quantity(text, Dimension.RATIO, tolerance=False)
    if dimension is Dimension.ANGLE:
        return float(ratio)
    if over is None:
        raise UnitError("a share of a length that is not given", "over: 1 km or the like", text)
    return float(ratio) * over
