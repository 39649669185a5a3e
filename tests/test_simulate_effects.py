"""Every effect of the dictionary acts in the Monte Carlo, with the distribution that theory says.

One noiseless stage without lever arms, so that |error| is the effect's alone; each (effect, sensor)
has an oracle: the distribution function of |error|, in closed form or by quadrature.  A new effect
fails here until it has one.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad

from syncline_design.effects import registry
from syncline_design.effects.acting import known_of
from syncline_design.effects.record import Array
from syncline_design.model.horizon import Horizon
from syncline_design.model.known import EffectEntry
from syncline_design.model.system import Platform, Sensor, Stage, System
from syncline_design.model.timing import NO_ERROR
from syncline_design.simulation import SimulationSettings, cross_check, sample_errors
from syncline_design.simulation.sampling import JOB

V, W, D = 10.0, 0.8, 50.0
T, EXTENT, TILT = 1800.0, 400.0, math.radians(20.0)
HORIZON = Horizon(T, EXTENT, TILT)
SAMPLES = 2 * JOB
Oracle = Callable[[float], float]  # P(|error| <= x)


def system(
    effect: str,
    sensor: str,
    values: dict[str, float | str],
    v: float = V,
    w: float = 0.0,
    kind: str = "usbl",
    **sigma: tuple[float, float, float],
) -> System:
    def made(role: str) -> Sensor:
        still = (0.0, 0.0, 0.0)
        return Sensor(role, role, sigma.get(role, still), NO_ERROR, type=kind)  # type: ignore[arg-type]

    stage = Stage(
        "boat", "boat", Platform(v, w, D), *map(made, ("position", "attitude", "ranging"))
    )
    entry = EffectEntry(effect, sensor, "boat", tuple(values.items()))
    return System((stage,), effects=(entry,), horizon=HORIZON)


def uniform(top: float) -> Oracle:
    """Uniform between 0 and the top."""
    return lambda x: min(x / top, 1.0)


def constant(size: float) -> Oracle:
    """One value; 1e-6 for the second order of small turns."""
    return lambda x: float(x >= size * (1.0 - 1e-6)) if x < size * (1.0 + 1e-6) else 1.0


def swept(angle_rad: float) -> Oracle:
    """A chord about a fixed axis of a vector D in a random direction: D 2 sin(a/2) sin(theta)."""
    radius = 2.0 * D * math.sin(0.5 * angle_rad)
    return lambda x: sin_theta(x / radius)


def sin_theta(x: float) -> float:
    """P(sin theta <= x), theta between isotropic directions."""
    return 1.0 - math.sqrt(1.0 - min(x, 1.0) ** 2)


def times(part: Oracle, density: Callable[[float], float], top: float) -> Oracle:
    """Product of a variate with distribution `part` and one of the density on 0 .. top."""
    return lambda x: quad(lambda s: density(s) * part(x / s), 0.0, top, limit=300)[0]


def half_normal(std: float) -> Oracle:
    return lambda x: math.erf(x / (std * math.sqrt(2.0)))


def maxwell(std: float) -> Oracle:
    return lambda x: float(stats.chi(3).cdf(x / std))


def cap(lever_m: float) -> Oracle:
    """lever |u_x|, u uniform on the cap of half-angle TILT: share of each circle of latitude."""

    def share(z: float, x: float) -> float:
        return 2.0 / math.pi * math.asin(min(x / (lever_m * math.sqrt(1.0 - z * z)), 1.0))

    low = math.cos(TILT)
    return lambda x: quad(share, low, 1.0, args=(x,), limit=300)[0] / (1.0 - low)


def half_cosine(x: float) -> float:
    """P(|cos psi| <= x), psi uniform."""
    return 2.0 / math.pi * math.asin(min(x, 1.0))


def sin_density(s: float) -> float:
    """Density of sin theta."""
    return s / math.sqrt(1.0 - s * s)


SMALL = 0.004  # rad
A_WHILE = {"from_s": 0.3 * T, "to_s": 0.5 * T}


def for_a_while(law: Callable[[float], Oracle], sigma: float) -> Oracle:
    """Three times as large in a fifth of the mission."""
    usual, grown = law(sigma), law(3.0 * sigma)
    return lambda x: 0.8 * usual(x) + 0.2 * grown(x)


STRAIGHT, TURN = {"v": V, "w": 0.0}, {"v": 0.0, "w": W}
NOISY = {"position": (0.02,) * 3, "attitude": (1e-4,) * 3, "ranging": (0.03, 0.0, 0.0)}
ROTATION = {"x_rad": SMALL * 2 / 7, "y_rad": SMALL * 3 / 7, "z_rad": -SMALL * 6 / 7}
LEVER = {"x_m": 0.2, "y_m": -0.3, "z_m": 0.6}
Case = tuple[dict[str, float | str], dict[str, object], Oracle]
CASES: dict[tuple[str, str], Case] = {
    ("latency", "position"): ({"latency_s": 0.03}, STRAIGHT, constant(V * 0.03)),
    ("latency", "attitude"): ({"latency_s": 0.03}, TURN, swept(W * 0.03)),
    ("latency", "ranging"): ({"latency_s": 0.03}, STRAIGHT, constant(V * 0.03)),
    ("clock_drift", "position"): ({"rate": 1e-4}, STRAIGHT, uniform(V * 1e-4 * T)),
    ("clock_drift", "attitude"): (
        {"rate": 2e-6}, TURN, times(uniform(D * W * 2e-6 * T), sin_density, 1.0)
    ),
    ("timestamp_step", "position"): (
        {"step_s": 0.2, "time_s": 0.3 * T}, STRAIGHT, lambda x: 0.3 if x < 0.2 * V - 1e-9 else 1.0
    ),
    ("timestamp_step", "attitude"): (
        {"step_s": 0.02, "time_s": 0.3 * T}, TURN, lambda x: 0.3 + 0.7 * swept(W * 0.02)(x)
    ),
    ("clock_drift", "ranging"): ({"rate": 1e-4}, STRAIGHT, uniform(V * 1e-4 * T)),
    ("timestamp_step", "ranging"): (
        {"step_s": 0.2, "time_s": 0.3 * T}, STRAIGHT, lambda x: 0.3 if x < 0.2 * V - 1e-9 else 1.0
    ),
    ("timestamp_jitter", "ranging"): ({"std_s": 0.01}, STRAIGHT, half_normal(0.01 * V)),
    ("echo_delay", "ranging"): ({"share": 1.5}, STRAIGHT, constant(V * 1.5 * D / 1500.0)),
    ("squat", "position"): ({"sinkage_m": 0.01}, STRAIGHT, constant(0.01 * V**2)),
    ("tide", "position"): ({"rate_mps": 5e-4}, STRAIGHT, uniform(5e-4 * T)),
    ("noise_episode", "position"): ({"factor": 3.0, **A_WHILE}, NOISY, for_a_while(maxwell, 0.02)),
    ("noise_episode", "attitude"): (
        {"factor": 3.0, **A_WHILE},
        NOISY,
        for_a_while(lambda s: lambda x: float(stats.chi(2).cdf(x / s)), 1e-4 * D),
    ),
    ("noise_episode", "ranging"): (
        {"factor": 3.0, **A_WHILE}, NOISY, for_a_while(half_normal, 0.03)
    ),
    ("heading_soft_iron", "attitude"): (
        {"sin_rad": 3e-4, "cos_rad": 4e-4},
        STRAIGHT,
        times(lambda x: half_cosine(x / (D * 5e-4)), sin_density, 1.0),
    ),
    ("integer_second_slip", "position"): ({"seconds": -2.0}, STRAIGHT, constant(2.0 * V)),
    ("timestamp_jitter", "position"): ({"std_s": 0.01}, STRAIGHT, half_normal(0.01 * V)),
    ("timestamp_jitter", "attitude"): (
        {"std_s": 1e-4}, TURN, times(half_normal(D * W * 1e-4), sin_density, 1.0)
    ),
    ("packetised_timestamps", "position"): ({"interval_s": 0.02}, STRAIGHT, uniform(V * 0.02)),
    ("packetised_timestamps", "attitude"): (
        {"interval_s": 2e-3}, TURN, times(uniform(D * W * 2e-3), sin_density, 1.0)
    ),
    ("filter_lag", "position"): ({"time_constant_s": 0.3}, STRAIGHT, constant(V * 0.3)),
    ("lever_arm", "position"): (LEVER, STRAIGHT, constant(0.7)),
    ("lever_arm", "ranging"): (LEVER, STRAIGHT, constant(0.7)),
    ("boresight", "ranging"): (ROTATION, STRAIGHT, swept(SMALL)),
    ("mounting", "attitude"): (ROTATION, STRAIGHT, swept(SMALL)),
    ("range_bias", "ranging"): ({"bias_m": -0.4}, STRAIGHT, constant(0.4)),
    ("range_scale", "ranging"): ({"scale": 0.01}, STRAIGHT, constant(0.01 * D)),
    ("azimuth_bias", "ranging"): ({"bias_rad": 0.1}, STRAIGHT, swept(0.1)),
    ("elevation_bias", "ranging"): (
        {"bias_rad": 0.1}, STRAIGHT, constant(2.0 * D * math.sin(0.05))
    ),
    ("heading_bias", "attitude"): ({"bias_rad": 0.1}, STRAIGHT, swept(0.1)),
    ("heading_hard_iron", "attitude"): (
        {"sin_rad": 3e-4, "cos_rad": 4e-4},
        STRAIGHT,
        times(lambda x: half_cosine(x / (D * 5e-4)), sin_density, 1.0),
    ),
    ("heading_drift", "attitude"): (
        {"rate_radps": 1e-6}, STRAIGHT, times(uniform(D * 1e-6 * T), sin_density, 1.0)
    ),
    ("noise_understated", "position"): ({"factor": 3.0}, NOISY, maxwell(0.06)),
    ("noise_understated", "attitude"): (
        {"factor": 3.0}, NOISY, lambda x: float(stats.chi(2).cdf(x / (3e-4 * D)))
    ),
    ("noise_understated", "ranging"): ({"factor": 3.0}, NOISY, half_normal(0.09)),
    ("correlated_noise", "position"): (
        {"std_m": 0.3, "time_constant_s": 60.0}, STRAIGHT, maxwell(0.3)
    ),
    ("height_drift", "position"): (
        {"std_m": 0.3, "time_constant_s": 9e3}, STRAIGHT, half_normal(0.3)
    ),
    ("datum_offset", "target"): (
        {"north_m": 0.2, "east_m": -0.3, "down_m": 0.6}, STRAIGHT, constant(0.7)
    ),
    ("grid_scale", "target"): (
        {"scale": 1e-3}, STRAIGHT, lambda x: min(x / (1e-3 * EXTENT), 1.0) ** 2
    ),
    ("grid_convergence", "target"): (
        {"rotation_rad": 1e-3}, STRAIGHT, lambda x: min(x / (1e-3 * EXTENT), 1.0) ** 2
    ),
    ("scan_distortion", "ranging"): ({"period_s": 0.1}, STRAIGHT, uniform(0.5 * 0.1 * V)),
    ("turnaround_delay", "ranging"): ({"delay_s": 1e-3}, STRAIGHT, constant(0.75)),
    ("induced_heave", "position"): ({"x_m": 4.0, "y_m": 0.0, "z_m": 0.0}, STRAIGHT, cap(4.0)),
    ("frame_convention", "attitude"): ({"convention": "yaw_180"}, STRAIGHT, swept(math.pi)),
    ("frame_convention", "ranging"): (
        {"convention": "azimuth_sign"}, STRAIGHT, uniform(2.0 * D)
    ),
}  # fmt: skip


def bent_by_sound(error: float) -> Oracle:
    """Range and sine off the array's normal (along down) times 1 + error, |sin el| uniform."""
    height = (np.arange(100_000) + 0.5) / 100_000
    elevation = np.arcsin(height)
    seen = np.arccos(np.minimum(np.cos(elevation) * (1.0 + error), 1.0))
    along = (1.0 + error) * np.stack([np.cos(seen), np.sin(seen)])
    moved = np.sort(D * np.linalg.norm(along - [np.cos(elevation), np.sin(elevation)], axis=0))
    return lambda x: float(np.searchsorted(moved, x) / moved.size)


