"""What is constant between two frames that only the log laid onto each other is no finding."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis import DiagnosisSettings
from syncline_design.diagnosis.run import diagnose_measured
from syncline_design.diagnosis.system import measured
from syncline_design.logs.frame_fit import Turns
from syncline_design.spec.load import load
from tests.flight_logs import write_ros1
from tests.test_diagnose_recordings import FIXES, TRUTH, spec

SHIFT = np.array([0.01, -0.02, 0.05])  # as a laying may be off; the fixes scatter by 2 cm


def named(folder: Path, laid: Turns | None, turn_rad: float = 0.0) -> dict[str, float]:
    """What is named, with its first value, where the reference stands off by a shift and a turn."""
    inputs = measured(load(spec(folder)), [write_ros1(folder / "a.bag", TRUTH, fixes=FIXES)])
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    turned = inputs.log.truth_m @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + SHIFT
    log = replace(inputs.log, truth_m=turned, laid=laid)
    done = diagnose_measured(replace(inputs, log=log), DiagnosisSettings(seed=1))
    return {one.effect: next(iter(one.parameters.values())).value for one in done.findings}


def test_a_shift_of_a_frame_that_is_known_is_found(tmp_path: Path) -> None:
    assert len(named(tmp_path, None)) > 1


@pytest.mark.parametrize(("laid", "turn_rad"), [("none", 0.0), ("heading", 1e-3)])
def test_a_shift_and_turn_of_a_laid_frame_are_not(
    tmp_path: Path, laid: Turns, turn_rad: float
) -> None:
    found = named(tmp_path, laid, turn_rad)
    assert list(found) == ["latency"]
    assert found["latency"] == pytest.approx(0.08, abs=0.001)
