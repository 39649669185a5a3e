"""A log begins somewhere: what a filter remembers from before is no noise, no contradiction.

Oracle: on sinusoids the filter T dy/dt + y = x has the closed form (sin W t - W T cos W t) /
(1 + W^2 T^2), as if it had always run; a vehicle on such a path turns at any moment otherwise than
it did before.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from syncline_design.diagnosis import diagnose

Array = NDArray[np.float64]
SIGMA_M, ROWS, STEP_S = 0.02, 700, 0.2
AXES = ("north", "east", "down")
WAVES = ((0.9, 6.0), (0.55, 9.0), (0.23, 1.5))  # rad/s, m
SPEC = f"""syncline: 1
name: boat
requirements: [{{id: ACC-1, kind: accuracy, limit: 1 m}}]
stages:
  - name: boat
    platform: {{v_max: 10 m/s, omega_max: 60 deg/s, distance: 10 m, baseline: 1 m}}
    position:
      sensor: {{modality: position, type: gnss, sigma_position: {SIGMA_M} m, primitives: [pps]}}
      primitive: pps
      timestamping: {{error: {{distribution: uniform, low: -10 ns, high: 10 ns}}}}
"""


def place(t: Array, lag_s: float = 0.0) -> Array:
    axes = [
        size * (np.sin(w * t) - w * lag_s * np.cos(w * t)) / (1.0 + (w * lag_s) ** 2)
        for w, size in WAVES
    ]
    return np.stack(axes, axis=1)


def speed(t: Array) -> Array:
    return np.stack([size * w * np.cos(w * t) for w, size in WAVES], axis=1)


@pytest.mark.parametrize("lag_s", [0.6, 1.8])
def test_a_smoothed_position_is_nothing_but_that(lag_s: float, tmp_path: Path) -> None:
    """omega T up to 1.6, a break of a minute in the log."""
    t = STEP_S * np.arange(ROWS)
    t[ROWS // 2 :] += 60.0
    noise = SIGMA_M * np.random.default_rng(7).standard_normal((ROWS, 3))
    columns = {"time_s": t, "roll_deg": 0 * t, "pitch_deg": 0 * t, "yaw_deg": 40.0 + 0 * t}
    for name, values, unit in (
        ("position", place(t, lag_s) + noise, "m"),
        ("reference", place(t), "m"),
        ("velocity", speed(t), "mps"),
    ):
        columns |= {f"{name}_{axis}_{unit}": values[:, k] for k, axis in enumerate(AXES)}
    table, head = np.stack(list(columns.values()), axis=1), ",".join(columns)
    np.savetxt(tmp_path / "log.csv", table, "%.6f", ",", header=head, comments="")
    (tmp_path / "spec.yaml").write_text(SPEC)
    found = diagnose(tmp_path / "spec.yaml", [tmp_path / "log.csv"])
    assert found.checks == ()
    assert found.verdict == "explained"
    (only,) = found.findings
    assert only.effect == "filter_lag"
    low, high = only.parameters["time_constant_s"].interval95 or (np.nan, np.nan)
    assert low <= lag_s <= high
    assert high - low < 0.01 * lag_s
    assert found.gap.held_out is not None
    left = float(np.sqrt(np.mean(np.sum(noise**2, axis=1))))
    assert found.gap.held_out.after.rms_m == pytest.approx(left, rel=0.02)
