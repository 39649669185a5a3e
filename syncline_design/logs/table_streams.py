"""A table whose columns have names that the spec explains: listed as recordings are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from syncline_design.logs.cells import NO_TIME
from syncline_design.logs.columns import TIME, known_names, si_columns
from syncline_design.logs.readers.stream import (
    UNSET,
    Incomplete,
    Nanoseconds,
    Piece,
    Stamps,
    Stream,
)
from syncline_design.logs.refusals import refuse
from syncline_design.logs.row_source import NANOSECONDS, RowSource
from syncline_design.logs.sources import opened
from syncline_design.spec.load import BadInput


class NamedTable:
    """One file as one stream, without samples: `diagnose` reads its rows by their names."""

    def __init__(self, source: RowSource, stream: Stream, incomplete: Incomplete | None) -> None:
        self.path: Path = source.path
        self.format = "table"
        self.incomplete = incomplete
        self._stream = stream

    def streams(self) -> tuple[Stream, ...]:
        return (self._stream,)

    def samples(self, name: str) -> Iterator[Piece]:
        raise refuse(self.path, f"{name} is read by the names of its columns")


def named_table(path: Path, mapping: Mapping[str, str], stages: Sequence[str]) -> NamedTable | None:
    """A file with a column of times by the spec's names; None of what is none."""
    try:
        source = opened(path)
    except BadInput:
        return None
    found = si_columns(source.header, mapping, known_names(stages))
    if TIME not in found or len(found) < 2:
        return None
    name, factor = found[TIME]
    clock = source.clock(name)
    calendar = clock.nanoseconds is not None
    stamps: Nanoseconds = np.zeros(0, dtype=np.int64)
    if clock.nanoseconds is not None:
        stamps = np.where(clock.nanoseconds == NO_TIME, UNSET, clock.nanoseconds)
    elif clock.seconds is not None:
        scaled = clock.seconds * (1.0 if clock.spans else factor) * NANOSECONDS
        held = np.abs(scaled) < 2.0**63  # of NaN too: no
        stamps = np.where(held, np.round(np.where(held, scaled, 0.0)).astype(np.int64), UNSET)
    rows = int(stamps.shape[0])
    cut = Incomplete(f"cut off in line {source.cut}", rows) if source.cut else None
    stream = Stream(
        name=path.stem,
        quantity=(),
        messages=rows,
        stamps=Stamps(name, None, stamps),
        timeline="utc" if calendar else "unknown",
        partial=cut is not None,
        notes=("its columns are read by the names that the spec gives them",),
        kind="table",
        columns=tuple(sorted(si for si in found if si != TIME)),
    )
    return NamedTable(source, stream, cut)
