"""What binds a drive: the area it has, how the vehicle turns, what it leans to, and how large an
effect has to be; and figures as people write them."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import find_peaks
from scipy.spatial.transform import Rotation

import syncline_design as sd
from syncline_design.effects.record import Array
from syncline_design.planning.areas import tight_areas
from syncline_design.planning.drives import outcome, whole_drive
from syncline_design.planning.leg_library import library
from syncline_design.planning.legs import MOST_LEG_S, transition
from syncline_design.planning.path import (
    STEP_S,
    CourseCommands,
    PathStates,
    joined,
    travelled,
    unasked,
)
from syncline_design.planning.run import plan as planned
from syncline_design.planning.setup import PlanRequest, Setup
from syncline_design.planning.telling import PlanRun, Telling
from syncline_design.planning.vehicle import vehicles
from syncline_design.planning.wanted import PlanWanted, reach_of, separate_of
from syncline_design.report.plans import render_plan
from syncline_design.spec.load import load
from tests.planned_specs import call, spec_with

PAIR = ("heading_bias(attitude)", "boresight(ranging)")
AREA_M = (150.0, 80.0)


@pytest.fixture(scope="module")
def car(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return spec_with(
        tmp_path_factory.mktemp("car"),
        ("motion: multirotor", "motion: ground"),
        ("area: [250 m, 250 m]", "area: [150 m, 80 m]"),
    )


@pytest.fixture(scope="module")
def alike(car: Path) -> PlanRun:
    """Two effects with a correlation above 0.99 on every drive of a level vehicle."""
    return planned_alone(car, *PAIR)


def planned_alone(path: Path, first: str, second: str) -> PlanRun:
    wanted = PlanWanted(pairs=separate_of(first, second))
    return planned(load(path), PlanRequest(wanted, minutes=4.0, line_plans=False))


def test_a_drive_of_many_turns_stays_within_its_area(alike: PlanRun) -> None:
    """A car's turns take it aside: the whole path counts, the turns between the legs too."""
    assert len(alike.result.legs) > 3
    taken = np.ptp(alike.path.position_m[:, :2], axis=0)
    assert taken[0] <= AREA_M[0]
    assert taken[1] <= AREA_M[1]
    assert alike.result.cautions is None


def test_a_drive_that_leaves_its_area_is_said_to(car: Path) -> None:
    """Of a vehicle that has less room than the drive was made for."""
    wanted = PlanWanted(pairs=separate_of(*PAIR))
    setup = Setup.begun(load(car), PlanRequest(wanted, minutes=4.0, line_plans=False))
    tight = replace(setup.world.vehicles[0], area_m=(150.0, 20.0))
    told = setup.told[:1]
    setup = replace(setup, world=replace(setup.world, vehicles=(tight,)))
    run = Telling(setup).whole(outcome(setup.world, told), None, 240.0)
    (beyond,) = run.result.cautions or ()
    north, east = np.ptp(with_runs(run.path, 2.0 * 2.0), axis=0)
    assert f"takes {north:.0f} m by {east:.0f} m, beyond its area of 150 m by 20 m" in beyond


def test_what_an_area_is_too_small_for_is_said_where_nothing_is_enough(tmp_path: Path) -> None:
    """By the places of each leg driven alone, and a tenth of the area left at its edges, of which
    the run-up and the run-out may take all."""
    area, ground = ("area: [250 m, 250 m]", "area: [62 m, 30 m]"), ("multirotor", "ground")
    path = spec_with(tmp_path, area, ground)
    wanted = PlanWanted(reach_of("latency(position)=1 us"))
    setup = Setup.begun(load(path), PlanRequest(wanted, minutes=1.0, line_plans=False))
    taken = []
    for told in setup.told:
        _, (course,) = whole_drive(setup.world, [told])
        path = travelled(setup.world.vehicles[0], course)
        whole = np.ptp(with_runs(path, 2.0 * 2.0), axis=0)
        taken.append(np.maximum(whole, np.ptp(path.position_m[:, :2], axis=0) / 0.9))
    fitting = sum(bool(np.all(one <= np.array([62.0, 30.0]))) for one in taken)
    assert 0 < fitting < len(taken)
    (words,) = tight_areas(setup)
    assert words.startswith(f"{fitting} of the {len(taken)} legs that vehicle can drive stay")
    assert "area of 62 m by 30 m" in words


