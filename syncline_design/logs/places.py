"""WGS 84 columns of a log to north, east, down about an origin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.logs.columns import GEODETIC, POSITION, REFERENCE, TARGET, shown
from syncline_design.logs.local_level import turned_to_origin
from syncline_design.logs.log import LogTrack
from syncline_design.logs.refusals import refuse
from syncline_design.model.figure_text import to_digits, to_places

Origin = tuple[float, float, float]  # latitude, longitude [rad], height above the ellipsoid [m]

HIGHEST_RAD = 0.5 * np.pi + 1e-12


def made_local(
    path: Path,
    columns: dict[str, Array],
    tracks: Mapping[str, LogTrack],
    prefixes: Sequence[str],
    origin: Origin | None,
) -> tuple[dict[str, LogTrack], list[str]]:
    """Add local columns for all places in WGS 84 and turn the attitudes and velocities with them.

    Gives the tracks, turned alike, and what was done, for people.  Without a stated origin it is
    the first complete row, which suits only a log whose places are all in WGS 84.
    """
    first = prefixes[0]
    pairs = {first: tuple(first + n for n in POSITION), "reference_": REFERENCE, "target_": TARGET}
    notes: list[str] = []
    used = {p: tuple(p + g for g in GEODETIC) for p in pairs if _has_place(columns, p)}
    if not used:
        idle = ["the origin that the spec states has no use: no place is in WGS 84"]
        return dict(tracks), idle * bool(origin)
    level = _level(columns, used, origin)
    for names in used.values():
        if names[2] not in columns:
            columns[names[2]] = np.full(columns[names[0]].shape, level)
            notes.append(
                f"{names[2]} is not in the log: taken as {to_places(level, 3)} m, down not compared"
            )
    _demand_one_kind(path, columns, pairs, used, origin)
    start = np.array(_first_row(path, columns, used)) if origin is None else np.array(origin)
    for prefix, names in used.items():
        place = np.stack([columns[n] for n in names], axis=1)
        _demand_globe(path, place, names)
        local = geodetic_to_ned(place, start)
        columns |= {n: local[:, k] for k, n in enumerate(pairs[prefix])}
        if any(names[2] in note for note in notes):
            del columns[pairs[prefix][2]]
    where = "at the first row" if origin is None else "at the spec's origin"
    at = (
        f"{to_places(np.degrees(start[0]), 7)} deg, {to_places(np.degrees(start[1]), 7)} deg, "
        f"{to_places(start[2], 3)} m"
    )
    notes.append(f"WGS 84 positions were made local (north, east, down) {where}, {at}")
    own = next((p for p in (first, "reference_") if p in used), None)
    if own is None:  # only targets are in WGS 84: the vehicle's frame is that of its places
        return dict(tracks), notes
    went = np.stack([columns[n] for n in used[own][:2]], axis=1)
    turned, said = turned_to_origin(columns, tracks, prefixes, went, start)
    return turned, [*notes, *said]


def _has_place(columns: dict[str, Array], prefix: str) -> bool:
    return all(prefix + name in columns for name in GEODETIC[:2])


def _level(
    columns: dict[str, Array], used: dict[str, tuple[str, ...]], origin: Origin | None
) -> float:
    """Height [m] of places without one: the origin's, or the first of another kind of place."""
    if origin is not None:
        return origin[2]
    there = [columns[names[2]] for names in used.values() if names[2] in columns]
    known = [float(h[np.isfinite(h)][0]) for h in there if np.any(np.isfinite(h))]
    return known[0] if known else 0.0


def _first_row(path: Path, columns: dict[str, Array], used: dict[str, tuple[str, ...]]) -> Array:
    names = next(iter(used.values()))
    place = np.stack([columns[n] for n in names], axis=1)
    complete = np.flatnonzero(np.all(np.isfinite(place), axis=1))
    if not complete.shape[0]:
        raise refuse(path, "no position", field=shown(names[0]))
    first: Array = place[complete[0]]
    return first


def _demand_one_kind(
    path: Path,
    columns: dict[str, Array],
    pairs: dict[str, tuple[str, ...]],
    used: dict[str, tuple[str, ...]],
    origin: Origin | None,
) -> None:
    """Each place is given once; local and WGS 84 places meet only at a stated origin."""
    for prefix, local in pairs.items():
        there = [n for n in local if n in columns]
        if prefix in used and there:
            raise refuse(
                path,
                "both local and WGS 84 coordinates",
                field=shown(used[prefix][0]),
                hint=f"leave out either these or {there[0]}",
            )
        if there and origin is None:
            names = shown(next(iter(used.values()))[0])
            raise refuse(
                path,
                f"{names} is in WGS 84 and {there[0]} is local, and nothing says where its zero is",
                field=there[0],
                expected="the origin of the local frame, or all places of one kind",
                hint="state it in the spec: log: {origin: [47.3 deg, 8.55 deg, 460 m]}",
            )


def _demand_globe(path: Path, place: Array, names: tuple[str, ...]) -> None:
    known = place[np.all(np.isfinite(place), axis=1)]
    if known.shape[0] and float(np.max(np.abs(known[:, 0]))) > HIGHEST_RAD:
        worst = float(np.degrees(np.max(np.abs(known[:, 0]))))
        raise refuse(
            path,
            "no latitude",
            field=shown(names[0]),
            expected="at most 90 deg",
            found=f"{to_digits(worst, 6)} deg",
            hint="is the unit in the column's name right?",
        )


def geodetic_to_ned(place: Array, origin: Array) -> Array:
    """North, east, down [m] (n, 3) of latitude, longitude [rad], height [m] about an origin."""
    import pymap3d

    degrees = np.degrees(place[:, :2])
    ned = pymap3d.geodetic2ned(
        degrees[:, 0], degrees[:, 1], place[:, 2], *np.degrees(origin[:2]), origin[2]
    )
    local: Array = np.stack(ned, axis=1)
    return local
