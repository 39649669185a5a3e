"""The test drive: what it tells by an independent simulator, what it asks for, its outputs."""

from __future__ import annotations

import csv
import io
import json
import math
import os
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import jsonschema
import numpy as np
import pymap3d
import pytest
from typer.testing import CliRunner

import syncline_design as sd
from browsing import flaws_of
from html_page import Page
from syncline_design.cli.app import app
from syncline_design.machine.records import read_as
from syncline_design.planning.drives import whole_drive
from syncline_design.planning.placing import lasting_s
from syncline_design.planning.result import Plan
from syncline_design.planning.run import plan as planned
from syncline_design.planning.setup import PlanRequest, Setup
from syncline_design.planning.standard import MOST_LEGS, Lines, most_within
from syncline_design.planning.telling import PlanRun
from syncline_design.planning.wanted import PlanWanted, reach_of
from syncline_design.report.document import TableNode
from syncline_design.report.on_plan import on_plan
from syncline_design.report.plans import render_plan
from syncline_design.report.result_schemas import result_schema
from syncline_design.spec.load import load
from tests.planned_specs import LIMITS, SPEC, call, spec_with, world
from tests.world.bound import cramer_rao
from tests.world.hidden import hidden
from tests.world.noise import Noise
from tests.world.worldlog import make_log

ORIGIN = (47.3, 8.55, 460.0)
ACCELERATION = 2.0
REACH = "latency(position)=1 ms, lever_arm(position)=1 cm"


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return spec_with(tmp_path_factory.mktemp("plan"))


@pytest.fixture(scope="module")
def run(spec: Path) -> PlanRun:
    return sd.plan(spec, reach=REACH)


@pytest.fixture(scope="module")
def pair(spec: Path) -> PlanRun:
    return sd.plan(spec, separate=("latency(position)", "lever_arm(position)"))


def test_sigma_is_the_cramer_rao_bound_of_an_independent_simulator(run: PlanRun) -> None:
    """Finite differences of the world's own readings and its own filter of the noise."""
    effects = (
        hidden("latency", "position", latency_s=0.0),
        hidden("lever_arm", "position", x_m=0.0, y_m=0.0, z_m=0.0),
    )
    bound = cramer_rao(world(run), effects, Noise())
    sigma = run.result.after[-1].sigma
    for (index, name), expected in bound.items():
        key = f"{effects[index].effect}(position).{name}"
        assert sigma[key] == pytest.approx(expected, rel=0.03), key


def test_correlation_is_that_of_the_independent_covariance(pair: PlanRun) -> None:
    """One parameter against three: the multiple correlation, by the world's information matrix."""
    from tests.world.bound import information

    effects = (
        hidden("latency", "position", latency_s=0.0),
        hidden("lever_arm", "position", x_m=0.0, y_m=0.0, z_m=0.0),
    )
    keys = [(0, "latency_s"), (1, "x_m"), (1, "y_m"), (1, "z_m")]
    covariance = np.linalg.inv(information(world(pair), effects, Noise(), keys))
    cross = covariance[0, 1:]
    explained = cross @ np.linalg.solve(covariance[1:, 1:], cross) / covariance[0, 0]
    found = pair.result.after[-1].correlation
    assert found == pytest.approx(math.sqrt(explained), abs=0.02)
    assert pair.result.pairs[0].separated


def test_what_is_asked_is_reached_leg_by_leg(run: PlanRun) -> None:
    plan = run.result
    assert plan.reached
    assert plan.exit_code == 0
    assert plan.duration_s <= 60.0 * plan.minutes
    last = plan.after[-1]
    for key, asked in plan.tolerance.items():
        assert last.sigma[key] <= asked
        assert last.sigma_all[key] >= last.sigma[key]
        assert last.sigma_all[key] <= plan.priors[key] * (1 + 1e-9)
        course = [one.sigma[key] for one in plan.after]
        assert course == sorted(course, reverse=True)
    assert [one.leg for one in plan.after] == [leg.name for leg in plan.legs]
    assert plan.legs[0].from_s == 0.0
    for before, after in pairwise(plan.legs):
        assert before.to_s == after.from_s


