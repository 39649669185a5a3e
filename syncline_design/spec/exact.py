"""Figures of files as fractions: what a verdict is decided on, rounded only at the very end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from syncline_design.model.quantity import Quantity
from syncline_design.spec.timestamp_errors import (
    ConstantError,
    NormalError,
    TimestampError,
    UniformError,
)

ROOT_DIGITS = 60


def fraction_of(value: float) -> Fraction:
    """The exact figure as written, or the float itself."""
    return value.exact if isinstance(value, Quantity) else Fraction(value)


def square_root(value: Fraction) -> Fraction:
    """Square root to at least ROOT_DIGITS significant digits."""
    if value == 0:
        return Fraction(0)
    zeros = max(0, len(str(value.denominator // max(1, value.numerator))) // 2 + 1)
    scale = 10 ** (ROOT_DIGITS + zeros)
    return Fraction(math.isqrt(value.numerator * scale**2 // value.denominator), scale)


def norm(figures: float | Sequence[float], axes: int) -> Fraction:
    """Euclidean norm over the axes; one figure holds for each of them."""
    values = (figures,) * axes if isinstance(figures, float | int) else tuple(figures)
    return square_root(sum((fraction_of(v) ** 2 for v in values), Fraction(0)))


def travel_m(speed: Fraction, distance: Fraction, sound: Fraction) -> Fraction:
    """v 2 d / c [m], v the sum of what moves meanwhile: see model/underway.py."""
    return speed * 2 * distance / sound


def bend_of(acceleration: float | None, rate: float | None, echo: Fraction) -> Fraction:
    """a T^2 / 8, T = max(1 / rate, echo) [s] as far as both are told: see model/underway.py."""
    if acceleration is None:
        return Fraction(0)
    apart = echo if rate is None else max(1 / fraction_of(rate), echo)
    return fraction_of(acceleration) * apart**2 / 8


def tau_bound(error: TimestampError, coverage_factor: float) -> Fraction:
    """Bound of |mu| [s]: see timing.bound, here in fractions."""
    if error.bound is not None:
        return fraction_of(error.bound)
    values, spread = _values(error), Fraction(0)
    if isinstance(error, NormalError):
        spread = fraction_of(coverage_factor) * fraction_of(error.std)
    shift = remains = Fraction(0)
    if error.calibrated is not None:
        shift = sum(values, Fraction(0)) / len(values)
        remains = fraction_of(error.calibrated)
    return max(abs(value - shift) for value in values) + spread + remains


def _values(error: TimestampError) -> list[Fraction]:
    """Figures whose mean is that of the distribution and whose ends bound it (normal: the mean)."""
    if isinstance(error, UniformError):
        return [fraction_of(error.low), fraction_of(error.high)]
    if isinstance(error, NormalError):
        return [fraction_of(error.mean)]
    if isinstance(error, ConstantError):
        return [fraction_of(error.value)]
    return [fraction_of(value) for value in error.values or ()]
