"""A copter to plan drives for, the command that does, and a plan as the world drives it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from syncline_design.cli.app import app
from syncline_design.planning.telling import PlanRun
from tests.world.motions import Sensors
from tests.world.planned import driven
from tests.world.scenarios import Scenario

DEGREE = math.pi / 180.0
LIMITS = (9.0, 50.0 * DEGREE, 40.0)  # v_max, omega_max, distance
STAMPED = "timestamping: {error: {distribution: uniform, low: -10 ns, high: 10 ns}}"
SPEC = f"""\
syncline: 1
name: copter
requirements: [{{id: ACC-1, kind: accuracy, limit: 1 m}}]
stages:
  - name: vehicle
    platform: {{v_max: 9 m/s, omega_max: 50 deg/s, distance: 40 m, baseline: 0.5 m,
      motion: multirotor, acceleration: 2 m/s^2, area: [250 m, 250 m]}}
    position: {{sensor: {{modality: position, type: gnss,
      sigma_position: [0.012 m, 0.012 m, 0.02 m], primitives: [pps]}}, primitive: pps, {STAMPED},
      lever_arm: [0.25 m, -0.1 m, -0.4 m]}}
    attitude: {{sensor: {{modality: attitude, type: ins,
      sigma_attitude: [0.03 deg, 0.03 deg, 0.06 deg], primitives: [pps]}}, primitive: pps,
      {STAMPED}}}
    ranging: {{sensor: {{modality: ranging, type: lidar, sigma_range: 0.02 m,
      sigma_bearing: [0.02 deg, 0.02 deg], primitives: [pps]}}, primitive: pps, {STAMPED},
      lever_arm: [0.15 m, 0.05 m, 0.2 m]}}
log: {{origin: [47.3 deg, 8.55 deg, 460 m]}}
"""


def spec_with(folder: Path, *changes: tuple[str, str]) -> Path:
    """The spec in a file of its own, each text in it exchanged for another."""
    text = SPEC
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "copter.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def world(run: PlanRun, seed: int = 5) -> Scenario:
    """The plan in the world, from what is written as waypoints, once a tenth of a second."""
    states, aims = run.driven.states[0], run.driven.aims
    assert aims is not None
    return driven("copter", seed, states.time_s, states.position_m, states.euler_rad,
                  aims.targets_m, aims.aimed, Sensors(), LIMITS)  # fmt: skip


def call(*words: object) -> Any:
    return CliRunner().invoke(app, ["plan", *map(str, words)])
