"""Files to columns of floats in SI; nothing here knows what the columns mean."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cache
from pathlib import Path

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.logs.cells import NO_TIME, StampArray
from syncline_design.logs.columns import (
    TARGET_ID,
    TIME,
    headings,
    known_names,
    named_column,
    passed_over,
    rivals,
    si_columns,
)
from syncline_design.logs.refusals import refuse
from syncline_design.logs.row_choice import Arranged, arranged, thinned
from syncline_design.logs.row_source import NANOSECONDS, Clock, Mask, RowSource
from syncline_design.logs.runs import demand_one_run
from syncline_design.logs.sources import opened
from syncline_design.logs.surveys import Survey, has_places, is_survey, joined, survey_of
from syncline_design.logs.table_parts import TableParts, in_turn, parts_of
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import format_estimate
from syncline_design.model.quantity import si_name, suffix_unit
from syncline_design.spec.fields import did_you_mean
from syncline_design.spec.load import BadInput

DAY = 86_400 * NANOSECONDS
UNLIKE = 0.002  # rad, or share of the usual figure, by which a quantity given twice differs
CUT_OFF = "cut off in the last row"
CALENDAR = "calendar"  # files whose times are a calendar's, and no parts of those that count
Slip = tuple[Sequence[str], float]  # files with one of these columns have stamps ahead by so much


@dataclass(frozen=True, slots=True)
class LogTable:
    """One file: SI name -> values (n,) by rising stamp, with NaN where a value is missing.

    rows: of the file; rejected: left out of these, by reason; thinned: left out as too many.
    since_s: the midnight (UTC) that calendar times count from [s since 1970]; 0 of plain numbers.
    """

    path: Path
    columns: Mapping[str, Array]
    header: tuple[str, ...]
    notes: tuple[str, ...] = ()
    rows: int = 0
    rejected: Mapping[str, int] = field(default_factory=dict)
    thinned: int = 0
    since_s: float = 0.0

    def __len__(self) -> int:
        return int(self.columns[TIME].shape[0])


@dataclass(frozen=True, slots=True)
class _Open:
    """A file whose time column has been read.

    day: nanoseconds since 1970 of the midnight (UTC) that its seconds count from; None for numbers.
    """

    source: RowSource
    found: Mapping[str, tuple[str, float]]
    seconds: Array
    day: int | None
    notes: tuple[str, ...]
    rivals: tuple[tuple[str, str], ...] = ()


def read_tables(
    given: Sequence[Path | RowSource],
    mapping: Mapping[str, str],
    stages: tuple[str, ...],
    slip: Slip = ((), 0.0),
) -> list[LogTable]:
    """Read files that belong together; raises BadInput."""
    sources = [opened(one) if isinstance(one, Path) else one for one in given]
    surveys = _surveys(sources, mapping, stages)
    surveyed = {one.path for one in surveys}
    sources = [one for one in sources if one.path not in surveyed]
    files = [_opened(source, mapping, stages) for source in sources]
    known = {name for one in surveys for name in one.header}
    files = _one_run(_on_one_scale(_with_absent(files, mapping, known)))
    names, ahead_s = slip
    stamps = [
        f.seconds - ahead_s if ahead_s and any(n in f.found for n in names) else f.seconds
        for f in files
    ]
    rows = [arranged(f.source.path, s) for f, s in zip(files, stamps, strict=True)]
    tables = [_table(f, chosen) for f, chosen in zip(files, thinned(rows), strict=True)]
    return _with_targets(tables, surveys)


def _surveys(
    sources: Sequence[RowSource], mapping: Mapping[str, str], stages: tuple[str, ...]
) -> list[Survey]:
    """Files that name targets and their places and no times; none where there is no other file."""
    wanted = known_names(stages)
    found = [(one, si_columns(one.header, mapping, wanted)) for one in sources]
    surveys = [(one, names) for one, names in found if is_survey(names)]
    if len(surveys) == len(found):
        return []
    return [survey_of(one, names) for one, names in surveys]


def _with_targets(tables: list[LogTable], surveys: Sequence[Survey]) -> list[LogTable]:
    """Targets of a survey for the files that name them and do not place them."""
    for survey in surveys:
        open_ = [t for t in tables if TARGET_ID in t.columns and not has_places(t.columns)]
        if not open_:
            note = f"{survey.path.name}: not used, as no file names targets without their places"
            tables = [replace(tables[0], notes=(*tables[0].notes, note)), *tables[1:]]
        for table in open_:
            columns, notes = joined(table.columns, survey)
            own = replace(table, columns=columns, notes=(*table.notes, *notes))
            tables = [own if one is table else one for one in tables]
    return tables


def _opened(source: RowSource, mapping: Mapping[str, str], stages: tuple[str, ...]) -> _Open:
    path = source.path
    found = si_columns(source.header, mapping, known_names(stages))
    if TIME not in found:
        raise refuse(
            path,
            "no time column",
            line=1,
            column=1,
            field=TIME,
            expected="a column time_s (or time_ms, time_us, time_ns), or time with ISO 8601 times",
            found=", ".join(source.header[:12])[:300] or "no columns",
            hint="name it there, or map it in the spec: log: {columns: {time_s: theirs}}",
        )
    name, factor = found[TIME]
    clock = source.clock(name)
    notes = (*source.notes, *headings(found), *passed_over(source.header, found, mapping))
    seconds, day, said = _seconds(path, name, factor, clock)
    if not seconds.shape[0]:
        raise refuse(path, "no rows below the header", line=2, column=1)
    twice = rivals(source.header, found, mapping)
    return _Open(source, found, seconds, day, (*notes, *said), twice)


def _with_absent(files: list[_Open], mapping: Mapping[str, str], surveyed: set[str]) -> list[_Open]:
    """Refuse, or say, where the spec maps columns that no file has.

    Another column must not silently stand in for the one that is meant.
    """
    headers = surveyed | {name for one in files for name in one.source.header}
    notes = []
    for canonical, theirs in mapping.items():
        if named_column(theirs, headers)[0] in headers:
            continue
        column = f"log.columns.{canonical}: no file has a column {theirs!r}"
        for one in files:
            if si_name(canonical) in one.found:
                raise refuse(
                    one.source.path,
                    column,
                    expected="one of the file's columns, or nothing: the file has "
                    + one.found[si_name(canonical)][0],
                    hint=did_you_mean(theirs, sorted(headers)),
                )
        notes.append(column)
    return [replace(files[0], notes=(*files[0].notes, *notes)), *files[1:]]


def _seconds(
    path: Path, name: str, factor: float, clock: Clock
) -> tuple[Array, int | None, tuple[str, ...]]:
    if clock.nanoseconds is not None:
        seconds, day = _since_midnight(clock.nanoseconds)
        said = () if clock.zoned else (f"{path.name}: {name} names no zone and is taken as UTC",)
        return seconds, day, said
    assert clock.seconds is not None
    if clock.spans:
        return clock.seconds, None, ()
    if math.isnan(factor) and clock.seconds.shape[0]:
        raise refuse(
            path,
            "times without a unit",
            field=name,
            expected="ISO 8601 times such as 2026-03-01T12:00:00.125Z",
            found="numbers",
            hint="put the unit into the name: time_s, time_ms, time_us or time_ns",
        )
    return clock.seconds * factor, None, ()


def _since_midnight(stamps: StampArray) -> tuple[Array, int]:
    """Seconds since the midnight (UTC) before the first stamp, which is exact to a nanosecond."""
    known = stamps != NO_TIME
    first = int(stamps[known].min()) if np.any(known) else 0
    day = first - first % DAY
    seconds = (np.where(known, stamps, day) - day) / NANOSECONDS
    return np.where(known, seconds, np.nan), day


def _on_one_scale(files: list[_Open]) -> list[_Open]:
    """Calendar times of all files count from one midnight; beside plain numbers, from 1970."""
    days = [f.day for f in files if f.day is not None]
    if not days:
        return files
    origin = min(days) if len(days) == len(files) else 0
    shown = np.datetime64(origin, "ns").astype("datetime64[s]")
    note = f"times are UTC, in seconds since {shown}Z"
    moved = [
        f
        if f.day is None
        else replace(f, seconds=f.seconds + (f.day - origin) / NANOSECONDS, day=origin)
        for f in files
    ]
    return [replace(moved[0], notes=(*moved[0].notes, note)), *moved[1:]]


def _one_run(files: Sequence[_Open]) -> list[_Open]:
    """The files, those that are parts of one run as one."""

    def span(k: int) -> tuple[float, float]:
        stamps = arranged(files[k].source.path, files[k].seconds).stamps
        return float(stamps[0]), float(stamps[-1])

    kinds = [frozenset(one.found) | ({CALENDAR} if one.day is not None else set()) for one in files]
    groups = in_turn(kinds, cache(span))
    return [
        files[group[0]] if len(group) == 1 else _joined([files[k] for k in group])
        for group in groups
    ]


def _joined(parts: Sequence[_Open]) -> _Open:
    """Parts of one run, in the order of time."""
    first = parts[0]
    seconds = [one.seconds for one in parts]
    source = TableParts([one.source for one in parts], [one.found for one in parts], seconds)
    names = ", ".join(one.source.path.name for one in parts)
    notes = dict.fromkeys(note for one in parts for note in one.notes)
    headers = [one.source.header for one in parts]
    twice = tuple(pair for pair in first.rivals if all(pair[0] in one for one in headers))
    return replace(
        first,
        source=source,
        seconds=np.concatenate(seconds),
        notes=(*notes, f"parts of one run, in the order of time: {names}"),
        rivals=twice,
    )


def _unlike(file: _Open, keep: Mask, place: Array, columns: Mapping[str, Array]) -> Iterator[str]:
    """What to say of a quantity that is given twice and not alike."""
    for name, si in file.rivals:
        if si in (TIME, TARGET_ID):
            continue
        try:
            other = file.source.numbers([name], keep)[name][place] * suffix_unit(name)[0]
        except BadInput:  # no figures: nobody reads them
            continue
        angle = si.endswith("_rad")
        apart = other - columns[si]
        apart = np.abs((apart + np.pi) % (2.0 * np.pi) - np.pi) if angle else np.abs(apart)
        size = float(np.nanmedian(apart)) if np.any(np.isfinite(apart)) else 0.0
        usual = 1.0 if angle else float(np.nanmedian(np.abs(columns[si])))
        if size > UNLIKE * usual:
            shown = format_estimate(size, None, "rad" if angle else _si_unit(si))
            yield f"{file.found[si][0]} and {name} differ by {shown} in the median"


def _si_unit(si: str) -> str:
    """The unit that an SI name ends in, as it is written."""
    suffix = si.rsplit("_", 1)[-1]
    return {"mps": "m/s", "radps": "rad/s"}.get(suffix, suffix)


def _table(file: _Open, rows: Arranged) -> LogTable:
    """The columns of the rows that are worked on."""
    keep = np.zeros(rows.rows, dtype=bool)
    keep[rows.order] = True
    place = (np.cumsum(keep) - 1)[rows.order]  # of every row among the kept ones of the file
    figures = {si: f for si, f in file.found.items() if si not in (TIME, TARGET_ID)}
    read = file.source.numbers(sorted({name for name, _ in figures.values()}), keep)
    columns = {si: read[name][place] * factor for si, (name, factor) in sorted(figures.items())}
    if TARGET_ID in file.found:
        columns[TARGET_ID] = file.source.labels(file.found[TARGET_ID][0], keep)[place]
    columns[TIME] = rows.stamps
    if rows.pieces is not None:
        demand_one_run(file.source.path, columns, rows.order, rows.pieces)
    rejected, notes, count = dict(rows.rejected), [*file.notes, *rows.notes], rows.rows
    notes += _unlike(file, keep, place, columns)
    for part in parts_of(file.source):
        if part.cut:
            rejected[CUT_OFF] = rejected.get(CUT_OFF, 0) + 1
            count += 1
            line = f"{part.path.name} is cut off in line {part.cut}"
            notes.append(f"{line}; the rows before it are used")
    return LogTable(
        file.source.path,
        columns,
        file.source.header,
        tuple(notes),
        count,
        rejected,
        rows.thinned,
        (file.day or 0) / NANOSECONDS,
    )
