"""A filter of seconds is one cause, not a slip of the clock, nor arms that cancel each other.

The logs are made here from closed forms: on a circle travelled for ever at w, T dy/dt + y = x is
y = x / (1 + i w T); on a wave it is (sin W t - W T cos W t) / (1 + W^2 T^2).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis import Diagnosis, diagnose
from syncline_design.diagnosis.scene import acting, scene
from syncline_design.diagnosis.system import measured
from syncline_design.spec.load import load

Array = NDArray[np.float64]
AXES = ("north", "east", "down")
POSITION_M, RANGE_M, ANGLE_DEG, SPEED_MPS = 0.012, 0.02, 0.03, 0.01
ARM_M = 0.4  # of the antenna, forward
SPEC = f"""syncline: 1
name: boat
requirements: [{{id: ACC-1, kind: accuracy, limit: 1 m}}]
stages:
  - name: boat
    platform: {{v_max: 10 m/s, omega_max: 60 deg/s, distance: 20 m, baseline: {ARM_M} m}}
    position:
      sensor: {{modality: position, type: gnss, sigma_position: {POSITION_M} m, primitives: [pps]}}
      primitive: pps
      timestamping: {{error: {{distribution: uniform, low: -10 ns, high: 10 ns}}}}
      lever_arm: [ARM m, 0 m, 0 m]
"""
SCANNER = f"""    attitude:
      sensor: {{modality: attitude, type: ins, sigma_attitude: {ANGLE_DEG} deg, primitives: [pps]}}
      primitive: pps
      timestamping: {{error: {{distribution: uniform, low: -10 ns, high: 10 ns}}}}
    ranging:
      sensor: {{modality: ranging, type: lidar, sigma_range: {RANGE_M} m,
               sigma_bearing: {ANGLE_DEG} deg, primitives: [pps]}}
      primitive: pps
      timestamping: {{error: {{distribution: uniform, low: -10 ns, high: 10 ns}}}}
"""
CIRCLING = SPEC.replace("ARM", f"{ARM_M}") + SCANNER


def written(folder: Path, spec: str, columns: dict[str, Array]) -> Diagnosis:
    (folder / "spec.yaml").write_text(spec)
    table = np.stack(list(columns.values()), axis=1)
    np.savetxt(folder / "log.csv", table, "%.7f", ",", header=",".join(columns), comments="")
    return diagnose(folder / "spec.yaml", [folder / "log.csv"])


def vectors(name: str, values: Array, unit: str) -> dict[str, Array]:
    return {f"{name}_{axis}_{unit}": values[:, k] for k, axis in enumerate(AXES)}


def circling(seed: int, lag_s: float, turn: float, noise: float = 1.0) -> dict[str, Array]:
    """A level vehicle on a steady circle at 5 m/s sees targets below; its position is smoothed."""
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(800)

    def drawn(size: int | tuple[int, int]) -> Array:
        return noise * rng.standard_normal(size)

    yaw, level = turn * t, 0.0 * t
    place = 5.0 / turn * np.exp(1j * (yaw - np.pi / 2))  # north + i east
    antenna = (place + ARM_M * np.exp(1j * yaw)) / (1.0 + 1j * turn * lag_s)
    position = np.stack([antenna.real, antenna.imag, level - 10.0], axis=1)
    velocity = np.stack([5.0 * np.cos(yaw), 5.0 * np.sin(yaw), level], axis=1)
    bearing, across = rng.uniform(-np.pi, np.pi, t.size), rng.uniform(2.0, 14.0, t.size)
    target = place + across * np.exp(1j * (yaw + bearing))
    distance = np.hypot(across, 10.0)
    noise_deg = ANGLE_DEG * drawn((t.size, 5))
    return {
        "time_s": t,
        **vectors("position", position + POSITION_M * drawn((t.size, 3)), "m"),
        **vectors("velocity", velocity + SPEED_MPS * drawn((t.size, 3)), "mps"),
        "roll_deg": noise_deg[:, 0], "pitch_deg": noise_deg[:, 1],
        "yaw_deg": np.degrees(yaw) + noise_deg[:, 2],
        "rate_x_degps": level, "rate_y_degps": level, "rate_z_degps": np.degrees(turn) + level,
        "range_m": distance + RANGE_M * drawn(t.size),
        "azimuth_deg": np.degrees(bearing) + noise_deg[:, 3],
        "elevation_deg": -np.degrees(np.arctan2(10.0, across)) + noise_deg[:, 4],
        **vectors("target", np.stack([target.real, target.imag, level], axis=1), "m"),
    }  # fmt: skip


def lag_of(found: Diagnosis) -> tuple[float, float]:
    """The interval of the only finding, a filter's time constant."""
    (only,) = found.findings
    assert only.effect == "filter_lag"
    return only.parameters["time_constant_s"].interval95 or (np.nan, np.nan)


