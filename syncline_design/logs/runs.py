"""Two runs in one file: stamps that start again, with the vehicle elsewhere at the same moments.

Rows out of order may just be the order of a file (one target after the other); then its pieces tell
of one motion.  Where they contradict each other, sorting would weave two motions into one.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array
from syncline_design.logs.columns import NED, TIME
from syncline_design.logs.refusals import refuse
from syncline_design.model.figure_text import to_digits

Index = NDArray[np.intp]
MOST_PIECES = 20  # of rising stamps; a file in more of them is shuffled, not a few runs
LEAST_ROWS = 10  # of one piece within the time of the other
ELSEWHERE = 5.0  # times the way between two rows; interpolation between these is closer by far
LEAST_M = 0.05
REACH = 3.0  # intervals of a piece across which its places are interpolated
WGS_84 = {"latitude_rad": 6.4e6, "longitude_rad": 6.4e6, "height_m": 1.0}  # m each, roughly


def pieces_of(stamps: Array) -> Index | None:
    """The number of the piece of rising stamps of every row; None where these are too many."""
    piece: Index = np.concatenate([[0], np.cumsum(stamps[1:] < stamps[:-1])]).astype(np.intp)
    return piece if piece[-1] < MOST_PIECES else None


def demand_one_run(path: Path, columns: Mapping[str, Array], order: Index, pieces: Index) -> None:
    """Refuse a file whose pieces put the vehicle at different places at the same moments.

    order: the file's row of each row of the columns; pieces: the piece of each, `pieces_of`.
    """
    stamps = columns[TIME]
    for place in _places(columns):
        known = np.all(np.isfinite(place), axis=1)
        rows = [np.flatnonzero(known & (pieces == k)) for k in np.unique(pieces)]
        for later in range(1, len(rows)):
            for earlier in range(later):
                a, b = rows[earlier], rows[later]
                apart = _apart(stamps[a], place[a], stamps[b], place[b])
                if apart is not None:
                    raise refuse(
                        path,
                        f"two runs in one file: the stamps start again in row {order[b].min() + 1}",
                        field=TIME,
                        expected="one run, or rows of one run in any order",
                        found=f"places {to_digits(apart, 3)} m apart at the same stamps",
                        hint="split the file there",
                    )


def _places(columns: Mapping[str, Array]) -> list[Array]:
    """The tracks (n, 2 or 3) that the columns hold, in metres or nearly so."""
    scales = {f"position_{axis}_m": 1.0 for axis in NED} | WGS_84
    found: dict[str, list[Array]] = {}
    for name, values in columns.items():
        for ending, scale in scales.items():
            if name.endswith(ending):
                found.setdefault(name.removesuffix(ending), []).append(values * scale)
    return [np.stack(track, axis=1) for track in found.values()]


def _apart(own: Array, place: Array, other: Array, there: Array) -> float | None:
    """How far the places of two pieces are apart [m], where that is too far for one motion."""
    own, first = np.unique(own, return_index=True)
    other, second = np.unique(other, return_index=True)
    place, there = place[first], there[second]
    if min(own.shape[0], other.shape[0]) < LEAST_ROWS:
        return None
    right = np.clip(np.searchsorted(own, other), 1, own.shape[0] - 1)
    near = own[right] - own[right - 1] <= REACH * np.median(np.diff(own))
    inside = (other >= own[0]) & (other <= own[-1]) & near
    if np.count_nonzero(inside) < LEAST_ROWS:
        return None
    at = np.stack([np.interp(other[inside], own, axis) for axis in place.T], axis=1)
    gap = float(np.median(np.linalg.norm(there[inside] - at, axis=1)))
    steps = [np.median(np.linalg.norm(np.diff(track, axis=0), axis=1)) for track in (place, there)]
    return gap if gap > max(LEAST_M, ELSEWHERE * float(max(steps))) else None