def student_with_outliers(x: float) -> float:
    """|N| of 3 axes at 2 cm: Student's t of 4 degrees of freedom; in 10 % normal at 20 cm."""
    tail = float(stats.f(3, 4.0).cdf((x / 0.02) ** 2 / 3.0))
    return 0.9 * tail + 0.1 * float(stats.chi(3).cdf(x / 0.2))


def student_range_with_outliers(x: float) -> float:
    """The same along the line of sight alone, of 3 cm."""
    tail = 2.0 * float(stats.t(4.0).cdf(x / 0.03)) - 1.0
    return 0.9 * tail + 0.1 * half_normal(0.3)(x)


CASES |= {
    ("sound_speed", "ranging"): ({"relative_error": -0.01}, STRAIGHT, bent_by_sound(-0.01)),
    ("heavy_tails", "position"): (
        {"degrees_of_freedom": 4.0, "outlier_rate": 0.1}, NOISY, student_with_outliers
    ),
    ("heavy_tails", "ranging"): (
        {"degrees_of_freedom": 4.0, "outlier_rate": 0.1}, NOISY, student_range_with_outliers
    ),
}  # fmt: skip


def rms_of_bend() -> float:
    """C f, f = a - g u: E a_i^2 = (2/9) (v w)^2, E u_z^2 = (1 + c + c^2) / 3, c = cos(tilt)."""
    c = math.cos(TILT)
    down = (1.0 + c + c * c) / 3.0
    push, pull = 2.0 / 9.0 * (V * W) ** 2, 9.80665**2
    side = push + pull * 0.5 * (1.0 - down)
    return math.sqrt((0.02**2 + 0.01**2) * side + 0.03**2 * (push + pull * down))


