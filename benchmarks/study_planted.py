"""Effects planted in measured logs, by plain arithmetic on their columns.

A shift of stamps interpolates a column; an arm is turned by the logged attitude; a bias is added.
"""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

Columns = dict[str, NDArray[np.float64]]
Truth = dict[str, float]
Names = set[tuple[str, str]]
PLACE = ("position_north_m", "position_east_m", "position_down_m")


def _late(names: tuple[str, ...], late_s: float) -> Callable[[Columns], None]:
    def plant(log: Columns) -> None:
        time_s = log["time_s"]
        for name in (one for one in names if one in log):
            angle = name.endswith("_deg")
            values = np.degrees(np.unwrap(np.radians(log[name]))) if angle else log[name]
            first = np.unique(time_s, return_index=True)[1]
            spline = CubicSpline(time_s[first], values[first])  # straight lines would smooth
            log[name] = spline(np.maximum(time_s - late_s, time_s[0]))

    return plant


def _scaled(name: str, factor: float, added: float) -> Callable[[Columns], None]:
    def plant(log: Columns) -> None:
        log[name] = factor * log[name] + added

    return plant


def _arm(arm_m: tuple[float, float, float]) -> Callable[[Columns], None]:
    """The antenna is further out than the spec believes."""

    def plant(log: Columns) -> None:
        angles = np.array([log["yaw_deg"], log["pitch_deg"], log["roll_deg"]]).T
        out = Rotation.from_euler("ZYX", angles, degrees=True).apply(np.array(arm_m))
        for name, values in zip(PLACE, out.T, strict=True):
            log[name] = log[name] + values

    return plant


def _arm_of_reference(arm_m: tuple[float, float, float]) -> Callable[[Columns], None]:
    """The same where the reference point is in a file of its own, with the attitude."""

    def plant(log: Columns) -> None:
        if "yaw_deg" not in log:
            return
        angles = np.array([log["yaw_deg"], log["pitch_deg"], log["roll_deg"]]).T
        out = Rotation.from_euler("ZYX", angles, degrees=True).apply(np.array(arm_m))
        for axis, values in zip(("north", "east", "down"), out.T, strict=True):
            log[f"reference_{axis}_m"] = log[f"reference_{axis}_m"] - values

    return plant


def _arms(x_m: float, y_m: float) -> tuple[Names, Truth]:
    return {("lever_arm", "position"), ("lever_arm", "ranging")}, {"x_m": x_m, "y_m": y_m}


RANGING: Names = {("latency", "ranging")}
Planted = tuple[str, Callable[[Columns], None], Names, Truth]
PLANTED: dict[str, Planted] = {
    "woods_clean, range bias 6 cm": (
        "woods_clean", _scaled("range_m", 1.0, 0.06), {("range_bias", "ranging")},
        {"bias_m": 0.06}),
    "woods_clean, range scale 2 %": (
        "woods_clean", _scaled("range_m", 1.02, 0.0), {("range_scale", "ranging")},
        {"scale": 0.02}),
    "woods_clean, azimuth bias 2 deg": (
        "woods_clean", _scaled("azimuth_deg", 1.0, 2.0),
        {("azimuth_bias", "ranging"), ("boresight", "ranging"), ("heading_bias", "attitude"),
         ("mounting", "attitude")}, {"bias_rad": float(np.radians(2.0))}),
    "woods_clean, heading bias 3 deg": (
        "woods_clean", _scaled("yaw_deg", 1.0, 3.0),
        {("azimuth_bias", "ranging"), ("boresight", "ranging"), ("heading_bias", "attitude"),
         ("mounting", "attitude")}, {}),
    "woods_clean, position 150 ms late": (
        "woods_clean", _late(PLACE, 0.15), {("latency", "position")}, {"latency_s": 0.15}),
    "woods_clean, attitude 100 ms late": (
        "woods_clean", _late(("yaw_deg",), 0.1), {("latency", "attitude")}, {"latency_s": 0.1}),
    "woods_clean, arm 8 cm": ("woods_clean", _arm((0.08, -0.05, 0.0)), *_arms(0.08, -0.05)),
    "euroc_clean, position 20 ms late": (
        "euroc_clean", _late(PLACE, 0.02), {("latency", "position")}, {"latency_s": 0.02}),
    "euroc_clean, arm 3 cm": (
        "euroc_clean", _arm_of_reference((0.03, -0.02, 0.01)), {("lever_arm", "position")},
        {"x_m": 0.03, "y_m": -0.02, "z_m": 0.01}),
    "asl_natural, range bias 5 cm": (
        "asl_natural", _scaled("range_m", 1.0, 0.05), {("range_bias", "ranging")},
        {"bias_m": 0.05}),
    "asl_natural, arm 10 cm": (
        "asl_natural", _arm((0.1, 0.05, -0.05)), *_arms(0.1, 0.05)),
}  # fmt: skip


def planted(measured: Path, name: str, folder: Path) -> tuple[Path, list[Path], Names, Truth]:
    """(spec, logs, right names, true values) of one planted log."""
    base, plant, names, truth = PLANTED[name]
    spec = Path(shutil.copy(measured / f"{base}.yaml", folder))
    logs = []
    for path in sorted(measured.glob(f"{base}*.csv")):
        with path.open(encoding="utf-8", newline="") as file:
            head, *rows = csv.reader(file)
        log = dict(zip(head, np.array(rows, dtype=float).T, strict=True))
        plant(log)
        lines = [",".join(f"{v:.9g}" for v in row) for row in np.array(list(log.values())).T]
        logs.append(folder / path.name)
        logs[-1].write_text("\n".join([",".join(head), *lines]) + "\n", encoding="utf-8")
    return spec, logs, names, truth
