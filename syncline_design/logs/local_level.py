"""Attitudes and velocities at the vehicle's own level, turned to the frame of the log's origin.

A log with places in WGS 84 comes from a navigation system whose north is true north, and whose
down is the plumb line, where the vehicle is.  A local frame has one north and one down, those of
its origin: 10 km beside it they differ by 0.09 deg in tilt and, at 69 deg north, 0.23 deg in
heading, more than a good INS errs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from syncline_design.effects.kinematics import euler_to_rotation, rotation_to_euler
from syncline_design.effects.record import Array
from syncline_design.logs.columns import ATTITUDE, TIME, VELOCITY
from syncline_design.logs.log import LogTrack
from syncline_design.model.figure_text import to_places

WORTH_SAYING_RAD = np.radians(0.001)


def turned_to_origin(
    columns: dict[str, Array],
    tracks: Mapping[str, LogTrack],
    prefixes: Sequence[str],
    path: Array,
    origin: Array,
) -> tuple[dict[str, LogTrack], list[str]]:
    """Turn every stage's attitude and velocity columns in place; its tracks, and what was done.

    path (n, 2): latitude and longitude [rad] of the first stage, whose level all stages share;
    origin: those of the local frame.
    """
    stamps = columns[TIME]
    known = np.all(np.isfinite(path), axis=1)
    if not np.any(known):
        return dict(tracks), []
    turn = level_turn(_at(stamps, stamps[known], path[known]), origin)
    for prefix in prefixes:
        _turn_attitude(columns, [prefix + n for n in ATTITUDE], turn)
        _turn_vector(columns, [prefix + n for n in VELOCITY], turn)
    result = dict(tracks)
    for prefix in prefixes:
        track = tracks.get(prefix + "velocity")
        if track is not None:
            there = level_turn(_at(track.time_s, stamps[known], path[known]), origin)
            value = np.einsum("nij,nj->ni", there, track.value)
            result[prefix + "velocity"] = LogTrack(track.time_s, value)
    return result, _said(turn[known])


def level_turn(path: Array, origin: Array) -> Array:
    """C_on (n, 3, 3): takes vectors in the north, east, down of a place to those of the origin.

    C_on = C_eo^T C_en, with the columns of C_en the north, east and down of a latitude and
    longitude in earth-centred axes.  Source: Groves, Principles of GNSS, Inertial, and Multisensor
    Integrated Navigation Systems, 2nd ed., eq. 2.150.
    """
    turn: Array = np.einsum("ji,njk->nik", _axes(origin[None, :2])[0], _axes(path))
    return turn


def _axes(place: Array) -> Array:
    """C_en (n, 3, 3) of latitude and longitude [rad] (n, 2)."""
    (sa, so), (ca, co) = np.sin(place).T, np.cos(place).T
    rows = [[-sa * co, -so, -ca * co], [-sa * so, co, -ca * so], [ca, 0.0 * ca, -sa]]
    return np.moveaxis(np.array(rows), -1, 0)


def _at(stamps: Array, known_s: Array, path: Array) -> Array:
    """Latitude and longitude at stamps, between those that are known."""
    whole = np.unwrap(path, axis=0)
    return np.stack([np.interp(stamps, known_s, whole[:, k]) for k in range(2)], axis=1)


def _turn_attitude(columns: dict[str, Array], names: Sequence[str], turn: Array) -> None:
    """A log that leaves out roll and pitch has only its yaw turned."""
    there = [n for n in names if n in columns]
    if not there:
        return
    zero = np.zeros(turn.shape[0])
    euler = np.stack([columns.get(n, zero) for n in names], axis=1)
    euler = rotation_to_euler(turn @ euler_to_rotation(euler))
    columns |= {n: euler[:, k] for k, n in enumerate(names) if n in there}


def _turn_vector(columns: dict[str, Array], names: Sequence[str], turn: Array) -> None:
    there = [n for n in names if n in columns]
    if not there:
        return
    zero = np.zeros(turn.shape[0])
    value = np.stack([columns.get(n, zero) for n in names], axis=1)
    value = np.einsum("nij,nj->ni", turn, value)
    columns |= {n: value[:, k] for k, n in enumerate(names) if n in there}


def _said(turn: Array) -> list[str]:
    tilt = float(np.max(np.arccos(np.clip(turn[:, 2, 2], -1.0, 1.0))))
    heading = float(np.max(np.abs(np.arctan2(turn[:, 1, 0], turn[:, 0, 0]))))
    if max(tilt, heading) < WORTH_SAYING_RAD:
        return []
    return [
        "attitudes and velocities, true north and down at the vehicle, were turned to those of the "
        f"origin: heading by up to {to_places(np.degrees(heading), 3)} deg, tilt "
        f"{to_places(np.degrees(tilt), 3)} deg"
    ]
