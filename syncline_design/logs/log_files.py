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
from syncline_design.logs.readers.stream import Recording
from syncline_design.logs.refusals import refuse
from syncline_design.logs.roles import ROLES, Offer, Role, offers_of
from syncline_design.logs.row_source import RowSource
from syncline_design.logs.run_parts import one_run
from syncline_design.logs.sources import demand_plain_file, opened
from syncline_design.logs.static_arms import arm_notes, arms_beside
from syncline_design.logs.stream_sources import demand_parts, sources_of
from syncline_design.logs.surveys import Survey, first_survey
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.load import BadInput
from syncline_design.spec.log_block import LogChoice, StreamChoice

TABLES = (".parquet", ".pq")
ONE_STAGE = ("stage",)  # where no spec names stages: columns then begin with none of them
TEXT_TABLE = "csv_text"  # the reader of delimited text, whose files `sources` reads by their names


@dataclass(frozen=True, slots=True, eq=False)
class SortedFiles:
    """The files of a call: those that are read by the names of their columns, and all others.

    held: the parts that the tables play, in all and table by table.
    """

    tables: tuple[RowSource, ...]
    recordings: tuple[Path, ...]
    held: frozenset[Role]
    held_by: tuple[frozenset[Role], ...]
    survey: Survey | None


def sorted_files(
    paths: Sequence[Path], mapping: Mapping[str, str], stages: Sequence[str]
) -> SortedFiles:
    """Which files are tables, and which are recordings; raises BadInput of a table."""
    once = list(dict.fromkeys(paths))
    tables = [t for t in (_table(path, mapping, stages) for path in once) if t is not None]
    beside = len(tables) < len(once)
    if beside or not any("reference" in _held(one, mapping, stages) for one in tables):
        found = [one for one in tables if _is_trajectory(one, mapping, stages)]
        # beside recordings, or as one of two that tell places, a trajectory is a recording too
        if beside or sum("position" in _quantities(one.path) for one in found) > 1:
            tables = [one for one in tables if one not in found]
    read = {one.path for one in tables}
    held = tuple(_held(one, mapping, stages) for one in tables)
    survey = first_survey(tables, mapping, stages)
    others = tuple(path for path in once if path not in read)
    return SortedFiles(tuple(tables), others, frozenset().union(*held), held, survey)


def row_sources(
    paths: Sequence[Path], choice: LogChoice, stages: Sequence[str], poses: bool,
    arms: Mapping[str, tuple[float, float, float]] | None = None,
) -> list[RowSource]:  # fmt: skip
    """Every file opened; raises BadInput.  Recordings are read as one, whatever their number.

    arms: the spec's lever arms by `stage.role`, to be held against those that a log states.
    """
    files = sorted_files(paths, choice.columns, stages)
    if not files.recordings:
        return list(files.tables)
    run = one_run([open_recording(path) for path in files.recordings])
    prefix = f"{stages[0]}_" if len(stages) > 1 else ""
    offers = some_offers(run)
    sources = sources_of(
        offers, without_tables(choice, files, offers), prefix, poses, files.held, files.survey,
        _arms(arms or {}, stages),
    )  # fmt: skip
    static = [pose for one in run for stream in one.streams() for pose in stream.static]
    for source in sources[:1]:
        source.notes += arm_notes(arms_beside(static, arms or {}))
    return [*files.tables, *sources]


def some_offers(recordings: Sequence[Recording]) -> list[Offer]:
    """The streams of recordings; refuses where there is none at all."""
    offers = offers_of(recordings)
    if not offers:
        first = recordings[0]
        raise refuse(first.path, "no message in the log", found=f"a {first.format} without any")
    return offers


