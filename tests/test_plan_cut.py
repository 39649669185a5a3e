"""Drives of one swing of speed, cut to what is asked."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from syncline_design.effects.record import Array
from syncline_design.planning.drives import World, whole_information
from syncline_design.planning.leg_library import library
from syncline_design.planning.path import PathStates, travelled
from syncline_design.planning.run import plan as planned
from syncline_design.planning.setup import PlanRequest, Setup
from syncline_design.planning.swings import SHAPES, SwingShape, swing_within
from syncline_design.planning.telling import PlanRun
from syncline_design.planning.vehicle import Vehicle
from syncline_design.planning.wanted import PlanWanted, reach_of, separate_of
from syncline_design.spec.load import load

TRACTOR = """\
syncline: 1
name: tractor
requirements: [{id: ACC-1, kind: accuracy, limit: 1 m}]
stages:
  - name: tractor
    platform: {name: tractor, v_max: 4 m/s, omega_max: 25 deg/s, distance: 40 m, baseline: 1 m,
      motion: ground, minimum_turn_radius: 5 m, acceleration: 0.8 m/s^2}
    position: {sensor: {modality: position, sigma_position: [2 cm, 2 cm, 4 cm], primitives: [pps],
      name: G}, TIMED, lever_arm: [0.3 m, 0.1 m, -0.5 m]}
    attitude: {sensor: {modality: attitude, sigma_attitude: [0.1 deg, 0.1 deg, 0.2 deg],
      primitives: [pps], name: I}, TIMED}
    ranging: {sensor: {modality: ranging, type: lidar, sigma_range: 2 cm,
      sigma_bearing: [0.05 deg, 0.05 deg], primitives: [pps], rate: 5 Hz, name: L}, TIMED,
      lever_arm: [-0.2 m, 0 m, 0.4 m]}
""".replace("TIMED", "timestamping: {error: {distribution: uniform, low: -1 us, high: 1 us}}")


def vehicle(motion: str, **more: float) -> Vehicle:
    figures = {"v_max_mps": 4.0, "omega_max_radps": 0.44, "acceleration_mps2": 0.8,
               "turn_radius_m": 5.0, "slowest_mps": 0.0, "tilt_rad": 0.0, "distance_m": 40.0,
               "depth_m": 0.0} | more  # fmt: skip
    return Vehicle("one", motion, **figures)  # type: ignore[arg-type]


VEHICLES = {
    "ground": vehicle("ground"),
    "multirotor": vehicle("multirotor", turn_radius_m=0.0, acceleration_mps2=2.5,
                          omega_max_radps=1.5, v_max_mps=8.0),
    "fixed_wing": vehicle("fixed_wing", v_max_mps=25.0, omega_max_radps=0.5, slowest_mps=15.0,
                          turn_radius_m=50.0, acceleration_mps2=4.0),
    "rail": vehicle("ground", v_max_mps=20.0, omega_max_radps=math.radians(0.5),
                    turn_radius_m=3000.0, acceleration_mps2=0.5),
}  # fmt: skip


@pytest.mark.parametrize("one", VEHICLES.values(), ids=list(VEHICLES))
@pytest.mark.parametrize("most_s", [15.0, 40.0, 120.0])
def test_swings_of_any_length_keep_to_what_the_vehicle_can(one: Vehicle, most_s: float) -> None:
    """By the path's own differences: speed, turn rate, radius, acceleration along and across."""
    made = [swing_within(one, 0, shape, most_s) for shape in SHAPES]
    swings = [leg for leg in made if leg is not None]
    assert swings
    for leg in swings:
        assert leg.duration_s <= most_s
        path = travelled(one, leg.course)
        speed, turn = _level(path)
        along = np.gradient(speed, path.time_s)
        assert speed.max() <= 0.9 * one.v_max_mps + 1e-6
        assert speed.min() >= one.slowest_mps - 1e-6
        assert np.abs(turn).max() <= 0.76 * one.omega_max_radps
        assert np.hypot(along, speed * turn).max() <= 1.02 * one.acceleration_mps2
        if leg.words.startswith("On"):
            assert _radii(path).min() >= 0.98 * one.turn_radius_m


def _level(path: PathStates) -> tuple[Array, Array]:
    """Speed over ground and turn rate of a path."""
    speed = np.hypot(path.velocity_mps[:, 0], path.velocity_mps[:, 1])
    return speed, np.gradient(path.euler_rad[:, 2], path.time_s)


