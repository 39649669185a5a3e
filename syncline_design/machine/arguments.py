"""What a caller of the Python functions hands in: refused by its name where it cannot be meant.

The commands refuse the same by their options.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import date, datetime
from numbers import Integral, Real
from pathlib import Path
from typing import Final, NoReturn

FALSE_ALARM_RATES: Final = (0.0005, 0.5)  # of a diagnosis
MOST_EFFECTS: Final = 20


def _refuse(name: str, expected: str, found: object) -> NoReturn:
    raise ValueError(f"{name}: expected {expected}, found {found!r}")


def whole(name: str, value: object, least: int, most: int | None = None) -> int:
    """A whole number, `least` or more; one of an array's too."""
    if isinstance(value, bool) or not isinstance(value, Integral) or int(value) < least:
        _refuse(name, f"a whole number of at least {least}", value)
    if most is not None and int(value) > most:
        _refuse(name, f"a whole number of at most {most}", value)
    return int(value)


def amount(name: str, value: object, low: float, high: float = math.inf) -> float:
    """A number between two others."""
    if isinstance(value, bool) or not isinstance(value, Real) or not low <= float(value) <= high:
        ends = f"of at least {low:g}" if high == math.inf else f"from {low:g} to {high:g}"
        _refuse(name, f"a number {ends}", value)
    return float(value)


def word(name: str, value: object, words: Sequence[str]) -> None:
    """One of these words."""
    if value not in words:
        _refuse(name, f"one of {', '.join(words)}", value)


def day(name: str, value: object) -> None:
    """A date, or None for the machine's."""
    if value is not None and (not isinstance(value, date) or isinstance(value, datetime)):
        _refuse(name, "a date of `datetime`", value)


def path(name: str, value: object) -> Path:
    """A path as text or as a Path."""
    if not isinstance(value, str | Path) or "\0" in str(value):
        _refuse(name, "a path", value)
    return Path(str(value))
