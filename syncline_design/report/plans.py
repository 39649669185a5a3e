"""The outputs of `plan` in every format: documents, and the path as waypoints."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import chain, repeat
from typing import Any, Final
from xml.etree import ElementTree as Xml

import numpy as np

from syncline_design.planning.path import PathStates
from syncline_design.planning.telling import PlanRun
from syncline_design.report.csv_out import plain_csv
from syncline_design.report.json_out import json_text
from syncline_design.report.on_plan import on_plan
from syncline_design.report.rendered import rendered
from syncline_design.report.text import visible

COLUMNS: Final = (
    "time_s", "north_m", "east_m", "down_m", "roll_deg", "pitch_deg", "yaw_deg",
    "target_north_m", "target_east_m", "target_down_m", "leg",
)  # fmt: skip
KML: Final = "http://www.opengis.net/kml/2.2"
WAYPOINT, CHANGE_SPEED, TAKEOFF = 16, 178, 22  # MAV_CMD of MAVLink's common set
HEADING, REVERSE = 115, 194  # the same: CONDITION_YAW, DO_SET_REVERSE
AIRSPEED, GROUND_SPEED = 0, 1  # SPEED_TYPE of CHANGE_SPEED
RELATIVE, MISSION = 3, 2  # MAV_FRAME: relative to home; of a command without a place
GENERIC, FIXED_WING, QUADROTOR, ROVER, BOAT, SUBMARINE = 0, 1, 2, 10, 11, 12  # MAV_TYPE
VEHICLES: Final = {
    "multirotor": QUADROTOR, "fixed_wing": FIXED_WING, "ground": ROVER, "surface": BOAT,
    "underwater": SUBMARINE,
}  # fmt: skip
ARDUPILOT = 3  # MAV_AUTOPILOT
APART_M, APART_S = 0.05, 5.0  # by how much a straight line may miss the path, and for how long
APART_RAD: Final = math.radians(10.0)  # by which a steady turn may miss a heading that is flown
MOST_TURN_RAD: Final = math.radians(120.0)  # in one command
SAME_DEG: Final = 1.0  # of headings that need no command of their own
LINE_ROWS: Final = 5  # rows from point to point of a drawn line


def render_plan(name: str, run: PlanRun) -> str:
    """The text of one format."""
    match name:
        case "csv":
            return waypoints_csv(run)
        case "kml":
            return kml(run)
        case "qgc":
            return qgc(run)
        case _:
            return rendered(name, run.result, lambda: on_plan(run))


def waypoints_csv(run: PlanRun) -> str:
    """The path row by row: pose of the reference point, the target aimed at, the leg."""
    path, legs = run.path, run.result.legs
    rows = (
        [
            round(float(t), 4),
            *pose,
            *(None if math.isnan(v) else round(float(v), 4) for v in target),
            legs[leg].name,
        ]
        for t, pose, target, leg in zip(
            path.time_s, _pose(path), run.target_m, run.leg, strict=True
        )
    )
    more = [(name, _pose(one)) for name, one in run.others.items()]
    names = [f"{stage}_{column}" for stage, _ in more for column in COLUMNS[1:7]]
    beside = zip(*(pose for _, pose in more), strict=True) if more else repeat(())
    whole = ([*row, *chain.from_iterable(own)] for row, own in zip(rows, beside, strict=False))
    return plain_csv((*COLUMNS, *names), whole)


def _pose(states: PathStates) -> list[list[float]]:
    """Place and attitude row by row, as they are written."""
    angles = np.degrees(
        np.column_stack([states.euler_rad[:, :2], _wrapped(states.euler_rad[:, 2])])
    )
    return [
        [*(round(float(v), 4) for v in place), *(round(float(v), 5) for v in turn)]
        for place, turn in zip(states.position_m, angles, strict=True)
    ]


def _wrapped(angle: Any) -> Any:
    return np.angle(np.exp(1j * angle))


def geodetic(run: PlanRun, places_m: Any) -> Any:
    """Latitude, longitude [deg] and height above the ellipsoid [m] of local places (n, 3)."""
    import pymap3d

    assert run.result.origin_deg_m is not None
    found = pymap3d.ned2geodetic(*np.asarray(places_m, dtype=float).T, *run.result.origin_deg_m)
    return np.column_stack([np.atleast_1d(v) for v in found])


def kml(run: PlanRun) -> str:
    """The path, its legs and the targets as KML 2.2 (OGC 07-147r2).

    Heights are above the WGS 84 ellipsoid, as the origin's is; a viewer draws them above the geoid.
    """
    Xml.register_namespace("", KML)
    root = Xml.Element(f"{{{KML}}}kml")
    document = _child(root, "Document")
    _child(document, "name", visible(run.result.spec.name))
    _child(document, "description", "Heights are above the WGS 84 ellipsoid.")
    for leg, rows in _legs(run):
        planned = run.result.legs[leg]
        mark = _child(document, "Placemark")
        _child(mark, "name", visible(planned.name))
        _child(mark, "description", visible(planned.words))
        line = _child(mark, "LineString")
        _child(line, "altitudeMode", "absolute")
        _child(line, "coordinates", _coordinates(geodetic(run, run.path.position_m[rows])))
    for name, ends in _before_and_after(run):
        mark = _child(document, "Placemark")
        _child(mark, "name", name)
        line = _child(mark, "LineString")
        _child(line, "altitudeMode", "absolute")
        _child(line, "coordinates", _coordinates(geodetic(run, ends)))
    for target in run.result.targets:
        mark = _child(document, "Placemark")
        _child(mark, "name", f"target {visible(target.label)}")
        point = _child(mark, "Point")
        _child(point, "altitudeMode", "absolute")
        place = [[target.north_m, target.east_m, target.down_m]]
        _child(point, "coordinates", _coordinates(geodetic(run, place)))
    Xml.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, "unicode") + "\n"


def _before_and_after(run: PlanRun) -> Iterator[tuple[str, Any]]:
    """The run-up and the run-out: name, and both ends."""
    places, beside = run.path.position_m, run.approach
    if beside.run_up_m is not None:
        yield "run-up, not logged", np.stack([beside.run_up_m, places[0]])
    if beside.run_out_m is not None:
        yield "run-out, not logged", np.stack([places[-1], beside.run_out_m])


def _child(parent: Xml.Element, name: str, text: str | None = None) -> Xml.Element:
    child = Xml.SubElement(parent, f"{{{KML}}}{name}")
    child.text = text
    return child


def _coordinates(places: Any) -> str:
    return " ".join(f"{lon:.9f},{lat:.9f},{height:.3f}" for lat, lon, height in places)


def _legs(run: PlanRun) -> Iterator[tuple[int, Any]]:
    """Every leg with rows of its path, its end the next one's begin."""
    leg = np.array(run.leg)
    for k in range(len(run.result.legs)):
        own = np.flatnonzero(leg == k)
        if own.size:
            last = min(own[-1] + 1, len(leg) - 1)
            yield k, np.unique(np.r_[own[::LINE_ROWS], own[-1], last])


