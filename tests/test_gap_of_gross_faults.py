"""Before a gross fault is undone the log is as wrong as the maker of the log knows it to be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis import diagnose

SIGMA_M, ROWS, STEP_S = 0.02, 600, 0.2
AXES = ("north", "east", "down")
SPEC = f"""syncline: 1
name: boat
requirements: [{{id: ACC-1, kind: accuracy, limit: 1 m}}]
stages:
  - name: boat
    platform: {{v_max: 5 m/s, omega_max: 60 deg/s, distance: 10 m, baseline: 1 m}}
    position:
      sensor: {{modality: position, type: gnss, sigma_position: {SIGMA_M} m, primitives: [pps]}}
      primitive: pps
      timestamping: {{error: {{distribution: uniform, low: -10 ns, high: 10 ns}}}}
"""


def path(time_s: np.ndarray) -> np.ndarray:
    t = time_s
    return np.stack(
        [30.0 * np.sin(0.07 * t), 20.0 * np.cos(0.11 * t), 3.0 + np.sin(0.2 * t)], axis=1
    )


@pytest.mark.parametrize("fault", ["slip", "enu"])
def test_before_is_the_log_as_it_came(fault: str, tmp_path: Path) -> None:
    time_s = STEP_S * np.arange(ROWS)
    noise = SIGMA_M * np.random.default_rng(2).standard_normal((ROWS, 3))
    true = path(time_s)
    read = path(time_s - (2.0 if fault == "slip" else 0.0)) + noise
    if fault == "enu":
        read = np.stack([read[:, 1], read[:, 0], -read[:, 2]], axis=1)
    speed = (path(time_s + 1e-3) - path(time_s - 1e-3)) / 2e-3
    columns = {"time_s": time_s}
    for name, values, unit in (
        ("position", read, "m"),
        ("reference", true, "m"),
        ("velocity", speed, "mps"),
    ):
        columns |= {f"{name}_{axis}_{unit}": values[:, k] for k, axis in enumerate(AXES)}
    for axis in ("roll", "pitch", "yaw"):
        columns[f"{axis}_deg"] = 0.0 * time_s
    table, head = np.stack(list(columns.values()), axis=1), ",".join(columns)
    np.savetxt(tmp_path / "log.csv", table, "%.6f", ",", header=head, comments="")
    (tmp_path / "spec.yaml").write_text(SPEC)
    found = diagnose(tmp_path / "spec.yaml", [tmp_path / "log.csv"])
    wrong = float(np.sqrt(np.mean(np.sum((read - true) ** 2, axis=1))))
    right = float(np.sqrt(np.mean(np.sum(noise**2, axis=1))))
    assert found.gap.held_out is not None
    assert found.gap.held_out.before.rms_m == pytest.approx(wrong, rel=0.02)
    assert found.gap.held_out.after.rms_m == pytest.approx(right, rel=0.02)
    assert found.gap.closed_fraction == pytest.approx(1.0, abs=1e-3)
    (only,) = found.findings
    assert only.size_m == pytest.approx(np.sqrt(wrong**2 - right**2), rel=0.02)
    assert found.steps[0].held_out is not None
    assert found.steps[0].held_out.before.rms_m == pytest.approx(wrong, rel=0.02)
