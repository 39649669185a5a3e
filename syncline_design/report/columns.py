"""Figures of a column as they are compared: of one unit to the same place, else to as many digits.

A figure for itself drops its zeros, `1 cm`; below `1.414 cm` it reads `1.000 cm`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Sequence
from dataclasses import replace
from typing import Final

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_places
from syncline_design.model.unit_table import UNITS, Dimension
from syncline_design.report.numbers import Limited, error, typeset

MORE_DIGITS: Final = 1  # of the largest figure of a column; beyond, each has a place of its own
SUMS: Final = (Dimension.MASS, Dimension.POWER)
_WORDED: Final = (" to spare", " over")  # behind a margin
_SPACE: Final = "\N{NO-BREAK SPACE}"
_FIGURE: Final = re.compile(
    r"(?P<number>[\u2212+]?\d+(?:\u00a0\d{3})*(?:\.(?P<decimals>\d+))?)(?:\u00a0(?P<unit>\S+))?"
)


@dataclass(frozen=True, slots=True)
class _Figure:
    """A figure as a cell shows it, and what it is in that unit to all digits."""

    value: float
    unit: str
    decimals: int
    sign: bool

    @property
    def power(self) -> int:
        """Of ten, of its first digit as it is shown."""
        shown = abs(round(self.value, self.decimals))
        return math.floor(math.log10(shown)) if shown else 0

    @property
    def kind(self) -> Hashable:
        """What it may be compared with."""
        known = UNITS.get(_plain(self.unit))
        return self.unit if known is None else known[0]

    def to(self, decimals: int) -> str:
        """Its text with so many decimals."""
        whole, point, rest = to_places(self.value, decimals, self.sign).partition(".")
        if self.is_money and len(whole.lstrip("+-")) > 3:
            whole = f"{int(whole):+,}" if self.sign else f"{int(whole):,}"
            whole = whole.replace(",", " ")
        return typeset(f"{whole}{point}{rest} {self.unit}".strip())

    @property
    def is_money(self) -> bool:
        """An amount of a currency: to the cent or to the whole."""
        return len(self.unit) == 3 and self.unit.isupper()


def alike(column: Sequence[tuple[str, float | None]]) -> list[str]:
    """The figures of a column, text and value [SI], each with as many decimals as others need.

    Figures of one dimension and one unit are given to the same place; where that would be too many
    digits, and where units differ, to the same number of digits.  What has no value, and what is
    no plain figure, stays as it is.
    """
    figures = [_figure_of(text, value) for text, value in column]
    found = [text for text, _ in column]
    for kind in dict.fromkeys(one.kind for one in figures if one is not None):
        together = {k: one for k, one in enumerate(figures) if one is not None and one.kind == kind}
        shown = _in_one_unit(list(together.values()))
        for k, one, decimals in zip(together, shown, _decimals(shown), strict=True):
            if one != figures[k] or decimals > one.decimals:
                found[k] = one.to(max(decimals, one.decimals))
    return found


def padded(column: Sequence[str]) -> list[str]:
    """The same of texts alone, rounded alike: those that lost zeros get them back."""
    figures = [_read(text) for text in column]
    found = list(column)
    for kind in dict.fromkeys(one.kind for one in figures if one is not None):
        together = [(k, one) for k, one in enumerate(figures) if one and one.kind == kind]
        alone = [one for _, one in together]
        most = max(one.decimals for one in alone)
        wanted = [most] * len(alone) if alone[0].is_money else _by_digits(alone)
        for (k, one), decimals in zip(together, wanted, strict=True):
            found[k] = one.to(decimals)
    return found


def worded(column: Sequence[str]) -> list[str]:
    """The same of figures with a word: margins (`7.90 % to spare`), intervals (`0.32 m to 1.40 m`).

    What is neither stays as it is.
    """
    parts = [_ends(text) for text in column]
    again = iter(padded([end for ends, _ in parts for end in ends]))
    shown = [(" to ".join([next(again) for _ in ends]), word) for ends, word in parts]
    return [
        figures + word if figures else text
        for text, (figures, word) in zip(column, shown, strict=True)
    ]


def _ends(text: str) -> tuple[list[str], str]:
    """The figures of a margin or of an interval, and the word behind; none of another text."""
    word = next((end for end in _WORDED if text.endswith(end)), "")
    ends = text.removesuffix(word).split(" to ")
    known = len(ends) == (1 if word else 2) and all(map(_FIGURE.fullmatch, ends))
    return (ends, word) if known else ([], "")


def _in_one_unit(together: Sequence[_Figure]) -> Sequence[_Figure]:
    """Masses and powers, which add up, in the unit of the largest; others as they are."""
    units = {one.unit: float(UNITS[_plain(one.unit)][1]) for one in together if one.kind in SUMS}
    if len(units) < 2:
        return together
    largest = max(together, key=lambda one: abs(one.value) * units[one.unit]).unit
    found = []
    for one in together:
        smaller = units[one.unit] / units[largest]
        value, decimals = one.value * smaller, one.decimals - round(math.log10(smaller))
        while decimals > 0 and round(value, decimals) == round(value, decimals - 1):
            decimals -= 1  # of `500 mW` no digit is lost as `0.5 W`
        found.append(_Figure(value, largest, max(0, decimals), one.sign))
    return found


def _decimals(together: Sequence[_Figure]) -> list[int]:
    """How many decimals each of these figures takes; nothing at all is `0 W`, whatever the rest."""
    shown = [one for one in together if one.value or one.is_money]
    found = iter(_of_amounts(shown) if shown else [])
    return [next(found) if one.value or one.is_money else 0 for one in together]


def _of_amounts(together: Sequence[_Figure]) -> list[int]:
    most = max(one.decimals for one in together)
    if not most or not any(one.value for one in together):
        return [most] * len(together)
    digits = max(map(_digits, together))
    if len({one.unit for one in together}) == 1:
        largest = max(one.power for one in together if one.value)
        if together[0].is_money or largest + 1 + most <= digits + MORE_DIGITS:
            return [most] * len(together)
    return _by_digits(together)


def _by_digits(together: Sequence[_Figure]) -> list[int]:
    """Decimals that give each figure as many significant digits."""
    digits = max(map(_digits, together))
    return [max(one.decimals, digits - 1 - one.power) if one.value else 0 for one in together]


def _digits(one: _Figure) -> int:
    """Significant digits that are shown; of a whole number those that are surely meant."""
    return one.power + 1 + one.decimals if one.decimals else 1


def _figure_of(text: str, value: float | None) -> _Figure | None:
    """What a text shows where that is one figure, its value known in SI or as it stands."""
    shown = _read(text)
    if shown is None or value is None or not math.isfinite(value):
        return None
    known = UNITS.get(_plain(shown.unit))
    exact = value if known is None else value / float(known[1])
    if abs(exact - shown.value) > 0.5000001 * 10.0**-shown.decimals:
        return None
    return replace(shown, value=exact)


def _read(text: str) -> _Figure | None:
    """A text that is one figure, as far as it shows it."""
    found = _FIGURE.fullmatch(text)
    if found is None:
        return None
    number = found["number"]
    shown = float(number.replace(_SPACE, "").replace("\N{MINUS SIGN}", "-"))
    return _Figure(shown, found["unit"] or "", len(found["decimals"] or ""), number[0] == "+")


def _plain(unit: str) -> str:
    return unit.replace("\N{MICRO SIGN}", "u").replace("\N{SUPERSCRIPT TWO}", "^2")


def errors(values_m: Sequence[float], limit: Limited | None, digits: int = 4) -> list[str]:
    """Errors [m] that stand below one another, in the unit of their limit where there is one."""
    return alike([(error(value, limit, digits), value) for value in values_m])
