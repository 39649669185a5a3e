"""Axes of one sensor that are not alike, and velocities that come from the places themselves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from syncline_design.diagnosis.checks import log_checks
from syncline_design.diagnosis.fitting import fit
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.searched import prepared
from syncline_design.diagnosis.system import measured
from syncline_design.diagnosis.unlike_readings import unlike_readings
from syncline_design.spec.load import load
from tests.test_long_memories import CIRCLING, POSITION_M, SPEC, circling, vectors, written

Array = NDArray[np.float64]


def wandering(times: tuple[float, float, float], draws: Array) -> dict[str, Array]:
    """A vehicle against a better system; draws (n, 3) standard normal, so many times the spec's."""
    t = 0.1 * np.arange(len(draws))
    place = np.stack([20.0 * np.sin(0.3 * t), 15.0 * np.cos(0.2 * t), np.sin(0.5 * t)], axis=1)
    speed = np.stack([6.0 * np.cos(0.3 * t), -3.0 * np.sin(0.2 * t), 0.5 * np.cos(0.5 * t)], axis=1)
    read = place + POSITION_M * np.array(times) * draws
    return {
        "time_s": t, **vectors("position", read, "m"), **vectors("reference", place, "m"),
        **vectors("velocity", speed, "mps"),
        "roll_deg": 0 * t, "pitch_deg": 0 * t, "yaw_deg": 40.0 * np.sin(0.1 * t),
    }  # fmt: skip


def test_one_axis_with_all_of_the_specs_noise_beside_quiet_ones_does_not_drift(
    tmp_path: Path,
) -> None:
    """North and east at a fifth of the spec's noise, down as it says, all white: nothing is amiss.

    One factor for all three leaves down three times too loud for it.
    """
    draws = np.random.default_rng(8).standard_normal((900, 3))
    columns = wandering((0.2, 0.2, 1.0), draws)
    found = written(tmp_path, SPEC.replace("ARM", "0"), columns)
    assert found.verdict == "agrees"
    assert found.findings == ()


def test_one_loud_axis_is_said_as_that_and_not_as_heavy_tails(tmp_path: Path) -> None:
    """Down scatters 3.5 times as the spec says, east 1.8 times: by the drawn samples themselves."""
    draws = np.random.default_rng(5).standard_normal((400, 3))
    times = (1.0, 1.8, 3.5)
    found = written(tmp_path, SPEC.replace("ARM", "0"), wandering(times, draws))
    (one,) = found.findings
    assert (one.effect, one.sensor, one.kind) == ("noise_understated", "position", "noise")
    sample = np.array(times) * np.std(draws, axis=0)
    assert one.readings is not None
    assert list(one.readings.values()) == pytest.approx(sample, rel=0.06)
    factor = one.parameters["factor"]
    assert factor.value == max(one.readings.values())
    spread = sample[2] / np.sqrt(2.0 * len(draws))  # of a normal sample's deviation
    assert factor.standard_uncertainty == pytest.approx(spread, rel=0.5)
    assert one.sentence.endswith("most in down")
    more_m = POSITION_M * float(np.sqrt(np.sum(sample**2 - 1.0)))
    assert one.size_m == pytest.approx(more_m, rel=0.06)


@pytest.mark.parametrize("tails", [True, False])
def test_axes_that_are_alike_are_left_so(tmp_path: Path, *, tails: bool) -> None:
    """Student's t of 3 on all axes, and normal noise of twice the spec's on all."""
    rng = np.random.default_rng(6)
    draws = rng.standard_t(3.0, (600, 3)) if tails else 2.0 * rng.standard_normal((600, 3))
    columns = wandering((1.0, 1.0, 1.0), draws)
    (tmp_path / "spec.yaml").write_text(SPEC.replace("ARM", "0"))
    table = np.stack(list(columns.values()), axis=1)
    np.savetxt(tmp_path / "log.csv", table, "%.7f", ",", header=",".join(columns), comments="")
    inputs = measured(load(tmp_path / "spec.yaml"), [tmp_path / "log.csv"])
    data = prepared(inputs, inputs.log)
    assert unlike_readings(data, fit(data)) == ()


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
