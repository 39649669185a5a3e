"""Which rows of a file are worked on: in rising time, and of a very long log windows of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array
from syncline_design.logs.columns import TIME
from syncline_design.logs.refusals import refuse
from syncline_design.logs.runs import pieces_of
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits

MOST_KEPT = 500_000  # rows of one file that are held in memory
WINDOWS = 40
LONGEST_S = 1e8  # a log longer than three years has its stamps in the wrong unit
LARGEST = 4  # times as many rows in windows as there should be are one stamp's
BACKWARDS = 0.9  # share of the steps: the file was written from its end
STRAY = 0.01  # share of rows out of order up to which they are strays, and not the file's order
MARGIN_S, MARGIN_STEPS = 2.0, 3.0  # beyond a window, of files that are interpolated

Index = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Arranged:
    """Rows of one file by rising stamp.

    order (m,): rows of the file; stamps (m,) [s]; rows: of the file; rejected: left out, by
    reason; thinned: left out because the log is too long; pieces (m,): of rising stamps, of a file
    that was put in order and has few.
    """

    path: Path
    order: Index
    stamps: Array
    rows: int
    rejected: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    thinned: int = 0
    pieces: Index | None = None

    def part(self, keep: NDArray[np.bool_]) -> Arranged:
        """Some of the rows; the others count as thinned."""
        left = int(keep.shape[0] - np.count_nonzero(keep))
        pieces = None if self.pieces is None else self.pieces[keep]
        return replace(
            self, order=self.order[keep], stamps=self.stamps[keep], thinned=left, pieces=pieces
        )


def arranged(path: Path, stamps: Array) -> Arranged:
    """Rows with a stamp in rising time; refuses a time column that makes no sense.

    A few rows whose stamps jump are stamp faults and left out.  Many are the order of the file
    (one target after the other, parts of a log): they are put in the order of their stamps.
    """
    order = np.flatnonzero(np.isfinite(stamps))
    rejected: dict[str, int] = {}
    if order.shape[0] < stamps.shape[0]:
        rejected["no time stamp"] = int(stamps.shape[0] - order.shape[0])
    finite = stamps[order]
    _demand_sense(path, finite)
    stray = _strays(finite)
    notes: tuple[str, ...] = ()
    pieces: Index | None = None
    count = int(np.count_nonzero(stray))
    if 0 < count <= max(1.0, STRAY * finite.shape[0]):
        rejected["stamp out of order"] = count
        order, finite = order[~stray], finite[~stray]
    elif count:
        notes = (f"{path.name}: rows are not in order of their stamps and were put in order",)
        pieces = pieces_of(finite)
    if count:
        rising = np.argsort(finite, kind="stable")
        order, finite = order[rising], finite[rising]
        pieces = None if pieces is None else pieces[rising]
    return Arranged(path, order, finite, int(stamps.shape[0]), rejected, notes, pieces=pieces)


def _demand_sense(path: Path, finite: Array) -> None:
    if finite.shape[0] < 2:
        if not finite.shape[0]:
            raise refuse(path, "no time stamps", field=TIME, found="empty column")
        raise refuse(path, "one time stamp only", field=TIME, expected="two or more")
    back = int(np.count_nonzero(finite[1:] < finite[:-1]))
    if back > BACKWARDS * (finite.shape[0] - 1):  # half of them is a file in no order at all
        raise refuse(path, "time runs backwards", field=TIME, hint="reverse the rows")
    if finite.max() == finite.min():
        raise refuse(
            path, "time stands still", field=TIME, found=f"{to_digits(finite[0], 9)} s throughout"
        )
    length = float(finite.max() - finite.min())
    if length > LONGEST_S:
        raise refuse(
            path,
            "the log is years long",
            field=TIME,
            found=f"{to_digits(length, 3)} s",
            hint="are the stamps in nanoseconds? Then call the column time_ns",
        )


def _strays(stamps: Array) -> NDArray[np.bool_]:
    """Rows to leave out so that stamps never fall: the late or the early ones, if these are fewer.

    Late: before one that came earlier.  Early: after one that comes later.
    """
    late = np.zeros(stamps.shape[0], dtype=bool)
    early = np.zeros(stamps.shape[0], dtype=bool)
    late[1:] = stamps[1:] < np.maximum.accumulate(stamps)[:-1]
    early[:-1] = stamps[:-1] > np.minimum.accumulate(stamps[::-1])[::-1][1:]
    return late if np.count_nonzero(late) <= np.count_nonzero(early) else early


def thinned(files: Sequence[Arranged], most: int = MOST_KEPT) -> list[Arranged]:
    """The files, or where one has more than `most` rows, the same windows of time of all."""
    largest = max(files, key=lambda one: one.stamps.shape[0])
    if largest.stamps.shape[0] <= most:
        return list(files)
    low = max(float(one.stamps[0]) for one in files)
    high = min(float(one.stamps[-1]) for one in files)
    inside = largest.stamps[(largest.stamps >= low) & (largest.stamps <= high)]
    inside = inside if inside.shape[0] else largest.stamps
    count = 1 if inside.shape[0] <= most else WINDOWS
    length = min(most, inside.shape[0]) // count
    first = np.linspace(0, inside.shape[0] - length, count).astype(np.intp)
    lows, highs = inside[first], inside[first + length - 1]
    return [_part(one, lows, highs, one is not largest, most) for one in files]


def _part(one: Arranged, lows: Array, highs: Array, wider: bool, most: int) -> Arranged:
    found = one.part(_within(one, lows, highs, wider))
    if found.stamps.shape[0] > LARGEST * most:  # windows end with a stamp, however many rows it has
        still = f"{found.stamps.shape[0]} rows at {np.unique(found.stamps).shape[0]} stamps"
        raise refuse(one.path, "time stands still", field=TIME, found=still)
    return found


def _within(one: Arranged, lows: Array, highs: Array, wider: bool) -> NDArray[np.bool_]:
    """Rows whose stamps lie in a window, with a margin where the file is interpolated."""
    margin = 0.0
    if wider:
        step = float(np.median(np.diff(one.stamps)))
        margin = max(MARGIN_S, MARGIN_STEPS * step)
    first = np.searchsorted(one.stamps, lows - margin, side="left")
    after = np.searchsorted(one.stamps, highs + margin, side="right")
    keep = np.zeros(one.stamps.shape[0], dtype=bool)
    for a, b in zip(first.tolist(), after.tolist(), strict=True):
        keep[a:b] = True
    return keep
