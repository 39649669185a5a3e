"""Measured logs: files to a `Log`, every row that is not used counted with its reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Final, Literal

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.logs import places, planar
from syncline_design.logs.columns import (
    ATTITUDE,
    GEODETIC,
    POSITION,
    RANGING,
    RATE,
    REFERENCE,
    REFERENCE_ATTITUDE,
    TARGET,
    TARGET_ID,
    TIME,
    VELOCITY,
    known_names,
    shown,
    si_columns,
)
from syncline_design.logs.derivatives import derived_rate, derived_velocity
from syncline_design.logs.log import Log, LogKind, LogTrack, StageLog
from syncline_design.logs.magnitudes import demand_possible
from syncline_design.logs.merging import merged
from syncline_design.logs.pose_pairs import with_points
from syncline_design.logs.refusals import refuse
from syncline_design.logs.row_source import RowSource
from syncline_design.logs.tables import LogTable, read_tables
from syncline_design.logs.twins import without_twins
from syncline_design.machine.quick_dataclass import dataclass

ColumnSource = Literal["columns", "position", "reference"]  # of a velocity

LEAST_ROWS = 10


@dataclass(slots=True)
class _Draft:
    """A log under construction: columns at common stamps, and what has been noted."""

    table: LogTable
    columns: dict[str, Array]
    tracks: Mapping[str, LogTrack]
    notes: list[str] = field(default_factory=list)
    follows_position: bool = False
    velocity_of_reference: bool = False
    level: tuple[str, ...] = ()

    @property
    def path(self) -> Path:
        return self.table.path

    def vectors(self, names: Sequence[str]) -> Array:
        return np.stack([self.columns[n] for n in names], axis=1)

    def has(self, names: Sequence[str]) -> bool:
        return all(n in self.columns for n in names)


def read_log(
    paths: Sequence[Path | RowSource],
    stages: Sequence[str],
    mapping: Mapping[str, str] | None = None,
    needs_ranging: bool = True,
    slip_s: float = 0.0,
    origin: places.Origin | None = None,
    pose_lever_m: float | None = None,
) -> Log:
    """Read one log, from one file or several, for a system of these stages.

    needs_ranging: whether the spec has ranging sensors; it decides what is said to be missing.
    slip_s: by how much the stamps of a file of positions are ahead; they are set back.  origin: of
    the local frame, where the spec states it.  pose_lever_m: at what lever two poses are compared;
    None where attitudes are not.
    """
    prefixes = [f"{name}_" for name in stages] if len(stages) > 1 else [""]
    names = (prefixes[0] + POSITION[0], prefixes[0] + GEODETIC[0])
    slip = (names, slip_s if len(paths) > 1 else 0.0)
    tables = read_tables(paths, mapping or {}, tuple(stages), slip)
    draft = _draft(tables, prefixes)
    draft.tracks, said = places.made_local(
        draft.path, draft.columns, draft.tracks, prefixes, origin
    )
    draft.notes += said
    kind = _kind(draft, prefixes, needs_ranging, pose_lever_m)
    notes, draft.level = planar.filled(draft.columns, prefixes, kind)
    draft.notes += notes
    _demand_columns(draft, prefixes, kind)
    rejected = dict(draft.table.rejected)
    draft.columns, missing = _complete_rows(draft, prefixes, kind)
    if missing:
        rejected["missing value"] = missing
    left = draft.columns[TIME]
    if left.shape[0] < LEAST_ROWS or left[0] == left[-1]:
        raise refuse(
            draft.path,
            "too few complete rows",
            expected=f"at least {LEAST_ROWS}, at several stamps",
            found=f"{left.shape[0]} of {draft.table.rows}",
        )
    if kind == "pose":
        assert pose_lever_m is not None
        draft.notes.append(with_points(draft.columns, prefixes[0], pose_lever_m))
    demand_possible(draft.path, draft.columns, prefixes)
    return _log(draft, stages, prefixes, kind, rejected)


def holds_poses(source: RowSource, mapping: Mapping[str, str], stages: Sequence[str]) -> bool:
    """Whether a file holds positions of the first stage and attitudes: both have its stamps."""
    prefix = f"{stages[0]}_" if len(stages) > 1 else ""
    several = tuple(stages) if len(stages) > 1 else ()
    found = si_columns(source.header, mapping, known_names(several))
    placed = any(prefix + n in found for n in (POSITION[0], GEODETIC[0]))
    return placed and any(prefix + n in found for n in ATTITUDE)


def _draft(tables: Sequence[LogTable], prefixes: Sequence[str]) -> _Draft:
    if len(tables) == 1:
        only = without_twins(tables[0])
        return _Draft(only, dict(only.columns), {}, list(only.notes))
    joined = merged(tables, prefixes)
    return _Draft(
        joined.table,
        dict(joined.table.columns),
        joined.tracks,
        list(joined.table.notes),
        joined.follows_position,
        joined.velocity_of_reference,
    )


def _kind(
    draft: _Draft, prefixes: Sequence[str], needs_ranging: bool, pose_lever_m: float | None
) -> LogKind:
    last = prefixes[-1]
    ranging = last + RANGING[0] in draft.columns
    reference = any(n in draft.columns for n in REFERENCE)
    if ranging and any(n in draft.columns for n in TARGET):
        return "georeference"
    if reference and not ranging:
        whole = (*POSITION, *REFERENCE, *REFERENCE_ATTITUDE)
        turned = len(prefixes) == 1 and draft.has(whole)
        return "pose" if turned and pose_lever_m is not None else "position"
    wanted = (*(last + n for n in RANGING), *TARGET) if needs_ranging or ranging else REFERENCE
    raise _missing(draft, [n for n in wanted if n not in draft.columns])


def _demand_columns(draft: _Draft, prefixes: Sequence[str], kind: LogKind) -> None:
    wanted = [prefixes[0] + n for n in POSITION]
    for prefix in prefixes:
        wanted += [prefix + n for n in ATTITUDE]
        if kind == "georeference":
            wanted += [prefix + n for n in RANGING]
        else:
            _demand_all_or_none(draft, prefix)
    if kind == "georeference":
        wanted += TARGET
    missing = [n for n in wanted if n not in draft.columns]
    if missing:
        raise _missing(draft, missing)


def _demand_all_or_none(draft: _Draft, prefix: str) -> None:
    """A position log may know less than three components of the reference; the output says so."""
    missing = [n for n in REFERENCE if n not in draft.columns]
    for name in missing:
        draft.columns[name] = np.full(draft.columns[TIME].shape, np.nan)
    if missing:
        draft.notes.append(f"not in the log, so not compared: {', '.join(missing)}")


NAME_THEM: Final = (
    "name them there, or map them in the spec: log: {columns: {roll_deg: theirs [rad]}}"
)
NO_PLACES: Final = (
    "only the first stage of a chain has places to derive a velocity from: log this one's own (of "
    "what is towed, the towing vehicle's is one), or map it: log: {columns: {...}}"
)


def _missing(draft: _Draft, names: Sequence[str], hint: str = NAME_THEM) -> Exception:
    listed = ", ".join(shown(n) for n in names)
    plural = "columns are" if len(names) > 1 else "column is"
    return refuse(
        draft.path,
        f"{plural} missing: {listed}",
        line=1,
        column=1,
        found=", ".join(draft.table.header[:20])[:500] or "no columns",
        hint=_spelt_otherwise(draft.table.header, names) or hint,
    )


def _spelt_otherwise(header: Sequence[str], names: Sequence[str]) -> str:
    """That what is missing is there but for capitals or the signs between its words; or nothing."""
    there = {_letters(name): name for name in header}
    alike = [(shown(n), there[_letters(shown(n))]) for n in names if _letters(shown(n)) in there]
    if not alike:
        return ""
    wanted, found = alike[0]
    more = f" (and {len(alike) - 1} more so)" if len(alike) > 1 else ""
    return (
        f"{found} would be {wanted}{more}: an underscore joins words, and a stage and its column; "
        f"rename them there, or map them in the spec: log: {{columns: {{{wanted}: {found}}}}}"
    )


def _letters(name: str) -> str:
    return "".join(c for c in name.lower() if c.isalnum())


def _complete_rows(
    draft: _Draft, prefixes: Sequence[str], kind: LogKind
) -> tuple[dict[str, Array], int]:
    """Rows with every needed value; components of a reference that is never there do not count."""
    needed = [prefixes[0] + n for n in POSITION]
    for prefix in prefixes:
        needed += [prefix + n for n in ATTITUDE]
        needed += [prefix + n for n in RANGING] if kind == "georeference" else []
        needed += [prefix + n for n in (*VELOCITY, *RATE) if prefix + n in draft.columns]
    truth = TARGET if kind == "georeference" else REFERENCE
    needed += [n for n in truth if np.any(np.isfinite(draft.columns[n]))]
    needed += REFERENCE_ATTITUDE if kind == "pose" else ()
    keep = np.ones(draft.columns[TIME].shape, dtype=bool)
    for name in needed:
        keep &= np.isfinite(draft.columns[name])
    columns = {name: values[keep] for name, values in draft.columns.items()}
    return columns, int(np.sum(~keep))


def _log(
    draft: _Draft,
    stages: Sequence[str],
    prefixes: Sequence[str],
    kind: LogKind,
    rejected: dict[str, int],
) -> Log:
    built = []
    for k, (name, prefix) in enumerate(zip(stages, prefixes, strict=True)):
        built.append(_stage_log(draft, name, prefix, k == 0, kind))
    target_id = draft.columns.get(TARGET_ID)
    return Log(
        kind=kind,
        time_s=draft.columns[TIME],
        stages=tuple(built),
        truth_m=draft.vectors(REFERENCE if kind == "position" else TARGET),
        target_id=target_id,
        rows_read=draft.table.rows,
        rejected=rejected,
        notes=tuple(draft.notes),
        thinned=draft.table.thinned,
        since_s=draft.table.since_s,
        level=draft.level,
        hidden_down_m=draft.columns.get(planar.HIDDEN_DOWN),
    )


def _stage_log(draft: _Draft, name: str, prefix: str, first: bool, kind: LogKind) -> StageLog:
    time_s = draft.columns[TIME]
    euler = draft.vectors([prefix + n for n in ATTITUDE])
    antenna = draft.vectors([prefix + n for n in POSITION]) if first else None
    velocity, source = _velocity(draft, prefix, antenna, kind, name)
    if draft.has([prefix + n for n in RATE]):
        rate = draft.vectors([prefix + n for n in RATE])
    else:
        rate = derived_rate(time_s, euler)
        draft.notes.append(f"rates of {name} were derived from its attitude")
    distance, azimuth, elevation = (
        None if kind == "position" else draft.columns[prefix + n] for n in RANGING
    )
    return StageLog(
        name,
        antenna,
        euler,
        velocity,
        rate,
        distance,
        azimuth,
        elevation,
        velocity_track=draft.tracks.get(prefix + "velocity"),
        rate_track=draft.tracks.get(prefix + "rate"),
        follows_position=source == "position",
        follows_reference=source == "reference",
        velocity_of_reference=first and draft.velocity_of_reference,
    )


def _velocity(
    draft: _Draft, prefix: str, antenna: Array | None, kind: LogKind, name: str
) -> tuple[Array, ColumnSource]:
    """Velocity columns, or the slope of reference or antenna positions, smoothed; its source."""
    time_s = draft.columns[TIME]
    if draft.has([prefix + n for n in VELOCITY]):
        source: ColumnSource = "position" if draft.follows_position else "columns"
        return draft.vectors([prefix + n for n in VELOCITY]), source
    reference = draft.vectors(REFERENCE) if kind != "georeference" else None
    if reference is not None and np.all(np.isfinite(reference)):
        draft.notes.append(f"velocity of {name} was derived from the reference positions")
        return derived_velocity(time_s, reference), "reference"
    if antenna is None:
        raise _missing(draft, [prefix + n for n in VELOCITY], NO_PLACES)
    draft.notes.append(f"velocity of {name} was derived from its own positions, smoothed over 1 s")
    return derived_velocity(time_s, antenna), "position"
