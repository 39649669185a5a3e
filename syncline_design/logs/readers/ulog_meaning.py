"""What the topics of PX4 measure: columns with unit, frame and body, by the fields they have.

Conventions of PX4: local frame north, east, down; body forward, right, down; quaternions w, x, y,
z from body to local.  Old topics give degrees times 1e7 and millimetres; ref_alt and alt are above
sea level.  Source: msg/*.msg of PX4-Autopilot.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers.stream import Body, Frame, Nature
from syncline_design.machine.quick_dataclass import dataclass

Column = Callable[[NDArray[Any]], NDArray[Any]]
Fields = Mapping[str, tuple[int, str]]

LEAST_FIX: Final = 2  # fix_type of a two-dimensional fix
FUSED: Final = "estimated from the GNSS among others: no independent reference for it"
QUATERNION: Final = ("quaternion_w", "quaternion_x", "quaternion_y", "quaternion_z")
BODY: Final = "quaternion is w, x, y, z from body (forward, right, down) to north, east, down"


@dataclass(frozen=True, slots=True)
class Meaning:
    """How a topic's fields become columns."""

    quantity: tuple[str, ...]
    columns: Mapping[str, Column]
    frame: Frame = "unknown"
    body: Body = "unknown"
    notes: tuple[str, ...] = ()
    nature: Nature = "measured"


def meaning_of(kind: str, fields: Fields) -> Meaning | None:
    """By the topic's name and the fields that it has; None for other topics."""
    if "setpoint" in kind or "status" in kind or kind in ("home_position", "mission"):
        return None
    for make in (_gnss, _global, _local, _odometry, _attitude, _rates, _range):
        found = make(kind, fields)
        if found is not None:
            return found
    return None


def _as(name: str, factor: float = 1.0) -> Column:
    return lambda table: table[name].astype(float) * factor


def _has(fields: Fields, *names: str) -> bool:
    return all(name in fields for name in names)


def _nature(kind: str) -> Nature:
    return "truth" if kind.endswith("groundtruth") else "fused"


def _gnss(kind: str, fields: Fields) -> Meaning | None:
    if "gps" not in kind or "time_utc_usec" not in fields:
        return None
    if _has(fields, "lat", "lon", "alt"):
        names, degree, metre = ("lat", "lon", "alt", "alt_ellipsoid"), 1e-7, 1e-3
        said = "latitude and longitude in 1e-7 deg (1.1 cm), heights in mm"
    elif _has(fields, "latitude_deg", "longitude_deg", "altitude_msl_m"):
        names = ("latitude_deg", "longitude_deg", "altitude_msl_m", "altitude_ellipsoid_m")
        degree, metre, said = 1.0, 1.0, "latitude and longitude as doubles"
    else:
        return None
    lat, lon, sea, ellipsoid = names
    fixed = _fixed if "fix_type" in fields else _always
    columns: dict[str, Column] = {
        "latitude_deg": fixed(_as(lat, degree)),
        "longitude_deg": fixed(_as(lon, degree)),
        "height_msl_m": fixed(_as(sea, metre)),
    }
    heights = "height is above sea level: the topic has no other"
    if ellipsoid in fields:
        columns["height_m"] = fixed(_as(ellipsoid, metre))
        heights = "height_m is above the ellipsoid, height_msl_m above sea level"
    quantity = ["position", "clock"]
    if _has(fields, "vel_n_m_s", "vel_e_m_s", "vel_d_m_s"):
        quantity.insert(1, "velocity")
        for ours, theirs in zip(("north", "east", "down"), "ned", strict=True):
            columns[f"velocity_{ours}_mps"] = fixed(_as(f"vel_{theirs}_m_s"))
    for name in ("eph", "epv"):
        if name in fields:
            columns[f"{name}_m"] = _as(name)
    columns["clock_utc_ns"] = _utc
    notes = (said, heights, "fixes below 2D are left out")
    return Meaning(tuple(quantity), columns, "wgs84", notes=notes)


def _utc(table: NDArray[Any]) -> NDArray[Any]:
    whole: NDArray[Any] = (table["time_utc_usec"].astype(np.uint64) * np.uint64(1000)).astype(
        np.int64
    )
    return whole


def _fixed(column: Column) -> Column:
    """NaN before a fix: the receiver writes zeros then."""

    def masked(table: NDArray[Any]) -> NDArray[Any]:
        values: NDArray[Any] = np.where(table["fix_type"] >= LEAST_FIX, column(table), np.nan)
        return values

    return masked


def _always(column: Column) -> Column:
    return column