def rms_of_tilt() -> float:
    """gain |z x a / g x q|, a = w x v, all isotropic: three factors sqrt(2/3)."""
    return 0.01 * D * V * W / 9.80665 * math.sqrt(8.0 / 27.0)


def rms_of_enu() -> float:
    """Antenna p = place - D n: (e - n, n - e, -2 d), E (n - e)^2 = 2 (extent^2 / 4 + D^2 / 3)."""
    return math.sqrt(4.0 * (EXTENT**2 / 4.0 + D**2 / 3.0) + 4.0 * D**2 / 3.0)


MOVING = {"v": V, "w": W}
RMS_CASES: dict[tuple[str, str], tuple[dict[str, float | str], dict[str, object], float]] = {
    ("acceleration_tilt", "attitude"): ({"gain": 0.01}, MOVING, rms_of_tilt()),
    ("flexure", "ranging"): ({"x": 0.02, "y": -0.01, "z": 0.03}, MOVING, rms_of_bend()),
    ("frame_convention", "position"): ({"convention": "enu"}, STRAIGHT, rms_of_enu()),
}


def made(
    effect: str, sensor: str, values: dict[str, float | str], how: dict[str, object]
) -> System:
    """The system of a case; of noises only the sensor's own."""
    if how is NOISY:
        return system(effect, sensor, values, **{sensor: NOISY[sensor]})
    return system(effect, sensor, values, **how)  # type: ignore[arg-type]


