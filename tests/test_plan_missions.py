"""Plans of vehicles that do not hover, and of a chain, as missions and KML, by their formats.

Oracles: the developer guide's keys of a plan file, the order of OGC's schema, pymap3d.
"""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import jsonschema
import numpy as np
import pymap3d
import pytest

import syncline_design as sd
from syncline_design.planning.drives import outcome
from syncline_design.planning.setup import PlanRequest, Setup
from syncline_design.planning.telling import PlanRun, Telling
from syncline_design.planning.wanted import PlanWanted, reach_of
from syncline_design.report.plans import render_plan
from syncline_design.spec.load import load
from tests.world import make_log, scenario

ORIGIN = (47.3, 8.55, 460.0)
STAMPED = "timestamping: {error: {distribution: uniform, low: -10 ns, high: 10 ns}}"
SPEC = f"""\
syncline: 1
name: vehicle
requirements: [{{id: ACC-1, kind: accuracy, limit: 10 m}}]
stages:
  - name: vehicle
    platform: PLATFORM
    position: {{sensor: {{modality: position, type: gnss, sigma_position: 0.02 m,
      primitives: [pps]}}, primitive: pps, {STAMPED}, lever_arm: [0.25 m, -0.1 m, -0.4 m]}}
    attitude: {{sensor: {{modality: attitude, type: ins, sigma_attitude: 0.05 deg,
      primitives: [pps]}}, primitive: pps, {STAMPED}}}
    ranging: {{sensor: {{modality: ranging, type: lidar, sigma_range: 0.02 m,
      sigma_bearing: [0.02 deg, 0.02 deg], primitives: [pps]}}, primitive: pps, {STAMPED},
      lever_arm: [0.15 m, 0.05 m, 0.2 m]}}
log: {{origin: [47.3 deg, 8.55 deg, 460 m]}}
"""

VEHICLES = {
    "fixed_wing": "v_max: 25 m/s, omega_max: 30 deg/s, distance: 150 m",
    "surface": "v_max: 5 m/s, omega_max: 10 deg/s, distance: 60 m",
    "underwater": "v_max: 2 m/s, omega_max: 15 deg/s, distance: 50 m",
}
MAV_TYPES = {"fixed_wing": 1, "surface": 11, "underwater": 12}
ITEM = {
    "type": "object",
    "required": ["autoContinue", "command", "doJumpId", "frame", "params", "type"],
    "properties": {
        "autoContinue": {"type": "boolean"},
        "command": {"enum": [16, 22, 115, 178, 194]},
        "doJumpId": {"type": "integer", "minimum": 1},
        "frame": {"enum": [2, 3]},
        "params": {
            "type": "array", "minItems": 7, "maxItems": 7, "items": {"type": ["number", "null"]}
        },
        "type": {"const": "SimpleItem"},
    },
}  # fmt: skip
MISSION = {
    "type": "object",
    "required": ["fileType", "geoFence", "groundStation", "mission", "rallyPoints", "version"],
    "properties": {
        "fileType": {"const": "Plan"},
        "version": {"const": 1},
        "geoFence": {"required": ["circles", "polygons", "version"]},
        "rallyPoints": {"required": ["points", "version"]},
        "mission": {
            "required": ["cruiseSpeed", "firmwareType", "hoverSpeed", "items",
                         "plannedHomePosition", "vehicleType", "version"],
            "properties": {
                "cruiseSpeed": {"type": "number", "exclusiveMinimum": 0},
                "hoverSpeed": {"type": "number", "exclusiveMinimum": 0},
                "items": {"type": "array", "minItems": 3, "items": ITEM},
                "plannedHomePosition": {"type": "array", "minItems": 3, "maxItems": 3},
                "version": {"const": 2},
            },
        },
    },
}  # fmt: skip
# element: its children in their order (OGC 07-147r2, ogckml22.xsd)
KML_ORDER = {
    "kml": ["Document"],
    "Document": ["name", "description", "Placemark"],
    "Placemark": ["name", "description", "Point", "LineString"],
    "Point": ["altitudeMode", "coordinates"],
    "LineString": ["altitudeMode", "coordinates"],
}