def with_runs(path: PathStates, twice_gain_mps2: float) -> Array:
    """North and east of a path, and of what it takes to gain and to lose its speed, v^2 / (2 a)."""
    begins, ends = path.velocity_mps[0, :2], path.velocity_mps[-1, :2]
    before, after = (np.linalg.norm(v) * v / twice_gain_mps2 for v in (begins, ends))
    place = path.position_m[:, :2]
    return np.vstack([place[0] - before, place, place[-1] + after])


def test_effects_that_look_alike_are_told_apart_where_one_is_large(
    alike: PlanRun, car: Path
) -> None:
    """That no drive tells two effects is said of small ones: of such a size this drive does."""
    (pair,) = alike.result.pairs
    assert not pair.separated
    assert 0.99 < pair.correlation < 1.0
    size = (pair.told_from or {})["bias_rad"]
    found = planned_alone(car, f"{PAIR[0]}={1.05 * size} rad", PAIR[1]).result
    assert found.reached
    assert found.duration_s <= alike.result.duration_s + 1.0
    words = " ".join(render_plan("markdown", alike).split())
    assert "No drive of this platform" not in words
    assert f"From {math.degrees(size):.3g} deg of the first on" in words
    assert "Correlation of the pair 1 " not in words


def test_of_an_arm_each_component_has_its_own_size(car: Path) -> None:
    """On the level an arm's height is one with the datum's, and the others are told in a few turns:
    an arm of such a size along one axis is told when that is stated."""
    arm, datum = "lever_arm(position)", "datum_offset(target)"
    unsized = planned_alone(car, arm, datum)
    sizes = unsized.result.pairs[0].told_from or {}
    assert {"x_m", "y_m"} <= set(sizes)
    assert sizes.get("z_m", math.inf) > 20.0 * max(sizes["x_m"], sizes["y_m"])
    words = " ".join(render_plan("markdown", unsized).split())
    (pair,) = unsized.result.pairs
    if "z_m" in sizes:
        last = f", and z from {1e3 * sizes['z_m']:.3g} mm on"
    else:
        last = "; z at no plausible size"
    at = f"{1e3 * pair.sizes['x_m']:.3g} mm"
    assert "Told apart in x and y, in z only" in words
    assert f"in z alone: the drive below tells x {at} and y {at} of the first apart{last}" in words
    for stated in (f"[{1.05 * sizes['x_m']} m, 0 m, 0 m]", f"[0 m, {1.05 * sizes['y_m']} m, 0 m]"):
        found = planned_alone(car, f"{arm}={stated}", datum).result
        assert found.reached
        assert found.duration_s <= unsized.result.duration_s + 1.0


def test_a_copter_with_a_turning_radius_is_planned_for(tmp_path: Path) -> None:
    """It does not turn on the spot then, and none of its turns is tighter."""
    path = spec_with(
        tmp_path,
        ("motion: multirotor", "motion: multirotor, minimum_turn_radius: 6 m"),
        (", area: [250 m, 250 m]", ""),
    )
    run = sd.plan(path, reach="latency(position)=1 ms, lever_arm(position)=1 cm")
    speed = np.linalg.norm(run.path.velocity_mps[:, :2], axis=1)
    turn = np.abs(np.gradient(np.unwrap(run.path.euler_rad[:, 2]), run.path.time_s))
    assert run.result.reached
    assert turn.max() > 0.05
    assert np.all(speed >= 0.97 * 6.0 * turn - 0.02)


@pytest.mark.parametrize(
    ("key", "change"),
    [
        ("minimum_turn_radius", ("motion:", "minimum_turn_radius: 1000 km, motion:")),
        ("omega_max", ("omega_max: 50 deg/s", "omega_max: 0.001 deg/s")),
    ],
)
def test_a_platform_that_as_good_as_cannot_turn_is_refused(
    key: str, change: tuple[str, str], tmp_path: Path
) -> None:
    done = call(spec_with(tmp_path, change))
    assert done.exit_code == 2
    words = " ".join(done.stderr.split())
    assert f"platform.{key}: the platform of stage 'vehicle' cannot turn" in words


