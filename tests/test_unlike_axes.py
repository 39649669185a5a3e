"""Axes of one sensor that are not alike, and velocities that come from the places themselves."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from syncline_design.diagnosis.checks import log_checks
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.system import measured
from syncline_design.spec.load import load
from tests.test_long_memories import CIRCLING, POSITION_M, SPEC, circling, vectors, written


def test_one_axis_with_all_of_the_specs_noise_beside_quiet_ones_does_not_drift(
    tmp_path: Path,
) -> None:
    """North and east at a fifth of the spec's noise, down as it says, all white: nothing is amiss.

    One factor for all three leaves down three times too loud for it.
    """
    rng, t = np.random.default_rng(8), 0.1 * np.arange(900)
    place = np.stack([20.0 * np.sin(0.3 * t), 15.0 * np.cos(0.2 * t), np.sin(0.5 * t)], axis=1)
    speed = np.stack([6.0 * np.cos(0.3 * t), -3.0 * np.sin(0.2 * t), 0.5 * np.cos(0.5 * t)], axis=1)
    drawn = POSITION_M * np.array([0.2, 0.2, 1.0]) * rng.standard_normal(place.shape)
    columns = {
        "time_s": t, **vectors("position", place + drawn, "m"), **vectors("reference", place, "m"),
        **vectors("velocity", speed, "mps"),
        "roll_deg": 0 * t, "pitch_deg": 0 * t, "yaw_deg": 40.0 * np.sin(0.1 * t),
    }  # fmt: skip
    found = written(tmp_path, SPEC.replace("ARM", "0"), columns)
    assert found.verdict == "agrees"
    assert found.findings == ()


def test_a_log_without_velocities_has_none_that_contradict_its_places(tmp_path: Path) -> None:
    """A heave of 3 s: slopes over a second lack (w h)^2 / 10 = 11 % of it, far beyond noise."""
    columns = circling(seed=2, lag_s=0.0, turn=0.3, noise=0.0)
    heave = np.sin(2.0 * np.pi / 3.0 * columns["time_s"])
    for name in ("position_down_m", "target_down_m"):
        columns[name] = columns[name] + heave
    moved = {name: values for name, values in columns.items() if not name.startswith("velocity")}
    (tmp_path / "spec.yaml").write_text(CIRCLING)
    table = np.stack(list(moved.values()), axis=1)
    np.savetxt(tmp_path / "log.csv", table, "%.7f", ",", header=",".join(moved), comments="")
    inputs = measured(load(tmp_path / "spec.yaml"), [tmp_path / "log.csv"])
    view = scene(inputs.system, inputs.log)
    assert view.log.stages[0].follows_position
    assert [one.code for one in log_checks(view, ()) if one.severity == "contradiction"] == []