@pytest.fixture(scope="module", params=VEHICLES)
def other(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> PlanRun:
    """A drive of another kind of vehicle."""
    path = tmp_path_factory.mktemp("vehicles") / f"{request.param}.yaml"
    platform = f"{{{VEHICLES[request.param]}, baseline: 1 m, motion: {request.param}}}"
    path.write_text(SPEC.replace("PLATFORM", platform), encoding="utf-8")
    return sd.plan(path, reach="latency(position)=5 ms", minutes=30.0)


def test_missions_of_other_vehicles_fit_the_format_and_the_vehicle(other: PlanRun) -> None:
    """The developer guide's keys and kinds; a fixed wing never stops, a boat takes no off."""
    plan = json.loads(render_plan("qgc", other))
    jsonschema.validate(plan, MISSION)
    mission, motion = plan["mission"], other.motion
    assert mission["vehicleType"] == MAV_TYPES[motion]
    items = logged(other)
    assert [i["command"] == 22 for i in items] == [
        motion == "fixed_wing",
        *[False] * len(items[1:]),
    ]
    speeds = [i["params"][1] for i in items if i["command"] == 178]
    most = {"fixed_wing": 25.0, "surface": 5.0, "underwater": 2.0}[motion]
    least = {"fixed_wing": 0.6, "surface": 0.0, "underwater": 0.3}[motion] * most
    assert all(least - 0.02 <= speed <= most for speed in speeds)
    places = [i["params"] for i in items if i["command"] == 16]
    if least:
        assert all(params[0] == 0.0 for params in places)  # it cannot hold
    path, axes = other.path, 2 if motion == "surface" else 3
    for *_, lat, lon, height in places:
        local = np.array(pymap3d.geodetic2ned(lat, lon, ORIGIN[2] + height, *ORIGIN))
        far = np.linalg.norm(path.position_m[:, :axes] - local[:axes], axis=1)
        assert far.min() < 0.05
    if motion == "surface":  # waves heave it, nobody does
        assert np.ptp([height for *_, height in places]) < 1e-3
        assert np.ptp(path.position_m[:, 2]) > 0.1
    # driven at these speeds from place to place it takes the time of the path
    driven_s, speed, before = 0.0, math.nan, None
    for item in items:
        if item["command"] == 178:
            speed = item["params"][1]
        elif item["command"] == 16:
            lat, lon, height = item["params"][4:]
            here = np.array(pymap3d.geodetic2ned(lat, lon, ORIGIN[2] + height, *ORIGIN))
            if before is not None:
                far = float(np.linalg.norm(here - before))
                driven_s += item["params"][0] + (far / speed if far > 0.01 else 0.0)
            before = here
    assert driven_s == pytest.approx(path.time_s[-1] - path.time_s[0], rel=0.05)


USUAL = {"fixed_wing": (4.0, 0.6), "surface": (0.3, 0.0), "underwater": (0.15, 0.3)}  # docs/plan.md


def test_missions_hold_the_run_up_and_the_run_out(other: PlanRun) -> None:
    """(v^2 - v0^2) / (2 a) straight on before and after, at most half of v_max a second: without
    them an autopilot gains its speed after the begin and brakes before the end.  What cannot stop
    has two radii of its turn: v over 0.75 omega_max or 0.8 a / v, at least v_max / omega_max."""
    acceleration, slowest = USUAL[other.motion]
    most, omega = {"fixed_wing": (25.0, math.radians(30.0)), "surface": (5.0, math.radians(10.0)),
                   "underwater": (2.0, math.radians(15.0))}[other.motion]  # fmt: skip
    path, items = other.path, json.loads(render_plan("qgc", other))["mission"]["items"]
    places = [
        np.array(pymap3d.geodetic2ned(lat, lon, ORIGIN[2] + height, *ORIGIN))[:2]
        for *_, lat, lon, height in (i["params"] for i in items if i["command"] == 16)
    ]
    way = path.position_m[:, :2]
    ends = ((places[0], way[0], way[1], 1), (places[-1], way[-1], way[-2], -2))
    for place, end, inside, k in ends:
        step_s = abs(path.time_s[k] - path.time_s[k + 1 if k < 0 else 0])
        speed = float(np.linalg.norm(inside - end)) / step_s
        gain = min(acceleration, 0.5 * most)
        long_m = (speed**2 - (slowest * most) ** 2) / (2.0 * gain)
        if slowest:
            radii = speed / (0.75 * omega), speed**2 / (0.8 * gain), most / omega
            long_m = max(long_m, 2.0 * max(radii))
        away = place - end
        assert float(np.linalg.norm(away)) == pytest.approx(max(long_m, 0.0), rel=0.05, abs=0.1)
        if long_m > 0.5:
            ahead = (end - inside) / float(np.linalg.norm(end - inside))
            assert float(away @ ahead) == pytest.approx(float(np.linalg.norm(away)), rel=0.02)
    asked = [i for i in items if i["command"] in (16, 178)]
    assert asked[0]["command"] == 178  # the speed before the way to the first place
    kind, first = asked[0]["params"][:2]
    assert kind == (0 if other.motion == "fixed_wing" else 1)  # of ArduPlane 1 is a least
    begun = float(np.linalg.norm(way[1] - way[0])) / float(path.time_s[1] - path.time_s[0])
    assert first == pytest.approx(begun, rel=0.1, abs=0.05)


def logged(run: PlanRun) -> list[dict[str, Any]]:
    """The items of a mission without the run-up and the run-out."""
    items = json.loads(render_plan("qgc", run))["mission"]["items"]
    places = [k for k, item in enumerate(items) if item["command"] == 16]
    beside = (run.approach.run_up_m, places[0]), (run.approach.run_out_m, places[-1])
    dropped = [k for place, k in beside if place is not None]
    return [item for k, item in enumerate(items) if k not in dropped]


def course(run: PlanRun) -> list[tuple[float, dict[str, float], int]]:
    """What an autopilot makes of a mission: when it is at each place, the heading and the way round
    that it was told, and whether it was told to reverse, in the order of ArduPilot (commands before
    a place count on the way there)."""
    now, speed, before = float(run.path.time_s[0]), math.nan, None
    told, astern, found = {}, 0, []
    for item in logged(run):
        first, second, third = item["params"][:3]
        match item["command"]:
            case 178:
                speed = second
            case 115:
                told = {"to": first, "rate": second, "way": third}
            case 194:
                astern = int(first)
            case 16:
                lat, lon, height = item["params"][4:]
                here = np.array(pymap3d.geodetic2ned(lat, lon, ORIGIN[2] + height, *ORIGIN))
                far = 0.0 if before is None else float(np.linalg.norm(here - before))
                now += first if first > 0.0 else far / speed if far > 0.01 else 0.0
                found.append((now, dict(told), astern))
                before = here
    return found


def driven(folder: Path, platform: str, leg: str) -> PlanRun:
    """A drive of all legs of a name, with lines between, whether or not they would be chosen."""
    path = folder / "vehicle.yaml"
    path.write_text(SPEC.replace("PLATFORM", f"{{{platform}, baseline: 1 m}}"), encoding="utf-8")
    asked = PlanRequest(PlanWanted(reach_of("latency(position)=1 ms")), line_plans=False)
    setup = Setup.begun(load(path), asked)
    legs = [told for told in setup.told if leg in told.leg.name]
    line = next(told for told in setup.told if told.leg.name == "straight line")
    drive = outcome(setup.world, [part for one in legs for part in (line, one)])
    return Telling(setup).whole(drive, None, math.inf)


@pytest.mark.parametrize("leg", ["spin", "astern", "sweeps"])
def test_a_copter_is_told_where_to_head(leg: str, tmp_path: Path) -> None:
    """Its autopilot does not look at a waypoint's heading: CONDITION_YAW, with the way round."""
    run = driven(
        tmp_path, "v_max: 9 m/s, omega_max: 50 deg/s, distance: 40 m, motion: multirotor", leg
    )
    yaw = np.degrees(np.unwrap(run.path.euler_rad[:, 2]))
    flown = course(run)
    assert flown[-1][0] == pytest.approx(run.path.time_s[-1], rel=0.05)
    stretch = run.path.time_s[-1] / flown[-1][0]
    total = 0.0
    for (_, before, _), (at, told, _) in pairwise(flown):
        really = float(np.interp(at * stretch, run.path.time_s, yaw))
        assert abs((told["to"] - really + 180.0) % 360.0 - 180.0) < 30.0
        assert told["rate"] <= 50.0
        turn = (told["to"] - before["to"] + 180.0) % 360.0 - 180.0
        if told != before and told["way"]:
            turn = (turn * told["way"]) % 360.0 * told["way"]  # that way round
        total += turn
    assert total == pytest.approx(yaw[-1] - yaw[0], abs=5.0)


@pytest.mark.parametrize("motion", ["ground", "surface"])
def test_what_goes_astern_is_told_to_reverse(motion: str, tmp_path: Path) -> None:
    """Of a rover or a boat the heading is where it goes, unless it was told to reverse."""
    run = driven(
        tmp_path, f"v_max: 6 m/s, omega_max: 30 deg/s, distance: 50 m, motion: {motion}", "astern"
    )
    velocity = np.gradient(run.path.position_m, run.path.time_s, axis=0)
    yaw = run.path.euler_rad[:, 2]
    ahead = velocity[:, 0] * np.cos(yaw) + velocity[:, 1] * np.sin(yaw)
    flown = course(run)
    stretch = run.path.time_s[-1] / flown[-1][0]
    right = []
    for (begun, _, _), (at, _, astern) in pairwise(flown):
        middle = float(np.interp(0.5 * (begun + at) * stretch, run.path.time_s, ahead))
        if abs(middle) > 0.5:
            right.append((middle < 0.0) == bool(astern))
    assert {one[2] for one in flown} == {0, 1}
    assert np.mean(right) > 0.95


def test_kml_of_other_vehicles_keeps_the_order_of_its_schema(other: PlanRun) -> None:
    root = ElementTree.fromstring(render_plan("kml", other))
    space = "{http://www.opengis.net/kml/2.2}"
    for element in root.iter():
        name = element.tag.removeprefix(space)
        children = [child.tag.removeprefix(space) for child in element]
        order = KML_ORDER.get(name, [])
        assert all(child in order for child in children), (name, children)
        assert children == sorted(children, key=order.index)
    for text in (e.text or "" for e in root.iter(f"{space}coordinates")):
        for lon, lat, height in (map(float, one.split(",")) for one in text.split()):
            assert abs(lon - ORIGIN[1]) < 0.2
            assert abs(lat - ORIGIN[0]) < 0.2
            assert abs(height - ORIGIN[2]) < 500.0


def test_a_chain_is_planned_and_written(tmp_path: Path) -> None:
    """A vessel and what it tracks: one drives, the other waits, and both paths are written."""
    path = tmp_path / "chain.yaml"
    text = make_log(scenario("survey_chain", 3, 20.0, 5.0)).spec_yaml()
    path.write_text(text + "log: {origin: [47.3 deg, 8.55 deg, 460 m]}\n", encoding="utf-8")
    found = sd.plan(path, reach="latency(position)=50 ms", minutes=60.0)
    jsonschema.validate(json.loads(render_plan("qgc", found)), MISSION)
    header = render_plan("csv", found).splitlines()[0].split(",")
    (waits,) = found.others
    assert [name for name in header if name.startswith(f"{waits}_")] == [
        f"{waits}_{name}" for name in header[1:7]
    ]
    root = ElementTree.fromstring(render_plan("kml", found))
    lines = root.iter("{http://www.opengis.net/kml/2.2}LineString")
    beside = (found.approach.run_up_m, found.approach.run_out_m)
    more = sum(place is not None for place in beside)
    assert len(list(lines)) == len(found.result.legs) + more