def _radii(path: PathStates) -> Array:
    """Of every step by which the heading turns: the way of it over its turn."""
    way = np.linalg.norm(np.diff(path.position_m[:, :2], axis=0), axis=1)
    turned = np.abs(np.diff(path.euler_rad[:, 2]))
    return np.asarray(way[turned > 1e-3 * turned.max()] / turned[turned > 1e-3 * turned.max()])


def test_the_words_of_a_swing_are_its_path() -> None:
    """How far about, and the slowest and the fastest speed."""
    for leg in library(VEHICLES["ground"], 0):
        if leg.name != "swing of speed":
            continue
        path = travelled(VEHICLES["ground"], leg.course)
        speed = np.hypot(path.velocity_mps[:, 0], path.velocity_mps[:, 1])
        said = [float(word) for word in leg.words.replace(",", " ").split() if _is_number(word)]
        if leg.words.startswith("On an arc"):
            about = math.degrees(path.euler_rad[-1, 2] - path.euler_rad[0, 2])
            assert said[1] == pytest.approx(about, abs=0.5)
            assert said[0] == pytest.approx(path_length(path) / math.radians(about), rel=0.02)
        assert any(s == pytest.approx(speed.min(), rel=0.01) for s in said)


def path_length(path: PathStates) -> float:
    return float(np.sum(np.linalg.norm(np.diff(path.position_m[:, :2], axis=0), axis=1)))


def _is_number(word: str) -> bool:
    return word.replace(".", "", 1).isdigit()


def asked(folder: Path, wanted: PlanWanted, minutes: float = 10.0, text: str = TRACTOR) -> PlanRun:
    path = folder / "tractor.yaml"
    path.write_text(text, encoding="utf-8")
    return planned(load(path), PlanRequest(wanted, minutes=minutes, line_plans=False))


RIVALS = "latency(ranging), lever_arm(position), lever_arm(ranging)"


@pytest.mark.parametrize(
    ("wanted", "seconds"),
    [
        # the shortest of 1800 drives drawn at random, each judged whole: one to three changes of
        # speed at 0.48 m/s^2, held or not, on an arc (3.4 to 1.1 m/s on 18 m; 3.1 to 0.5 to
        # 1.7 m/s on 15 m)
        (PlanWanted((), separate_of("latency(position)=44.3 ms", RIVALS)), 1.15 * 8.1),
        (PlanWanted(reach_of("latency(position)=2 ms")), 1.25 * 16.1),
    ],
)
def test_no_drive_of_one_swing_is_much_shorter(
    wanted: PlanWanted, seconds: float, tmp_path: Path
) -> None:
    """Near drives that somebody else thought of; the least was twice as long while its legs began
    at their joining speed.  With the least as its minutes the very drive is found."""
    found = asked(tmp_path, wanted).result
    assert found.reached
    assert found.duration_s < seconds
    assert found.least_minutes is not None
    again = asked(tmp_path, wanted, minutes=found.least_minutes + 1e-6).result
    assert again.reached
    assert again.duration_s == found.duration_s


@pytest.fixture(scope="module")
def tractor(tmp_path_factory: pytest.TempPathFactory) -> World:
    path = tmp_path_factory.mktemp("world") / "tractor.yaml"
    path.write_text(TRACTOR, encoding="utf-8")
    wanted = PlanWanted(reach_of("latency(position)=2 ms"))
    return Setup.begun(load(path), PlanRequest(wanted, line_plans=False)).world


def test_what_begins_at_rest_is_driven_straight_on_and_alone(tractor: World) -> None:
    """A car does not turn on the spot, and nothing comes before what begins at rest."""
    one = VEHICLES["ground"]
    rise = swing_within(one, 0, SwingShape(1.0, 0.5, "rise"), 15.0)
    assert rise is not None
    assert rise.begins_mps == 0.0
    assert "from rest up to" in rise.words
    assert rise.words.endswith("back to rest")
    speed, _ = _level(travelled(one, rise.course))
    assert speed[-1] < 0.05 * speed.max()
    told = tractor.unjudged(rise)
    assert [way.heading for way in told.ways_from(0.0)] == [0]
    assert [way.turn_rad for way in told.ways_from(0.0)] == [0.0]


