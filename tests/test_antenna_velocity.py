"""Velocities that come from the antenna's places hold the sweep of its arm, which counts once.

On a circle about the origin, travelled at w, an antenna that is late by tau is turned by -w tau.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis.scene import acting, scene
from syncline_design.diagnosis.system import measured
from syncline_design.spec.load import load
from tests.test_long_memories import ARM_M, CIRCLING, circling

TURN, LATE_S, SPEED_MPS = 0.5, 0.06, 5.0


@pytest.mark.parametrize("columns_of_velocity", [True, False])
def test_a_late_antenna_is_put_back_with_its_arm(
    tmp_path: Path, *, columns_of_velocity: bool
) -> None:
    columns = circling(seed=1, lag_s=0.0, turn=TURN, noise=0.0)
    antenna = columns["position_north_m"] + 1j * columns["position_east_m"]
    late = antenna * np.exp(-1j * TURN * LATE_S)
    columns |= {"position_north_m": late.real, "position_east_m": late.imag}
    if not columns_of_velocity:
        columns = {k: v for k, v in columns.items() if not k.startswith("velocity")}
    (tmp_path / "spec.yaml").write_text(CIRCLING)
    table = np.stack(list(columns.values()), axis=1)
    np.savetxt(tmp_path / "log.csv", table, "%.7f", ",", header=",".join(columns), comments="")
    inputs = measured(load(tmp_path / "spec.yaml"), [tmp_path / "log.csv"])
    view = scene(inputs.system, inputs.log)
    assert view.log.stages[0].follows_position is not columns_of_velocity
    known = (acting("latency", "position", 0, {"latency_s": LATE_S}),)
    left = np.linalg.norm(view.error(known), axis=1)[10:-10]
    again = TURN * ARM_M * LATE_S  # 12 mm, were the arm's sweep there twice
    by_parabola = SPEED_MPS * LATE_S * (0.5 * TURN) ** 2 / 10.0  # slopes over a second: 2 mm
    assert float(np.max(left)) < by_parabola + 0.1 * again
    speed = np.linalg.norm(view.rows[0].velocity_mps, axis=1)[10:-10]
    np.testing.assert_allclose(speed, SPEED_MPS, rtol=(0.5 * TURN) ** 2 / 10.0 + 1e-3)
