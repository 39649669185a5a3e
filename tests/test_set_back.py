"""A file of poses whose stamps are off by whole seconds: of all that it holds, or of its places.

The state at the reference's stamps is known exactly, so what a re-read log should hold is too.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis import DiagnosisSettings
from syncline_design.diagnosis.run import diagnose_measured
from syncline_design.diagnosis.system import Measured, measured
from syncline_design.effects.kinematics import euler_to_rotation
from syncline_design.spec.load import load
from tests.flat_flight_logs import write_tum
from tests.flight_logs import flight

NOISE_M, SLIP_S = 0.05, 3.0
SPEC = """syncline: 1
name: pose pair
requirements: [{id: ACC-1, kind: accuracy, limit: 1 m}]
stages:
  - name: uav
    platform: {v_max: 20 m/s, omega_max: 40 deg/s, distance: 1 m, baseline: 5 m}
    position:
      sensor: {modality: position, type: gnss, sigma_position: 0.05 m, primitives: [pps]}
      primitive: pps
      timestamping: {error: {distribution: uniform, low: -10 ns, high: 10 ns}}
    attitude:
      sensor: {modality: attitude, type: ins, sigma_attitude: 0.1 deg, primitives: [pps]}
      primitive: pps
      timestamping: {error: {distribution: uniform, low: -10 ns, high: 10 ns}}
log: {frame: enu, body: flu}
"""


def pair(folder: Path, places_s: float, attitudes_s: float) -> Measured:
    """Poses of which places and attitudes are so much older than their stamps."""
    (folder / "s.yaml").write_text(SPEC, encoding="utf-8")
    old, tested = flight(60.0, late_s=attitudes_s), flight(60.0, late_s=places_s, noise_m=NOISE_M)
    tested = replace(tested, turn=old.turn)
    files = [write_tum(folder / "t.txt", tested), write_tum(folder / "r.txt", flight(60.0))]
    return measured(load(folder / "s.yaml"), files)


def off(inputs: Measured) -> tuple[float, float]:
    """How far places [m] and attitudes [rad] of the re-read log are off, at the median."""
    assert inputs.reread is not None
    log = inputs.reread(SLIP_S)
    (held,) = log.stages
    assert held.antenna_m is not None
    true = flight(60.0)
    near = np.argmin(np.abs(log.time_s[:, None] - (true.stamp_ns * 1e-9 % 86400.0)), axis=1)
    angle = np.einsum("nij,nij->n", euler_to_rotation(held.euler_rad), true.turn.as_matrix()[near])
    place = np.linalg.norm(held.antenna_m - true.place[near], axis=1)
    return float(np.median(place)), float(np.median(np.arccos(np.clip((angle - 1) / 2, -1, 1))))


@pytest.mark.parametrize("attitudes_s", [0.0, SLIP_S])
def test_what_is_not_off_stays_where_it_is(tmp_path: Path, attitudes_s: float) -> None:
    place_m, attitude_rad = off(pair(tmp_path, SLIP_S, attitudes_s))
    assert place_m < 3 * NOISE_M
    assert attitude_rad < 0.003


@pytest.mark.parametrize("attitudes_s", [0.0, SLIP_S])
def test_a_slip_of_a_file_of_poses_is_one_finding(tmp_path: Path, attitudes_s: float) -> None:
    done = diagnose_measured(pair(tmp_path, SLIP_S, attitudes_s), DiagnosisSettings(seed=1))
    assert [(one.effect, one.sensor) for one in done.findings] == [
        ("integer_second_slip", "position")
    ]
