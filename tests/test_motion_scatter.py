"""Jitter of stamps is named where the scatter grows with the motion, and nowhere else.

The logs are made here: a boat on waves whose places are read with noise, every reading at a moment
of its own where there is jitter.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from syncline_design.diagnosis import Diagnosis, diagnose

Array = NDArray[np.float64]
ROWS, STEP_S = 1000, 0.1
SIGMA_M = np.array([0.012, 0.012, 0.02])
AXES = ("north", "east", "down")

SPEC = """syncline: 1
name: boat
requirements: [{id: ACC-1, kind: accuracy, limit: 1 m}]
stages:
  - name: boat
    platform: {v_max: 6 m/s, omega_max: 90 deg/s, distance: 10 m, baseline: 1 m}
    position:
      sensor: {modality: position, type: gnss, sigma_position: [12 mm, 12 mm, 20 mm],
               primitives: [pps]}
      primitive: pps
      timestamping: {error: {distribution: uniform, low: -10 ns, high: 10 ns}}
      lever_arm: [0 m, 0 m, HEIGHT m]
"""


def path(time_s: Array) -> Array:
    """North, east, down [m]: wide turns, stops in between, waves."""
    t = time_s
    return np.stack(
        [
            22.0 * np.sin(0.09 * t) + 6.0 * np.sin(0.23 * t + 1.0),
            17.0 * np.cos(0.11 * t) + 5.0 * np.sin(0.31 * t),
            0.4 * np.sin(1.0 * t) + 0.2 * np.sin(1.43 * t + 0.5),
        ],
        axis=1,
    )


def diagnosed(
    folder: Path, seed: int, quiet: Array, jitter_s: float = 0.0, height_m: float = 0.0,
    flat: bool = False,
) -> Diagnosis:  # fmt: skip
    """A log whose noise is `quiet` times the spec's; flat: all along a slow plane."""
    rng = np.random.default_rng(seed)
    time_s = STEP_S * np.arange(ROWS)
    still = np.array([0.02, 0.02, 0.0]) if flat else np.ones(3)
    read = path(time_s - jitter_s * rng.standard_normal(ROWS)) * still
    read += quiet * SIGMA_M * rng.standard_normal((ROWS, 3))
    true = path(time_s) * still
    speed = (path(time_s + 1e-3) - path(time_s - 1e-3)) / 2e-3 * still
    yaw = np.degrees(np.arctan2(speed[:, 1], speed[:, 0]))
    columns = {"time_s": time_s, "roll_deg": 0 * yaw, "pitch_deg": 0 * yaw, "yaw_deg": yaw}
    for name, values, unit in (
        ("position", read, "m"), ("reference", true, "m"), ("velocity", speed, "mps"),
    ):  # fmt: skip
        columns |= {f"{name}_{axis}_{unit}": values[:, k] for k, axis in enumerate(AXES)}
    log, spec = folder / "log.csv", folder / "spec.yaml"
    np.savetxt(
        log, np.stack(list(columns.values()), axis=1), "%.6f", ",", header=",".join(columns),
        comments="",
    )  # fmt: skip
    spec.write_text(SPEC.replace("HEIGHT", str(height_m)))
    return diagnose(spec, [log])


@pytest.mark.parametrize("seed", [5, 6, 8])
def test_an_axis_quieter_than_the_spec_says_is_no_jitter(seed: int, tmp_path: Path) -> None:
    found = diagnosed(tmp_path, seed, np.array([1.0, 1.0, 0.1]))
    assert found.checks == ()
    assert found.verdict == "agrees"
    assert found.findings == ()


@pytest.mark.parametrize("seed", [6, 8])
def test_a_height_that_is_off_all_along_is_no_jitter(seed: int, tmp_path: Path) -> None:
    """A slow robot on a plane: the height error is the same in every row and beyond its noise."""
    found = diagnosed(tmp_path, seed, np.array([1.0, 1.0, 0.0]), height_m=-0.3, flat=True)
    assert len(found.findings) == 1
    named = found.findings[0]
    assert named.effect in ("lever_arm", "datum_offset")
    height = named.parameters["z_m" if named.effect == "lever_arm" else "down_m"]
    assert abs(float(height.value)) == pytest.approx(0.3, abs=1e-3)


def test_jitter_is_named_whatever_the_noise_of_each_axis(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, 5, np.array([1.0, 1.0, 0.3]), jitter_s=0.01)
    assert [one.effect for one in found.findings] == ["timestamp_jitter"]
    assert found.findings[0].parameters["std_s"].value == pytest.approx(0.01, rel=0.12)


def test_each_noise_has_the_size_of_its_own(tmp_path: Path) -> None:
    """Jitter of 10 ms at this path's speed, and white noise twice as large as the spec says."""
    found = diagnosed(tmp_path, 6, np.array([2.0, 2.0, 2.0]), jitter_s=0.01)
    size = {one.effect: one.size_m for one in found.findings}
    time_s = STEP_S * np.arange(ROWS)
    speed2 = np.sum(((path(time_s + 1e-3) - path(time_s - 1e-3)) / 2e-3) ** 2, axis=1)
    assert size["timestamp_jitter"] == pytest.approx(0.01 * np.sqrt(speed2.mean()), rel=0.15)
    beyond = np.sqrt((2.0**2 - 1.1**2) * np.sum(SIGMA_M**2))
    assert size["noise_understated"] == pytest.approx(beyond, rel=0.1)
