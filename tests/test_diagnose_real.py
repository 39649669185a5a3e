"""Measured logs from others: where their own documentation says what the diagnosis should find.

The data are not part of this repository.  They are looked for in the folder that SYNCLINE_DATA
names, or in ../shared/data beside the checkout.
"""

from __future__ import annotations

import csv
import os
from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis import Diagnosis, diagnose

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("SYNCLINE_DATA", ROOT.parent / "shared" / "data"))
VEHICLE, CAMERA = DATA / "i2nav_whu_ds2", DATA / "terra_gopro_delay"
LEVER_ARM_M = (-0.37, 0.008, 0.353)  # documented
DELAY_S = 0.88  # documented; fitted by its authors to the same photos
LEAP_SECONDS = 18.0
FIXED_SIGMA_M = 0.03  # epochs with a smaller north standard deviation have fixed ambiguities

pytestmark = pytest.mark.shared_data
vehicle = pytest.mark.skipif(not VEHICLE.is_dir(), reason=f"no measured data in {VEHICLE}")
camera = pytest.mark.skipif(not CAMERA.is_dir(), reason=f"no measured data in {CAMERA}")

SPEC = """syncline: 1
name: measured
requirements: [{{id: ACC-1, kind: accuracy, limit: 1 m}}]
stages:
  - name: vehicle
    platform: {{v_max: 2 m/s, omega_max: 40 deg/s, distance: 10 m, baseline: 0.5 m}}
    position:
      sensor: {{modality: position, type: gnss, sigma_position: {sigma}, primitives: [pps]}}
      primitive: pps
      timestamping: {{error: {{distribution: uniform, low: -1 us, high: 1 us}}}}
      lever_arm: {lever}
"""


def rows_of(path: Path) -> dict[str, np.ndarray]:
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def write(path: Path, columns: dict[str, np.ndarray]) -> Path:
    names = list(columns)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(zip(*(columns[n].tolist() for n in names), strict=True))
    return path


def vehicle_log(folder: Path, only_fixed: bool) -> list[Path]:
    """Two files as canonical columns: GNSS at 1 Hz, the reference trajectory at 10 Hz."""
    gnss, truth = rows_of(VEHICLE / "gnss_posvel_1hz.csv"), rows_of(VEHICLE / "truth_imu_10hz.csv")
    keep = gnss["sn_m"] < (FIXED_SIGMA_M if only_fixed else np.inf)
    fixes = {
        "time_s": gnss["sow_s"][keep],
        "latitude_deg": gnss["lat_deg"][keep],
        "longitude_deg": gnss["lon_deg"][keep],
        "height_m": gnss["h_m"][keep],
    }
    reference = {
        "time_s": truth["sow_s"],
        "reference_latitude_deg": truth["lat_deg"],
        "reference_longitude_deg": truth["lon_deg"],
        "reference_height_m": truth["h_m"],
        "velocity_north_mps": truth["vn_mps"],
        "velocity_east_mps": truth["ve_mps"],
        "velocity_down_mps": truth["vd_mps"],
        **{f"{axis}_deg": truth[f"{axis}_deg"] for axis in ("roll", "pitch", "yaw")},
    }
    return [write(folder / "gnss.csv", fixes), write(folder / "reference.csv", reference)]


def spec_file(folder: Path, sigma: str, lever: str) -> Path:
    path = folder / "spec.yaml"
    path.write_text(SPEC.format(sigma=sigma, lever=lever), encoding="utf-8")
    return path


def names(found: Diagnosis) -> list[tuple[str, str]]:
    return [(f.effect, f.sensor) for f in found.findings]


@vehicle
def test_the_vehicles_lever_arm_is_found(tmp_path: Path) -> None:
    """Fixed epochs, the spec's lever arm zero: named, and within 2 cm of the documented one."""
    spec = spec_file(tmp_path, "[0.012 m, 0.013 m, 0.055 m]", "[0 m, 0 m, 0 m]")
    found = diagnose(spec, vehicle_log(tmp_path, only_fixed=True))
    assert ("lever_arm", "position") in names(found)
    lever = next(f for f in found.findings if f.effect == "lever_arm")
    values = [float(lever.parameters[f"{axis}_m"].value) for axis in "xyz"]
    assert values == pytest.approx(LEVER_ARM_M, abs=0.02)
    assert found.gap.held_out is not None
    assert found.gap.held_out.after.rms_m < 0.2 * found.gap.held_out.before.rms_m


@vehicle
def test_float_epochs_scatter_more_than_they_claim(tmp_path: Path) -> None:
    """All epochs, the documented lever arm in the spec: the noise is understated."""
    lever = ", ".join(f"{value} m" for value in LEVER_ARM_M)
    spec = spec_file(tmp_path, "[0.012 m, 0.013 m, 0.055 m]", f"[{lever}]")
    found = diagnose(spec, vehicle_log(tmp_path, only_fixed=False))
    stochastic = {"noise_understated", "heavy_tails", "correlated_noise"}
    assert stochastic & {name for name, _ in names(found)}


def camera_log(folder: Path, seconds_off: float) -> list[Path]:
    """Photos as the reference (north only), the track as positions; level, facing north."""
    photos, track = rows_of(CAMERA / "images.csv"), rows_of(CAMERA / "gnss_track_5hz.csv")
    mark = 4144505.760  # north of the mark [m], mean of its four measurements
    zero = np.zeros_like(photos["exif_utc_sod_s"])
    reference = {
        "time_s": photos["exif_utc_sod_s"],
        "reference_north_m": photos["measured_north_of_mark_m"],
        "roll_deg": zero,
        "pitch_deg": zero,
        "yaw_deg": zero,
        "rate_x_degps": zero,
        "rate_y_degps": zero,
        "rate_z_degps": zero,
    }
    positions = {
        "time_s": track["gpst_sod_s"] - LEAP_SECONDS + seconds_off,
        "position_north_m": track["utm34_n_m"] - mark,
        "position_east_m": track["utm34_e_m"] - 688828.27,
        "position_down_m": -track["h_m"],
    }
    return [write(folder / "photos.csv", reference), write(folder / "track.csv", positions)]


@camera
def test_the_cameras_delay_is_found(tmp_path: Path) -> None:
    """15 photos, north only: positions seem old by what the camera's clock is behind."""
    spec = spec_file(tmp_path, "[0.02 m, 0.02 m, 0.03 m]", "[-0.07 m, 0 m, 0 m]")
    found = diagnose(spec, camera_log(tmp_path, 0.0))
    assert names(found)[:1] == [("latency", "position")]
    latency = found.findings[0].parameters["latency_s"]
    assert latency.value == pytest.approx(DELAY_S, abs=0.1)


@camera
def test_forgotten_leap_seconds_are_found(tmp_path: Path) -> None:
    """Stamps in GPS time taken for UTC: a whole-second slip beside the delay."""
    spec = spec_file(tmp_path, "[0.02 m, 0.02 m, 0.03 m]", "[-0.07 m, 0 m, 0 m]")
    found = diagnose(spec, camera_log(tmp_path, LEAP_SECONDS))
    assert ("integer_second_slip", "position") in names(found)
    slip = next(f for f in found.findings if f.effect == "integer_second_slip")
    rest = sum(
        float(f.parameters["latency_s"].value) for f in found.findings if f.effect == "latency"
    )
    assert float(slip.parameters["seconds"].value) + rest == pytest.approx(
        LEAP_SECONDS + DELAY_S, abs=0.1
    )
