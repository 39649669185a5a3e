"""Noise by range and by angle, read off its rows anew for the recheck."""

from __future__ import annotations

import bisect
import math
from decimal import Decimal
from fractions import Fraction
from typing import Any


def bends(sigma: Any) -> list[Decimal]:
    """Ranges [m] of the rows of a table by range; none of a plain figure."""
    if getattr(sigma, "of", None) != "range":
        return []
    return [_decimal(place) for place, _ in sigma.rows]


def sigma_at(sigma: Any, distance: Decimal, look: Any) -> Decimal | None:
    """A table at a distance [m], or its largest figure where a stage looks; None of plain figures.

    By range the line through two neighbouring rows, the last two beyond, the first row's figure
    before it.  By angle from straight down, which is an elevation of -90 deg: the largest of the
    rows inside and of the line at both ends, the outermost rows beyond.
    """
    kind = getattr(sigma, "of", None)
    if kind is None:
        return None
    places = [_decimal(place) for place, _ in sigma.rows]
    values = [_decimal(value) for _, value in sigma.rows]
    if kind == "range":
        return _line(places, values, distance)
    elevation = getattr(look, "elevation", None)
    if elevation is None:
        return max(values)
    ends = [Decimal(end) + Decimal(math.pi / 2.0) for end in (elevation.low, elevation.high)]
    inside = [v for p, v in zip(places, values, strict=True) if ends[0] <= p <= ends[1]]
    at_ends = (_line(places, values, min(end, places[-1])) for end in ends)
    return max([*inside, *at_ends])


def _line(places: list[Decimal], values: list[Decimal], at: Decimal) -> Decimal:
    if len(places) == 1 or at <= places[0]:
        return values[0]
    right = min(bisect.bisect_left(places, at), len(places) - 1)
    slope = (values[right] - values[right - 1]) / (places[right] - places[right - 1])
    return values[right] + slope * (at - places[right])


def _decimal(value: Fraction) -> Decimal:
    return Decimal(value.numerator) / Decimal(value.denominator)