def test_many_drives_looked_at_as_one_log_tell_what_each_tells(tractor: World) -> None:
    """Each judged whole, by the path of its own log; but for steps, whose middle row falls to one
    half or the other by the last figure of its time."""
    steps = np.array([one.candidate.effect.name == "timestamp_step" for one in tractor.every])
    kept = np.flatnonzero(~np.append(steps, False))
    legs = [swing_within(tractor.vehicles[0], 0, shape, 12.0) for shape in SHAPES]
    made = [leg for leg in legs if leg is not None]
    assert len(made) == len(SHAPES)
    for leg, found in zip(made, tractor.alone(made), strict=True):
        whole = whole_information(tractor, [tractor.unjudged(leg)])
        size = np.sqrt(np.maximum(np.diag(whole), 1e-12))
        apart = np.abs(found - whole) / size / size[:, None]
        assert apart[np.ix_(kept, kept)].max() < 1e-6


def test_what_begins_fast_says_its_run_up(tmp_path: Path) -> None:
    """Of v at 0.8 m/s^2 from rest: v^2 / 1.6 m."""
    wanted = PlanWanted((), separate_of("latency(position)=44.3 ms", RIVALS))
    (leg,) = asked(tmp_path, wanted).result.legs
    begins = float(leg.words.split(" in all: at ")[1].split(" m/s")[0])
    run_up = float(leg.words.split("; before it a run-up of ")[1].split(" m ")[0])
    assert run_up == pytest.approx(begins**2 / 1.6, rel=0.06)


def test_an_area_holds_the_run_up_and_the_run_out(tmp_path: Path) -> None:
    """Just less of it than the best drive takes with both; the drive alone keeps nine tenths."""
    wanted = PlanWanted((), separate_of("latency(position)=44.3 ms", RIVALS))
    (tmp_path / "free").mkdir()
    free = asked(tmp_path / "free", wanted)
    small_m = 0.99 * float(np.max(taken_m(free)))
    area = f"area: [{small_m} m, {small_m} m], distance:"
    run = asked(tmp_path, wanted, text=TRACTOR.replace("distance:", area))
    assert run.result.reached
    assert np.all(taken_m(run) <= small_m + 1e-6)
    assert np.all(np.ptp(run.path.position_m[:, :2], axis=0) <= 0.9 * small_m + 1e-6)


def test_an_area_holds_them_for_a_drive_of_several_legs(tmp_path: Path) -> None:
    """A boat that turns wide, by the places of its mission: from where its run-up begins on."""
    path = tmp_path / "boat.yaml"
    text = TRACTOR.replace("motion: ground", "motion: surface, area: [60 m, 50 m]")
    path.write_text(text.replace("acceleration: 0.8", "acceleration: 0.3"), encoding="utf-8")
    wanted = PlanWanted((), separate_of("heading_bias(attitude)", "boresight(ranging)"))
    run = planned(load(path), PlanRequest(wanted, minutes=4.0, line_plans=False))
    assert len(run.result.legs) > 1
    assert run.approach.run_up_m is not None
    places = np.vstack([run.path.position_m, *run.approach.places_m])
    north, east = np.ptp(places[:, :2], axis=0)
    assert north <= 60.0
    assert east <= 50.0


def test_what_is_plausible_of_itself_holds_no_tolerance(tmp_path: Path) -> None:
    """A filter of 0.1 s left free leaves a delay of a tractor that is asked to 20 ms at nearly as
    much: by hand, of the information on both the log leaves next to none across."""
    run = asked(tmp_path, PlanWanted(reach_of("latency(position)=20 ms")))
    found = {
        one.effect: one.sigma["latency(position).latency_s"] for one in run.result.untold or ()
    }
    assert found["filter_lag(position)"] == pytest.approx(0.1, rel=0.2)


def test_what_a_pair_is_told_from_is_not_taken_as_known(tmp_path: Path) -> None:
    """A delay of 300 ms is told from a filter beyond first order."""
    pair = separate_of("latency(position)=300 ms", "filter_lag(position)")
    run = asked(tmp_path, PlanWanted((), pair))
    assert run.result.reached
    assert "filter_lag(position)" not in {one.effect for one in run.result.untold or ()}


def taken_m(run: PlanRun) -> Array:
    """North and east extent of a drive, v^2 / 1.6 m before and after with it."""
    place, way = run.path.position_m[:, :2], np.diff(run.path.position_m[:, :2], axis=0)
    step_s = float(run.path.time_s[1] - run.path.time_s[0])
    before, after = (np.linalg.norm(one) * one / step_s**2 / 1.6 for one in (way[0], way[-1]))
    return np.ptp(np.vstack([place[0] - before, place, place[-1] + after]), axis=0)