def test_a_smoothed_circle_is_no_pair_of_arms(tmp_path: Path) -> None:
    """A constant in the body: arms of many baselines fit it too, and a little better, as the noise
    of the velocities is no part of them."""
    lag_s = 1.5
    found = written(tmp_path, CIRCLING, circling(seed=1, lag_s=lag_s, turn=0.6))
    low, high = lag_of(found)
    assert low - 0.001 < lag_s < high + 0.001
    assert high - low < 0.01 * lag_s
    assert found.verdict == "explained"


def test_a_filter_of_seconds_is_no_slip_of_seconds(tmp_path: Path) -> None:
    """The log has no velocities, so they come from the places that the filter has not touched."""
    rng, lag_s = np.random.default_rng(3), 3.0
    t = 0.2 * np.arange(700)
    waves = ((0.31, 18.0, 0), (0.11, 30.0, 0), (0.23, 21.0, 1), (0.47, 6.0, 1), (0.6, 0.5, 2))
    place, smoothed = np.zeros((t.size, 3)), np.zeros((t.size, 3))
    for w, size, axis in waves:
        place[:, axis] += size * np.sin(w * t)
        slow = np.sin(w * t) - w * lag_s * np.cos(w * t)
        smoothed[:, axis] += size * slow / (1.0 + (w * lag_s) ** 2)
    columns = {
        "time_s": t,
        **vectors("position", smoothed + POSITION_M * rng.standard_normal((t.size, 3)), "m"),
        **vectors("reference", place, "m"),
        "roll_deg": 0 * t, "pitch_deg": 0 * t, "yaw_deg": 30.0 + 0 * t,
    }  # fmt: skip
    found = written(tmp_path, SPEC.replace("ARM", "0"), columns)
    low, high = lag_of(found)
    assert low <= lag_s <= high
    assert high - low < 0.01 * lag_s
    assert found.verdict == "explained"


def test_the_slope_of_smoothed_places_tells_the_lag_with_the_arm(tmp_path: Path) -> None:
    """Without velocity columns y - x = -T dy/dt, of the antenna: its arm must not count again."""
    lag_s = 2.0
    columns = circling(seed=1, lag_s=lag_s, turn=0.5, noise=0.0)
    moved = {name: values for name, values in columns.items() if not name.startswith("velocity")}
    (tmp_path / "spec.yaml").write_text(CIRCLING)
    table = np.stack(list(moved.values()), axis=1)
    np.savetxt(tmp_path / "log.csv", table, "%.7f", ",", header=",".join(moved), comments="")
    inputs = measured(load(tmp_path / "spec.yaml"), [tmp_path / "log.csv"])
    view = scene(inputs.system, inputs.log)
    assert view.log.stages[0].follows_position
    smoothed = (acting("filter_lag", "position", 0, {"time_constant_s": lag_s}),)
    left = np.linalg.norm(view.error(smoothed), axis=1)[10:-10]
    was = np.linalg.norm(view.error(), axis=1)
    assert np.min(was) > 6.0
    # less than the parabola over a second that the rest of the motion is derived by would leave
    assert np.max(left) < 0.2 * (0.5 * 0.5) ** 2 / 10.0 * np.max(was)
