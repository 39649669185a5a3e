"""A figure of the error has one value, whether a requirement limits it or the budget states it."""

from __future__ import annotations

from pathlib import Path

import pytest

from syncline_design.spec.load import load_text
from syncline_design.verdict.verify import CheckSettings, check_loaded

# 0.16702 m is the largest quantile that seven searches find, 0.16696 m that of one.
SPEC = """\
syncline: 1
name: boat
requirements:
  - {{id: ACC-1, kind: accuracy, limit: 300 mm}}
  - {{id: SYNC-1, kind: sync, limit: 2}}
  - {{id: RMS-1, kind: rmse, axis: horizontal, limit: 90 mm}}
  - {{id: Q-1, kind: quantile, of: 3d, p: 0.95, limit: {limit}}}
stages:
  - name: boat
    platform: {{v_max: 6 km/h, omega_max: 0.3 rad/s, distance: 25 m, baseline: 80 cm}}
    position:
      sensor: {{modality: position, type: gnss, sigma_position: [12 mm, 12 mm, 20 mm],
               primitives: [pps]}}
      primitive: pps
      timestamping: {{error: {{distribution: normal, mean: 1 us, std: 200 us}}}}
      lever_arm: [25 cm, -10 cm, -40 cm]
    attitude:
      sensor: {{modality: attitude, type: ins, sigma_attitude: [0.05 deg, 0.05 deg, 0.1 deg],
               primitives: [pps]}}
      primitive: pps
      timestamping: {{error: {{distribution: uniform, low: -10 ms, high: 10 ms}}}}
    ranging:
      sensor: {{modality: ranging, type: lidar, sigma_range: 30 mm,
               sigma_bearing: [0.1 deg, 0.1 deg], primitives: [pps]}}
      primitive: pps
      timestamping: {{error: {{distribution: uniform, low: -1 ms, high: 1 ms}}}}
      lever_arm: [15 cm, 5 cm, 20 cm]
"""


@pytest.mark.parametrize(("limit", "status"), [("250 mm", "pass"), ("166.9 mm", "fail")])
def test_a_requirement_and_the_figures_say_the_same(
    tmp_path: Path, limit: str, status: str
) -> None:
    case = load_text(SPEC.format(limit=limit), tmp_path / "boat.yaml")
    verdict = check_loaded(case, CheckSettings())
    rows = {row.id: row for row in verdict.requirements}
    assert verdict.figures is not None
    assert verdict.figures.rmse_m is not None
    assert rows["Q-1"].value == verdict.figures.quantile95_3d_m
    assert rows["RMS-1"].value == verdict.figures.rmse_m["horizontal"]
    assert rows["Q-1"].status == status
    assert rows["Q-1"].margin == pytest.approx(rows["Q-1"].limit - (rows["Q-1"].value or 0.0))
    assert verdict.verdict == ("meets" if status == "pass" else "fails")
