"""Several files, each with its own rate, to rows at the stamps of the reference sensor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.kinematics import euler_to_rotation, rotation_to_euler
from syncline_design.effects.record import Array
from syncline_design.logs.columns import (
    ATTITUDE,
    GEODETIC,
    NED,
    POSITION,
    RANGING,
    RATE,
    REFERENCE,
    TIME,
    VELOCITY,
    shown,
)
from syncline_design.logs.derivatives import derived_velocity
from syncline_design.logs.log import LogTrack
from syncline_design.logs.refusals import refuse
from syncline_design.logs.tables import LogTable
from syncline_design.logs.twins import one_a_stamp, without_twins
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import percent, to_places

Index = NDArray[np.intp]
TURNING = ("yaw_rad", "azimuth_rad", "longitude_rad")  # where 180 deg and -180 deg are neighbours
REACH = 2.5  # intervals of the other file across which its values are still interpolated


@dataclass(frozen=True, slots=True)
class Merged:
    """Columns at common stamps, and the motion at the rate it was logged at."""

    table: LogTable  # the file that sets the rows, with the columns of all
    tracks: Mapping[str, LogTrack]  # "PREFIXvelocity" or "PREFIXrate"
    follows_position: bool = False
    velocity_of_reference: bool = False


def merged(tables: Sequence[LogTable], prefixes: Sequence[str]) -> Merged:
    """Interpolate every other file to the stamps of the file that sets the rows."""
    at = _base(tables, prefixes)
    tables = [without_twins(t) if k == at else one_a_stamp(t) for k, t in enumerate(tables)]
    follows = _needs_velocity(tables, prefixes[0])
    if follows is not None:
        tables = [_with_velocity(t, prefixes[0]) if t is follows else t for t in tables]
    base = tables[at]
    columns: dict[str, Array] = dict(base.columns)
    tracks: dict[str, LogTrack] = {}
    notes = [note for t in tables for note in t.notes]
    notes += [note for t in tables if t is not base for note in _left_out(t)]
    stamps = base.columns[TIME]
    for table in tables:
        if table is base:
            continue
        taken = {k: v for k, v in table.columns.items() if k not in columns and k != TIME}
        twice = sorted(shown(k) for k in table.columns if k in columns and k != TIME)
        if twice and _apart(base, table):
            raise _unlike_parts(base, table)
        if base.columns.keys() <= table.columns.keys():
            raise refuse(
                table.path,
                "it tells nothing that the files before it do not tell",
                expected="files that are parts of one run, each with columns of its own, or with "
                "the same columns one after the other in time",
                found=f"a second log of {len(twice)} columns that are in {base.path.name} already, "
                f"{_stamps(table)}, beside {_stamps(base)}",
                hint="several runs of one system are taken together by `diagnose --joint`",
            )
        if twice:
            notes.append(
                f"{table.path.name}: not read, as another file gives it: {', '.join(twice)}"
            )
        found, covered = interpolated(table, taken, stamps, prefixes)
        columns |= found
        tracks |= _tracks(table, taken, prefixes)
        share = float(np.mean(covered))
        notes.append(f"{table.path.name}: {percent(share)} of the rows matched")
        if not np.any(covered):
            raise refuse(
                table.path,
                "no row of the log is matched",
                field=TIME,
                expected=f"stamps between {to_places(stamps[0], 3)} and "
                f"{to_places(stamps[-1], 3)} s",
                found=_stamps(table),
                hint="are both files on the same time scale?",
            )
    table = replace(base, columns=columns, notes=tuple(notes))
    theirs = _velocity_of_reference([base, *tables], prefixes[0])
    return Merged(table, tracks, follows is not None, theirs)


def _apart(one: LogTable, other: LogTable) -> bool:
    """Whether one file ends before the other begins."""
    a, b = one.columns[TIME], other.columns[TIME]
    return bool(a[-1] < b[0] or b[-1] < a[0])


def _stamps(table: LogTable) -> str:
    own = table.columns[TIME]
    return f"{to_places(own[0], 3)} to {to_places(own[-1], 3)} s"


def _unlike_parts(base: LogTable, table: LogTable) -> Exception:
    """Of files that follow one another in time, and share some columns and not all."""
    lacks = sorted(shown(n) for n in base.columns.keys() - table.columns.keys())
    more = sorted(shown(n) for n in table.columns.keys() - base.columns.keys())
    told = [f"without {', '.join(lacks)}"] if lacks else []
    told += [f"with {', '.join(more)} besides"] if more else []
    return refuse(
        table.path,
        f"its columns differ from those of {base.path.name}, one after the other in time",
        line=1,
        column=1,
        expected="the same columns in every part of one run",
        found=f"{_stamps(table)}, {', '.join(told)}",
        hint="leave the parts out that lack columns, or leave these columns out of all",
    )


def _needs_velocity(tables: Sequence[LogTable], prefix: str) -> LogTable | None:
    """The file of antenna positions, if nothing else can tell the velocity at a high rate."""
    if any(prefix + VELOCITY[0] in t.columns for t in tables):
        return None
    holds = [t for t in tables if all(prefix + n in t.columns for n in POSITION)]
    reference = [t for t in tables if all(n in t.columns for n in REFERENCE)]
    if not holds or (reference and len(reference[0]) >= len(holds[0])):
        return None
    return holds[0]


def _velocity_of_reference(tables: Sequence[LogTable], prefix: str) -> bool:
    """Whether the velocity that is taken, the first, came with the better system's places."""
    holds = [t for t in tables if prefix + VELOCITY[0] in t.columns]
    theirs = (*REFERENCE, *(f"reference_{n}" for n in GEODETIC))
    return bool(holds) and any(n in holds[0].columns for n in theirs)


