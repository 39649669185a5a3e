"""Frames, units and clocks of a whole log are found by search, and mended to what they were."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from syncline_design.diagnosis import diagnose
from syncline_design.diagnosis.gross import Gross, gross_faults
from syncline_design.diagnosis.system import Measured, measured
from syncline_design.effects.kinematics import euler_to_rotation
from syncline_design.logs.log import Log
from syncline_design.spec.load import load
from tests.world import WorldLog, make_log, scenario

Columns = dict[str, np.ndarray]
Fault = Callable[[Columns], None]
NED = ("north", "east", "down")
ANGLES = ("roll_deg", "pitch_deg", "yaw_deg")
RATES = ("rate_x_degps", "rate_y_degps", "rate_z_degps")
SWAP = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # NED <-> ENU
LEFT_UP = np.diag([1.0, -1.0, -1.0])


def names(prefix: str, unit: str = "m") -> list[str]:
    return [f"{prefix}_{axis}_{unit}" for axis in NED]


def held(columns: list[str], matrix: np.ndarray) -> Fault:
    """The columns hold other axes: matrix times what they should."""

    def fault(log: Columns) -> None:
        turned = matrix @ np.array([log[name] for name in columns])
        log.update(zip(columns, turned, strict=True))

    return fault


def together(*faults: Fault) -> Fault:
    def fault(log: Columns) -> None:
        for one in faults:
            one(log)

    return fault


def attitude(world: np.ndarray, body: np.ndarray) -> Fault:
    """Attitude of another body frame against another world frame, by scipy's rotations."""

    def fault(log: Columns) -> None:
        angles = np.array([log["yaw_deg"], log["pitch_deg"], log["roll_deg"]]).T
        turned = world @ Rotation.from_euler("ZYX", angles, degrees=True).as_matrix() @ body
        found = Rotation.from_matrix(turned).as_euler("ZYX", degrees=True)
        log["yaw_deg"], log["pitch_deg"], log["roll_deg"] = found.T

    return fault


def scaled(columns: list[str], factor: float) -> Fault:
    def fault(log: Columns) -> None:
        log.update({name: factor * log[name] for name in columns})

    return fault


def late(columns: list[str], seconds: float) -> Fault:
    """Every row holds what the columns were so long before; rows before the first go."""

    def fault(log: Columns) -> None:
        time_s = log["time_s"]
        for name in columns:
            angle = name == "yaw_deg"
            series = np.degrees(np.unwrap(np.radians(log[name]))) if angle else log[name]
            log[name] = np.interp(time_s - seconds, time_s, series)
        kept = time_s - seconds >= time_s[0]
        log.update({name: values[kept] for name, values in log.items()})

    return fault


def plus(column: str, value: float, sign: float = 1.0) -> Fault:
    def fault(log: Columns) -> None:
        log[column] = sign * log[column] + value

    return fault


def exchanged(*pairs: tuple[str, str]) -> Fault:
    """Columns under each other's name."""

    def fault(log: Columns) -> None:
        for one, other in pairs:
            log[one], log[other] = log[other], log[one]

    return fault