def qgc(run: PlanRun) -> str:
    """A mission for QGroundControl: speeds and places, heights relative to the origin (home).

    Structure: the plan file format of QGroundControl's developer guide, version 1.
    """
    items = list(_items(run))
    home = list(run.result.origin_deg_m or (0.0, 0.0, 0.0))
    axes = 2 if run.motion == "surface" else 3
    fast = float(np.max(np.linalg.norm(run.path.velocity_mps[:, :axes], axis=1)))
    mission = {
        "cruiseSpeed": round(fast, 2),
        "firmwareType": ARDUPILOT,
        "globalPlanAltitudeMode": 1,
        "hoverSpeed": round(fast, 2),
        "items": [{**item, "doJumpId": k} for k, item in enumerate(items, start=1)],
        "plannedHomePosition": home,
        "vehicleType": VEHICLES.get(run.motion, GENERIC),
        "version": 2,
    }
    return json_text(
        {
            "fileType": "Plan",
            "geoFence": {"circles": [], "polygons": [], "version": 2},
            "groundStation": "QGroundControl",
            "mission": mission,
            "rallyPoints": {"points": [], "version": 2},
            "version": 1,
        }
    )


def _items(run: PlanRun) -> Iterator[dict[str, Any]]:
    """A take-off for what flies, then the speed to each place, how it is headed, and the place."""
    path, commanded_m = run.path, _commanded(run)
    places, height = geodetic(run, commanded_m), -commanded_m[:, 2]
    yaw = np.unwrap(path.euler_rad[:, 2])
    begun = places[0] if run.approach.run_up_m is None else _beside(run, run.approach.run_up_m)
    if run.motion in ("multirotor", "fixed_wing"):
        yield _item(TAKEOFF, [0, 0, 0, None, *_place(begun, height[0])])
    said = -1.0
    kept = corners(path.time_s, commanded_m, yaw if run.motion == "multirotor" else None)
    headed = _headed(run, kept, yaw)
    for before, k in zip([0, *kept], kept, strict=False):
        step = commanded_m[k] - commanded_m[before]
        lasts = float(path.time_s[k] - path.time_s[before])
        speed = round(float(np.linalg.norm(step)) / lasts, 2) if lasts > 0.0 else 0.0
        moving = speed > 0.05
        if moving and abs(speed - said) > 0.02 * max(speed, said):
            yield _at_speed(run, speed)
            said = speed
        yield from headed.get(k, ())
        to = round(math.degrees(yaw[k]) % 360.0, 1)
        if k == 0 and run.approach.run_up_m is not None:
            said = round(run.approach.begins_mps, 2)
            yield _at_speed(run, said)
            yield _item(WAYPOINT, [0, 0, 0, to, *_place(begun, height[0])])
        hold = 0.0 if moving else round(lasts, 1)
        yield _item(WAYPOINT, [hold, 0, 0, to, *_place(places[k], height[k])])
    if run.approach.run_out_m is not None:  # without it an autopilot brakes before the end
        yield _item(
            WAYPOINT, [0, 0, 0, to, *_place(_beside(run, run.approach.run_out_m), height[-1])]
        )