def _with_velocity(table: LogTable, prefix: str) -> LogTable:
    place = np.stack([table.columns[prefix + n] for n in POSITION], axis=1)
    kept = np.all(np.isfinite(place), axis=1)
    columns = {name: values[kept] for name, values in table.columns.items()}
    slope = derived_velocity(columns[TIME], place[kept])
    columns |= {prefix + n: slope[:, k] for k, n in enumerate(VELOCITY)}
    note = f"velocity was derived from the positions of {table.path.name}, smoothed over 1 s"
    return replace(table, columns=columns, notes=(*table.notes, note))


def _left_out(table: LogTable) -> list[str]:
    """What a file that does not set the rows lost."""
    return [f"{table.path.name}: {n} rows left out ({why})" for why, n in table.rejected.items()]


def _base(tables: Sequence[LogTable], prefixes: Sequence[str]) -> int:
    """The last stage's ranging sensor; in a position log the sparser of antenna and reference."""
    for k, table in enumerate(tables):
        if f"{prefixes[-1]}{RANGING[0]}" in table.columns:
            return k
    names = (POSITION[0], REFERENCE[0], GEODETIC[0], f"reference_{GEODETIC[0]}")
    fixes = [k for k, t in enumerate(tables) if any(n in t.columns for n in names)]
    return min(fixes or range(len(tables)), key=lambda k: len(tables[k]))


def interpolated(
    table: LogTable, taken: Mapping[str, Array], stamps: Array, prefixes: Sequence[str]
) -> tuple[dict[str, Array], Array]:
    """Columns of a file at other stamps; NaN where the file has a gap.  Also which are covered."""
    own = table.columns[TIME]
    if own.shape[0] < 2:
        raise refuse(table.path, "too few rows to interpolate", found=str(own.shape[0]))
    right = np.clip(np.searchsorted(own, stamps), 1, own.shape[0] - 1)
    step = own[right] - own[right - 1]
    inside = (stamps >= own[0]) & (stamps <= own[-1])
    covered = inside & (step <= REACH * np.median(np.diff(own)))
    result: dict[str, Array] = {}
    for prefix in dict.fromkeys(("", "reference_", *prefixes)):
        names = tuple(prefix + n for n in ATTITUDE)
        if all(n in taken for n in names):
            euler = _slerp(own, np.stack([taken[n] for n in names], axis=1), stamps, right)
            result |= {n: euler[:, k] for k, n in enumerate(names)}
    for name, values in taken.items():
        if name not in result:
            slope = taken.get(_slope_name(name))
            whole = _unwound(values) if name.endswith(TURNING) else values
            result[name] = hermite(own, whole, slope, stamps, right)
    for values in result.values():
        values[~covered] = np.nan
    return result, covered


def _unwound(angle: Array) -> Array:
    """An angle [rad] without the jumps of a whole turn."""
    known = np.isfinite(angle)
    result = angle.copy()
    result[known] = np.unwrap(angle[known])
    return result


def _slope_name(name: str) -> str:
    """The velocity column that belongs to a position column of the same file."""
    for kind in ("position", "reference"):
        for axis in NED:
            if name.endswith(f"{kind}_{axis}_m"):
                return name.replace(f"{kind}_{axis}_m", f"velocity_{axis}_mps")
    return ""


def hermite(own: Array, values: Array, slope: Array | None, stamps: Array, right: Index) -> Array:
    """Cubic Hermite interpolation with known slopes, or with those of a parabola."""
    slopes = np.gradient(values, own) if slope is None else slope
    left = right - 1
    h = own[right] - own[left]
    u = (stamps - own[left]) / h
    a, b = values[left], values[right]
    result: Array = (
        (1 + 2 * u) * (1 - u) ** 2 * a
        + u * (1 - u) ** 2 * h * slopes[left]
        + u * u * (3 - 2 * u) * b
        + u * u * (u - 1) * h * slopes[right]
    )
    return result


def _slerp(own: Array, euler: Array, stamps: Array, right: Index) -> Array:
    """Attitude at the stamps along the shortest turn between the neighbours, as Euler angles."""
    from scipy.spatial.transform import Rotation

    left = right - 1
    before, after = (Rotation.from_matrix(euler_to_rotation(euler[k])) for k in (left, right))
    share = (stamps - own[left]) / (own[right] - own[left])
    turn = (before.inv() * after).as_rotvec() * share[:, None]
    return rotation_to_euler((before * Rotation.from_rotvec(turn)).as_matrix())


def _tracks(
    table: LogTable, taken: Mapping[str, Array], prefixes: Sequence[str]
) -> dict[str, LogTrack]:
    tracks = {}
    for prefix in dict.fromkeys(("", *prefixes)):
        for word, names in (("velocity", VELOCITY), ("rate", RATE)):
            if all(prefix + n in taken for n in names):
                value = np.stack([taken[prefix + n] for n in names], axis=1)
                kept = np.all(np.isfinite(value), axis=1)
                tracks[prefix + word] = LogTrack(table.columns[TIME][kept], value[kept])
    return tracks