def test_sweeps_lean_to_what_is_said(tmp_path: Path) -> None:
    """The words are for who flies, the attitudes what the figures rest on."""
    (copter,) = vehicles(load(spec_with(tmp_path)), ("lidar",))
    for name, axis in (("roll sweeps", 0), ("pitch sweeps", 1)):
        leg = next(one for one in library(copter, 0) if one.name == name)
        most = math.degrees(np.abs(travelled(copter, leg.course).euler_rad[:, axis]).max())
        said = float(leg.words.removesuffix(" deg").split()[-1])
        assert said == pytest.approx(most, rel=0.05)


def test_what_takes_longer_than_any_drive_is_no_matter_of_the_platform(tmp_path: Path) -> None:
    """A latency to 1 ns: sigma falls with the root of the time, so that some drive would tell it,
    after 0.056 ms in ten minutes in some 60 000 years."""
    asked = PlanRequest(PlanWanted(reach_of("latency(position)=1 ns")), line_plans=False)
    run = planned(load(spec_with(tmp_path)), asked)
    assert not run.result.reached
    assert run.result.least_minutes is None
    said = " ".join(render_plan("markdown", run).replace("\u00a0", " ").split())
    assert "no drive of up to 4 h was found that tells so much" in said
    assert "no drive of this platform" not in said


def test_what_no_drive_tells_is_not_said_to_be_reached(tmp_path: Path) -> None:
    path = spec_with(tmp_path)
    rivals = "lever_arm(position), filter_lag(position)"
    done = call(path, "--separate", "latency(position)=5 ms", rivals)
    assert done.exit_code == 0
    words = " ".join(done.stdout.split())
    assert "but for what no drive tells" in words
    assert "All else that is asked is reached" in words


@pytest.mark.parametrize("effect", ["range_scale(ranging)", "clock_drift(position)"])
def test_scales_and_rates_are_read_in_ppm(effect: str, tmp_path: Path) -> None:
    path = spec_with(tmp_path)
    done = call(path, "--reach", f"{effect}=900 ppm", "--minutes", 4, "-o", "json:-")
    (asked,) = json.loads(done.stdout)["tolerance"].values()
    assert asked == pytest.approx(9e-4)


def test_a_pair_that_only_takes_longer_is_not_said_to_hang_on_its_size(tmp_path: Path) -> None:
    pair = ("latency(position)", "lever_arm(position)")
    done = call(spec_with(tmp_path), "--separate", *pair, "--minutes", 0.3, "-o", "markdown:-")
    assert done.exit_code == 1
    words = " ".join(done.stdout.split())
    assert "Not reached in 0.3 min" in words
    assert "only where it is larger" not in words


def test_a_stated_height_is_kept_or_refused(tmp_path: Path) -> None:
    """By plain geometry: d is 40 m, so that from 34 m up targets are in reach and from 60 m none,
    nor from 37.5 m: 38 m away they would be steeper below than 75 deg, 38 sin(75 deg) = 36.7.

    Closer to them than stated, the figures were those of another drive.
    """
    stated = ("motion: multirotor", "motion: multirotor, height: 34 m")
    waypoints = tmp_path / "drive.csv"
    wanted = ("--reach", "latency(position)=1 ms", "-q", "-o", f"csv:{waypoints}")
    assert call(spec_with(tmp_path, stated), *wanted).exit_code == 0
    with waypoints.open(encoding="utf-8", newline="") as stream:
        rows = [row for row in csv.DictReader(stream) if row["target_down_m"]]
    above = [float(row["target_down_m"]) - float(row["down_m"]) for row in rows]
    assert sum(above) / len(above) == pytest.approx(34.0, abs=2.0)
    away = [
        math.dist(*([float(row[f"{of}{axis}_m"]) for axis in ("north", "east", "down")]
                    for of in ("", "target_")))
        for row in rows
    ]  # fmt: skip
    assert max(away) < 40.0
    for height in (60.0, 37.5):
        text = f"motion: multirotor, height: {height:g} m"
        done = call(spec_with(tmp_path, (stated[0], text)), *wanted)
        assert done.exit_code == 2, done.output
        words = " ".join(done.stderr.split())
        assert f"keeps {height:g} m over its targets, and they are at most 38 m away" in words
        assert "expected a height of at most 92 % of its distance, 36.7 m" in words