def test_the_words_are_the_drive(run: PlanRun, pair: PlanRun) -> None:
    """Every turn of the path before a leg is said, and no other: headings by the path alone."""
    for one in (run, pair):
        yaw = np.degrees(one.path.euler_rad[:, 2])
        leg = np.array(one.leg)
        assert one.result.legs[0].turn_deg == 0.0
        assert not one.result.legs[0].words.startswith("Turn ")
        for k, told in enumerate(one.result.legs):
            if k + 1 < len(one.result.legs):  # what ends a drive may end at any heading
                turned = yaw[leg == k][-1] - yaw[leg == k][0]
                assert math.remainder(turned, 90.0) == pytest.approx(0.0, abs=2.0)
            if k == 0:
                assert told.heading_deg == pytest.approx(yaw[0], abs=1e-6)
                continue
            before = yaw[leg == k - 1][-1]
            assert math.remainder(before + told.turn_deg - told.heading_deg, 360.0) == (
                pytest.approx(0.0, abs=2.0)
            )
            side = "right" if told.turn_deg > 0.0 else "left"
            said = f"Turn {side} by {abs(told.turn_deg):.0f} deg on the spot, then "
            assert told.words.startswith(said) == (abs(told.turn_deg) > 1.0)


SURVEYED = (
    (512.0, 181.0, -2.9),
    (489.5, 222.25, -3.4),
    (531.0, 214.0, -2.2),
    (476.0, 190.5, -3.1),
    (505.0, 243.0, -3.3),
    (900.0, 200.0, -3.0),  # far from all others
)


def beside_a_survey(folder: Path, rows: list[str]) -> Path:
    """The spec with a survey of targets among its log's files."""
    heads = ",".join(("target_id", *(f"target_{axis}_m" for axis in ("north", "east", "down"))))
    (folder / "survey.csv").write_text("\n".join([heads, *rows, ""]), encoding="utf-8")
    path = folder / "copter.yaml"
    files = "log: {files: [survey.csv], "
    path.write_text(SPEC.replace("log: {", files), encoding="utf-8")
    return path


def test_a_drive_is_laid_beside_targets_that_are_surveyed_already(tmp_path: Path) -> None:
    """Aimed at is the survey alone, from within reach; sigma by the independent simulator."""
    rows = [f"P{k},{n},{e},{d}" for k, (n, e, d) in enumerate(SURVEYED)]
    found = sd.plan(beside_a_survey(tmp_path, rows), reach="latency(position)=2 ms")
    plan = found.result
    assert plan.reached
    assert plan.surveyed
    used = {(t.north_m, t.east_m, t.down_m): t.name for t in plan.targets}
    assert used == {p: f"P{k}" for k, p in enumerate(SURVEYED) if p in used}
    assert SURVEYED[-1] not in used
    for row in rows_of(found):
        aimed = tuple(float(row[f"target_{a}_m"] or "nan") for a in ("north", "east", "down"))
        if not math.isnan(aimed[0]):
            place = [float(row[f"{a}_m"]) for a in ("north", "east", "down")]
            assert aimed in used
            assert math.dist(aimed, place) < LIMITS[2]
    (bound,) = cramer_rao(
        world(found), (hidden("latency", "position", latency_s=0.0),), Noise()
    ).values()
    assert plan.after[-1].sigma["latency(position).latency_s"] == pytest.approx(bound, rel=0.05)
    assert all(f">target {name}<" in render_plan("kml", found) for name in used.values())


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (["A,1,2,3", "A,1,2,4"], "survey.csv:3:1: target A is there twice, at two places"),
        (["A,1,2,"], "survey.csv:2:1: target A has no whole place"),
    ],
)
def test_a_survey_that_is_not_whole_is_refused(rows: list[str], said: str, tmp_path: Path) -> None:
    found = CliRunner().invoke(app, ["plan", str(beside_a_survey(tmp_path, rows))])
    assert found.exit_code == 2
    assert said in found.output + found.stderr


def rows_of(run: PlanRun) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(render_plan("csv", run))))