def lengths(of: System, envelope: str = "limits", seed: int = 5) -> Array:
    settings = SimulationSettings(samples=SAMPLES, seed=seed, envelope=envelope)  # type: ignore[arg-type]
    return np.linalg.norm(sample_errors(of, settings), axis=1)


def agrees(found: Array, oracle: Oracle) -> None:
    """Kolmogorov's distance at 40 places: above 2.3 / sqrt(n) by chance one time in 20 000."""
    places = np.quantile(found, np.linspace(0.01, 0.99, 40)) * (1.0 + 1e-7)
    for x in places:
        share = np.count_nonzero(found <= x) / found.size
        assert abs(share - oracle(float(x))) < 2.3 / math.sqrt(found.size)


@pytest.mark.parametrize("pair", sorted(CASES), ids="-".join)
def test_the_monte_carlo_sees_the_effect_as_it_is(pair: tuple[str, str]) -> None:
    values, how, oracle = CASES[pair]
    agrees(lengths(made(*pair, values, how)), oracle)


@pytest.mark.parametrize("pair", sorted(RMS_CASES), ids="-".join)
def test_the_monte_carlo_has_the_effect_s_rms(pair: tuple[str, str]) -> None:
    """Five standard errors of the mean square."""
    values, how, rms = RMS_CASES[pair]
    square = lengths(made(*pair, values, how)) ** 2
    assert abs(square.mean() - rms**2) < 5.0 * square.std() / math.sqrt(square.size)


def test_every_effect_has_an_oracle() -> None:
    known = {(e.name, sensor) for e in registry().values() for sensor in e.sensors}
    assert known == set(CASES) | set(RMS_CASES)


