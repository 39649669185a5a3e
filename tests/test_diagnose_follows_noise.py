"""A vehicle that stands: its load varies by nothing but the noise of roll and pitch."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis import Diagnosis, DiagnosisSettings, diagnose
from syncline_design.effects import registry
from syncline_design.spec.load import load

ROWS, HEIGHT_M, YAW = 400, 30.0, 0.4
EXAMPLE = Path(__file__).parent.parent / "examples" / "hidden_latency.yaml"
ANTENNA, LASER = np.array([0.25, -0.1, -0.4]), np.array([0.15, 0.05, 0.2])  # the example's arms


def parked_log(path: Path, seed: int) -> None:
    """Level, at rest, heading 0.4 rad; targets on the ground; white noise of the example's spec."""
    rng = np.random.default_rng(seed)
    cos, sin = np.cos(YAW), np.sin(YAW)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    place = np.array([0.0, 0.0, -HEIGHT_M])
    scanner = place + turn @ LASER
    targets = np.column_stack([rng.uniform(-20.0, 20.0, (ROWS, 2)), np.zeros(ROWS)])
    seen = (targets - scanner) @ turn  # in body axes
    range_m = np.linalg.norm(seen, axis=1)
    sight = np.degrees([np.arctan2(seen[:, 1], seen[:, 0]), -np.arcsin(seen[:, 2] / range_m)]).T
    still = np.column_stack([rng.normal(0.0, 0.01, (ROWS, 3)), rng.normal(0.0, 0.05, (ROWS, 3))])
    table = np.column_stack(
        [
            np.arange(ROWS) / 10.0,
            place + turn @ ANTENNA + rng.normal(0.0, [0.012, 0.012, 0.02], (ROWS, 3)),
            np.array([0.0, 0.0, np.degrees(YAW)]) + rng.normal(0.0, [0.03, 0.03, 0.06], (ROWS, 3)),
            still,
            range_m + rng.normal(0.0, 0.02, ROWS),
            sight + rng.normal(0.0, 0.02, (ROWS, 2)),
            targets,
        ]
    )
    axes = ("north", "east", "down")
    names = ["time_s", *(f"position_{a}_m" for a in axes), "roll_deg", "pitch_deg", "yaw_deg"]
    names += [*(f"velocity_{a}_mps" for a in axes), *(f"rate_{a}_degps" for a in "xyz")]
    names += ["range_m", "azimuth_deg", "elevation_deg", *(f"target_{a}_m" for a in axes)]
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.6f")


@pytest.fixture(scope="module")
def parked(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    path = tmp_path_factory.mktemp("parked") / "parked.csv"
    parked_log(path, 3)
    asked = ("flexure", "heading_hard_iron", "range_bias", "lever_arm")
    others = tuple(name for name in registry() if name not in asked)
    settings = DiagnosisSettings(exclude_effects=others, unseen_block=False)
    return diagnose(load(EXAMPLE), [path], settings)


def test_the_noise_of_roll_and_pitch_is_no_structure_of_a_parked_log(parked: Diagnosis) -> None:
    assert parked.verdict == "agrees"
    assert not parked.findings


def test_what_follows_the_load_is_said_to_be_hidden(parked: Diagnosis) -> None:
    assert "flexure (ranging)" in parked.unseen
    assert "heading_hard_iron (attitude)" in parked.unseen
    hidden = {s.parameter: s.sure for s in parked.smallest_seen if s.effect == "flexure"}
    assert hidden == {"x": None, "y": None, "z": None}