def test_the_waypoints_keep_to_the_platform(run: PlanRun, pair: PlanRun) -> None:
    """Speeds, accelerations, turn rates and tilt by differences of the rows that are written."""
    for one in (run, pair):
        rows = rows_of(one)
        time_s = np.array([float(r["time_s"]) for r in rows])
        place = np.array([[float(r[f"{a}_m"]) for a in ("north", "east", "down")] for r in rows])
        turn = np.unwrap(np.radians([[float(r[f"{a}_deg"]) for a in ("roll", "pitch", "yaw")]
                                     for r in rows]), axis=0)  # fmt: skip
        assert np.max(np.diff(time_s)) <= 0.5
        step = np.diff(time_s)[:, None]
        velocity = np.diff(place, axis=0) / step
        assert np.max(np.linalg.norm(velocity, axis=1)) <= LIMITS[0]
        gain = np.diff(velocity, axis=0) / step[1:]
        assert np.max(np.linalg.norm(gain, axis=1)) <= 1.1 * ACCELERATION
        assert np.max(np.linalg.norm(np.diff(turn, axis=0) / step, axis=1)) <= LIMITS[1]
        assert np.ptp(place[:, 0]) <= 250.0
        assert np.ptp(place[:, 1]) <= 250.0
        level = np.linalg.norm(gain[:, :2], axis=1)
        lean = np.max(np.abs(turn[:, :2]), axis=1)[1:-1]
        assert np.all(lean <= np.arctan(level / 9.80665) + 0.02)


def test_every_row_aims_at_a_listed_target_in_reach(run: PlanRun) -> None:
    listed = {(round(t.north_m, 3), round(t.east_m, 3), round(t.down_m, 3))
              for t in run.result.targets}  # fmt: skip
    for row in rows_of(run):
        target = [float(row[f"target_{axis}_m"]) for axis in ("north", "east", "down")]
        place = [float(row[f"{axis}_m"]) for axis in ("north", "east", "down")]
        assert tuple(round(v, 3) for v in target) in listed
        assert math.dist(target, place) <= LIMITS[2]
        assert row["leg"] in {leg.name for leg in run.result.legs}


def test_kml_holds_the_path_where_it_is_on_the_globe(run: PlanRun) -> None:
    root = ElementTree.fromstring(render_plan("kml", run))
    space = {"k": "http://www.opengis.net/kml/2.2"}
    assert root.tag == "{http://www.opengis.net/kml/2.2}kml"
    lines = root.findall("k:Document/k:Placemark/k:LineString", space)
    logged = len(run.result.legs)
    before, after = run.approach.run_up_m, run.approach.run_out_m
    assert len(lines) == logged + (before is not None) + (after is not None)
    modes = {m.text for m in root.iter("{http://www.opengis.net/kml/2.2}altitudeMode")}
    assert modes == {"absolute"}
    path = run.path.position_m
    for line in lines[:logged]:
        text = line.findtext("k:coordinates", namespaces=space)
        assert text
        for part in text.split():
            lon, lat, height = map(float, part.split(","))
            local = pymap3d.geodetic2ned(lat, lon, height, *ORIGIN)
            assert np.min(np.linalg.norm(path - np.array(local), axis=1)) < 0.01
    points = root.findall("k:Document/k:Placemark/k:Point", space)
    assert len(points) == len(run.result.targets)


