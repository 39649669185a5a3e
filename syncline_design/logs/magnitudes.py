"""Figures that no vehicle, no sensor and no place on Earth has: a wrong unit or a broken file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.logs.columns import (
    ATTITUDE,
    POSITION,
    RANGING,
    RATE,
    REFERENCE,
    TARGET,
    VELOCITY,
    shown,
)
from syncline_design.logs.refusals import refuse
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits

MOST_SPEED_MPS = 2000.0
MOST_LENGTH_M = 1e8  # a quarter of the way to the Moon; Earth-centred coordinates stay below 1e7
DEG = 180.0 / np.pi
MOST_ANGLE_RAD = 2e6 * np.pi  # a heading may be counted on through many turns
MOST_RATE_RADPS = 2e3 * np.pi  # a thousand turns a second


@dataclass(frozen=True, slots=True)
class _Bound:
    """What the figures of some columns stay below, and what is said of one that does not."""

    names: tuple[str, ...]
    most: float
    unit: str
    problem: str
    per_si: float = 1.0  # `unit`s in an SI unit


BOUNDS = (
    _Bound(VELOCITY, MOST_SPEED_MPS, "m/s", "faster than any vehicle"),
    _Bound(RATE, MOST_RATE_RADPS, "deg/s", "turning faster than any vehicle", DEG),
    _Bound(RANGING[:1], MOST_LENGTH_M, "m", "farther than any sensor sees"),
    _Bound((*ATTITUDE, *RANGING[1:]), MOST_ANGLE_RAD, "deg", "an angle of a million turns", DEG),
    _Bound(POSITION, MOST_LENGTH_M, "m", "farther than any place on Earth"),
)
PLACES = _Bound((*REFERENCE, *TARGET), MOST_LENGTH_M, "m", "farther than any place on Earth")


def demand_possible(path: Path, columns: Mapping[str, Array], prefixes: Sequence[str]) -> None:
    """Refuse the first column with a figure that cannot be; squares of larger ones overflow."""
    for name, bound in _bounded(prefixes):
        values = columns.get(name)
        if values is None:
            continue
        largest = float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values)))
        if largest > bound.most:
            raise refuse(
                path,
                bound.problem,
                field=shown(name),
                expected=f"at most {to_digits(bound.most * bound.per_si, 2)} {bound.unit}",
                found=f"{to_digits(largest * bound.per_si, 4)} {bound.unit}",
                hint="is the unit in the column's name right?",
            )


def _bounded(prefixes: Sequence[str]) -> Iterator[tuple[str, _Bound]]:
    for prefix in prefixes:
        for bound in BOUNDS:
            yield from ((prefix + name, bound) for name in bound.names)
    yield from ((name, PLACES) for name in PLACES.names)
