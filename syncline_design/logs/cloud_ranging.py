"""Points of a cloud and the trajectory that it was made with, as range and bearing of each point.

A point stands at p + R (l + rho), with p and R of the trajectory at the point's time, l the lever
arms of the spec and rho what the scanner measured.  So

    rho = R^T (point - p) - l,   range = |rho|,   n = rho / range

and the chain gives the point back to the last digit, whatever arms its software used: what is wrong
with the point is what is wrong with the system that made it.  Which target a point is of is told by
`target_id` of the cloud, else by the surveyed target next to it, where points gather at targets.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.kinematics import euler_to_rotation, rotate
from syncline_design.effects.record import Array
from syncline_design.logs.columns import ATTITUDE, GEODETIC, RANGING, TARGET, TARGET_ID, TIME
from syncline_design.logs.merging import interpolated
from syncline_design.logs.places import geodetic_to_ned
from syncline_design.logs.readers.stream import UNSET
from syncline_design.logs.refusals import refuse
from syncline_design.logs.stream_values import ENU_TO_NED, GLOBE, StreamValues
from syncline_design.logs.surveys import Survey
from syncline_design.logs.tables import LogTable
from syncline_design.logs.utm import utm_to_geodetic, zone_of
from syncline_design.model.figure_text import percent, to_places
from syncline_design.spec.log_block import LogChoice

POINT: Final = tuple(f"point_{axis}_m" for axis in "xyz")
ZONE: Final = "utm_zone"
Mask = NDArray[np.bool_]
Arms = tuple[Array, Array]  # of the ranging sensor and of the antenna, forward, right, down [m]
NO_ARMS: Final[Arms] = (np.zeros(3), np.zeros(3))
_FARTHEST_M: Final = 50_000.0  # from the trajectory: further points are of another frame
_NEXT: Final = 1.0 / 3.0  # of the way to the second target: nearer points are the first's
_GATHER: Final = 0.1  # of that way, in the middle: points of a ground are as far as it goes
_NANO: Final = 1e9


def with_ranges(
    cloud: StreamValues, place: StreamValues, turn: StreamValues, choice: LogChoice,
    survey: Survey | None, arms: Arms = NO_ARMS,
) -> None:  # fmt: skip
    """Give a cloud range, bearing and target of its points, in the order of their times."""
    if not place.has((*GLOBE, "height_m")) or not turn.has(ATTITUDE):
        raise refuse(
            place.offer.path,
            f"{place.offer.name} does not tell places in WGS 84 with heights and attitudes",
            expected="the trajectory that the cloud was made with, such as an SBET",
        )
    stamps, points = _in_order(cloud)
    lat_lon_h, covered = _at(place, (*GLOBE, "height_m"), stamps)
    euler, turned = _at(turn, ATTITUDE, stamps)
    known = covered & turned
    if not np.any(known):
        raise refuse(
            cloud.offer.path,
            "no point was measured while the trajectory runs",
            found=f"points from {to_places(stamps[0], 3)} to {to_places(stamps[-1], 3)} s",
            hint="are both on one clock? log: {timeline: ..., gps_week: ...}",
        )
    globe = _on_globe(cloud, points, lat_lon_h[known], choice)
    seen = _seen_from(globe, lat_lon_h)
    apart = float(np.median(np.linalg.norm(seen[known], axis=1)))
    if not apart < _FARTHEST_M:
        raise refuse(
            cloud.offer.path,
            "the points lie elsewhere than the trajectory",
            expected=f"points within {to_places(_FARTHEST_M / 1e3, 0)} km of it",
            found=f"{to_places(apart / 1e3, 1)} km away in the middle",
            hint="say the cloud's frame: log: {frame: enu, origin: [47.3 deg, 8.55 deg, 460 m]}",
        )
    ranging, antenna = arms
    own = rotate(np.swapaxes(euler_to_rotation(euler), -1, -2), seen) - ranging + antenna
    _put_ranges(cloud, own)
    if TARGET_ID not in cloud.columns:
        cloud.columns[TARGET_ID] = _nearest(cloud, globe, survey, choice)
    cloud.note(
        f"range and bearing of its points were taken from {place.offer.name}, at the spec's lever "
        f"arms ({percent(float(np.mean(known)))} of the points lie within its time)"
    )


def _in_order(cloud: StreamValues) -> tuple[Array, Array]:
    """Seconds and places of the points, sorted by time; those without time left out."""
    kept = np.flatnonzero(cloud.time_ns != UNSET)
    kept = kept[np.argsort(cloud.time_ns[kept], kind="stable")]
    if not kept.shape[0]:
        raise refuse(cloud.offer.path, "no point of the cloud has a time")
    cloud.time_ns = cloud.time_ns[kept]
    cloud.columns = {name: values[kept] for name, values in cloud.columns.items()}
    return cloud.time_ns / _NANO, cloud.vectors(POINT)


def _at(one: StreamValues, names: Sequence[str], stamps: Array) -> tuple[Array, Mask]:
    """Columns of a trajectory at other times, as rows of several files are joined."""
    set_ = np.flatnonzero(one.time_ns != UNSET)
    order = set_[np.argsort(one.time_ns[set_], kind="stable")]
    first = np.concatenate([[True], np.diff(one.time_ns[order]) > 0])
    order = order[first]
    taken = {name: one.columns[name][order] for name in names}
    table = LogTable(one.offer.path, {TIME: one.time_ns[order] / _NANO, **taken}, ())
    found, covered = interpolated(table, taken, stamps, ("",))
    return np.stack([found[name] for name in names], axis=1), np.asarray(covered, dtype=bool)


def _on_globe(cloud: StreamValues, points: Array, went: Array, choice: LogChoice) -> Array:
    """Latitude, longitude [rad], height [m] of points, by what tells their frame."""
    if cloud.offer.stream.frame != "utm" and choice.origin is not None:
        return _about_origin(cloud, points, choice)
    zone, south = _zone(cloud, went)
    known = cloud.columns.get(ZONE)
    if known is None and not _is_grid(points):
        raise refuse(
            cloud.offer.path,
            "nothing tells where the cloud's coordinates count from",
            expected="UTM, or the origin of its frame",
            hint="say it: log: {frame: enu, origin: [47.3 deg, 8.55 deg, 460 m]}",
        )
    assumed = "" if known is not None else ", which the file does not tell: by size, and by the "
    assumed += "" if known is not None else "trajectory's longitude"
    cloud.note(f"points are in UTM zone {zone}{'S' if south else 'N'}{assumed}; their heights were "
               "taken as above the ellipsoid")  # fmt: skip
    lat_lon = utm_to_geodetic(points[:, 0], points[:, 1], zone, south=south)
    return np.column_stack([lat_lon, points[:, 2]])


def _zone(cloud: StreamValues, went: Array) -> tuple[int, bool]:
    told = cloud.columns.get(ZONE)
    if told is not None:
        return int(abs(told[0])), bool(told[0] < 0)
    middle = np.median(went, axis=0)
    return zone_of(float(middle[1])), bool(middle[0] < 0.0)


def _is_grid(points: Array) -> bool:
    east, north = np.median(points[:, :2], axis=0)
    return bool(1e5 <= east < 1e6 and 0.0 <= north < 1e7 and north > 1e3)


def _about_origin(cloud: StreamValues, points: Array, choice: LogChoice) -> Array:
    """Of a local frame at the spec's origin."""
    import pymap3d

    assert choice.origin is not None
    frame = choice.frame or "enu"
    if choice.frame is None:
        cloud.note("the frame of its points is not told: east, north, up about the origin is "
                   "assumed (log: {frame: ...})")  # fmt: skip
    ned = points @ (ENU_TO_NED.T if frame == "enu" else np.eye(3))
    lat, lon, height = pymap3d.ned2geodetic(*ned.T, *np.degrees(choice.origin[:2]),
                                            choice.origin[2])  # fmt: skip
    return np.column_stack([np.radians(lat), np.radians(lon), height])


