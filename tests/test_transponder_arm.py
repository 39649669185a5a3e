"""The transponder of a later stage may sit elsewhere: an arm like any other, and one that looks
like that of the stage's own ranging sensor with its sign turned."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis.candidates import candidates, signature
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.system import measured
from syncline_design.spec.load import load
from tests.world import CHAIN, make_log, scenario


def test_a_transponder_that_sits_elsewhere_is_looked_for(tmp_path: Path) -> None:
    made = make_log(scenario(CHAIN, 4, 30.0, 2.0))
    (tmp_path / "spec.yaml").write_text(made.spec_yaml(), encoding="utf-8")
    made.to_csv(tmp_path / "log.csv")
    inputs = measured(load(tmp_path / "spec.yaml"), [tmp_path / "log.csv"])
    view = scene(inputs.system, inputs.log, inputs.known)
    arms = {
        (one.sensor, one.stage): signature(view, one, {})
        for one in candidates(view)
        if one.effect.name == "lever_arm"
    }
    assert set(arms) == {("position", 0), ("ranging", 0), ("position", 1), ("ranging", 1)}
    assert arms["position", 1] == pytest.approx(-arms["ranging", 1], abs=1e-9)
    # the reference point is the transponder's place less the arm turned with the vehicle
    pitch, roll = (view.rows[1].euler_rad[:, k] for k in (1, 0))
    down_of_forward = np.stack([-np.sin(pitch), np.cos(pitch) * np.sin(roll)], axis=1)
    assert arms["position", 1][:, 2, :2] == pytest.approx(down_of_forward, abs=1e-9)
