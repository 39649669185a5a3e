"""A spec of a host that logs measure; its position is stamped in UTC."""

from __future__ import annotations

from pathlib import Path

from typer.testing import CliRunner, Result

from syncline_design.cli.app import app
from tests.clock_logs import sessions_csv

ROOT = Path(__file__).parent.parent
SPEC = """\
syncline: 1
name: two timelines
requirements:
  - {id: ACC-1, kind: accuracy, limit: 0.30 m}
  - {id: SYNC-1, kind: sync, limit: 1.0}
catalogs: [own_clock.yaml]
coverage_factor: 2
stages:
  - name: uav
    platform: {v_max: 20 m/s, omega_max: 0.001 deg/s, distance: 0.1 m, baseline: 0 m}
    clock: {candidates: [own_clock]}
    position: {sensor: {modality: position, sigma_position: 1 cm, primitives: []},
               timestamping: {error: {distribution: constant, value: 0 s}, timeline: utc}}
    attitude: {sensor: {modality: attitude, sigma_attitude: 0.01 deg, primitives: []},
               timestamping: {error: {distribution: constant, value: 0 s}}}
    ranging: {sensor: {modality: ranging, sigma_range: 1 cm, sigma_bearing: 0.01 deg,
              primitives: []}, timestamping: {error: {distribution: constant, value: 0 s}}}
"""


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(a) for a in arguments])


def week_of_logs(folder: Path, sigma_s: float) -> list[Path]:
    return sessions_csv(folder, [sigma_s] * 7, count=400, step_s=60.0, seed=2)
