"""Logs of scanners: several targets at one stamp, seen from one pose.

The world is built here: a vehicle on a slalom reads its position late; every stamp has one
position and one attitude, which all its rows repeat, and a range and bearing to each target.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncline_design.diagnosis import diagnose
from syncline_design.logs.reading import read_log
from syncline_design.logs.row_choice import Arranged, arranged, thinned
from syncline_design.logs.tables import read_tables

Columns = dict[str, np.ndarray]
LATENCY_S, SIGMA_M, RANGE_M = 0.06, 0.02, 0.005

SPEC = f"""syncline: 1
name: scanner
requirements: [{{id: ACC-1, kind: accuracy, limit: 5 m}}]
stages:
  - name: car
    platform: {{v_max: 9 m/s, omega_max: 40 deg/s, distance: 250 m, baseline: 0.5 m}}
    position:
      sensor: {{modality: position, type: gnss, sigma_position: {SIGMA_M} m, primitives: [pps]}}
      primitive: pps
      timestamping: {{error: {{distribution: uniform, low: -10 ns, high: 10 ns}}}}
    attitude:
      sensor: {{modality: attitude, type: ins, sigma_attitude: 0.003 deg, primitives: [pps]}}
      primitive: pps
      timestamping: {{error: {{distribution: uniform, low: -10 ns, high: 10 ns}}}}
    ranging:
      sensor: {{modality: ranging, type: lidar, sigma_range: {RANGE_M} m, sigma_bearing: 0.003 deg,
        primitives: [pps]}}
      primitive: pps
      timestamping: {{error: {{distribution: uniform, low: -10 ns, high: 10 ns}}}}
"""


def slalom(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Place, velocity (n, 2), yaw and yaw rate: speed and course both vary."""
    yaw, rate = 0.9 * np.sin(0.35 * t), 0.9 * 0.35 * np.cos(0.35 * t)
    speed = 5.0 + 3.0 * np.sin(0.8 * t)
    fine = np.arange(-1.0, t[-1] + 1.0, 1e-3)
    v = (5.0 + 3.0 * np.sin(0.8 * fine))[:, None] * _along(0.9 * np.sin(0.35 * fine))
    path = np.concatenate([np.zeros((1, 2)), np.cumsum(0.5e-3 * (v[1:] + v[:-1]), axis=0)])
    place = np.stack([np.interp(t, fine, path[:, k]) for k in range(2)], axis=1)
    return place, speed[:, None] * _along(yaw), yaw, rate


def _along(yaw: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(yaw), np.sin(yaw)], axis=1)


def scans(stamps: int, targets: int, seed: int, latency_s: float) -> Columns:
    rng = np.random.default_rng(seed)
    t = np.arange(stamps) * 0.1
    place, velocity, yaw, rate = slalom(t)
    late, _, _, _ = slalom(t - latency_s)
    read = late + SIGMA_M * rng.standard_normal((stamps, 2))
    down = SIGMA_M * rng.standard_normal(stamps)
    mounted = np.radians(0.003) * rng.standard_normal((stamps, 3))
    marks = np.round(rng.uniform([0, -60, -5], [300, 60, 5], (targets, 3)), 2)
    each = np.repeat(np.arange(stamps), targets)
    mark = np.tile(marks, (stamps, 1))
    delta = mark - np.concatenate([place, np.zeros((stamps, 1))], axis=1)[each]
    c, s = np.cos(yaw[each]), np.sin(yaw[each])
    body = np.stack([c * delta[:, 0] + s * delta[:, 1], c * delta[:, 1] - s * delta[:, 0],
                     delta[:, 2]], axis=1)  # fmt: skip
    distance = np.linalg.norm(body, axis=1)
    shaken = rng.standard_normal((3, stamps * targets))
    angles = np.stack([np.arctan2(body[:, 1], body[:, 0]), -np.arcsin(body[:, 2] / distance)])
    angles += np.radians(0.003) * shaken[1:]
    zero = np.zeros(stamps * targets)
    return {
        "time_s": t[each],
        "position_north_m": read[each, 0],
        "position_east_m": read[each, 1],
        "position_down_m": down[each],
        "roll_deg": np.degrees(mounted[each, 0]),
        "pitch_deg": np.degrees(mounted[each, 1]),
        "yaw_deg": np.degrees(yaw + mounted[:, 2])[each],
        "velocity_north_mps": velocity[each, 0],
        "velocity_east_mps": velocity[each, 1],
        "velocity_down_mps": zero,
        "rate_x_degps": zero,
        "rate_y_degps": zero,
        "rate_z_degps": np.degrees(rate)[each],
        "range_m": distance + RANGE_M * shaken[0],
        "azimuth_deg": np.degrees(angles[0]),
        "elevation_deg": np.degrees(angles[1]),
        **{f"target_{a}_m": mark[:, k] for k, a in enumerate(("north", "east", "down"))},
        "target_id": np.tile(np.arange(targets), stamps),
    }


