"""Tables of the same columns, one after the other in time (a log cut by size), as one table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.logs.row_source import Clock, Mask, RowSource

Found = Mapping[str, tuple[str, float]]  # SI name -> the file's column, and its unit in SI


class TableParts:
    """The rows of several files in turn, under the column names and in the units of the first."""

    def __init__(
        self, sources: Sequence[RowSource], found: Sequence[Found], seconds: Sequence[Array]
    ) -> None:
        """seconds: the stamps of every part; found: what each part calls the columns."""
        self.parts = tuple(sources)
        self.path, self.header = sources[0].path, sources[0].header
        self.cut = 0  # of its own; each part has the line that it is cut off in
        self.notes = tuple(note for one in sources for note in one.notes)
        self._names = [_theirs(found[0], own) for own in found]
        self._seconds = list(seconds)
        self._starts = np.cumsum([0, *(one.shape[0] for one in seconds)]).tolist()

    def clock(self, name: str) -> Clock:
        """The stamps of all parts [s], whatever their column."""
        return Clock(np.concatenate(self._seconds), None)

    def numbers(self, names: Sequence[str], keep: Mask) -> dict[str, Array]:
        pieces: dict[str, list[Array]] = {name: [] for name in names}
        for part, theirs, (a, b) in zip(
            self.parts, self._names, pairwise(self._starts), strict=True
        ):
            called = {name: theirs.get(name, (name, 1.0)) for name in names}
            read = part.numbers(sorted({own for own, _ in called.values()}), keep[a:b])
            for name, (own, factor) in called.items():
                pieces[name].append(read[own] * factor)
        return {name: np.concatenate(several) for name, several in pieces.items()}

    def labels(self, name: str, keep: Mask) -> Array:
        return np.concatenate(
            [
                part.labels(theirs.get(name, (name, 1.0))[0], keep[a:b])
                for part, theirs, (a, b) in zip(
                    self.parts, self._names, pairwise(self._starts), strict=True
                )
            ]
        )


def _theirs(first: Found, own: Found) -> dict[str, tuple[str, float]]:
    """The first part's name of a column -> the part's own, and its unit in the first's."""
    return {name: (own[si][0], own[si][1] / factor) for si, (name, factor) in first.items()}


def parts_of(source: RowSource) -> tuple[RowSource, ...]:
    """The files that a source is made of."""
    return source.parts if isinstance(source, TableParts) else (source,)


def in_turn(
    columns: Sequence[frozenset[str]], spans: Callable[[int], tuple[float, float]]
) -> list[list[int]]:
    """Which files are parts of one, in the order of time; the others alone, all as they were given.

    columns: of each file; spans: first and last stamp of one.  Files of the same columns that
    overlap are no parts of one another.
    """
    groups: dict[frozenset[str], list[int]] = {}
    for k, own in enumerate(columns):
        groups.setdefault(own, []).append(k)
    found: list[list[int]] = []
    for group in groups.values():
        if len(group) > 1:
            ordered = sorted(group, key=spans)
            if all(spans(a)[1] <= spans(b)[0] for a, b in pairwise(ordered)):
                found.append(ordered)
                continue
        found += [[k] for k in group]
    return sorted(found, key=min)
