"""Measured logs: files to a `Log`, every row that is not used counted with its reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from syncline_design.diagnose.columns import (
    ATTITUDE,
    GEODETIC,
    POSITION,
    RANGING,
    RATE,
    REFERENCE,
    TARGET,
    TARGET_ID,
    TIME,
    VELOCITY,
    shown,
)
from syncline_design.diagnose.derivatives import derived_rate, derived_velocity
from syncline_design.diagnose.log import Kind, Log, StageLog, Track
from syncline_design.diagnose.merging import in_order, merged
from syncline_design.diagnose.tables import Table, read_table, refuse
from syncline_design.effects.base import Array

LEAST_ROWS = 10
MOST_SPEED_MPS = 2000.0
LONGEST_S = 1e8  # a log longer than three years has its stamps in the wrong unit


@dataclass(slots=True)
class _Draft:
    """A log under construction: columns at common stamps, and what has been noted."""

    path: Path
    header: tuple[str, ...]
    columns: dict[str, Array]
    tracks: Mapping[str, Track]
    notes: list[str] = field(default_factory=list)
    follows_position: bool = False

    def vectors(self, names: Sequence[str]) -> Array:
        return np.stack([self.columns[n] for n in names], axis=1)

    def has(self, names: Sequence[str]) -> bool:
        return all(n in self.columns for n in names)


def read_log(
    paths: Sequence[Path],
    stages: Sequence[str],
    mapping: Mapping[str, str] | None = None,
    needs_ranging: bool = True,
    slip_s: float = 0.0,
) -> Log:
    """Read one log, from one file or several, for a system of these stages.

    needs_ranging: whether the spec has ranging sensors; it decides what is said to be missing.
    slip_s: by how much the stamps of a file of positions are ahead; they are set back.
    """
    prefixes = [f"{name}_" for name in stages] if len(stages) > 1 else [""]
    tables = [read_table(Path(p), mapping or {}, tuple(stages)) for p in paths]
    if slip_s and len(tables) > 1:
        tables = [_set_back(t, prefixes[0], slip_s) for t in tables]
    rejected = _time_faults(tables)
    read = len(tables[0]) if len(tables) == 1 else 0
    draft = _draft(tables, prefixes)
    read = read or len(draft.columns[TIME])
    _make_local(draft, prefixes)
    kind = _kind(draft, prefixes, needs_ranging)
    _demand_columns(draft, prefixes, kind)
    draft.columns, missing = _complete_rows(draft, prefixes, kind)
    if missing:
        rejected["missing value"] = missing
    if len(draft.columns[TIME]) < LEAST_ROWS:
        raise refuse(
            draft.path,
            "too few complete rows",
            expected=f"at least {LEAST_ROWS}",
            found=f"{len(draft.columns[TIME])} of {read}",
        )
    return _log(draft, stages, prefixes, kind, read, rejected)


def _set_back(table: Table, prefix: str, slip_s: float) -> Table:
    """A file of antenna positions with its stamps set back; others as they are."""
    if not any(prefix + name in table.columns for name in (POSITION[0], GEODETIC[0])):
        return table
    return replace(table, columns={**table.columns, TIME: table.columns[TIME] - slip_s})


def _time_faults(tables: Sequence[Table]) -> dict[str, int]:
    """Rows without a stamp, out of order or doubled; raises where the column makes no sense."""
    rejected: dict[str, int] = {}
    for table in tables:
        stamps = table.columns[TIME]
        finite = stamps[np.isfinite(stamps)]
        if finite.shape[0] < 2:
            raise refuse(table.path, "no time stamps", field=TIME, found="empty column")
        step = np.diff(finite)
        back, same = int(np.sum(step < 0)), int(finite.shape[0] - np.unique(finite).shape[0])
        if back > 0.5 * step.shape[0]:
            raise refuse(table.path, "time runs backwards", field=TIME, hint="reverse the rows")
        if same > 0.5 * finite.shape[0]:
            raise refuse(table.path, "time stands still", field=TIME, found=f"{same} equal stamps")
        if float(finite.max() - finite.min()) > LONGEST_S:
            raise refuse(
                table.path,
                "the log is years long",
                field=TIME,
                found=f"{finite.max() - finite.min():.3g} s",
                hint="are the stamps in nanoseconds? Then call the column time_ns",
            )
        for reason, count in (
            ("no time stamp", int(stamps.shape[0] - finite.shape[0])),
            ("stamp out of order", back),
            ("duplicate stamp", same),
        ):
            if count:
                rejected[reason] = rejected.get(reason, 0) + count
    return rejected


def _draft(tables: Sequence[Table], prefixes: Sequence[str]) -> _Draft:
    if len(tables) == 1:
        only = in_order(tables[0])
        return _Draft(only.path, only.header, dict(only.columns), {}, list(only.notes))
    joined = merged(tables, prefixes)
    header = tuple(name for table in tables for name in table.header)
    return _Draft(
        tables[0].path,
        header,
        dict(joined.columns),
        joined.tracks,
        list(joined.notes),
        joined.follows_position,
    )


def _make_local(draft: _Draft, prefixes: Sequence[str]) -> None:
    """WGS 84 columns to north, east, down about the first row's position."""
    pairs = {f"{prefixes[0]}": POSITION, "reference_": REFERENCE, "target_": TARGET}
    geodetic = {p: tuple(p + g for g in GEODETIC) for p in pairs}
    used = [p for p, names in geodetic.items() if draft.has(names)]
    if not used:
        return
    start = draft.vectors(geodetic[used[0]])
    complete = np.flatnonzero(np.all(np.isfinite(start), axis=1))
    if not complete.shape[0]:
        raise refuse(draft.path, "no position", field=shown(geodetic[used[0]][0]))
    origin = start[complete[0]]
    for prefix in used:
        names = pairs[prefix]
        local = [prefix + n if prefix == prefixes[0] else n for n in names]
        if any(n in draft.columns for n in local):
            raise refuse(
                draft.path,
                "both local and WGS 84 coordinates",
                field=shown(geodetic[prefix][0]),
                hint=f"leave out either these or {local[0]}",
            )
        place = _geodetic_to_ned(draft.vectors(geodetic[prefix]), origin)
        draft.columns |= {n: place[:, k] for k, n in enumerate(local)}
    draft.notes.append(
        "WGS 84 positions were made local (north, east, down) at the first row, "
        f"{np.degrees(origin[0]):.7f} deg, {np.degrees(origin[1]):.7f} deg, {origin[2]:.3f} m"
    )