UPRIGHT = (("position", "m"), ("velocity", "mps"), ("target", "m"))
PLACES = tuple(zip(names("position"), names("target"), strict=True))
EVERYTHING = together(
    held(names("position"), SWAP), held(names("velocity", "mps"), SWAP), held(names("target"), SWAP)
)
ROBOT = together(
    EVERYTHING, attitude(SWAP, LEFT_UP), scaled(["rate_y_degps", "rate_z_degps"], -1.0)
)
FAULTS: dict[str, tuple[Fault, str]] = {
    "all in ENU, so is yaw": (
        together(EVERYTHING, plus("yaw_deg", 90.0, -1.0)),
        "east-north-up in all, yaw from east",
    ),
    "a robot's log": (ROBOT, "east-north-up in all, forward-left-up"),
    "a robot's log, bearings too": (
        together(ROBOT, scaled(["azimuth_deg"], -1.0)),
        "east-north-up in all, forward-left-up, azimuth to the left",
    ),
    "all in ENU": (EVERYTHING, "east-north-up (position, velocity and target alike)"),
    "targets in ENU": (held(names("target"), SWAP), "east-north-up"),
    "axes permuted": (held(names("position"), np.eye(3)[[1, 2, 0]]), "east-down-north"),
    "one mirrored": (held(names("position"), np.diag([1.0, -1.0, 1.0])), "north-west-down"),
    "height up": (held(names("position"), np.diag([1.0, 1.0, -1.0])), "up"),
    "height up, so is the velocity": (
        together(*(scaled([f"{one}_down_{u}"], -1.0) for one, u in UPRIGHT[:2])),
        "up",
    ),
    "places and velocity in ENU": (
        together(held(names("position"), SWAP), held(names("velocity", "mps"), SWAP)),
        "enu",
    ),
    "places and velocity in cm": (
        together(scaled(names("position"), 100.0), scaled(names("velocity", "mps"), 100.0)),
        "in cm",
    ),
    "ranges in mm": (scaled(["range_m"], 1000.0), "range in mm"),
    "radians": (scaled(list(ANGLES), np.pi / 180.0), "radians"),
    "ENU, y left": (attitude(SWAP, LEFT_UP), "enu"),
    "world ENU": (attitude(SWAP, np.eye(3)), "world axes east-north-up"),
    "y left": (attitude(np.eye(3), LEFT_UP), "body axes forward-left-up"),
    "yaw + 90, y left": (
        together(attitude(np.eye(3), LEFT_UP), plus("yaw_deg", 90.0)),
        "world axes west-north-down, body axes forward-left-up",
    ),
    "from the zenith": (plus("elevation_deg", 90.0, -1.0), "elevation from the zenith"),
    "bearings exchanged": (
        exchanged(("azimuth_deg", "elevation_deg")),
        "azimuth and elevation under each other's name",
    ),
    "roll, pitch exchanged": (
        exchanged(("roll_deg", "pitch_deg")),
        "roll and pitch under each other's name",
    ),
    "yaw, roll exchanged": (
        exchanged(("roll_deg", "yaw_deg")),
        "roll and yaw under each other's name",
    ),
    "places exchanged": (
        exchanged(*PLACES),
        "the position and the target under each other's name",
    ),
    "heights of all up": (
        together(*(scaled([f"{one}_down_{u}"], -1.0) for one, u in UPRIGHT)),
        "north-east-up (position, velocity and target alike)",
    ),
    "yaw in radians": (
        scaled(["yaw_deg"], np.pi / 180.0),
        "radians for degrees in yaw alone",
    ),
    "elevation in mrad": (
        scaled(["elevation_deg"], 1e3 * np.pi / 180.0),
        "milliradians for degrees in elevation alone",
    ),
    "azimuth in radians": (
        scaled(["azimuth_deg"], np.pi / 180.0),
        "radians for degrees in azimuth alone",
    ),
    "azimuth + 90": (plus("azimuth_deg", 90.0), "azimuth off by 90 deg"),
}
SHIFTS = {
    "slip": (late(names("position"), 1.0), ("integer_second_slip", "position"), 1.0),
    "long slip": (late(names("position"), 18.0), ("integer_second_slip", "position"), 18.0),
    "two clocks": (late(names("position"), 12.5), ("latency", "position"), 12.5),
    "late attitudes": (late([*ANGLES, *RATES], 2.0), ("latency", "attitude"), 2.0),
}


@cache
def clean() -> WorldLog:
    return make_log(scenario("car_stops", 3, 60.0, 4.0))


def spoilt(fault: Fault | None) -> WorldLog:
    columns = {name: values.astype(float) for name, values in clean().columns.items()}
    if fault is not None:
        fault(columns)
    return replace(clean(), columns=columns)


def read(log: WorldLog) -> Measured:
    with TemporaryDirectory() as folder:
        spec = Path(folder) / "spec.yaml"
        spec.write_text(log.spec_yaml(), encoding="utf-8")
        return measured(load(spec), [log.to_csv(Path(folder) / "log.csv")])


@cache
def true_log() -> Log:
    return read(spoilt(None)).log


def searched(fault: Fault) -> tuple[tuple[str, str], str | float, Log]:
    """(effect and sensor, value, mended log) of the one gross fault found."""
    inputs = read(spoilt(fault))
    (found,), mended = gross_faults(inputs.system, inputs.log, inputs.known)
    (value,) = found.acting.values.values()
    return (found.acting.effect.name, found.acting.sensor), value, mended


@pytest.mark.parametrize("name", FAULTS)
def test_a_convention_is_named_and_mended(name: str) -> None:
    fault, convention = FAULTS[name]
    (effect, _), value, mended = searched(fault)
    assert (effect, value) == ("frame_convention", convention)
    true, found = true_log(), mended
    one, other = true.stages[0], found.stages[0]
    if true.truth_m[0] == pytest.approx(found.truth_m[0], abs=1e-3):  # not all of it turned about
        assert other.antenna_m == pytest.approx(one.antenna_m, abs=1e-3)
        assert other.velocity_mps == pytest.approx(one.velocity_mps, abs=1e-2)
    assert other.range_m == pytest.approx(one.range_m, abs=1e-3)
    assert np.cos(other.azimuth_rad - one.azimuth_rad) == pytest.approx(1.0, abs=1e-6)
    turned = euler_to_rotation(other.euler_rad)
    assert turned == pytest.approx(euler_to_rotation(one.euler_rad), abs=1e-4)


