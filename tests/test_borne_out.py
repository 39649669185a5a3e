"""Attitudes in another convention, where the arm is short beside the noise: the motion tells.

Positions beside a reference, by the formula for a lever arm alone; the noise is white.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from syncline_design.diagnosis import diagnose
from syncline_design.diagnosis.gross import gross_faults
from syncline_design.diagnosis.mean_turn import least_turn_rad
from syncline_design.diagnosis.system import measured
from syncline_design.logs.log import Log
from syncline_design.spec.load import load

Columns = dict[str, np.ndarray]
NED = ("north", "east", "down")
ANGLES = ("roll_deg", "pitch_deg", "yaw_deg")
ARM_M = np.array([0.5, 0.0, -0.6])
SIGMA_M = 0.25
SPEC = f"""syncline: 1
name: beside a reference
requirements: [{{id: A, kind: accuracy, limit: 5 m}}]
stages:
  - name: boat
    platform: {{v_max: 3 m/s, omega_max: 20 deg/s, distance: 1 m, baseline: 1 m}}
    position:
      sensor: {{modality: position, type: gnss, sigma_position: {SIGMA_M} m, primitives: [pps]}}
      primitive: pps
      timestamping: {{error: {{distribution: uniform, low: -10 ns, high: 10 ns}}}}
      lever_arm: [{ARM_M[0]} m, {ARM_M[1]} m, {ARM_M[2]} m]