def _global(kind: str, fields: Fields) -> Meaning | None:
    if "global_position" not in kind or not _has(fields, "lat", "lon", "alt"):
        return None
    if fields["lat"][1] != "<f8":
        return None
    columns: dict[str, Column] = {
        "latitude_deg": _as("lat"), "longitude_deg": _as("lon"), "height_msl_m": _as("alt"),
    }  # fmt: skip
    if "alt_ellipsoid" in fields:
        columns["height_m"] = _as("alt_ellipsoid")
    nature = _nature(kind)
    notes = ("height_msl_m is above sea level", *((FUSED,) if nature == "fused" else ()))
    return Meaning(("position",), columns, "wgs84", notes=notes, nature=nature)


def _local(kind: str, fields: Fields) -> Meaning | None:
    if "local_position" not in kind or not _has(fields, "x", "y", "z"):
        return None
    columns: dict[str, Column] = {
        f"position_{a}_m": _valid(a, "z_valid" if a == "z" else "xy_valid", fields) for a in "xyz"
    }
    quantity = ["position"]
    if _has(fields, "vx", "vy", "vz"):
        quantity.append("velocity")
        for ours, theirs in zip(("north", "east", "down"), "xyz", strict=True):
            columns[f"velocity_{ours}_mps"] = _as(f"v{theirs}")
    said = ["north, east, down about its own origin"]
    if _has(fields, "ref_lat", "ref_lon", "ref_alt"):
        degree = 1.0 if fields["ref_lat"][1] == "<f8" else 1e-7
        columns["origin_latitude_deg"] = _valid("ref_lat", "xy_global", fields, degree)
        columns["origin_longitude_deg"] = _valid("ref_lon", "xy_global", fields, degree)
        columns["origin_height_msl_m"] = _valid("ref_alt", "z_global", fields)
        said.append("the origin is given, its height above sea level")
    nature = _nature(kind)
    said += [FUSED] if nature == "fused" else []
    return Meaning(tuple(quantity), columns, "ned", notes=tuple(said), nature=nature)


def _valid(name: str, flag: str, fields: Fields, factor: float = 1.0) -> Column:
    """NaN where the topic's own flag says that the value is none."""
    column = _as(name, factor)
    if flag not in fields:
        return column

    def masked(table: NDArray[Any]) -> NDArray[Any]:
        values: NDArray[Any] = np.where(table[flag] != 0, column(table), np.nan)
        return values

    return masked


def _odometry(kind: str, fields: Fields) -> Meaning | None:
    if "odometry" not in kind or "q[0]" not in fields:
        return None
    place = ("position[0]", "position[1]", "position[2]")
    place = place if _has(fields, *place) else ("x", "y", "z")
    if not _has(fields, *place):
        return None
    columns: dict[str, Column] = {
        f"position_{a}_m": _as(n) for a, n in zip("xyz", place, strict=True)
    }
    columns |= {n: _as(f"q[{k}]") for k, n in enumerate(QUATERNION)}
    notes = (BODY, "its frame may be north, east, down or forward, right, down (pose_frame)")
    nature: Nature = "measured" if "visual" in kind or "mocap" in kind else "fused"
    return Meaning(("position", "attitude"), columns, "ned", "frd", notes, nature)


def _attitude(kind: str, fields: Fields) -> Meaning | None:
    if "attitude" not in kind or not _has(fields, "q[0]", "q[1]", "q[2]", "q[3]"):
        return None
    columns: dict[str, Column] = {n: _as(f"q[{k}]") for k, n in enumerate(QUATERNION)}
    quantity = ["attitude"]
    if _has(fields, "rollspeed", "pitchspeed", "yawspeed"):
        quantity.append("rate")
        names = zip("xyz", ("rollspeed", "pitchspeed", "yawspeed"), strict=True)
        columns |= {f"rate_{axis}_radps": _as(name) for axis, name in names}
    return Meaning(tuple(quantity), columns, "ned", "frd", (BODY,), _nature(kind))


def _rates(kind: str, fields: Fields) -> Meaning | None:
    if kind == "vehicle_angular_velocity" and "xyz[0]" in fields:
        columns = {f"rate_{axis}_radps": _as(f"xyz[{k}]") for k, axis in enumerate("xyz")}
        return Meaning(("rate",), columns, body="frd")
    if kind == "sensor_combined" and _has(fields, "gyro_rad[0]", "accelerometer_m_s2[0]"):
        columns = {f"rate_{axis}_radps": _as(f"gyro_rad[{k}]") for k, axis in enumerate("xyz")}
        columns |= {
            f"acceleration_{axis}_mps2": _as(f"accelerometer_m_s2[{k}]")
            for k, axis in enumerate("xyz")
        }
        return Meaning(("rate", "acceleration"), columns, body="frd")
    return None


def _range(kind: str, fields: Fields) -> Meaning | None:
    if kind != "distance_sensor" or "current_distance" not in fields:
        return None
    return Meaning(("ranging",), {"range_m": _as("current_distance")}, body="frd")
