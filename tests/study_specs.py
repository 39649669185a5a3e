"""A small system and studies of it, written into a test's own folder."""

from __future__ import annotations

from pathlib import Path

SPEC = """\
syncline: 1
name: Small UAV
requirements:
  - {id: ACC-1, kind: accuracy, limit: 0.30 m}
  - {id: COST-1, kind: cost, limit: 100000 EUR}
stages:
  - name: uav
    platform: uav_fixed_wing
    position: {candidates: [ublox_f9p_rtk, ublox_f9p_pvt]}
    attitude: {candidates: [sbg_apogee, sbg_ellipse]}
    ranging: {candidates: [velodyne_hdl32e, riegl_vux1uav]}
timestamping: {candidates: [hardware, gpio]}
"""

STUDY = """\
study: 1
name: Height and accuracy
base: [spec.yaml]
grid:
  "stages[uav].distance": [40 m, 60 m, 100 m]
  "requirements[ACC-1].limit": [0.15 m, 0.3 m]
"""


def write(folder: Path, study: str = STUDY, spec: str = SPEC) -> Path:
    """The spec and a study of it; returns the study's path."""
    (folder / "spec.yaml").write_text(spec, encoding="utf-8")
    path = folder / "study.yaml"
    path.write_text(study, encoding="utf-8")
    return path
