"""A survey of targets in a file of its own: each row one target, joined to a log by target_id."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.logs import delimited
from syncline_design.logs.cells import trimmed
from syncline_design.logs.columns import (
    GEODETIC,
    TARGET,
    TARGET_ID,
    TIME,
    known_names,
    si_columns,
)
from syncline_design.logs.refusals import refuse
from syncline_design.logs.row_source import RowSource
from syncline_design.logs.text_source import TextSource
from syncline_design.machine.quick_dataclass import dataclass

PLACES = (TARGET, tuple(f"target_{name}" for name in GEODETIC))
Found = Mapping[str, tuple[str, float]]  # SI name -> column of the file, factor to SI
NAMED = "target_id of no target that was surveyed"


@dataclass(frozen=True, slots=True)
class Survey:
    """Surveyed targets: SI columns (n,), and the row of every label that a log may have for one.

    A log's label of a target is the figure that its name is, or a hash of the name.
    names: of the targets as they are written.
    """

    path: Path
    header: tuple[str, ...]
    columns: Mapping[str, Array]
    rows: Mapping[float, int]
    names: tuple[str, ...] = ()

    @property
    def places(self) -> tuple[tuple[str, ...], Array]:
        """Every target once: its name, and the figures of its columns (m, 3)."""
        once = sorted(set(self.rows.values()))
        whole = np.stack(list(self.columns.values()), axis=1)
        return tuple(self.names[row] for row in once), whole[once]


def is_survey(found: Found) -> bool:
    """Whether a file names targets and their places, and has no times."""
    named = TARGET_ID in found and TIME not in found
    return named and any(name in found for names in PLACES for name in names)


def first_survey(
    tables: Sequence[RowSource], mapping: Mapping[str, str], stages: Sequence[str]
) -> Survey | None:
    """The first survey of targets among tables."""
    for table in tables:
        found = si_columns(table.header, mapping, known_names(stages))
        if is_survey(found):
            return survey_of(table, found)
    return None


def has_places(columns: Mapping[str, Array]) -> bool:
    """Whether a log places its targets itself."""
    return any(name in columns for names in PLACES for name in names)


def survey_of(source: RowSource, found: Found) -> Survey:
    """Read a survey; refuses one that puts a target at two places, or leaves a place open."""
    if not isinstance(source, TextSource):
        raise refuse(source.path, "a survey of targets is read from text only", found="Parquet")
    names = [name for group in PLACES for name in group if name in found]
    wanted = next((g for g in PLACES if all(name in found for name in g)), None)
    if wanted is None:
        raise refuse(
            source.path,
            "the places of the targets are not whole",
            line=source.how.line,
            column=1,
            expected=f"{', '.join(TARGET)}, or target_latitude_deg, target_longitude_deg, "
            "target_height_m",
            found=", ".join(names),
        )
    ids, lines = _ids(source, source.header.index(found[TARGET_ID][0]))
    keep = np.ones(len(ids), dtype=bool)
    read = source.numbers([found[name][0] for name in wanted], keep)
    columns = {name: read[found[name][0]] * found[name][1] for name in wanted}
    rows = _rows(source.path, ids, lines, columns)
    return Survey(source.path, source.header, columns, rows, tuple(one or "" for one in ids))


def _ids(source: TextSource, place: int) -> tuple[list[str | None], list[int]]:
    """The names of the targets as text, and their lines."""
    ids: list[str | None] = []
    lines: list[int] = []
    for block in delimited.blocks(source.path, source.how, source.end):
        text = trimmed(delimited.parsed(block, source.how, [place], as_text=True).to_series(0))
        ids += text.to_list()
        lines += block.lines.tolist()
    return ids, lines


def _rows(
    path: Path, ids: Sequence[str | None], lines: Sequence[int], columns: Mapping[str, Array]
) -> dict[float, int]:
    import polars as pl

    named = [one or "" for one in ids]
    hashes = (pl.Series(named, dtype=pl.String).hash(seed=0).to_numpy() >> np.uint64(12)).astype(
        float
    )
    places = np.stack(list(columns.values()), axis=1)
    rows: dict[float, int] = {}
    for row, name in enumerate(named):
        if not name or not np.all(np.isfinite(places[row])):
            what = "a target without a name" if not name else f"target {name} has no whole place"
            raise refuse(path, what, line=lines[row], column=1, expected="a value in every cell")
        first = rows.setdefault(float(hashes[row]), row)
        if not np.array_equal(places[first], places[row]):
            raise refuse(
                path,
                f"target {name} is there twice, at two places",
                line=lines[row],
                column=1,
                expected="one row a target",
                found=f"another in line {lines[first]}",
            )
        figure = _figure(name)
        if figure is not None:
            rows.setdefault(figure, row)
    return rows


def _figure(name: str) -> float | None:
    try:
        return float(name)
    except ValueError:
        return None


def joined(
    columns: Mapping[str, Array], survey: Survey
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Columns of a log with the places of its targets, and what to say of it."""
    labels = columns[TARGET_ID]
    rows = np.array([survey.rows.get(float(label), -1) for label in labels], dtype=np.intp)
    unknown = int(np.count_nonzero(rows < 0))
    if unknown == rows.shape[0]:
        raise refuse(
            survey.path,
            "no row of the log has a target of the survey",
            field=TARGET_ID,
            expected="the names that the log uses",
            found=f"{len(set(survey.rows.values()))} other names",
        )
    places = {
        name: np.where(rows >= 0, values[rows], np.nan) for name, values in survey.columns.items()
    }
    seen = len(set(rows[rows >= 0].tolist()))
    said = f"{survey.path.name}: {seen} targets joined by target_id"
    notes = (said, f"{unknown} rows have a {NAMED}") if unknown else (said,)
    return {**columns, **places}, notes
