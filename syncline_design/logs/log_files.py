"""The files of a call as sources of rows: tables by their columns, recordings by their streams."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from syncline_design.logs.cloud_ranging import Arms
from syncline_design.logs.columns import (
    ATTITUDE,
    GEODETIC,
    POSITION,
    RANGING,
    RATE,
    REFERENCE,
    TARGET,
    TIME,
    VELOCITY,
    known_names,
    si_columns,
)
from syncline_design.logs.readers import open_recording, reader_of, registry
from syncline_design.logs.readers.reader import head_of
from syncline_design.logs.roles import Role, offers_of
from syncline_design.logs.run_parts import one_run
from syncline_design.logs.sources import RowSource, demand_plain_file, opened
from syncline_design.logs.static_arms import arm_notes, arms_beside
from syncline_design.logs.stream_sources import sources_of
from syncline_design.logs.surveys import first_survey
from syncline_design.spec.load import BadInput
from syncline_design.spec.log_block import LogChoice

TABLES = (".parquet", ".pq")
TEXT_TABLE = "csv_text"  # the reader of delimited text, whose files `sources` reads by their names


def row_sources(
    paths: Sequence[Path], choice: LogChoice, stages: Sequence[str], poses: bool,
    arms: Mapping[str, tuple[float, float, float]] | None = None,
) -> list[RowSource]:  # fmt: skip
    """Every file opened; raises BadInput.  Recordings are read as one, whatever their number.

    arms: the spec's lever arms by `stage.role`, to be held against those that a log states.
    """
    found = {path: _table(path, choice.columns, stages) for path in paths}
    tables = [table for table in found.values() if table is not None]
    if len(tables) == len(found):
        return tables
    tables = [one for one in tables if not _is_trajectory(one, choice.columns, stages)]
    read = {one.path for one in tables}
    recordings = [open_recording(path) for path in paths if path not in read]
    prefix = f"{stages[0]}_" if len(stages) > 1 else ""
    held = _held(tables, choice.columns, stages)
    run = one_run(recordings)
    survey = first_survey(tables, choice.columns, stages)
    sources = sources_of(
        offers_of(run), choice, prefix, poses, held, survey, _arms(arms or {}, stages)
    )
    static = [pose for one in run for stream in one.streams() for pose in stream.static]
    for source in sources[:1]:
        source.notes += arm_notes(arms_beside(static, arms or {}))
    return [*tables, *sources]


def _arms(arms: Mapping[str, tuple[float, float, float]], stages: Sequence[str]) -> Arms:
    """Lever arms of the last stage's ranging sensor and of the first's antenna."""
    zero = (0.0, 0.0, 0.0)
    ranging, antenna = (arms.get(f"{stages[k]}.{role}", zero)
                        for k, role in ((-1, "ranging"), (0, "position")))  # fmt: skip
    return np.asarray(ranging), np.asarray(antenna)


def _held(
    tables: Sequence[RowSource], mapping: Mapping[str, str], stages: Sequence[str]
) -> frozenset[Role]:
    """The parts that tables beside the recordings play."""
    names: set[str] = set()
    for table in tables:
        names |= set(si_columns(table.header, mapping, known_names(stages)))
    last, first = (f"{s}_" if len(stages) > 1 else "" for s in (stages[-1], stages[0]))
    told: dict[Role, bool] = {
        "ranging": last + RANGING[0] in names,
        "target": TARGET[0] in names or f"target_{GEODETIC[0]}" in names,
        "reference": REFERENCE[0] in names or f"reference_{GEODETIC[0]}" in names,
        "position": first + POSITION[0] in names or first + GEODETIC[0] in names,
        "attitude": first + ATTITUDE[2] in names,
        "velocity": first + VELOCITY[0] in names,
        "rate": first + RATE[0] in names,
    }
    return frozenset(role for role, there in told.items() if there)


def _table(path: Path, mapping: Mapping[str, str], stages: Sequence[str]) -> RowSource | None:
    """A file that is read by the names of its columns; None where it is a recording."""
    if path.suffix.lower() in TABLES:
        return opened(path)
    if path.is_dir():
        return None
    reader = _reader_name(path)
    if reader not in (None, TEXT_TABLE):
        return None
    if reader is None:
        return opened(path)
    try:
        source = opened(path)
    except BadInput:
        demand_plain_file(path)
        raise
    found = si_columns(source.header, mapping, known_names(stages))
    if TIME in found and len(found) > 1:
        return source
    return None if _is_stream(path) else source


def _is_trajectory(table: RowSource, mapping: Mapping[str, str], stages: Sequence[str]) -> bool:
    """Whether a table beside recordings is one more of them: places or attitudes and no more.

    One with ranges, targets or a reference says by its columns' names which part it plays.
    """
    if mapping or table.path.suffix.lower() in TABLES:
        return False
    found = si_columns(table.header, mapping, known_names(stages))
    parted = ("reference_", "target_", *(f"{stage}_" for stage in stages))
    if any(name.startswith(parted) or name in RANGING for name in found):
        return False
    return _is_stream(table.path)


def _reader_name(path: Path) -> str | None:
    if not path.is_file():
        return None
    try:
        reader = reader_of(head_of(path))
    except BadInput:  # said by `opened`, in the words for tables
        return None
    return next((name for name, one in registry().items() if one is reader), None)


def _is_stream(path: Path) -> bool:
    """Whether the columns tell anything under the names that readers know."""
    return any(one.quantity and one.stamps for one in open_recording(path).streams())