def test_the_mission_is_a_plan_file_of_qgroundcontrol(run: PlanRun) -> None:
    """Keys and kinds by the plan file format of QGroundControl's developer guide."""
    plan = json.loads(render_plan("qgc", run))
    assert (plan["fileType"], plan["version"]) == ("Plan", 1)
    assert set(plan) == {"fileType", "geoFence", "groundStation", "mission", "rallyPoints",
                         "version"}  # fmt: skip
    mission = plan["mission"]
    assert mission["version"] == 2
    assert mission["vehicleType"] == 2  # MAV_TYPE_QUADROTOR
    assert mission["plannedHomePosition"] == pytest.approx(ORIGIN)
    assert [i["doJumpId"] for i in mission["items"]] == list(range(1, len(mission["items"]) + 1))
    places = []
    for item in mission["items"]:
        assert item["type"] == "SimpleItem"
        assert len(item["params"]) == 7
        if item["command"] == 16:  # NAV_WAYPOINT
            assert item["frame"] == 3  # relative to home
            lat, lon, height = item["params"][4:]
            places.append(pymap3d.geodetic2ned(lat, lon, ORIGIN[2] + height, *ORIGIN))
    path = run.path.position_m
    places = places[run.approach.run_up_m is not None :]
    places = places[: -1 if run.approach.run_out_m is not None else None]
    for place in places:
        assert np.min(np.linalg.norm(path - np.array(place), axis=1)) < 0.05
    legs = np.array(places)  # straight lines between the items stay near the path
    for a, b in pairwise(legs):
        assert np.min(np.linalg.norm(path - 0.5 * (a + b), axis=1)) < 2.0


def test_json_fits_its_schema_and_reads_back(run: PlanRun, pair: PlanRun) -> None:
    for one in (run, pair):
        text = render_plan("json", one)
        data = json.loads(text)
        jsonschema.validate(data, result_schema("plan"))
        assert data["schema"] == "syncline-design/plan/v1"
        assert read_as(Plan, text) == one.result
        assert {"legs", "after", "unseen", "columns", "rate_hz", "priors"} <= set(data)
    assert run.result.after[-1].correlation is None
    assert run.result.columns[0] == "time_s"
    assert run.result.rate_hz == 10.0


def test_constant_speed_never_tells_a_latency_from_a_lever_arm(pair: PlanRun) -> None:
    """-V latency and R l x are one vector at constant speed and course-fixed heading."""
    known = {one.name: one for one in pair.result.standard}
    for name in ("straight lines", "figure eights"):
        assert known[name].minutes is None
        correlation = known[name].correlation
        assert correlation is not None
        assert correlation > 0.99
    assert pair.result.after[-1].correlation < known["patch-test lines"].correlation  # type: ignore[operator]


def test_line_plans_are_taken_leg_by_leg_with_their_turns() -> None:
    """Added up one by one: three legs of 20, 30 and 20 s, turns of 5, 7 and 7 s before each."""
    information = np.array([k * np.eye(2) for k in (1.0, 2.0, 3.0)])
    lines = Lines("", information, np.array([20.0, 30.0, 20.0]), np.array([5.0, 7.0, 7.0]))
    total, clock = np.zeros((2, 2)), 0.0
    for count in range(8):
        assert np.allclose(lines.told(count), total)
        assert lines.duration_s(count) == pytest.approx(clock)
        assert np.allclose(lines.told_in(clock), total)
        leg, turn = count % 3, (0.0 if count == 0 else lines.turns_s[count % 3])
        halfway = lines.told_in(clock + turn + 0.5 * lines.lasts_s[leg])
        assert np.allclose(halfway, total + 0.5 * information[leg])
        total, clock = total + information[leg], clock + turn + lines.lasts_s[leg]
    for most in (0, 1, 2, 3, 7, 64, 1000):
        assert most_within(lambda count, most=most: count <= most) == most  # type: ignore[misc]
    assert most_within(lambda _: True) == MOST_LEGS


def test_a_drive_is_the_same_where_no_line_plans_are_judged_beside_it(
    run: PlanRun, spec: Path
) -> None:
    """As `diagnose` asks for it, which shows none."""
    alone = planned(load(spec), PlanRequest(PlanWanted(reach_of(REACH)), line_plans=False))
    assert run.result.standard
    assert not alone.result.standard
    assert alone.result.after == run.result.after
    assert alone.result.legs == run.result.legs