def _seen_from(globe: Array, place: Array) -> Array:
    """North, east, down [m] of points from the vehicle, each in the vehicle's own local level."""
    import pymap3d

    degrees = np.degrees(globe[:, :2])
    at = np.degrees(place[:, :2])
    ned = pymap3d.geodetic2ned(
        degrees[:, 0], degrees[:, 1], globe[:, 2], at[:, 0], at[:, 1], place[:, 2]
    )
    seen: Array = np.stack(ned, axis=1)
    return seen


def _put_ranges(cloud: StreamValues, own: Array) -> None:
    distance = np.linalg.norm(own, axis=1)
    azimuth = np.arctan2(own[:, 1], own[:, 0])
    elevation = -np.arcsin(np.clip(own[:, 2] / np.maximum(distance, 1e-9), -1.0, 1.0))
    cloud.put(RANGING, np.stack([distance, azimuth, elevation], axis=1))


def _nearest(
    cloud: StreamValues, globe: Array, survey: Survey | None, choice: LogChoice
) -> Array:  # fmt: skip
    """Labels of the targets that points lie at; NaN of those that lie at none."""
    if survey is None:
        raise refuse(
            cloud.offer.path,
            "nothing tells which target a point is of",
            field=TARGET_ID,
            expected="a survey of targets beside, or an extra dimension target_id in the cloud",
        )
    origin = np.median(globe, axis=0) if choice.origin is None else np.asarray(choice.origin)
    targets = _targets(survey, origin)
    points = geodetic_to_ned(globe, origin)
    away = np.stack([np.linalg.norm(points - one, axis=1) for one in targets], axis=1)
    labels = _labels(survey)
    if targets.shape[0] == 1:
        raise refuse(
            cloud.offer.path,
            "which points are of the one target is not told",
            field=TARGET_ID,
            expected="an extra dimension target_id, or log: {columns: {target_id: user_data}}",
        )
    first, second = np.sort(away, axis=1)[:, :2].T
    at = first < _NEXT * second
    if not np.any(at) or float(np.median(first[at] / second[at])) > _GATHER:
        raise refuse(
            cloud.offer.path,
            "the points do not gather at the surveyed targets",
            field=TARGET_ID,
            expected="returns of targets alone, or an extra dimension target_id",
            found=f"{to_places(float(np.median(first)), 2)} m to the next target in the middle",
        )
    middle = to_places(float(np.median(first[at])), 3)
    cloud.note(f"points were taken as of the target next to them, {middle} m away in the middle; "
               f"{int(np.sum(~at))} lie at none")  # fmt: skip
    return np.where(at, labels[np.argmin(away, axis=1)], np.nan)


def _targets(survey: Survey, origin: Array) -> Array:
    """Surveyed places (n, 3), north, east, down [m] about an origin."""
    if all(name in survey.columns for name in TARGET):
        return np.stack([survey.columns[name] for name in TARGET], axis=1)
    names = [f"target_{name}" for name in GEODETIC]
    return geodetic_to_ned(np.stack([survey.columns[n] for n in names], axis=1), origin)


def _labels(survey: Survey) -> Array:
    """A label of every surveyed row, under which a log finds it."""
    rows: Mapping[float, int] = survey.rows
    found = np.full(len(next(iter(survey.columns.values()))), np.nan)
    for label, row in rows.items():
        found[row] = label
    return found
