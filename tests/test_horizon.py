"""The horizon of a spec: what drifts, grids, heave and attitude errors are charged for."""

from __future__ import annotations

import math
from typing import Any

import pytest

from syncline_design.spec.load import BadInput, load_text
from syncline_design.spec.spec import HorizonChoice
from syncline_design.verdict.verify import CheckSettings, check_loaded

SPEC = """\
syncline: 1
name: survey boat
requirements: [{{id: ACC-1, kind: accuracy, limit: 1 km}}]
{horizon}
stages:
  - name: vessel
    platform: {{v_max: 3 m/s, omega_max: 20 deg/s, distance: 40 m, baseline: 2 m}}
    position:
      sensor: {{modality: position, sigma_position: 1 cm, primitives: [pps]}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}}}
      {antenna}
    attitude:
      sensor: {{modality: attitude, sigma_attitude: 0.1 deg, primitives: [pps]}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}}}
    ranging:
      sensor: {{modality: ranging, sigma_range: 1 cm, sigma_bearing: 0.1 deg, primitives: [pps]}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}}}
      lever_arm: [0 m, 0 m, 1.5 m]
effects:
  - {effect}
"""
HORIZON = "horizon: {duration: 20 min, extent: 300 m, tilt: 25 deg}"
ARM = "lever_arm: [3 m, 4 m, -10.5 m]"  # 13 m from the ranging sensor: longer than half of d


def verdict(effect: str, horizon: str = HORIZON, antenna: str = ARM) -> dict[str, Any]:
    text = SPEC.format(effect=effect, horizon=horizon, antenna=antenna)
    return check_loaded(load_text(text, "boat.yaml"), CheckSettings(monte_carlo=False)).to_json()


def charged_m(effect: str, **spec: str) -> float:
    """What the effect adds to the Syncline [m], against the same spec without it."""
    without = verdict("{effect: range_bias, sensor: ranging, parameters: {bias_m: 0 m}}", **spec)
    total = verdict(effect, **spec)["syncline"]["total_m"]
    return float(total - without["syncline"]["total_m"])


TILT = math.radians(25.0)
LEAN = 3.0 * math.radians(20.0) / 9.80665  # v omega / g
RATE = 3.0 + 40.0 * math.radians(20.0)
TIMED = "{{effect: {0}, sensor: {1}, parameters: {{{2}}}}}".format
CASES = [
    (TIMED("clock_drift", "position", "rate: 1e-5"), RATE * 1e-5 * 1200.0),
    (TIMED("heading_drift", "attitude", "rate_radps: 1e-6"), 1e-6 * 1200.0 * (40.0 + 13.0)),
    (TIMED("grid_scale", "target", "scale: 4e-4"), 4e-4 * 300.0),
    (TIMED("grid_convergence", "target", "rotation_rad: 3e-4"), 3e-4 * 300.0),
    (TIMED("induced_heave", "position", "x_m: 3, y_m: 4, z_m: 0"), 5.0 * math.sin(TILT)),
    (TIMED("induced_heave", "position", "x_m: 0, y_m: 0, z_m: 2"), 2.0 * (1.0 - math.cos(TILT))),
    (TIMED("heading_bias", "attitude", "bias_rad: 0.01"), 0.01 * 53.0),
    (TIMED("heading_hard_iron", "attitude", "sin_rad: 0.003, cos_rad: 0.004"), 0.005 * 53.0),
    (TIMED("mounting", "attitude", "x_rad: 0.002, y_rad: 0.003, z_rad: 0.006"), 0.007 * 53.0),
    (TIMED("acceleration_tilt", "attitude", "gain: 0.1"), 0.1 * LEAN * 53.0),
    (TIMED("azimuth_bias", "ranging", "bias_rad: 0.01"), 0.01 * 40.0),
    (TIMED("boresight", "ranging", "x_rad: 0.002, y_rad: 0.003, z_rad: 0.006"), 0.007 * 40.0),
]  # fmt: skip


@pytest.mark.parametrize(("effect", "expected"), CASES, ids=lambda v: str(v)[9:30])
def test_effects_are_charged_over_the_horizon_and_on_the_arms(effect: str, expected: float) -> None:
    assert charged_m(effect) == pytest.approx(expected, rel=1e-9)


def test_an_arm_that_is_not_given_has_the_baseline_s_length_and_any_direction() -> None:
    effect = TIMED("heading_bias", "attitude", "bias_rad: 0.01")
    assert charged_m(effect, antenna="") == pytest.approx(0.01 * (40.0 + 2.0 + 1.5), rel=1e-9)


def test_the_default_is_an_hour_a_kilometre_and_ten_degrees() -> None:
    effect = TIMED("clock_drift", "position", "rate: 1e-5")
    assert charged_m(effect, horizon="") == pytest.approx(RATE * 0.036, rel=1e-9)
    shown = verdict(effect, horizon="")["horizon"]
    assert shown == {"duration_s": 3600.0, "extent_m": 1000.0, "tilt_rad": math.radians(10.0)}
    assert HorizonChoice().horizon().tilt_rad == math.radians(10.0)


def test_single_keys_may_be_given_and_the_verdict_shows_them() -> None:
    effect = TIMED("grid_scale", "target", "scale: 1e-4")
    shown = verdict(effect, horizon="horizon: {extent: 7 km}")["horizon"]
    assert (shown["duration_s"], shown["extent_m"]) == (3600.0, 7000.0)


@pytest.mark.parametrize("key", ["duration: -1 s", "extent: 3", "tilt: 81 deg", "length: 1 m"])
def test_a_horizon_that_makes_no_sense_is_refused_at_its_place(key: str) -> None:
    with pytest.raises(BadInput) as refused:
        verdict(TIMED("range_bias", "ranging", "bias_m: 0 m"), horizon=f"horizon: {{{key}}}")
    (problem,) = refused.value.problems
    assert (problem.line, problem.path) == (4, f"horizon.{key.split(':')[0]}")
