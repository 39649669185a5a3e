"""Clouds with the trajectory that they were made with: range and bearing of every point.

The world makes ranges itself, sums them up to points as cloud software does, and projects these by
Snyder's formulas (USGS Professional Paper 1395, eqs. 8-9 to 8-13, 3-21), which share nothing with
the series that the product inverts.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from syncline_design.logs.inspection import inspect_logs
from syncline_design.logs.log import Log
from syncline_design.logs.log_files import row_sources
from syncline_design.logs.reading import read_log
from syncline_design.logs.utm import utm_to_geodetic, zone_of
from syncline_design.spec.load import BadInput
from syncline_design.spec.log_block import LogChoice
from tests.flat_flight_logs import gps_week, write_sbet
from tests.flight_logs import E2, ORIGIN, TO_ENU, A, Flight, flight, geodetic

laspy = pytest.importorskip("laspy")

TARGETS = np.array([[20.0, -15.0, 2.0], [-25.0, 10.0, -1.0], [5.0, 40.0, 0.5]])
SCANNER = np.array([0.4, -0.2, 0.3])
TILT_M = (
    1.5e-3  # 90 m of range where the flight's axes and the local level, 80 m on, are 13 urad apart
)
ARMS = {"uav.ranging": tuple(SCANNER.tolist())}


def projected(lat_lon_deg: np.ndarray, zone: int) -> np.ndarray:
    """Eastings and northings of places north of the equator."""
    lat, lon = np.radians(lat_lon_deg).T
    prime = E2 / (1 - E2)
    n = A / np.sqrt(1 - E2 * np.sin(lat) ** 2)
    t, c = np.tan(lat) ** 2, prime * np.cos(lat) ** 2
    a = (lon - np.radians(6 * zone - 183)) * np.cos(lat)
    m = np.array([arc(float(one)) for one in lat])
    east = a + (1 - t + c) * a**3 / 6 + (5 - 18 * t + t**2 + 72 * c - 58 * prime) * a**5 / 120
    north = a**2 / 2 + (5 - t + 9 * c + 4 * c**2) * a**4 / 24
    north += (61 - 58 * t + t**2 + 600 * c - 330 * prime) * a**6 / 720
    return np.stack([0.9996 * n * east + 5e5, 0.9996 * (m + n * np.tan(lat) * north)], axis=1)


def arc(lat: float) -> float:
    """Length of the meridian from the equator [m]."""
    return float(A * (1 - E2) * quad(lambda u: (1 - E2 * np.sin(u) ** 2) ** -1.5, 0.0, lat,
                                     epsabs=1e-12, epsrel=1e-12)[0])  # fmt: skip


@pytest.mark.parametrize(("latitude", "longitude"), [(47.3, 8.55), (0.4, -176.2), (71.0, 25.0)])
def test_grid_to_globe(latitude: float, longitude: float) -> None:
    zone = zone_of(np.radians(longitude))
    middle = 6.0 * zone - 183.0
    places = np.array([[latitude, longitude], [latitude, middle], [latitude, middle - 1.5]])
    grid = projected(places, zone)
    found = np.degrees(utm_to_geodetic(grid[:, 0], grid[:, 1], zone, south=False))
    away = (found - places) * 111_000.0 * np.array([1.0, np.cos(np.radians(latitude))])
    assert np.max(np.abs(away)) < 2e-4
    mirrored = utm_to_geodetic(grid[:, 0], 1e7 - grid[:, 1], zone, south=True)
    assert np.allclose(np.degrees(mirrored), found * [-1.0, 1.0], atol=1e-12)


def scanned(folder: Path, late_s: float = 0.0) -> tuple[list[Path], np.ndarray, np.ndarray]:
    """A trajectory, the cloud of its returns and a survey; the ranges and what they belong to."""
    shown = flight(40.0, 50.0, late_s)  # what the trajectory says
    real = flight(40.0, 50.0)
    every = np.arange(3, len(real), 5)
    which = np.arange(every.size) % len(TARGETS)
    own = real.turn[every].inv().apply(TARGETS[which] - real.place[every]) - SCANNER
    points = shown.place[every] + shown.turn[every].apply(SCANNER + own)
    trajectory = write_sbet(folder / "sbet.out", shown)
    cloud = write_cloud(folder / "points.las", shown, every, points)
    globe = geodetic(TARGETS)
    rows = ["target_id,target_latitude_deg,target_longitude_deg,target_height_m"]
    rows += [f"T{k},{a:.10f},{b:.10f},{h:.4f}" for k, (a, b, h) in enumerate(globe)]
    survey = folder / "survey.csv"
    survey.write_text("\n".join(rows) + "\n", "utf-8")
    return [trajectory, cloud, survey], own, which


def write_cloud(
    path: Path, made: Flight, every: np.ndarray, points: np.ndarray, local: bool = False
) -> Path:
    """In UTM to a tenth of a millimetre, in no order of time; or east, north, up."""
    globe = geodetic(points)
    grid = np.column_stack([projected(globe[:, :2], 32), globe[:, 2]])
    grid = TO_ENU.apply(points) if local else grid
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [1e-4] * 3, np.floor(grid.mean(axis=0))
    las = laspy.LasData(header)
    mixed = np.random.default_rng(4).permutation(every.size)
    las.x, las.y, las.z = grid[mixed].T
    las.gps_time = np.array([gps_week(int(ns))[1] / 1e9 for ns in made.stamp_ns[every][mixed]])
    las.write(path)
    return path


def read(files: list[Path], choice: LogChoice | None = None) -> Log:
    return read_log(row_sources(files, choice or LogChoice(), ["uav"], poses=False, arms=ARMS),
                    ["uav"])  # fmt: skip


def bearings(log: Log) -> np.ndarray:
    stage = log.stages[0]
    assert stage.range_m is not None
    assert stage.azimuth_rad is not None
    assert stage.elevation_rad is not None
    flat = np.cos(stage.elevation_rad)
    n = np.stack([np.cos(stage.azimuth_rad) * flat, np.sin(stage.azimuth_rad) * flat,
                  -np.sin(stage.elevation_rad)], axis=1)  # fmt: skip
    return stage.range_m[:, None] * n


@pytest.mark.parametrize("late_s", [0.0, 0.08])
def test_points_give_back_what_the_scanner_measured(tmp_path: Path, late_s: float) -> None:
    files, own, which = scanned(tmp_path, late_s)
    log = read(files)
    assert log.kind == "georeference"
    assert len(log.time_s) == len(which)
    assert np.max(np.abs(bearings(log) - own)) < TILT_M
    apart = np.linalg.norm(np.diff(log.truth_m[:3], axis=0), axis=1)
    assert np.allclose(apart, np.linalg.norm(np.diff(TARGETS, axis=0), axis=1), atol=1e-3)
    assert any("UTM zone 32N, which the file does not tell" in note for note in log.notes)


def test_points_about_an_origin_that_the_spec_states(tmp_path: Path) -> None:
    files, own, _ = scanned(tmp_path)
    made = flight(40.0, 50.0)
    every = np.arange(3, len(made), 5)
    which = np.arange(every.size) % len(TARGETS)
    write_cloud(files[1], made, every, TARGETS[which], local=True)
    lat, lon, height = ORIGIN
    origin = (float(np.radians(lat)), float(np.radians(lon)), height)
    log = read(files, LogChoice.model_construct(**{**dict(LogChoice()), "origin": origin}))
    assert np.max(np.abs(bearings(log) - own)) < TILT_M


def test_what_a_cloud_lacks_is_said(tmp_path: Path) -> None:
    files, _, _ = scanned(tmp_path)
    with pytest.raises(BadInput, match="nothing to hold the positions against"):
        read(files[:2])
    made = flight(40.0, 50.0)
    every = np.arange(3, len(made), 5)
    ground = np.random.default_rng(5).uniform([-60, -60, -1], [60, 60, 1], (every.size, 3))
    write_cloud(files[1], made, every, ground)
    with pytest.raises(BadInput, match="do not gather"):
        read(files)
    write_cloud(files[1], made, every, ground + np.array([9e5, 0.0, 0.0]))
    with pytest.raises(BadInput, match="elsewhere"):
        read(files)


def test_inspection_proposes_the_points_as_ranges(tmp_path: Path) -> None:
    files, _, _ = scanned(tmp_path)
    found = inspect_logs(files).proposal
    assert found.kind == "georeference"
    parts = {part.role: part.stream for part in found.parts}
    assert parts["ranging"] == "points"
    assert parts["position"] == parts["attitude"] == "sbet"
    streams = {"streams": {"ranging": "points", "position": "sbet", "attitude": "sbet"}}
    assert read(files, LogChoice.model_validate(streams)).kind == "georeference"


def test_points_beside_a_table_of_places_want_their_own_trajectory(tmp_path: Path) -> None:
    """A table may be of another vehicle: named as ranges, points are refused in words."""
    files, _, _ = scanned(tmp_path)
    table = tmp_path / "places.csv"
    names = [f"position_{a}_m" for a in ("north", "east", "down")]
    names += ["roll_deg", "pitch_deg", "yaw_deg"]
    names += [f"reference_{a}_m" for a in ("north", "east", "down")]
    rows = [",".join(["time_s", *names])]
    rows += [f"{at},0,0,{-at},0,0,0,0,0,0" for at in range(30)]
    table.write_text("\n".join(rows) + "\n", "utf-8")
    choice = LogChoice.model_validate({"streams": {"ranging": "points"}})
    with pytest.raises(BadInput, match="no recording beside it its trajectory"):
        read([files[1], files[2], table], choice)