@pytest.mark.parametrize(
    ("seconds", "unit"),
    [((9.3, 115_200.0, 24_540.0), "min"), ((9.3, 30.0, 2.5), "s"), ((36_000.0, 90_000.0), "h"),
     ((61.0, None, 36_000.0), "min")],
)  # fmt: skip
def test_drives_beside_one_another_last_so_many_of_one_unit(
    run: PlanRun, seconds: tuple[float | None, ...], unit: str
) -> None:
    """Read back from the page's table: what was put in, to what two digits or a whole tell."""
    first, *others = seconds
    known = run.result.standard[0]
    lines = [replace(known, minutes=None if s is None else s / 60.0) for s in others]
    assert first is not None
    result = replace(run.result, duration_s=first, standard=tuple(lines))
    parts = on_plan(replace(run, result=result)).sections
    tables = [node.table for part in parts for node in part.nodes if isinstance(node, TableNode)]
    shown = next(one for one in tables if "standard line plans" in one.caption)
    cells = next(row[1:] for row in shown.rows if row[0].text == "Until reached")  # turned
    told = [cell.text.replace("\N{NO-BREAK SPACE}", " ") for cell in cells]
    size = {"s": 1.0, "min": 60.0, "h": 3600.0}[unit]
    for words, wanted in zip(told, seconds, strict=True):
        if wanted is None:
            assert words.startswith("never")
            continue
        figure, _, own = words.rpartition(" ")
        assert own == unit
        assert float(figure.replace(" ", "")) * size == pytest.approx(wanted, rel=0.06)


def test_no_line_plan_that_tells_as_much_is_much_shorter(run: PlanRun, pair: PlanRun) -> None:
    """Its lines begin at speed, where the drive has to gain it; a patch test needs three lines."""
    for one in (run.result, pair.result):
        known = {line.name: line for line in one.standard}
        assert (known["patch-test lines"].legs or 3) >= 3
        minutes = [line.minutes for line in one.standard if line.minutes is not None]
        assert one.duration_s / 60.0 <= 1.2 * min(minutes, default=math.inf)


def test_the_time_of_a_search_is_that_of_the_drive(spec: Path) -> None:
    """Any legs in any order: as long by their turns as the course that is steered."""
    setup = Setup.begun(load(spec), PlanRequest())
    rng = np.random.default_rng(4)
    for _ in range(5):
        legs = [setup.told[k] for k in rng.integers(len(setup.told), size=4)]
        stretches, _ = whole_drive(setup.world, legs)
        assert lasting_s(legs) == pytest.approx(stretches[-1].to_s, abs=0.2)


def test_a_drive_that_is_driven_names_what_was_hidden(pair: PlanRun, spec: Path) -> None:
    """The world drives the plan with 30 ms hidden; the class is told, the value as predicted."""
    log = make_log(world(pair, seed=11), (hidden("latency", "position", latency_s=0.03),), Noise())
    path = log.to_csv(spec.parent / "driven.csv")
    answer = sd.diagnose(spec, path, max_effects=2)
    named = {(f.effect, f.sensor): f for f in answer.findings if f.kind == "cause"}
    assert set(named) == {("latency", "position")}
    found = named["latency", "position"]
    assert ("lever_arm", "position") not in {(a.effect, a.sensor) for a in found.aliases}
    sigma = pair.result.after[-1].sigma["latency(position).latency_s"]
    assert abs(float(found.parameters["latency_s"].value) - 0.03) < 4.0 * sigma
    flown = sd.plan(spec, separate=("latency(position)", "lever_arm(position)"), flown=path)
    held = flown.result.flown
    assert held is not None
    assert held.cautions is None
    for key, value in held.sigma.items():
        assert value == pytest.approx(pair.result.after[-1].sigma[key], rel=0.05)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--reach", "latancy(position)=1 ms"], "there is no effect 'latancy'"),
        (["--reach", "latency(target)=1 ms"], "does not act on 'target'"),
        (["--reach", "latency(position)=1 cm"], "cannot read latency_s"),
        (["--reach", "latency(position)=0 ms"], "expected a tolerance above 0"),
        (["--reach", "latency(position)"], "expected effect(sensor)=TOLERANCE"),
        (["--reach", "timestamp_jitter(position)=1 ms"], "only scatters"),
        (["--reach", "turnaround_delay(ranging)=1 ms"], "does not apply to stage 'vehicle'"),
        (["--reach", "latency(boat.position)=1 ms"], "there is no stage 'boat'"),
        (["--separate", "latency(position)", "latency(position)"], "are one effect"),
        (["--separate", "latency", "lever_arm(position)"], "expected effect(sensor)"),
        (["--minutes", "0"], "expected more than 0 minutes"),
        (["--minutes", "inf"], "--minutes inf: expected more than 0 minutes, finite"),
        (["--diagnosis", "SPEC"], "expected a diagnosis"),
    ],
    ids=lambda words: str(words)[:40],
)
def test_what_cannot_be_planned_is_refused_with_the_reason(
    words: list[str], said: str, spec: Path
) -> None:
    done = call(spec, *(str(spec) if word == "SPEC" else word for word in words))
    assert done.exit_code == 2, done.output
    assert said in done.stderr.replace("\n", " ")
    assert done.stdout == ""