def test_a_drive_that_sees_no_target_for_long_says_so(tmp_path: Path) -> None:
    """From just below the highest height few are in sight; counted in what is written."""
    waypoints, page = tmp_path / "drive.csv", tmp_path / "drive.json"
    spec = spec_with(tmp_path, ("motion: multirotor", "motion: multirotor, height: 36.6 m"))
    asked = ("--reach", "lever_arm(position)=1 mm", "-q")
    done = call(spec, *asked, "-o", f"csv:{waypoints}", "-o", f"json:{page}")
    assert done.exit_code in (0, 1), done.output
    with waypoints.open(encoding="utf-8", newline="") as stream:
        blind = [not row["target_down_m"] for row in csv.DictReader(stream)]
    (said,) = json.loads(page.read_text("utf-8"))["cautions"]
    assert 0.15 < sum(blind) / len(blind) < 1.0
    assert float(said.split()[1]) == pytest.approx(100.0 * sum(blind) / len(blind), abs=1.0)


def test_a_height_over_nothing_that_is_ranged_to_is_kept(tmp_path: Path) -> None:
    """Without a ranging sensor there is no target that could be out of reach."""
    text = spec_with(tmp_path).read_text(encoding="utf-8")
    head, _, rest = text.partition("    ranging: {")
    tail = rest[rest.index("log: {") :]
    path = tmp_path / "copter.yaml"
    path.write_text(head.replace("motion: multirotor", "motion: multirotor, height: 60 m") + tail,
                    encoding="utf-8")  # fmt: skip
    waypoints = tmp_path / "drive.csv"
    done = call(path, "--reach", "latency(position)=1 ms", "-q", "-o", f"csv:{waypoints}")
    assert done.exit_code == 0, done.output
    with waypoints.open(encoding="utf-8", newline="") as stream:
        assert float(next(csv.DictReader(stream))["down_m"]) == pytest.approx(-60.0, abs=1.0)


@pytest.mark.parametrize(
    ("motion", "v_max_mps", "omega_max"),
    [
        ("fixed_wing", 70.0, 5.0),
        ("fixed_wing", 250.0, 3.0),
        ("fixed_wing", 20.0, 40.0),
        ("multirotor", 8.0, 15.0),
        ("multirotor", 15.0, 60.0),
        ("ground", 40.0, 3.0),
        ("surface", 4.0, 3.0),
        ("underwater", 3.0, 2.0),
    ],
)
def test_no_leg_turns_faster_than_the_platform_can(
    tmp_path: Path, motion: str, v_max_mps: float, omega_max: float
) -> None:
    """The whole body rate, leaning into turns too, by differences of attitudes as quaternions; nor
    does any accelerate more, along and across together."""
    spec = spec_with(
        tmp_path,
        ("motion: multirotor", f"motion: {motion}"),
        (
            "v_max: 9 m/s, omega_max: 50 deg/s",
            f"v_max: {v_max_mps} m/s, omega_max: {omega_max} deg/s",
        ),
        (", area: [250 m, 250 m]", ""),
        ("acceleration: 2 m/s^2", "distance: 300 m"),
        ("distance: 40 m, ", ""),
    )
    (vehicle,) = vehicles(load(spec), ("lidar",))
    for leg in library(vehicle, 0):
        parts = (transition(vehicle, math.pi), leg.course, transition(vehicle, -0.5 * math.pi))
        states = travelled(vehicle, joined(parts))
        turned = Rotation.from_euler("ZYX", states.euler_rad[:, ::-1])
        rates = (turned[:-1].inv() * turned[1:]).magnitude() / STEP_S
        assert np.max(rates) <= math.radians(omega_max), leg.name
        level = np.linalg.norm(np.diff(states.velocity_mps[:, :2], axis=0), axis=1) / STEP_S
        assert np.max(level) <= 1.001 * vehicle.acceleration_mps2, leg.name


def test_legs_of_years_are_not_made(tmp_path: Path) -> None:
    """A copter of 1e9 km/s: what it does in place is planned, nothing of 47 TiB is asked for."""
    spec = spec_with(tmp_path, ("v_max: 9 m/s", "v_max: 1e9 km/s"))
    (vehicle,) = vehicles(load(spec), ("lidar",))
    legs = library(vehicle, 0)
    assert 0 < len(legs) < 8
    assert max(leg.duration_s for leg in legs) <= MOST_LEG_S
    done = call(spec, "--reach", "latency(position)=1 s")
    assert done.exit_code in (0, 1, 2), done.output