def _at_speed(run: PlanRun, speed_mps: float) -> dict[str, Any]:
    """The speed from here on.  ArduPlane takes a speed over ground for the least that it may have,
    and goes at the speed through the air that it was told; the plan is made for still air."""
    kind = AIRSPEED if run.motion == "fixed_wing" else GROUND_SPEED
    return _item(CHANGE_SPEED, [kind, speed_mps, -1, 0, 0, 0, 0], MISSION)


def _beside(run: PlanRun, place_m: Any) -> Any:
    return geodetic(run, place_m[None, :])[0]


def _commanded(run: PlanRun) -> Any:
    """Places that a vehicle is sent to (n, 3) [m]: no ship is told to heave."""
    places = run.path.position_m
    if run.motion != "surface":
        return places
    return np.column_stack([places[:, :2], np.full(len(places), np.mean(places[:, 2]))])


def _headed(run: PlanRun, kept: list[int], yaw: Any) -> dict[int, list[dict[str, Any]]]:
    """By place, how to head there, of what may head elsewhere than it goes.

    ArduPilot does not look at the heading of a waypoint: a copter is told with a command of its
    own, by so many degrees a second and which way round; what goes astern on the ground or on
    water, to reverse.
    """
    ways = list(zip([kept[0], *kept], kept, strict=False))
    if run.motion == "multirotor":
        return dict(_turned(run, ways, yaw))
    return dict(_reversed(run, ways, yaw)) if run.motion in ("ground", "surface") else {}


def _turned(run: PlanRun, ways: list[tuple[int, int]], yaw: Any) -> Iterator[tuple[int, Any]]:
    """Headings of a copter, each as it is another than was told before."""
    told = math.inf
    for before, k in ways:
        to = math.degrees(yaw[k])
        if abs(to - told) < SAME_DEG:
            continue
        turn = to - math.degrees(yaw[before])
        lasts = float(run.path.time_s[k] - run.path.time_s[before])
        rate = round(abs(turn) / lasts, 1) if lasts > 0.0 else 0.0
        way = 0 if abs(turn) < SAME_DEG else math.copysign(1, turn)
        yield k, [_item(HEADING, [round(to % 360.0, 1), rate, way, 0, 0, 0, 0], MISSION)]
        told = to


def _reversed(run: PlanRun, ways: list[tuple[int, int]], yaw: Any) -> Iterator[tuple[int, Any]]:
    """Where a vehicle begins to go astern, and where it goes ahead again."""
    astern = False
    for before, k in ways:
        step = run.path.position_m[k] - run.path.position_m[before]
        ahead = step[0] * math.cos(yaw[before]) + step[1] * math.sin(yaw[before])
        if abs(ahead) > APART_M and (ahead < 0.0) != astern:
            astern = not astern
            yield k, [_item(REVERSE, [int(astern), 0, 0, 0, 0, 0, 0], MISSION)]


def _place(place: Any, height_m: float) -> list[float]:
    figures = (round(float(place[0]), 9), round(float(place[1]), 9), round(float(height_m), 3))
    return [one + 0.0 for one in figures]  # no -0.0


def _item(command: int, params: list[Any], frame: int = RELATIVE) -> dict[str, Any]:
    return {
        "autoContinue": True, "command": command, "frame": frame, "params": params,
        "type": "SimpleItem",
    }  # fmt: skip


def corners(time_s: Any, places_m: Any, yaw: Any = None) -> list[int]:
    """Rows of a path between which straight lines at constant speed miss it by APART_M at most,
    and steady turns its headings (where they count) by APART_RAD."""
    kept, begun = [0], 0
    for k in range(2, len(time_s)):
        share = (time_s[begun + 1 : k] - time_s[begun]) / (time_s[k] - time_s[begun])
        line = places_m[begun] + share[:, None] * (places_m[k] - places_m[begun])
        off = float(np.max(np.linalg.norm(places_m[begun + 1 : k] - line, axis=1)))
        scale = max(APART_M, 0.02 * float(np.linalg.norm(places_m[k] - places_m[begun])))
        turned = yaw is not None and _turns_apart(yaw[begun : k + 1], share)
        if off > scale or time_s[k] - time_s[begun] > APART_S or turned:
            begun = k - 1
            kept.append(begun)
    return [*kept, len(time_s) - 1]


def _turns_apart(yaw: Any, share: Any) -> bool:
    """Whether headings are no steady turn, or more than one command turns."""
    turn = yaw[-1] - yaw[0]
    missed = float(np.max(np.abs(yaw[1:-1] - yaw[0] - share * turn)))
    return missed > APART_RAD or abs(turn) > MOST_TURN_RAD