def _geodetic_to_ned(place: Array, origin: Array) -> Array:
    import pymap3d

    degrees = np.degrees(place[:, :2])
    ned = pymap3d.geodetic2ned(
        degrees[:, 0], degrees[:, 1], place[:, 2], *np.degrees(origin[:2]), origin[2]
    )
    local: Array = np.stack(ned, axis=1)
    return local


def _kind(draft: _Draft, prefixes: Sequence[str], needs_ranging: bool) -> Kind:
    last = prefixes[-1]
    ranging = last + RANGING[0] in draft.columns
    reference = any(n in draft.columns for n in REFERENCE)
    if ranging and any(n in draft.columns for n in TARGET):
        return "georeference"
    if reference and not ranging:
        return "position"
    wanted = (*(last + n for n in RANGING), *TARGET) if needs_ranging or ranging else REFERENCE
    raise _missing(draft, [n for n in wanted if n not in draft.columns])


def _demand_columns(draft: _Draft, prefixes: Sequence[str], kind: Kind) -> None:
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


def _missing(draft: _Draft, names: Sequence[str]) -> Exception:
    listed = ", ".join(shown(n) for n in names)
    plural = "columns are" if len(names) > 1 else "column is"
    return refuse(
        draft.path,
        f"{plural} missing: {listed}",
        line=1,
        column=1,
        found=", ".join(draft.header[:20]) or "no columns",
        hint="name them there, or map them in the spec: log: {columns: {roll_deg: theirs [rad]}}",
    )


def _complete_rows(
    draft: _Draft, prefixes: Sequence[str], kind: Kind
) -> tuple[dict[str, Array], int]:
    """Rows with every needed value; components of a reference that is never there do not count."""
    needed = [prefixes[0] + n for n in POSITION]
    for prefix in prefixes:
        needed += [prefix + n for n in ATTITUDE]
        needed += [prefix + n for n in RANGING] if kind == "georeference" else []
        needed += [prefix + n for n in (*VELOCITY, *RATE) if prefix + n in draft.columns]
    truth = TARGET if kind == "georeference" else REFERENCE
    needed += [n for n in truth if np.any(np.isfinite(draft.columns[n]))]
    keep = np.all(np.isfinite(np.stack([draft.columns[n] for n in needed])), axis=0)
    columns = {name: values[keep] for name, values in draft.columns.items()}
    return columns, int(np.sum(~keep))


def _log(
    draft: _Draft,
    stages: Sequence[str],
    prefixes: Sequence[str],
    kind: Kind,
    read: int,
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
        truth_m=draft.vectors(TARGET if kind == "georeference" else REFERENCE),
        target_id=target_id,
        rows_read=read,
        rejected=rejected,
        notes=tuple(draft.notes),
    )


def _stage_log(draft: _Draft, name: str, prefix: str, first: bool, kind: Kind) -> StageLog:
    time_s = draft.columns[TIME]
    euler = draft.vectors([prefix + n for n in ATTITUDE])
    antenna = draft.vectors([prefix + n for n in POSITION]) if first else None
    velocity, follows = _velocity(draft, prefix, antenna, kind, name)
    if draft.has([prefix + n for n in RATE]):
        rate = draft.vectors([prefix + n for n in RATE])
    else:
        rate = derived_rate(time_s, euler)
        draft.notes.append(f"rates of {name} were derived from its attitude")
    distance, azimuth, elevation = (
        draft.columns[prefix + n] if kind == "georeference" else None for n in RANGING
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
        follows_position=follows,
    )


def _velocity(
    draft: _Draft, prefix: str, antenna: Array | None, kind: Kind, name: str
) -> tuple[Array, bool]:
    """Velocity columns, or the slope of the reference or antenna positions, smoothed."""
    time_s = draft.columns[TIME]
    if draft.has([prefix + n for n in VELOCITY]):
        velocity = draft.vectors([prefix + n for n in VELOCITY])
        fastest = float(np.max(np.abs(velocity)))
        if fastest > MOST_SPEED_MPS:
            raise refuse(
                draft.path,
                "faster than any vehicle",
                field=prefix + VELOCITY[0],
                found=f"{fastest:.4g} m/s",
                hint="is the unit in the column's name right?",
            )
        return velocity, draft.follows_position
    reference = draft.vectors(REFERENCE) if kind == "position" else None
    if reference is not None and np.all(np.isfinite(reference)):
        draft.notes.append(f"velocity of {name} was derived from the reference positions")
        return derived_velocity(time_s, reference), False
    if antenna is None:
        raise _missing(draft, [prefix + n for n in VELOCITY])
    draft.notes.append(f"velocity of {name} was derived from its own positions, smoothed over 1 s")
    return derived_velocity(time_s, antenna), True
