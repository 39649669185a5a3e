"""Time and memory of `diagnose` over the length of a log: python benchmarks/diagnose.py [ROWS ...]

The log is a vehicle on figure eights that sights surveyed targets, written from closed formulas,
with white noise of the spec's size and a GNSS latency of 20 ms.
"""

from __future__ import annotations

import platform
import resource
import subprocess
import sys
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

SPEC = """syncline: 1
name: figure eights
requirements: [{id: ACC-1, kind: accuracy, limit: 1 m}]
stages:
  - name: car
    platform: {v_max: 10 m/s, omega_max: 30 deg/s, distance: 30 m, baseline: 0.5 m}
    position:
      sensor: {modality: position, sigma_position: 2 cm, primitives: [pps]}
      primitive: pps
      timestamping: {error: {distribution: uniform, low: -10 ns, high: 10 ns}}
    attitude:
      sensor: {modality: attitude, sigma_attitude: [0.05 deg, 0.05 deg, 0.1 deg], primitives: [pps]}
      primitive: pps
      timestamping: {error: {distribution: uniform, low: -10 ns, high: 10 ns}}
    ranging:
      sensor: {modality: ranging, sigma_range: 2 cm, sigma_bearing: 0.02 deg, primitives: [pps]}
      primitive: pps
      timestamping: {error: {distribution: uniform, low: -10 ns, high: 10 ns}}
"""
LATENCY_S, PERIOD_S, RATE_HZ, DEGREE = 0.020, 60.0, 10.0, np.pi / 180.0


def eight(time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Place and velocity (n, 2) on a figure eight, its size slowly breathing."""
    w = 2 * np.pi / PERIOD_S
    size, slope = 40 + 15 * np.sin(0.37 * w * time_s), 15 * 0.37 * w * np.cos(0.37 * w * time_s)
    shape = np.stack([np.sin(w * time_s), 0.5 * np.sin(2 * w * time_s)], axis=1)
    turned = np.stack([w * np.cos(w * time_s), w * np.cos(2 * w * time_s)], axis=1)
    return size[:, None] * shape, slope[:, None] * shape + size[:, None] * turned


def columns(rows: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    t = np.arange(rows) / RATE_HZ
    place, velocity = eight(t)
    late, _ = eight(t - LATENCY_S)
    ahead = eight(t + 1e-3)[1]
    yaw, next_yaw = (np.unwrap(np.arctan2(v[:, 1], v[:, 0])) for v in (velocity, ahead))
    bearing, distance = rng.uniform(-np.pi, np.pi, rows), rng.uniform(8, 40, rows)
    target = place + distance[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    noise = 0.02 * rng.standard_normal((rows, 3))
    angle = np.array([0.05, 0.05, 0.1]) * rng.standard_normal((rows, 3))
    beam = rng.standard_normal((rows, 3)) * [0.02, 0.02, 0.02]
    zero = np.zeros(rows)
    return {
        "time_s": t,
        "position_north_m": late[:, 0] + noise[:, 0],
        "position_east_m": late[:, 1] + noise[:, 1],
        "position_down_m": noise[:, 2],
        "roll_deg": angle[:, 0],
        "pitch_deg": angle[:, 1],
        "yaw_deg": yaw / DEGREE + angle[:, 2],
        "velocity_north_mps": velocity[:, 0],
        "velocity_east_mps": velocity[:, 1],
        "velocity_down_mps": zero,
        "rate_x_degps": zero,
        "rate_y_degps": zero,
        "rate_z_degps": (next_yaw - yaw) / 1e-3 / DEGREE,
        "range_m": distance + beam[:, 0],
        "azimuth_deg": (bearing - yaw) / DEGREE + beam[:, 1],
        "elevation_deg": beam[:, 2],
        "target_north_m": target[:, 0],
        "target_east_m": target[:, 1],
        "target_down_m": zero,
    }


RUN = """
import resource, sys, time
from syncline_design.diagnosis import diagnose
start = time.perf_counter()
found = diagnose(sys.argv[1], [sys.argv[2]])
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
named = " + ".join(f"{f.effect} ({f.sensor})" for f in found.findings)
value = found.findings[0].parameters["latency_s"].text if named else None
print(f"{time.perf_counter() - start:.1f} s, {peak:.2f} GiB: {found.verdict}, {named}, {value}")
"""


def main() -> None:
    sizes = [int(a) for a in sys.argv[1:]] or [3_000, 30_000, 300_000, 1_000_000]
    print(f"{datetime.now(UTC):%Y-%m-%d}, Python {platform.python_version()}, seed 0")
    with tempfile.TemporaryDirectory() as folder:
        spec, log = Path(folder) / "spec.yaml", Path(folder) / "log.csv"
        spec.write_text(SPEC, encoding="utf-8")
        for rows in sizes:
            import polars as pl

            pl.DataFrame(columns(rows)).write_csv(log, float_precision=6)
            start = time.perf_counter()
            shown = subprocess.run(
                [sys.executable, "-c", RUN, str(spec), str(log)],
                check=True,
                capture_output=True,
                text=True,
            ).stdout.strip()
            print(f"{rows:>9} rows, {time.perf_counter() - start:6.1f} s in all: {shown}")
    print(f"this script: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2:.2f} GiB")


if __name__ == "__main__":
    main()