"""


def columns(seed: int, arm_m: np.ndarray = ARM_M, heads: float | np.ndarray = 0.0) -> Columns:
    """A boat on a winding course; heads: its bow away from where it goes [deg]."""
    rng, time_s = np.random.default_rng(seed), np.arange(500) * 0.1
    course = 2.0 * np.sin(0.21 * time_s + rng.uniform(0, 6)) + 0.06 * time_s
    velocity = np.stack([1.4 * np.cos(course), 1.4 * np.sin(course), 0.0 * time_s], axis=1)
    place = np.cumsum(velocity, axis=0) * 0.1
    roll, pitch = 9.0 * np.sin(1.3 * time_s), 6.0 * np.sin(0.9 * time_s + 1.0)
    yaw = np.degrees(course) + heads
    turn = Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1), degrees=True)
    rate = (turn[:-1].inv() * turn[1:]).as_rotvec(degrees=True) / 0.1
    antenna = place + turn.apply(arm_m) + SIGMA_M * rng.standard_normal(place.shape)
    wrapped = (yaw + 180.0) % 360.0 - 180.0
    log = {"time_s": time_s, **dict(zip(ANGLES, (roll, pitch, wrapped), strict=True))}
    for k, axis in enumerate(NED):
        log |= {f"position_{axis}_m": antenna[:, k], f"reference_{axis}_m": place[:, k]}
        log |= {f"velocity_{axis}_mps": velocity[:, k]}
        log[f"rate_{'xyz'[k]}_degps"] = np.append(rate[:, k], rate[-1, k])
    return log


def read(log: Columns) -> tuple[object, Log]:
    with TemporaryDirectory() as folder:
        spec, file = Path(folder) / "spec.yaml", Path(folder) / "log.csv"
        spec.write_text(SPEC, encoding="utf-8")
        table = np.stack(list(log.values()), axis=1)
        np.savetxt(file, table, "%.6f", ",", header=",".join(log), comments="")
        inputs = measured(load(spec), [file])
    found, _ = gross_faults(inputs.system, inputs.log, inputs.known)
    return found, inputs.log


@cache
def named(seed: int, fault: Callable[[Columns], None] | None = None, **how: float) -> list[str]:
    log = columns(seed, **how)
    if fault is not None:
        fault(log)
    found, _ = read(log)
    return [f"{one.acting.values['convention']}; {one.witness}" for one in found]


def turned(by_deg: float) -> Callable[[Columns], None]:
    def fault(log: Columns) -> None:
        log["yaw_deg"] = (log["yaw_deg"] + by_deg + 180.0) % 360.0 - 180.0

    return fault


def exchanged(log: Columns) -> None:
    log["roll_deg"], log["pitch_deg"] = log["pitch_deg"], log["roll_deg"]


def from_east(log: Columns) -> None:
    log["yaw_deg"] = (90.0 - log["yaw_deg"] + 180.0) % 360.0 - 180.0


def turned_round(log: Columns) -> None:
    log["yaw_deg"] = -log["yaw_deg"]


def with_a_rate_turned_round(log: Columns) -> None:
    log["rate_z_degps"] = -log["rate_z_degps"]


def without_rates(log: Columns) -> None:
    exchanged(log)
    for axis in "xyz":
        del log[f"rate_{axis}_degps"]


@pytest.mark.parametrize("off", [90, 180, -90])
def test_a_turned_heading_is_told_by_where_the_vehicle_goes(off: int) -> None:
    said = f"yaw off by {off} deg; the vehicle then heads where it goes".replace("-", "−")
    assert [one.replace("-", "−") for one in named(1, turned(off))] == [said]


def test_a_wrong_arm_of_a_vehicle_that_heads_where_it_goes_is_no_turned_heading() -> None:
    """The places are those of a heading that is off by 180 deg."""
    found, _ = read(columns(2, ARM_M * [-1.0, -1.0, 1.0]))
    assert found == ()


def test_a_wrong_arm_of_a_vehicle_that_goes_astern_is_no_turned_heading() -> None:
    """Half as long as the heading would make it: turned back, half of it would be left."""
    found, _ = read(columns(3, np.array([0.0, 0.0, -0.6]), 180.0))
    assert found == ()


def test_exchanged_angles_are_told_by_the_rates() -> None:
    assert named(4, exchanged) == [
        "roll and pitch under each other's name; the rates are then those of the attitude"
    ]
    assert named(4, without_rates) == []


@pytest.mark.parametrize("seed", range(20, 26))
@pytest.mark.parametrize(("fault", "said"), [(from_east, "yaw from east to north"),
                                             (turned_round, "yaw turned round")])  # fmt: skip
def test_a_heading_the_other_way_round_is_told_by_the_rates_and_its_zero_by_the_error(
    seed: int, fault: Callable[[Columns], None], said: str
) -> None:
    assert named(seed, fault) == [f"{said}; the rates are then those of the attitude"]


@pytest.mark.parametrize("seed", range(20, 26))
def test_a_rate_that_is_turned_round_turns_no_heading(seed: int) -> None:
    assert named(seed, with_a_rate_turned_round) == []


@pytest.mark.parametrize("heads", [0.0, 90.0, 180.0, -90.0])
def test_a_clean_log_has_no_turned_heading_wherever_its_vehicle_heads(heads: float) -> None:
    assert not any(named(seed, heads=heads) for seed in range(10, 20))


TURNS_ABOUT = np.linspace(0.0, 720.0, 500)


@pytest.mark.parametrize(("heads", "said"), [(TURNS_ABOUT, True), (0.0, False)])
def test_where_no_way_tells_a_turned_heading_is_said_beside_the_arm(
    heads: float | np.ndarray, said: bool, tmp_path: Path
) -> None:
    """Half a turn of yaw makes the error of an arm that is off by twice the arm."""
    log = columns(5, ARM_M * [-1.0, -1.0, 1.0], heads)
    spec, file = tmp_path / "spec.yaml", tmp_path / "log.csv"
    spec.write_text(SPEC, encoding="utf-8")
    table = np.stack(list(log.values()), axis=1)
    np.savetxt(file, table, "%.6f", ",", header=",".join(log), comments="")
    (arm,) = (one for one in diagnose(spec, [file]).findings if one.effect == "lever_arm")
    assert ("a yaw that is off by 180 deg would make the same error" in arm.evidence) is said


@pytest.mark.parametrize(("off_rad", "longer", "said"), [(0.12, 1.0, True), (0.0, 1.3, False)])
def test_attitudes_off_on_the_average_are_said_beside_the_arm_that_they_look_like(
    off_rad: float, longer: float, said: bool, tmp_path: Path
) -> None:
    """A turn of 0.12 rad across the arm moves its end across it; an arm that is longer is none."""
    log = columns(5, ARM_M * longer, TURNS_ABOUT)
    across = np.cross(ARM_M, [0.0, 1.0, 0.0]) / np.linalg.norm(ARM_M)
    turn = Rotation.from_euler(
        "ZYX", np.stack([log[a] for a in ANGLES[::-1]], axis=1), degrees=True
    )
    told = (turn * Rotation.from_rotvec(off_rad * across)).as_euler("ZYX", degrees=True)
    log |= dict(zip(ANGLES[::-1], told.T, strict=True))
    spec, file = tmp_path / "spec.yaml", tmp_path / "log.csv"
    spec.write_text(SPEC, encoding="utf-8")
    table = np.stack(list(log.values()), axis=1)
    np.savetxt(file, table, "%.6f", ",", header=",".join(log), comments="")
    (arm,) = (one for one in diagnose(spec, [file]).findings if one.effect == "lever_arm")
    assert ("on the average" in arm.evidence) is said
    turn_rad = least_turn_rad(arm, ARM_M)
    assert turn_rad is None if not said else turn_rad == pytest.approx(off_rad, abs=0.03)
