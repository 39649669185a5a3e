"""Logs whose north and down are those of where the vehicle is, and angles that pass 180 deg.

The oracle is the earth itself: a point seen from the vehicle is placed in the vehicle's own level,
taken to the earth-centred frame and back by `tests.world.geodesy`, and must lie where the attitude
that was read says that it lies.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from syncline_design.logs.log import Log
from syncline_design.logs.reading import read_log
from tests.test_diagnose_log import columns, refusal, write
from tests.world.geodesy import to_geodetic

Columns = dict[str, np.ndarray]
ROWS = 60


def written(path: Path, made: Columns) -> Path:
    lines = [",".join(made)]
    lines += [",".join(f"{v:.12f}" for v in row) for row in zip(*made.values(), strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def flight(latitude: float, longitude: float, far_m: float) -> Columns:
    """A line of some kilometres; what every row sees lies 40 m away, places in WGS 84."""
    rng = np.random.default_rng(5)
    share = np.linspace(0.0, 1.0, ROWS)[:, None]
    path = np.array([-400.0, 30.0, -500.0]) + share * np.array([0.6, 0.8, 0.0]) * far_m
    place = to_geodetic(path, (latitude, longitude, 0.0))
    euler = np.column_stack(
        [rng.normal(0.0, 5.0, ROWS), rng.normal(0.0, 5.0, ROWS), rng.uniform(-180.0, 180.0, ROWS)]
    )
    pose = Rotation.from_euler("ZYX", euler[:, ::-1], degrees=True)
    body = rng.normal(size=(ROWS, 3))
    body *= 40.0 / np.linalg.norm(body, axis=1)[:, None]
    level = pose.apply(body)
    speed = rng.normal(0.0, 5.0, (ROWS, 3))
    seen = [to_geodetic(v[None], tuple(p))[0] for v, p in zip(level, place, strict=True)]
    made: Columns = {"time_s": 0.1 * np.arange(ROWS)}
    for prefix, values in (("", place), ("target_", np.array(seen))):
        for k, name in enumerate(("latitude_deg", "longitude_deg", "height_m")):
            made[prefix + name] = values[:, k]
    made |= {n: euler[:, k] for k, n in enumerate(("roll_deg", "pitch_deg", "yaw_deg"))}
    for k, axis in enumerate(("north", "east", "down")):
        made[f"velocity_{axis}_mps"] = speed[:, k]
    made["range_m"] = np.linalg.norm(body, axis=1)
    made["azimuth_deg"] = np.degrees(np.arctan2(body[:, 1], body[:, 0]))
    made["elevation_deg"] = np.degrees(np.arcsin(-body[:, 2] / made["range_m"]))
    return made | {f"rate_{a}_degps": np.zeros(ROWS) for a in "xyz"}


def missed_m(log: Log) -> float:
    """Largest distance between a target and where the attitude that was read puts it."""
    stage = log.stages[0]
    for known in (stage.range_m, stage.azimuth_rad, stage.elevation_rad, stage.antenna_m):
        assert known is not None
    flat = np.cos(stage.elevation_rad)
    sight = np.column_stack(
        [
            np.cos(stage.azimuth_rad) * flat,
            np.sin(stage.azimuth_rad) * flat,
            -np.sin(stage.elevation_rad),
        ]
    )
    pose = Rotation.from_euler("ZYX", stage.euler_rad[:, ::-1])
    at = stage.antenna_m + pose.apply(sight * stage.range_m[:, None])
    return float(np.max(np.linalg.norm(at - log.truth_m, axis=1)))


CASES = [(47.3, 8.55, 20_000.0), (69.0, 18.9, 10_000.0), (-41.3, 179.99, 8_000.0), (0.0, 0.0, 5e4)]


@pytest.mark.parametrize(("latitude", "longitude", "far_m"), CASES)
@pytest.mark.parametrize("stated", [False, True])
def test_attitudes_are_read_at_the_level_of_the_vehicle(
    tmp_path: Path, latitude: float, longitude: float, far_m: float, stated: bool
) -> None:
    """A stated origin lies 25 km beside the line; not turned, attitudes miss by 0.1 m and more."""
    made = flight(latitude, longitude, far_m)
    beside = (np.radians(latitude + 0.2), np.radians(longitude - 0.1), 100.0) if stated else None
    log = read_log([written(tmp_path / "a.csv", made)], ["uav"], {}, origin=beside)
    assert missed_m(log) < 1e-4
    assert any("were turned to those of the origin" in note for note in log.notes)


@pytest.mark.parametrize("files", [1, 2])
def test_velocities_turn_with_the_level(tmp_path: Path, files: int) -> None:
    """The target of every row is where the velocity leads in a second; also from a file apart."""
    made = flight(60.0, 179.9, 15_000.0)
    rows = list(zip(*(made[n] for n in ("latitude_deg", "longitude_deg", "height_m")), strict=True))
    speed = np.column_stack([made[f"velocity_{a}_mps"] for a in ("north", "east", "down")])
    ahead = np.array([to_geodetic(v[None], p)[0] for v, p in zip(speed, rows, strict=True)])
    for k, name in enumerate(("latitude_deg", "longitude_deg", "height_m")):
        made["target_" + name] = ahead[:, k]
    apart = {n: v for n, v in made.items() if n == "time_s" or n.startswith(("velocity", "rate"))}
    rest = {n: v for n, v in made.items() if n == "time_s" or n not in apart}
    parts = [rest, apart] if files == 2 else [made]
    paths = [written(tmp_path / f"{k}.csv", part) for k, part in enumerate(parts)]
    stage = (log := read_log(paths, ["uav"], {})).stages[0]
    assert stage.antenna_m is not None
    way = log.truth_m - stage.antenna_m
    assert stage.velocity_mps == pytest.approx(way, abs=1e-4)
    assert (stage.velocity_track is None) == (files == 1)
    if stage.velocity_track is not None:
        assert stage.velocity_track.value == pytest.approx(way, abs=1e-4)


def test_local_places_keep_their_attitudes(tmp_path: Path) -> None:
    """Targets in WGS 84 alone say nothing about the level of a vehicle whose places are local."""
    made = flight(47.3, 8.55, 20_000.0)
    for name in ("latitude_deg", "longitude_deg", "height_m"):
        del made[name]
    made |= {f"position_{axis}_m": np.zeros(ROWS) for axis in ("north", "east", "down")}
    origin = (np.radians(47.3), np.radians(8.55), 0.0)
    log = read_log([written(tmp_path / "a.csv", made)], ["uav"], {}, origin=origin)
    assert np.degrees(log.stages[0].euler_rad[:, 2]) == pytest.approx(made["yaw_deg"], abs=1e-9)


@pytest.mark.parametrize("name", ["yaw_deg", "heading_deg"])
@pytest.mark.parametrize("whole", [False, True])
def test_a_heading_alone_is_interpolated_across_the_turn(
    tmp_path: Path, name: str, whole: bool
) -> None:
    """A file of headings at stamps of its own, through 180 deg (or 360 deg) many times.

    The heading turns evenly, so what lies between two stamps is known exactly; interpolated as a
    plain number it was up to 180 deg off at every passage.
    """
    time_s = 0.1 * np.arange(200)
    fine_s = 0.037 * np.arange(-3, 600)

    def heading(at: np.ndarray) -> np.ndarray:
        turned = 50.0 + 90.0 * at
        return turned % 360.0 if whole else (turned + 180.0) % 360.0 - 180.0

    zero = np.zeros(time_s.shape[0])
    made = {"time_s": time_s, "position_north_m": time_s, "position_east_m": zero}
    made |= {"velocity_north_mps": zero + 1.0, "velocity_east_mps": zero}
    made |= {"range_m": zero + 5.0, "azimuth_deg": zero, "target_north_m": zero + 9.0}
    made["target_east_m"] = zero
    other = {"time_s": fine_s, name: heading(fine_s), "rate_z_degps": 0.0 * fine_s + 90.0}
    paths = [write(tmp_path / "a.csv", made), write(tmp_path / "b.csv", other)]
    got = read_log(paths, ["uav"], {}).stages[0].euler_rad[:, 2]
    off = np.angle(np.exp(1j * (got - np.radians(50.0 + 90.0 * time_s))))
    assert np.max(np.abs(off)) < 1e-6


def test_positions_of_a_file_apart_pass_the_date_line(tmp_path: Path) -> None:
    made = flight(-17.0, 179.97, 8_000.0)
    place = {n: made.pop(n) for n in ("latitude_deg", "longitude_deg", "height_m")}
    fine = np.linspace(0.0, made["time_s"][-1], 400)
    grown = {
        n: np.interp(fine, made["time_s"], np.unwrap(v, period=360.0)) for n, v in place.items()
    }
    grown["longitude_deg"] = (grown["longitude_deg"] + 180.0) % 360.0 - 180.0
    assert np.ptp(grown["longitude_deg"]) > 300.0
    paths = [
        written(tmp_path / "a.csv", made),
        written(tmp_path / "b.csv", {"time_s": fine, **grown}),
    ]
    log = read_log(paths, ["uav"], {})
    assert missed_m(log) < 0.01


@pytest.mark.parametrize(("rows", "said"), [(0, "empty column"), (1, "one time stamp only")])
def test_a_log_of_one_row_is_not_called_empty(tmp_path: Path, rows: int, said: str) -> None:
    made = {name: values[:3].copy() for name, values in columns().items()}
    made["time_s"][rows:] = np.nan
    assert said in refusal(write(tmp_path / "a.csv", made))