@pytest.mark.parametrize(
    ("kind", "said"), [("folder", "a folder"), ("pipe", "a pipe"), ("huge", "bytes")]
)
def test_a_diagnosis_that_is_no_plain_file_is_refused(
    kind: str, said: str, spec: Path, tmp_path: Path
) -> None:
    path = tmp_path / "d.json"
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    else:
        with path.open("wb") as stream:
            stream.truncate(2 << 30)  # a hole: takes no place on the disk
    done = call(spec, "--diagnosis", path, "-q")
    assert done.exit_code == 2, done.output
    assert f"--diagnosis {path}: cannot read: " in done.stderr.replace("\n", " ")
    assert said in done.stderr


def test_too_few_minutes_end_with_the_least_that_is_enough(spec: Path) -> None:
    done = call(spec, "--reach", REACH, "--minutes", 0.1, "-o", "json:-")
    assert done.exit_code == 1
    data = json.loads(done.stdout)
    assert not data["reached"]
    least = data["least_minutes"]
    assert least > 0.1
    assert call(spec, "--reach", REACH, "--minutes", 1.01 * least, "-q").exit_code == 0


def test_a_platform_that_cannot_turn_is_refused(spec: Path, tmp_path: Path) -> None:
    still = tmp_path / "still.yaml"
    still.write_text(SPEC.replace("omega_max: 50 deg/s", "omega_max: 0 deg/s"), encoding="utf-8")
    done = call(still)
    assert done.exit_code == 2
    assert "cannot turn" in done.stderr
    assert f"{still}:6:" in done.stderr


def test_places_on_the_globe_need_an_origin(tmp_path: Path) -> None:
    local = tmp_path / "local.yaml"
    local.write_text(SPEC.partition("log:")[0], encoding="utf-8")
    done = call(local, "-o", f"kml:{tmp_path / 'x.kml'}")
    assert done.exit_code == 2
    assert "log: {origin: [47.3 deg, 8.55 deg, 460 m]}" in done.stderr
    assert not (tmp_path / "x.kml").exists()


def test_a_drive_longer_than_its_minutes_is_not_called_the_best_for_them(pair: PlanRun) -> None:
    longer = replace(pair.result, reached=False, least_minutes=9.0, minutes=0.05)
    words = render_plan("markdown", replace(pair, result=longer))
    assert longer.duration_s > 3.0
    assert "best for" not in words
    assert "No drive as short as 0.05 min was found" in words


def test_a_target_has_one_name_on_the_page(pair: PlanRun) -> None:
    """In the figure as in the table and the files: targets that no row aims at leave gaps."""
    kept = tuple(t for t in pair.result.targets if t.id != pair.result.targets[0].id)
    few = replace(pair, result=replace(pair.result, targets=kept))
    shown = Page(str(render_plan("html", few))).text
    assert all(f"target {t.id} {t.east_m:.1f} m east" in shown.replace("\N{MINUS SIGN}", "-")
               .replace("\N{NO-BREAK SPACE}", " ") for t in kept)  # fmt: skip


@pytest.mark.browser
def test_its_page_is_sound(browser: Any, pair: PlanRun, tmp_path: Path) -> None:
    path = tmp_path / "plan.html"
    path.write_text(str(render_plan("html", pair)), encoding="utf-8")
    assert flaws_of(browser, path) == []
