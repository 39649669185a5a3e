"""Effects that follow an acceleration, in logs whose acceleration is that of their own places."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fitted_data import data_from
from syncline_design.diagnosis import diagnose
from syncline_design.diagnosis.borrowed import noisier_scenes
from syncline_design.diagnosis.candidates import candidates, hidden_by_noise
from syncline_design.diagnosis.followed import acceleration_is_noise
from syncline_design.diagnosis.scene import Scene, scene
from syncline_design.diagnosis.slow_states import slow_states
from syncline_design.diagnosis.system import measured
from syncline_design.logs.derivatives import derived_velocity
from syncline_design.spec.load import load
from tests.world import Noise, WorldLog, make_log, scenario

MOVED = ("velocity", "rate")
FOLLOWING = {"flexure", "acceleration_tilt"}


def noisy_places(sigma_m: float, seed: int, *, moved: bool) -> WorldLog:
    """A clean log of a vessel, white noise of sigma_m put on its positions."""
    log = make_log(scenario("vessel_figure_eights", seed, 80.0, 6.0), (), Noise())
    rng = np.random.default_rng([seed, 3])
    columns = {
        name: values + sigma_m * rng.standard_normal(len(values))
        if name.startswith("position")
        else values
        for name, values in log.columns.items()
        if moved or not name.startswith(MOVED)
    }
    return replace(log, columns=columns)


def its_spec(log: WorldLog, sigma_m: float) -> str:
    """The log's spec with a position sensor of this standard deviation; 0: as it is."""
    spec = log.spec_yaml()
    if sigma_m == 0.0:
        return spec
    changed = re.sub(r"sigma_position: \[.*?\]", f"sigma_position: {sigma_m} m", spec)
    assert changed != spec
    return changed


def view_of(log: WorldLog, sigma_m: float, folder: Path) -> Scene:
    spec = folder / "spec.yaml"
    spec.write_text(its_spec(log, sigma_m), encoding="utf-8")
    inputs = measured(load(spec), [log.to_csv(folder / "log.csv")])
    return scene(inputs.system, inputs.log, inputs.known)


@pytest.mark.parametrize("moved", [True, False])
@pytest.mark.parametrize("sigma_m", [0.0, 0.5])
def test_noise_of_places_hides_what_follows_their_acceleration(
    tmp_path: Path, moved: bool, sigma_m: float
) -> None:
    view = view_of(noisy_places(sigma_m, 3, moved=moved), sigma_m, tmp_path)
    hidden = sigma_m > 0.0 and not moved
    assert acceleration_is_noise(view, 0) is hidden
    found = {one.effect.name for one in candidates(view)} & FOLLOWING
    assert found == (set() if hidden else FOLLOWING)
    assert {one.effect.name for one in hidden_by_noise(view)} >= FOLLOWING or not hidden


@pytest.mark.parametrize("seed", [5, 6])
def test_a_clean_log_of_noisy_places_has_no_flexure(tmp_path: Path, seed: int) -> None:
    """The spec's sigma is the noise's: with accelerations of the noise itself two of two had one,
    with a chance of 1e-30 and less."""
    log, spec = noisy_places(0.3, seed, moved=False), tmp_path / "spec.yaml"
    spec.write_text(its_spec(log, 0.3), encoding="utf-8")
    found = diagnose(load(spec), [log.to_csv(tmp_path / "log.csv")])
    assert [one.effect for one in found.findings if one.kind != "noise"] == []


def test_a_derived_velocity_gets_the_noise_of_its_places(tmp_path: Path) -> None:
    view = data_from(noisy_places(0.0, 3, moved=False), tmp_path).view
    (first, _) = noisier_scenes(view, np.random.default_rng(1))
    own, was = first.view.log.stages[0], view.log.stages[0]
    assert own.antenna_m is not None
    assert was.antenna_m is not None
    position = view.system.stages[0].position
    assert position is not None
    added = own.antenna_m - was.antenna_m
    assert np.all(np.std(added, axis=0) <= 1.1 * np.array(position.sigma))
    assert np.std(added) > 0.0
    slope = derived_velocity(view.log.time_s, own.antenna_m)
    assert own.velocity_track is None
    assert own.velocity_mps - was.velocity_mps == pytest.approx(
        slope - derived_velocity(view.log.time_s, was.antenna_m), abs=1e-9
    )


def test_a_part_of_a_log_that_has_no_row_is_one_block(tmp_path: Path) -> None:
    data = data_from(noisy_places(0.0, 3, moved=True), tmp_path)
    none = np.zeros(len(data.view), dtype=bool)
    assert slow_states(data).within(none, 12).count == 1
