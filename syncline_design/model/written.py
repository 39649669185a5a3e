"""Figures in the unit that someone wrote beside them: a value as `0.2945 m` where its limit is
`0.30 m`."""

from __future__ import annotations

from typing import Final

from syncline_design.model.figure_text import format_like, format_quantity
from syncline_design.model.quantity import Dimension, UnitError, parse_quantity

DIMENSIONS: Final = {"m": Dimension.LENGTH, "kg": Dimension.MASS, "W": Dimension.POWER}
_LEAST, _MOST = 1e-4, 1e5  # of the written unit: beyond them the ladder reads better


def limit_as_written(written: str | None, limit: float, unit: str) -> str | None:
    """The text of a limit [SI unit] where it says that limit, `0.30 m`.

    A file of results may hold any text there: what does not say the limit is not shown.
    """
    dimension = DIMENSIONS.get(unit)
    if written is None or dimension is None:
        return None
    try:
        read = parse_quantity(written, dimension, tolerance=False)
    except UnitError:
        return None
    return " ".join(read.text.split()) if float(read) == limit else None


def beside(written: str, value: float, unit: str, digits: int = 4) -> str:
    """A figure [SI unit] in the unit of the text `written`.

    By its ladder where that would make it unreadable: below a ten-thousandth of the unit, and from
    a hundred thousand on.
    """
    dimension = DIMENSIONS[unit]
    one = float(parse_quantity(f"1 {written.split()[1]}", dimension))
    if value and not _LEAST <= abs(value) / one < _MOST:
        return format_quantity(value, dimension, digits)
    return format_like(written, value, digits)