def test_a_vehicle_without_a_leg_is_refused(tmp_path: Path) -> None:
    """A car that takes a quarter of an hour to any other speed, and half an hour to turn about."""
    spec = spec_with(
        tmp_path,
        ("motion: multirotor", "motion: ground, minimum_turn_radius: 4000 m"),
        ("acceleration: 2 m/s^2, area: [250 m, 250 m]", "acceleration: 0.01 m/s^2"),
    )
    done = call(spec, "--reach", "latency(position)=1 ms")
    assert done.exit_code == 2, done.output
    words = " ".join(done.stderr.split())
    assert "no leg takes less than 300 s" in words
    assert "v_max and acceleration" in words


@pytest.mark.parametrize("motion", ["surface", "ground", "underwater", "multirotor"])
def test_what_moves_a_vehicle_unasked_is_said(tmp_path: Path, motion: str) -> None:
    """Held straight on, it rolls, pitches and heaves by what the plan says that it counts on."""
    spec = spec_with(tmp_path, ("motion: multirotor", f"motion: {motion}"))
    (vehicle,) = vehicles(load(spec), ("lidar",))
    steps = round(4000.0 / STEP_S)
    still = np.zeros(steps)
    states = travelled(vehicle, CourseCommands(np.full(steps, 3.0), still, still, still))
    roll, pitch = (f"{np.degrees(np.std(states.euler_rad[:, k])):.2g} deg" for k in (0, 1))
    said = unasked(vehicle)
    if motion == "multirotor":
        assert said is None
        return
    assert said is not None
    assert roll in said
    assert pitch in said
    heave = np.std(states.position_m[:, 2])
    assert (f"{100.0 * heave:.2g} cm" in said) == (motion == "surface")


@pytest.mark.parametrize(
    ("motion", "v_max_mps", "omega_max"),
    [("multirotor", 8.0, 40.0), ("ground", 3.0, 25.0), ("ground", 20.0, 0.5), ("surface", 4.0, 9.0),
     ("underwater", 1.5, 12.0), ("fixed_wing", 25.0, 30.0)],
)  # fmt: skip
def test_words_of_swings_are_what_is_driven(
    tmp_path: Path, motion: str, v_max_mps: float, omega_max: float
) -> None:
    """Speeds between the first and the last peak, and how far the heading swings, as the path has
    them; a heading that swings by less than a driver sees is no slalom."""
    spec = spec_with(
        tmp_path,
        ("motion: multirotor", f"motion: {motion}"),
        ("v_max: 9 m/s, omega_max: 50 deg/s",
         f"v_max: {v_max_mps} m/s, omega_max: {omega_max} deg/s"),
        (", area: [250 m, 250 m]", ""),
    )  # fmt: skip
    (vehicle,) = vehicles(load(spec), ("lidar",))
    legs = {leg.name: leg for leg in library(vehicle, 0)}
    if leg := legs.get("slow and fast circle"):
        speed = np.linalg.norm(travelled(vehicle, leg.course).velocity_mps[:, :2], axis=1)
        fast, slow = (
            float(word.split()[0])
            for word in (leg.words.split("three times up to ")[1], leg.words.split("down to ")[1])
        )
        first, last = find_peaks(speed)[0][[0, -1]]
        assert fast == pytest.approx(np.max(speed[first : last + 1]), rel=6e-3)
        assert slow == pytest.approx(np.min(speed[first:last]), rel=6e-3)
    if (leg := legs.get("slalom")) and motion != "fixed_wing":
        yaw = np.degrees(np.unwrap(travelled(vehicle, leg.course).euler_rad[:, 2]))
        told = float(leg.words.split("swings through ")[1].split()[0])
        assert told == pytest.approx(np.ptp(yaw), rel=0.06)
        assert told >= 2.0
        assert np.argmax(np.abs(yaw) > 0.2 * np.ptp(yaw)) == np.argmax(yaw > 0.2 * np.ptp(yaw))
    assert ("slalom" in legs) == (omega_max > 1.0)
