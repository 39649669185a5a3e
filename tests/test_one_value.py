"""A cause is one value wherever the vehicle goes; what is not stands for something else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis import DiagnosisSettings, diagnose
from syncline_design.diagnosis.result import Diagnosis, Finding
from tests.world import Hidden, hidden, make_log, scenario
from tests.world.worldlog import WorldLog

SCALE = hidden("range_scale", "ranging", scale=2e-3)
BIAS = hidden("range_bias", "ranging", bias_m=0.05)
SWEEP = hidden("scan_distortion", "ranging", period_s=0.03)
JITTER = hidden("timestamp_jitter", "position", std_s=0.006)


def log_of(effect: Hidden) -> WorldLog:
    return make_log(scenario("car_stops", 6, 80.0, 6.0), (effect,))


def asked(log: WorldLog, folder: Path, less: tuple[str, ...] = ()) -> Diagnosis:
    spec = folder / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    settings = DiagnosisSettings(exclude_effects=less, unseen_block=False)
    return diagnose(spec, [log.to_csv(folder / "log.csv")], settings)


def of_range(found: Diagnosis, name: str) -> Finding:
    return next(one for one in found.findings if one.effect == name)


def test_a_scale_that_may_not_be_named_is_no_bias_of_the_range(tmp_path: Path) -> None:
    """The bias that is named changes with the range by std(range) / mean(range) of itself."""
    log = log_of(SCALE)
    found = asked(log, tmp_path, ("range_scale", "sound_speed"))
    one = of_range(found, "range_bias")
    assert (one.kind, found.verdict) == ("stand_in", "unexplained")
    assert found.effects_entries() == ()
    assert "it changes with the range, by " in one.sentence
    range_m = log.columns["range_m"]
    told = float(one.sentence.split("range, by ")[1].split(" %")[0]) / 100.0
    assert told == pytest.approx(float(np.std(range_m) / np.mean(range_m)), rel=0.25)


@pytest.mark.parametrize("seed", [6, 7])
def test_a_scale_of_ranges_that_hardly_vary_is_no_bias_either(seed: int, tmp_path: Path) -> None:
    """A multirotor's ranges vary by an eighth: what is proportional to them changes by no more."""
    log = make_log(scenario("multirotor_lines", seed, 150.0, 10.0), (SCALE,))
    range_m = log.columns["range_m"]
    assert np.std(range_m) < 0.2 * np.mean(range_m)
    found = asked(log, tmp_path, ("range_scale", "sound_speed"))
    one = of_range(found, "range_bias")
    assert (one.kind, found.verdict) == ("stand_in", "unexplained")
    assert "it changes with the range, by " in one.sentence


@pytest.mark.parametrize("seed", [6, 7])
def test_a_bias_of_ranges_that_hardly_vary_keeps_its_name(seed: int, tmp_path: Path) -> None:
    log = make_log(scenario("multirotor_lines", seed, 150.0, 10.0), (BIAS,))
    one = of_range(asked(log, tmp_path, ("range_scale", "sound_speed")), "range_bias")
    assert one.kind == "cause"


def test_a_sweep_that_may_not_be_named_is_no_scatter_of_stamps(tmp_path: Path) -> None:
    """A scanner's stamps are late by its bearing: that is no scatter, and azimuth shows it."""
    found = asked(log_of(SWEEP), tmp_path, ("scan_distortion",))
    scatter = [one for one in found.findings if one.effect == "timestamp_jitter"]
    assert scatter
    assert {one.kind for one in scatter} == {"stand_in"}
    assert all("it changes with the azimuth" in one.sentence for one in scatter)
    assert found.verdict == "unexplained"


@pytest.mark.parametrize("effect", [SCALE, BIAS, SWEEP, JITTER], ids=lambda e: e.effect)
def test_what_is_there_keeps_its_name(effect: Hidden, tmp_path: Path) -> None:
    found = asked(log_of(effect), tmp_path)
    one = of_range(found, effect.effect)
    assert (one.sensor, one.kind, one.material) == (effect.sensor, "cause", True)
    assert "it changes with" not in one.sentence
    assert found.verdict == "explained"


@pytest.mark.parametrize("vehicle", ["car_stops", "multirotor_lines"])
def test_a_drift_that_may_not_be_named_is_no_step(vehicle: str, tmp_path: Path) -> None:
    """A clock that drifts from the log's start on is at nothing there, as before a step."""
    drift = hidden("clock_drift", "position", rate=1.2e-4)
    log = make_log(scenario(vehicle, 6, 100.0, 5.0), (drift,))
    found = asked(log, tmp_path, ("clock_drift",))
    steps = [one for one in found.findings if one.effect == "timestamp_step"]
    assert {one.kind for one in steps} <= {"stand_in"}
    assert found.verdict == "unexplained"
    assert found.effects_entries() == ()
