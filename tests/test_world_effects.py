"""Hidden effects of the world against hand computation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.world import (
    CONSTRUCTIONS,
    DISCRETE,
    SILENT,
    STOCHASTIC,
    Hidden,
    Noise,
    hidden,
    make_log,
    scenario,
)
from tests.world.bound import cramer_rao
from tests.world.rigs import SPEED_MPS, caused, close, north_bound, run_of, standing, track
from tests.world.sensing import lagged_track
from tests.world.trajectory import GRAVITY_MPS2, Path

Array = NDArray[np.float64]
DEGREE = np.pi / 180.0


def test_attitude_latency_of_10_ms_at_90_degrees_a_second_and_10_m_is_15_7_cm() -> None:
    run = run_of(track(lambda t: [0 * t] * 3, lambda t: 0.5 * np.pi * t), [10.0, 0.0, 0.0])
    error = caused(run, hidden("latency", "attitude", latency_s=0.01))
    chord = 2.0 * 10.0 * np.sin(0.5 * 0.01 * 0.5 * np.pi)
    np.testing.assert_allclose(np.linalg.norm(error, axis=1), chord, atol=1e-7)
    assert chord == pytest.approx(0.157, abs=1e-3)
    # an old attitude points left of where a right-turning vehicle now looks: at +x, towards -y
    assert np.all(error[:, 1] < 0.0)


CLOSED_FORMS: dict[str, tuple[Path, list[float], Hidden, list[float]]] = {
    "old positions lie behind": (
        north_bound(),
        [400.0, 0.0, 3.0],
        hidden("latency", "position", latency_s=0.05),
        [-SPEED_MPS * 0.05, 0.0, 0.0],
    ),
    "old ranges put the target ahead": (
        north_bound(),
        [400.0, 0.0, 3.0],
        hidden("latency", "ranging", latency_s=0.05),
        [SPEED_MPS * 0.05, 0.0, 0.0],
    ),
    "stamps one second ahead": (
        north_bound(),
        [400.0, 0.0, 3.0],
        hidden("integer_second_slip", "position", seconds=1.0),
        [-SPEED_MPS, 0.0, 0.0],
    ),
    "a lag on a ramp": (
        north_bound(),
        [400.0, 0.0, 3.0],
        hidden("filter_lag", "position", time_constant_s=0.2),
        [-SPEED_MPS * 0.2, 0.0, 0.0],
    ),
    "an antenna further forward, heading north": (
        standing(),
        [10.0, 0.0, 0.0],
        hidden("lever_arm", "position", x_m=0.1, y_m=0.2, z_m=-0.3),
        [0.1, 0.2, -0.3],
    ),
    "a scanner further forward sees the target nearer": (
        standing(),
        [10.0, 0.0, 0.0],
        hidden("lever_arm", "ranging", x_m=0.1, y_m=0.0, z_m=0.0),
        [-0.1, 0.0, 0.0],
    ),
    "a scanner turned right sees the target on its left": (
        standing(),
        [10.0, 0.0, 0.0],
        hidden("boresight", "ranging", x_rad=0.0, y_rad=0.0, z_rad=0.02),
        [10.0 * np.cos(0.02) - 10.0, -10.0 * np.sin(0.02), 0.0],
    ),
    "an INS turned right reports more heading": (
        standing(),
        [10.0, 0.0, 0.0],
        hidden("mounting", "attitude", x_rad=0.0, y_rad=0.0, z_rad=0.02),
        [10.0 * np.cos(0.02) - 10.0, 10.0 * np.sin(0.02), 0.0],
    ),
    "heading bias": (
        standing(),
        [10.0, 0.0, 0.0],
        hidden("heading_bias", "attitude", bias_rad=0.02),
        [10.0 * np.cos(0.02) - 10.0, 10.0 * np.sin(0.02), 0.0],
    ),
    "hard iron, heading north: the cosine part": (
        standing(),
        [10.0, 0.0, 0.0],
        hidden("heading_hard_iron", "attitude", sin_rad=0.5, cos_rad=0.02),
        [10.0 * np.cos(0.02) - 10.0, 10.0 * np.sin(0.02), 0.0],
    ),
    "azimuth bias": (
        standing(),
        [10.0, 0.0, 0.0],
        hidden("azimuth_bias", "ranging", bias_rad=0.02),
        [10.0 * np.cos(0.02) - 10.0, 10.0 * np.sin(0.02), 0.0],
    ),
    "elevation bias looks up": (
        standing(),
        [10.0, 0.0, 0.0],
        hidden("elevation_bias", "ranging", bias_rad=0.02),
        [10.0 * np.cos(0.02) - 10.0, 0.0, -10.0 * np.sin(0.02)],
    ),
    "range bias": (
        standing(),
        [0.0, 10.0, 0.0],
        hidden("range_bias", "ranging", bias_m=0.3),
        [0.0, 0.3, 0.0],
    ),
    "range scale": (
        standing(),
        [0.0, 10.0, 0.0],
        hidden("range_scale", "ranging", scale=0.01),
        [0.0, 0.1, 0.0],
    ),
    "sound speed taken one per cent too high": (
        standing(),
        [0.0, 0.0, 50.0],
        hidden("sound_speed", "ranging", relative_error=0.01),
        [0.0, 0.0, 0.5],
    ),
    "a transponder that answers 1 ms late": (
        standing(),
        [0.0, 0.0, 50.0],
        hidden("turnaround_delay", "ranging", delay_s=1e-3),
        [0.0, 0.0, 0.75],
    ),
    "a beam a quarter of a scan later": (
        track(lambda t: [0 * t, SPEED_MPS * t, 0 * t], lambda t: 0 * t),
        [0.0, 2000.0, 0.0],  # to the right, azimuth 90 degrees
        hidden("scan_distortion", "ranging", period_s=0.1),
        [0.0, -SPEED_MPS * 0.1 / 4.0, 0.0],
    ),
    "heave read a metre to starboard while rolled": (
        standing(roll=10.0 * DEGREE),
        [10.0, 0.0, 0.0],
        hidden("induced_heave", "position", x_m=0.0, y_m=1.0, z_m=0.0),
        [0.0, 0.0, np.sin(10.0 * DEGREE)],
    ),
    "survey shifted north": (
        standing(),
        [10.0, 0.0, 0.0],
        hidden("datum_offset", "target", north_m=0.3, east_m=0.0, down_m=-0.1),
        [-0.3, 0.0, 0.1],
    ),
    "survey grid too large": (
        standing(),
        [1000.0, 0.0, 0.0],
        hidden("grid_scale", "target", scale=1e-4),
        [-0.1, 0.0, 0.0],
    ),
    "survey grid turned from north to east": (
        standing(),
        [1000.0, 0.0, 0.0],
        hidden("grid_convergence", "target", rotation_rad=1e-3),
        [1000.0 - 1000.0 * np.cos(1e-3), -1000.0 * np.sin(1e-3), 0.0],
    ),
}


@pytest.mark.parametrize("case", CLOSED_FORMS)
def test_closed_forms(case: str) -> None:
    path, target, effect, expected = CLOSED_FORMS[case]
    close(caused(run_of(path, target), effect), expected, within=2e-6)


def test_lever_arm_turns_with_the_vehicle() -> None:
    run = run_of(standing_east(), [0.0, 10.0, 0.0])
    effect = hidden("lever_arm", "position", x_m=0.1, y_m=0.2, z_m=0.0)
    close(caused(run, effect), [-0.2, 0.1, 0.0])


def standing_east() -> Path:
    return track(lambda t: [0 * t] * 3, lambda t: 0 * t + 0.5 * np.pi)


def test_clock_drift_and_step_grow_as_said() -> None:
    run = run_of(north_bound(), [400.0, 0.0, 3.0])
    drift = caused(run, hidden("clock_drift", "position", rate=50e-6))[:, 0]
    age_s = run.stamps_s * 50e-6 / (1.0 + 50e-6)  # the stamps are the fast clock's
    np.testing.assert_allclose(drift, -SPEED_MPS * age_s, atol=1e-9)
    step = caused(run, hidden("timestamp_step", "position", step_s=0.1, time_s=40.0))[:, 0]
    np.testing.assert_allclose(step, np.where(run.stamps_s >= 40.0, -0.8, 0.0), atol=1e-9)


def test_heading_drift_grows_from_the_first_stamp() -> None:
    run = run_of(standing(), [10.0, 0.0, 0.0])
    error = caused(run, hidden("heading_drift", "attitude", rate_radps=1e-4))
    np.testing.assert_allclose(error[:, 1], 10.0 * np.sin(1e-4 * run.stamps_s), atol=1e-9)


def test_a_pendulum_in_a_vehicle_that_speeds_up_reports_nose_up() -> None:
    run = run_of(track(lambda t: [0.5 * t**2, 0 * t, 0 * t]), [3000.0, 0.0, 0.0])
    log = make_log(run, (hidden("acceleration_tilt", "attitude", gain=1.0),), SILENT)
    expected = np.degrees(np.arctan(1.0 / GRAVITY_MPS2))
    np.testing.assert_allclose(log.columns["pitch_deg"], expected, atol=1e-6)
    np.testing.assert_allclose(log.columns["roll_deg"], 0.0, atol=1e-9)


def test_flexure_moves_the_scanner_with_acceleration() -> None:
    run = run_of(track(lambda t: [0.5 * t**2, 0 * t, 0 * t]), [9000.0, 0.0, 0.0])
    error = caused(run, hidden("flexure", "ranging", x=0.02, y=0.0, z=0.0))
    close(error, [-0.02, 0.0, 0.0], within=1e-6)


def test_lag_of_a_sine_has_the_gain_and_phase_of_a_low_pass() -> None:
    frequency, lag_s = 1.5, 0.3
    path = track(lambda t: [np.sin(frequency * t), 0 * t, 0 * t])
    time_s = np.linspace(10.0, 90.0, 500)
    found = lagged_track(path, np.zeros(3), time_s, lag_s, 0.005)[:, 0]
    gain = 1.0 / np.hypot(1.0, frequency * lag_s)
    expected = gain * np.sin(frequency * time_s - np.arctan(frequency * lag_s))
    np.testing.assert_allclose(found, expected, atol=2e-5)


def test_conventions_are_what_they_are_called() -> None:
    run = scenario("car_stops", 2, 60.0)
    plain = make_log(run, (), SILENT).columns

    def with_convention(sensor: str, convention: str) -> dict[str, Array]:
        effect = hidden("frame_convention", sensor, convention=convention)
        return make_log(run, (effect,), SILENT).columns

    enu = with_convention("position", "enu")
    np.testing.assert_array_equal(enu["position_north_m"], plain["position_east_m"])
    np.testing.assert_array_equal(enu["position_down_m"], -plain["position_down_m"])
    radians = with_convention("attitude", "radians")
    np.testing.assert_allclose(radians["roll_deg"], np.radians(plain["roll_deg"]), atol=1e-12)
    noisy = make_log(run, (hidden("frame_convention", "attitude", convention="radians"),)).columns
    spread = np.std(np.degrees(noisy["roll_deg"]) - plain["roll_deg"])  # noise before the mistake
    assert spread == pytest.approx(0.03, rel=0.2)
    sign = with_convention("ranging", "elevation_sign")
    np.testing.assert_array_equal(sign["elevation_deg"], -plain["elevation_deg"])


EXAMPLES: dict[str, dict[str, float | str]] = {
    "latency": {"latency_s": 0.05},
    "clock_drift": {"rate": 1e-4},
    "timestamp_step": {"step_s": 0.05, "time_s": 30.0},
    "integer_second_slip": {"seconds": 1.0},
    "timestamp_jitter": {"std_s": 0.005},
    "packetised_timestamps": {"interval_s": 0.02},
    "filter_lag": {"time_constant_s": 0.2},
    "lever_arm": {"x_m": 0.1, "y_m": 0.1, "z_m": 0.1},
    "boresight": {"x_rad": 0.01, "y_rad": 0.01, "z_rad": 0.01},
    "mounting": {"x_rad": 0.01, "y_rad": 0.01, "z_rad": 0.01},
    "range_bias": {"bias_m": 0.1},
    "range_scale": {"scale": 0.01},
    "azimuth_bias": {"bias_rad": 0.01},
    "elevation_bias": {"bias_rad": 0.01},
    "heading_bias": {"bias_rad": 0.01},
    "heading_hard_iron": {"sin_rad": 0.01, "cos_rad": 0.01},
    "heading_soft_iron": {"sin_rad": 0.01, "cos_rad": 0.01},
    "squat": {"sinkage_m": 0.01},
    "tide": {"rate_mps": 1e-3},
    "heading_drift": {"rate_radps": 1e-4},
    "acceleration_tilt": {"gain": 0.2},
    "flexure": {"x": 0.01, "y": 0.01, "z": 0.01},
    "noise_understated": {"factor": 2.0},
    "correlated_noise": {"std_m": 0.05, "time_constant_s": 20.0},
    "heavy_tails": {"degrees_of_freedom": 3.0},
    "datum_offset": {"north_m": 0.1, "east_m": 0.1, "down_m": 0.1},
    "height_drift": {"std_m": 0.05, "time_constant_s": 60.0},
    "grid_scale": {"scale": 1e-3},
    "grid_convergence": {"rotation_rad": 1e-3},
    "frame_convention": {"convention": "radians"},
    "scan_distortion": {"period_s": 0.1},
    "sound_speed": {"relative_error": 0.01},
    "turnaround_delay": {"delay_s": 1e-4},
    "induced_heave": {"x_m": 0.3, "y_m": 0.3, "z_m": 0.3},
}


@pytest.mark.parametrize(("effect", "sensor"), CONSTRUCTIONS)
def test_every_effect_changes_its_log_and_has_a_bound(effect: str, sensor: str) -> None:
    run = scenario("vessel_figure_eights", 4, 60.0, 5.0)
    parameters = dict(EXAMPLES[effect])
    if (effect, sensor) == ("frame_convention", "position"):
        parameters = {"convention": "enu"}
    fault = hidden(effect, sensor, **parameters)
    change = make_log(run, (fault,)).error() - make_log(run).error()
    assert np.sqrt(np.mean(change**2)) > 1e-3
    if effect not in STOCHASTIC | DISCRETE:
        bounds = cramer_rao(run, (fault,), Noise())
        assert all(np.isfinite(b) and b > 0.0 for b in bounds.values())


def test_jitter_and_packets_have_the_spread_they_claim() -> None:
    run = run_of(north_bound(), [400.0, 0.0, 3.0])
    run = replace(run, stamps_s=np.linspace(0, 100, 20_000), sighted=np.zeros(20_000, np.int64))
    jitter = caused(run, hidden("timestamp_jitter", "position", std_s=0.01))[:, 0]
    assert np.std(jitter) == pytest.approx(SPEED_MPS * 0.01, rel=5.0 / np.sqrt(40_000))
    packets = caused(run, hidden("packetised_timestamps", "position", interval_s=0.02))[:, 0]
    assert -packets.max() >= 0.0
    assert np.mean(packets) == pytest.approx(-SPEED_MPS * 0.01, rel=0.02)
    assert np.std(packets) / -np.mean(packets) == pytest.approx(1 / np.sqrt(3.0), rel=0.03)