def write(path: Path, made: Columns) -> Path:
    rows = np.stack(list(made.values()), axis=1)
    np.savetxt(path, rows, fmt="%.9g", delimiter=",", header=",".join(made), comments="")
    return path


def latency(folder: Path, made: Columns) -> tuple[dict[str, Any], dict[str, float]]:
    (folder / "spec.yaml").write_text(SPEC, encoding="utf-8")
    found = diagnose(folder / "spec.yaml", [write(folder / "log.csv", made)]).to_json()
    named = [f for f in found["findings"] if f["effect"] == "latency"]
    assert [f["sensor"] for f in named] == ["position"], found["findings"]
    return found, named[0]["parameters"]["latency_s"]


@pytest.mark.parametrize("targets", [1, 6])
def test_more_targets_a_stamp_tell_no_more_of_the_vehicle(tmp_path: Path, targets: int) -> None:
    """Position noise is all that limits the latency, and there is one reading of it a stamp.

    Cramer-Rao: sigma / sqrt(sum of speed^2) over the stamps, whatever the number of targets.
    Taking six targets for six readings would claim a sigma smaller by sqrt(6).
    """
    stamps = 160
    found, value = latency(tmp_path, scans(stamps, targets, 11, LATENCY_S))
    assert found["log"]["used"] == found["log"]["rows"] == stamps * targets
    speed = np.linalg.norm(slalom(np.arange(stamps) * 0.1)[1], axis=1)
    bound = SIGMA_M / np.sqrt(np.sum(speed**2))
    assert 0.8 * bound < value["standard_uncertainty"] < 2.0 * bound
    assert value["value"] == pytest.approx(LATENCY_S, abs=4.0 * value["standard_uncertainty"])


def test_clean_scans_agree(tmp_path: Path) -> None:
    """One log at a false-alarm rate of 5 %, its seed fixed."""
    (tmp_path / "spec.yaml").write_text(SPEC, encoding="utf-8")
    log = write(tmp_path / "log.csv", scans(120, 5, 12, 0.0))
    assert diagnose(tmp_path / "spec.yaml", [log]).verdict == "agrees"


def windows_of(files: list[np.ndarray], most: int) -> list[Arranged]:
    return thinned([arranged(Path(f"{k}.csv"), stamps) for k, stamps in enumerate(files)], most)


def test_a_long_log_keeps_windows_with_whole_stamps() -> None:
    stamps = np.repeat(np.arange(40_000) * 0.01, 5)
    (kept,) = windows_of([stamps], 20_000)
    assert 18_000 < kept.stamps.shape[0] < 25_000
    assert kept.thinned + kept.stamps.shape[0] == kept.rows == 200_000
    assert np.array_equal(stamps[kept.order], kept.stamps)
    _, count = np.unique(kept.stamps, return_counts=True)
    assert np.all(count == 5)
    first_quarter = np.mean(kept.stamps < 100.0)
    assert first_quarter == pytest.approx(0.25, abs=0.03)


def test_files_of_one_log_keep_the_same_windows() -> None:
    """A fast file is cut, the slow one's stamps in its windows stay covered on both sides."""
    fast, slow = np.arange(0.0, 2000.0, 0.01), np.arange(100.0, 1500.0, 0.5)
    kept_fast, kept_slow = windows_of([fast, slow], 20_000)
    assert kept_fast.stamps.min() >= 100.0 - 1e-9
    assert kept_fast.stamps.max() <= 1500.0
    inside = (slow[:, None] >= kept_fast.stamps[None, ::50]).any(axis=1)
    assert inside.any()
    near = np.abs(kept_slow.stamps[:, None] - kept_fast.stamps[None, ::10]).min(axis=1)
    assert near.max() < 2.5


def test_the_kept_rows_are_the_file_s(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    made = scans(400, 3, 13, 0.0)
    path = write(tmp_path / "log.csv", made)
    monkeypatch.setattr("syncline_design.logs.tables.thinned", lambda f: thinned(f, 240))
    (table,) = read_tables([path], {}, ("car",))
    assert table.rows == 1200
    assert len(table) + table.thinned == 1200
    assert len(table) < 400
    at = {
        (round(10 * t), k): r
        for t, k, r in zip(made["time_s"], made["target_id"], made["range_m"], strict=True)
    }
    rows = zip(
        table.columns["time_s"], table.columns["target_id"], table.columns["range_m"], strict=True
    )
    assert all(at[round(10 * t), k] == pytest.approx(r, rel=1e-7) for t, k, r in rows)
    log = read_log([path], ["car"], {})
    assert log.rows_read == len(log) + log.thinned + sum(log.rejected.values())