def test_a_robots_log_is_mended_whole() -> None:
    """Not the mirrored world that fits it as well: north stays north, and rates fit attitudes."""
    _, _, mended = searched(ROBOT)
    true = true_log()
    assert mended.truth_m == pytest.approx(true.truth_m, abs=1e-3)
    one, other = true.stages[0], mended.stages[0]
    assert other.rate_radps == pytest.approx(one.rate_radps, abs=1e-5)


@pytest.mark.parametrize("name", SHIFTS)
def test_a_shift_of_stamps_is_found_to_the_second(name: str) -> None:
    fault, label, seconds = SHIFTS[name]
    found, value, _ = searched(fault)
    assert found == label
    assert value == pytest.approx(seconds, abs=0.03)


def test_a_clean_log_and_a_large_lever_arm_are_no_convention() -> None:
    """Half a metre of arm is far from noise, and no turn of axes."""
    assert not gross_of(None)
    longer = plus("range_m", 0.5)
    assert not gross_of(longer)


def gross_of(fault: Fault | None) -> tuple[Gross, ...]:
    inputs = read(spoilt(fault))
    return gross_faults(inputs.system, inputs.log, inputs.known)[0]


def test_a_fault_that_no_spec_holds_stays_out_of_it() -> None:
    log = spoilt(FAULTS["y left"][0])
    with TemporaryDirectory() as folder:
        spec = Path(folder) / "spec.yaml"
        spec.write_text(log.spec_yaml(), encoding="utf-8")
        found = diagnose(spec, [log.to_csv(Path(folder) / "log.csv")])
    (one,) = found.findings
    assert one.sentence == (
        "The attitude columns follow another convention: body axes forward-left-up"
    )
    assert found.verdict == "explained"
    assert found.effects_entries() == ()


def test_columns_under_each_others_name_are_said_so() -> None:
    (one,) = gross_of(FAULTS["bearings exchanged"][0])
    assert one.sentence == "The columns of azimuth and elevation are under each other's name"


@pytest.mark.parametrize("alike", [True, False])
def test_velocities_are_turned_with_the_places_where_they_fit(alike: bool) -> None:
    (one,) = gross_of(FAULTS["height up, so is the velocity" if alike else "height up"][0])
    assert one.velocity_alike is alike


def test_two_faults_are_found_of_which_the_greater_hides_the_unit() -> None:
    """East-north-up places and ranges in mm: in cm, the ranges would leave less than in mm."""

    def both(log: Columns) -> None:
        held(names("position"), SWAP)(log)
        log["range_m"] = 1e3 * log["range_m"]

    inputs = read(spoilt(both))
    found, mended = gross_faults(inputs.system, inputs.log, inputs.known)
    said = {(one.acting.sensor, *one.acting.values.values()) for one in found}
    assert said == {("position", "enu"), ("ranging", "range in mm")}
    true, other = true_log(), mended.stages[0]
    assert other.range_m == pytest.approx(true.stages[0].range_m, abs=1e-3)
    assert other.antenna_m == pytest.approx(true.stages[0].antenna_m, abs=1e-3)


REFERENCE = names("reference")


def beside_a_reference(sign: float, scatter_m: float = 0.0) -> Fault:
    """A position log: the antenna's arm beside the reference, times a sign, and noise of places."""

    def fault(log: Columns) -> None:
        angles = np.radians(np.array([log[name] for name in ANGLES]).T)
        arm = (
            sign
            * euler_to_rotation(angles)
            @ np.array(clean().run.carriers[0].sensors.antenna_arm_m)
        )
        noise = scatter_m * np.random.default_rng(5).standard_normal(arm.shape)
        for k, name in enumerate(names("position")):
            log[REFERENCE[k]] = log[name] - arm[:, k]
            log[name] = log[name] + noise[:, k]
        for name in ("range_m", "azimuth_deg", "elevation_deg", "target_id", *names("target")):
            log.pop(name, None)

    return fault


def test_a_lever_arm_of_the_wrong_sign_turns_no_world_round() -> None:
    """The error would be the same with all of the world south-west-up, or places exchanged."""
    assert not gross_of(beside_a_reference(-1.0))


def test_a_reference_that_scatters_like_a_receiver_is_called_so() -> None:
    exchange = exchanged(*zip(names("position"), REFERENCE, strict=True))
    (one,) = gross_of(together(beside_a_reference(1.0, 0.1), exchange))
    assert one.sentence == (
        "The columns of the position and the reference are under each other's name"
    )
