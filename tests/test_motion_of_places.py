"""Motion that is taken from the places: quick motion stays in it, however it is smoothed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.system import measured
from syncline_design.spec.load import load
from tests.test_long_memories import CIRCLING

SPEED_MPS, SWAY_M, SWAY_RADPS, LATE_S = 3.0, 0.15, 4.0, 0.08
LEVEL = dict.fromkeys(("roll_deg", "pitch_deg", "yaw_deg"), 0.0)
KINDS = {
    "position": ("reference_north_m", "reference_east_m", "reference_down_m"),
    "georeference": ("target_north_m", "target_east_m", "target_down_m"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_sway_of_a_second_and_a_half_is_not_smoothed_away(kind: str, tmp_path: Path) -> None:
    """A boat that sways by a sine: how far it moves in 80 ms, by the sine itself.

    A parabola over one second keeps 1 - (w/2)^2/10 of a slope: 40 % of this sway's would be gone.
    """
    time_s = np.arange(400) * 0.1
    sway = SWAY_M * np.sin(SWAY_RADPS * time_s)
    columns = {"time_s": time_s, "position_north_m": SPEED_MPS * time_s, "position_east_m": sway,
               "position_down_m": 0.0 * sway}  # fmt: skip
    columns |= {name: value + 0.0 * sway for name, value in LEVEL.items()}
    columns |= {f"rate_{axis}_degps": 0.0 * sway for axis in "xyz"}
    places = (columns["position_north_m"], sway, 0.0 * sway)
    columns |= dict(zip(KINDS[kind], places, strict=True))
    if kind == "georeference":
        columns |= dict.fromkeys(("azimuth_deg", "elevation_deg"), 0.0 * sway)
        columns |= {"range_m": 10.0 + 0.0 * sway, "target_north_m": places[0] + 10.0}
    (tmp_path / "spec.yaml").write_text(CIRCLING)
    table = np.stack(list(columns.values()), axis=1)
    np.savetxt(tmp_path / "log.csv", table, "%.9f", ",", header=",".join(columns), comments="")
    inputs = measured(load(tmp_path / "spec.yaml"), [tmp_path / "log.csv"])
    motion = scene(inputs.system, inputs.log).motions[0]
    moved = motion.displacement(time_s - LATE_S, time_s, np.zeros(1))[20:-20]
    true = sway - SWAY_M * np.sin(SWAY_RADPS * (time_s - LATE_S))
    np.testing.assert_allclose(moved[:, 0], SPEED_MPS * LATE_S, rtol=1e-3)
    np.testing.assert_allclose(moved[:, 1], true[20:-20], atol=0.02 * SWAY_M * SWAY_RADPS * LATE_S)