def without_tables(choice: LogChoice, files: SortedFiles, offers: Sequence[Offer]) -> LogChoice:
    """What a spec says of recordings: of the streams that it names, those that are no table of the
    call, whose columns say which part it plays; refuses a table that plays another."""
    streams = {one.name for one in offers}
    left = choice.streams.model_dump()
    for role in ROLES:
        name = left[role]
        for table, held in zip(files.tables, files.held_by, strict=True):
            if name is None or name in streams or name not in (table.path.name, table.path.stem):
                continue
            if role not in held:
                raise refuse(
                    table.path, f"{name} has no columns of a {role}",
                    field=f"log.streams.{role}",
                    expected="columns of that part by the package's names, or by `log: {columns}`",
                    found=", ".join(table.header[:12]),
                )  # fmt: skip
            left[role] = None
    return choice.model_copy(update={"streams": StreamChoice(**left)})


def roles_of_table(
    path: Path, mapping: Mapping[str, str], stages: Sequence[str]
) -> frozenset[Role]:
    """The parts that a file plays by the names of its columns; none of what is no table."""
    try:
        table = _table(path, mapping, stages)
    except BadInput:
        return frozenset()
    return frozenset() if table is None else _held(table, mapping, stages)


def _arms(arms: Mapping[str, tuple[float, float, float]], stages: Sequence[str]) -> Arms:
    """Lever arms of the last stage's ranging sensor and of the first's antenna."""
    zero = (0.0, 0.0, 0.0)
    ranging, antenna = (arms.get(f"{stages[k]}.{role}", zero)
                        for k, role in ((-1, "ranging"), (0, "position")))  # fmt: skip
    return np.asarray(ranging), np.asarray(antenna)


def _held(table: RowSource, mapping: Mapping[str, str], stages: Sequence[str]) -> frozenset[Role]:
    """The parts that a table plays by its columns."""
    names = si_columns(table.header, mapping, known_names(stages))
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
    return None if _quantities(path) else source


def _is_trajectory(table: RowSource, mapping: Mapping[str, str], stages: Sequence[str]) -> bool:
    """Whether a table beside recordings is one more of them: places or attitudes and no more.

    One with ranges, targets or a reference says by its columns' names which part it plays.
    """
    if mapping:
        return False
    found = si_columns(table.header, mapping, known_names(stages))
    parted = ("reference_", "target_", *(f"{stage}_" for stage in stages))
    if any(name.startswith(parted) or name in RANGING for name in found):
        return False
    return bool(_quantities(table.path))


def _reader_name(path: Path) -> str | None:
    if not path.is_file():
        return None
    try:
        reader = reader_of(head_of(path))
    except BadInput:  # said by `opened`, in the words for tables
        return None
    return next((name for name, one in registry().items() if one is reader), None)


def _quantities(path: Path) -> frozenset[str]:
    """What the columns tell, with times, under the names that readers know."""
    streams = open_recording(path).streams()
    return frozenset(what for one in streams if one.stamps for what in one.quantity)


def no_places_in(paths: Sequence[Path], choice: LogChoice, stages: Sequence[str]) -> str:
    """Why recordings, whose streams are there as the spec names them, tell no places that could be
    held against anything; "" where they do, or where a name is wrong.

    A stream that the spec names for its stamps alone (a scan) is no fault of the recording.
    """
    files = sorted_files(paths, choice.columns, stages)
    if not files.recordings:
        return ""
    offers = some_offers(one_run([open_recording(path) for path in files.recordings]))
    known = {name for o in offers for name in (o.name, o.path.name, o.path.stem)}
    known |= {f"{o.path.name}:{o.name}" for o in offers}
    left = without_tables(choice, files, offers)
    if any(name is not None and name not in known for name in left.streams.model_dump().values()):
        return ""
    try:
        demand_parts(offers, left, files.held)
    except BadInput as error:
        return error.problems[0].message
    return ""


def tells_all(paths: Sequence[Path], choice: LogChoice, stages: Sequence[str]) -> bool:
    """Whether the tables among files are a measured log of their own."""
    held = sorted_files(paths, choice.columns, stages).held
    return {"position", "attitude"} <= held and bool(held & {"ranging", "reference"})