def test_inside_the_limits_speed_is_a_factor_of_what_motion_carries() -> None:
    """Speed uniform below v: V U rate T U' has P = z (1 - ln z); a grid does not mind the speed."""
    drift = made("clock_drift", "position", {"rate": 1e-4}, STRAIGHT)
    top = V * 1e-4 * T
    agrees(
        lengths(drift, "inside"), lambda x: min(x / top, 1.0) * (1 - math.log(min(x / top, 1.0)))
    )
    grid = made("grid_scale", "target", {"scale": 1e-3}, STRAIGHT)
    agrees(lengths(grid, "inside"), lambda x: min(x / (1e-3 * EXTENT), 1.0) ** 2)


def test_intervals_of_slow_noise_hold_what_they_promise() -> None:
    """95 % intervals of the 0.95 quantile, 60 seeds: fewer than 50 of 60 is one in 30 000."""
    slow = made("correlated_noise", "position", {"std_m": 0.3, "time_constant_s": 60.0}, STRAIGHT)
    truth = 0.3 * float(stats.chi(3).ppf(0.95))
    held = 0
    for seed in range(60):
        found = cross_check(slow, SimulationSettings(samples=2000, seed=seed)).monte_carlo.quantile(
            0.95
        )
        held += found.low_m <= truth <= found.high_m
    assert held >= 50


def test_a_late_ranging_sensor_is_late_for_the_stage_it_carries() -> None:
    """A vessel at rest, its USBL 0.2 s old: the AUV's fix is 0.2 s behind at 2 m/s."""
    (vessel,) = made("latency", "ranging", {"latency_s": 0.2}, {"v": 0.0, "w": 0.0}).stages
    (carried,) = made("latency", "ranging", {"latency_s": 0.2}, {"v": 2.0, "w": 0.0}).stages
    carried = dataclasses.replace(carried, name="auv", vehicle="auv", position=None)
    entry = EffectEntry("latency", "ranging", "boat", (("latency_s", 0.2),))
    chain = System((vessel, carried), effects=(entry,), horizon=HORIZON)
    for envelope in ("limits", "trajectory"):
        settings = SimulationSettings(samples=500, envelope=envelope, trajectory=None)
        found = np.linalg.norm(sample_errors(chain, settings), axis=1)
        np.testing.assert_allclose(found, 0.4, rtol=1e-9)
    assert known_of(chain).extra_tau_s == {("boat", "ranging"): 0.2}


def test_along_a_file_time_counts_from_its_start(tmp_path: Path) -> None:
    """Due north at 10 m/s, stamps from 5 000 s on for 100 s: the lag is v rate (t - 5 000)."""
    lines = ["time_s,position_north_m,position_east_m,position_down_m,roll_deg,pitch_deg,yaw_deg"]
    lines += [f"{5000 + k},{10 * k},0,0,0,0,0" for k in range(101)]
    path = tmp_path / "north.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    drift = made("clock_drift", "position", {"rate": 1e-3}, STRAIGHT)
    settings = SimulationSettings(samples=SAMPLES, envelope="trajectory", trajectory=path)
    agrees(np.linalg.norm(sample_errors(drift, settings), axis=1), uniform(10.0 * 1e-3 * 100.0))


def test_a_manoeuvre_is_repeated_all_through_the_mission_and_its_extent() -> None:
    settings = SimulationSettings(samples=SAMPLES, envelope="trajectory", trajectory="straight")
    for effect, sensor, values in (
        ("clock_drift", "position", {"rate": 1e-4}),
        ("grid_scale", "target", {"scale": 1e-3}),
        ("correlated_noise", "position", {"std_m": 0.3, "time_constant_s": 60.0}),
    ):
        found = np.linalg.norm(
            sample_errors(made(effect, sensor, values, STRAIGHT), settings), axis=1
        )
        agrees(found, CASES[effect, sensor][2])


def test_an_effect_leaves_the_other_random_numbers_alone() -> None:
    """The same noise with an effect of no size: sample by sample."""
    noise = {"position": (0.02, 0.03, 0.05), "attitude": (1e-3,) * 3, "ranging": (0.03, 1e-3, 1e-3)}
    still = system("range_bias", "ranging", {"bias_m": 0.0}, V, W, **noise)
    settings = SimulationSettings(samples=3000, seed=3)
    plain = sample_errors(dataclasses.replace(still, effects=()), settings)
    np.testing.assert_allclose(sample_errors(still, settings), plain, atol=1e-12)
