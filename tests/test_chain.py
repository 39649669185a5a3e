"""The nonlinear chain against a slow independent one, closed forms and the paper's equations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.spatial.transform import Rotation

from syncline_design.effects.kinematics import rotation_to_euler
from syncline_design.effects.record import NOTHING, Departures, StageRows
from syncline_design.machine.random_numbers import generator
from syncline_design.simulation import kernel
from syncline_design.simulation.chain import (
    ChainNoise,
    ConstantTwist,
    rotation_exp,
    screw_displacement,
    stage_error,
)
from syncline_design.simulation.draws import RandomSource, stage_draw, timing_draws
from syncline_design.simulation.surroundings import Moment, placed_rows
from tests.simulation_systems import DEG, altered, fixed_wing, no_noise, position_only, survey


def bearing_of(azimuth: float, elevation: float) -> np.ndarray:
    """Forward turned down by -elevation about y, then right by azimuth about z."""
    return Rotation.from_euler("ZY", [azimuth, elevation]).apply([1.0, 0.0, 0.0])


def random_rows(rng: np.random.Generator, count: int, euler: np.ndarray) -> StageRows:
    rotation = Rotation.from_euler("ZYX", euler[:, ::-1]).as_matrix()
    return StageRows(
        time_s=np.arange(count, dtype=float),
        position_m=rng.normal(size=(count, 3)) * 100,
        rotation=rotation,
        euler_rad=euler,
        velocity_mps=rng.normal(size=(count, 3)) * 10,
        acceleration_mps2=np.zeros((count, 3)),
        rate_radps=rng.normal(size=(count, 3)),
        range_m=rng.uniform(1, 1000, count),
        azimuth_rad=rng.uniform(-3, 3, count),
        elevation_rad=rng.uniform(-1.5, 1.5, count),
        antenna_m=rng.normal(size=(count, 3)),
        ranging_m=rng.normal(size=(count, 3)),
        target_m=np.zeros((count, 3)),
    )


def random_noise(rng: np.random.Generator, count: int, shift_s: float) -> ChainNoise:
    shift = [rng.normal(size=count) * shift_s for _ in range(3)]
    return ChainNoise(
        rng.normal(size=(count, 3)),
        rng.normal(size=(count, 3)) * 0.05,
        rng.normal(size=count),
        rng.normal(size=count) * 0.05,
        rng.normal(size=count) * 0.05,
        *shift,
    )


def random_departures(rng: np.random.Generator, count: int) -> Departures:
    def vector(size: float) -> np.ndarray:
        return rng.normal(size=(count, 3)) * size

    def scalar(size: float) -> np.ndarray:
        return rng.normal(size=count) * size

    return Departures(
        position_shift_s=scalar(0.1),
        attitude_shift_s=scalar(0.1),
        ranging_shift_s=scalar(0.1),
        antenna_m=vector(0.5),
        ranging_m=vector(0.5),
        attitude_rotation_rad=vector(0.05),
        attitude_euler_rad=vector(0.05),
        bearing_rotation_rad=vector(0.05),
        position_m=vector(1.0),
        range_m=scalar(1.0),
        range_scale=scalar(0.01),
        azimuth_rad=scalar(0.05),
        elevation_rad=scalar(0.05),
        target_m=vector(1.0),
    )


def slow_error(rows: StageRows, noise: ChainNoise, world: Departures, k: int) -> np.ndarray:
    """One sample, the words of model.md with SciPy's rotations and numerical integration."""

    def row(values: np.ndarray) -> np.ndarray:
        return values[min(k, len(values) - 1)]

    true = Rotation.from_euler("ZYX", rows.euler_rad[k][::-1])
    w, v = rows.rate_radps[k].copy(), rows.velocity_mps[k].copy()
    measured_at = noise.mu_ranging_s[k] + row(world.ranging_shift_s)
    s_p = noise.mu_position_s[k] + row(world.position_shift_s) - measured_at
    s_a = noise.mu_attitude_s[k] + row(world.attitude_shift_s) - measured_at

    def turned(s: float) -> Rotation:
        return true * Rotation.from_rotvec(w * s)

    moved = quad_vec(lambda u: turned(u).apply(v), 0.0, s_p, epsabs=1e-12, epsrel=1e-12)[0]
    l_g, l_l = rows.antenna_m[k].copy(), rows.ranging_m[k].copy()
    antenna = moved + turned(s_p).apply(l_g + row(world.antenna_m))
    antenna = antenna + noise.position_m[k] + row(world.position_m)
    seen = turned(s_a) * Rotation.from_rotvec(row(world.attitude_rotation_rad))
    angles = seen.as_euler("ZYX")[::-1] + noise.attitude_rad[k] + row(world.attitude_euler_rad)
    measured = Rotation.from_euler("ZYX", angles[::-1])
    n = bearing_of(rows.azimuth_rad[k], rows.elevation_rad[k])
    truly = rows.range_m[k] * n
    n = Rotation.from_rotvec(-row(world.bearing_rotation_rad)).apply(n)
    azimuth = math.atan2(n[1], n[0]) + noise.azimuth_rad[k] + row(world.azimuth_rad)
    elevation = math.asin(-n[2]) + noise.elevation_rad[k] + row(world.elevation_rad)
    r = rows.range_m[k] * (1 + row(world.range_scale)) + row(world.range_m) + noise.range_m[k]
    estimate = antenna - measured.apply(l_g)
    estimate = estimate + measured.apply(l_l + r * bearing_of(azimuth, elevation))
    return estimate - true.apply(l_l + row(world.ranging_m) + truly) - row(world.target_m)


@pytest.mark.parametrize("shift_s", [1e-4, 0.1, 10.0])
@pytest.mark.parametrize("with_departures", [False, True])
def test_chain_agrees_with_the_slow_implementation(shift_s: float, with_departures: bool) -> None:
    rng = np.random.default_rng(1)
    count = 25
    euler = rng.uniform([-3, -1.4, -3], [3, 1.4, 3], (count, 3))
    rows, noise = random_rows(rng, count, euler), random_noise(rng, count, shift_s)
    world = random_departures(rng, count) if with_departures else NOTHING
    motion = ConstantTwist(rows.rotation, rows.velocity_mps, rows.rate_radps)
    fast = stage_error(rows, motion, noise, world)
    slow = np.array([slow_error(rows, noise, world, k) for k in range(count)])
    np.testing.assert_allclose(fast, slow, atol=2e-9, rtol=0)


def drawn(system, index: int = 0, inside: bool = False, count: int = 2000, seed: int = 3):
    source = RandomSource(generator(seed, 9), count)
    return stage_draw(system, index, timing_draws(system, source), source, inside)


def level_rows(draw: kernel.Draw):
    """The draw for the row-wise chain: level, at the start, the object at the origin."""
    count = draw.bearing.shape[1]
    return placed_rows(draw, Moment(np.zeros(count), np.zeros((2, count))), np.zeros((2, count)))


@pytest.mark.parametrize("scale", [0.0, 1.0, 1e3, 3e4])
@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize(
    "system", [fixed_wing(), survey(), position_only()], ids=["wing", "survey", "car"]
)
def test_kernel_agrees_with_chain(system, inside: bool, scale: float) -> None:
    for index, stage in enumerate(system.stages):
        draw = drawn(system, index, inside)
        for shift in (draw.mu_position_s, draw.mu_attitude_s, draw.mu_ranging_s):
            shift *= scale
        carried = generator(4, index).normal(size=(3, 2000))
        rows, motion, noise = level_rows(draw)
        expected = stage_error(rows, motion, noise, carried_m=carried.T).T
        found = kernel.stage_error(draw, carried)
        size = max(1.0, stage.platform.distance_m, float(np.abs(expected).max()))
        np.testing.assert_allclose(found, expected, atol=1e-12 * size, rtol=0)


@pytest.mark.filterwarnings("ignore:Gimbal lock")
def test_kernel_agrees_with_chain_at_gimbal_lock() -> None:
    draw = drawn(fixed_wing(), count=400)
    draw.rate_radps[:] = np.array([[0.0], [math.pi / 2], [0.0]])
    draw.mu_position_s[:], draw.mu_ranging_s[:] = 0.2, 0.0
    draw.mu_attitude_s[:200], draw.mu_attitude_s[200:] = 1.0, -1.0
    rows, motion, noise = level_rows(draw)
    expected = stage_error(rows, motion, noise).T
    np.testing.assert_allclose(kernel.stage_error(draw), expected, atol=1e-9, rtol=0)
    # noiseless, lock or not: the measured rotation is the turned one
    quiet = no_noise(400)
    quiet = ChainNoise(
        *(getattr(quiet, f) for f in ChainNoise.__slots__[:5]),
        noise.mu_position_s,
        noise.mu_attitude_s,
        noise.mu_ranging_s,
    )
    slow = [slow_error(rows, quiet, NOTHING, k) for k in (0, 1, 200, 201)]
    fast = stage_error(rows, motion, quiet)[[0, 1, 200, 201]]
    np.testing.assert_allclose(fast, slow, atol=1e-6, rtol=0)


def test_kernel_agrees_with_chain_straight_up_and_down() -> None:
    """Lines of sight at the zenith, at the nadir and almost there."""
    draw = drawn(fixed_wing(), count=600)
    for columns, z in ((slice(0, 200), 1.0), (slice(200, 400), -1.0)):
        draw.bearing[:, columns] = np.array([[0.0], [0.0], [z]])
    draw.bearing[:, 400:] = np.array([[3e-9], [-4e-9], [1.0]])
    draw.angle_noise_rad[3:] *= 100.0
    rows, motion, noise = level_rows(draw)
    expected = stage_error(rows, motion, noise).T
    np.testing.assert_allclose(kernel.stage_error(draw), expected, atol=1e-10, rtol=0)


def test_euler_angles_at_gimbal_lock_give_the_rotation_back() -> None:
    for pitch in (math.pi / 2, -math.pi / 2):
        rotation = Rotation.from_euler("ZYX", [0.7, pitch, 0.3]).as_matrix()
        angles = rotation_to_euler(rotation[None])[0]
        back = Rotation.from_euler("ZYX", angles[::-1]).as_matrix()
        np.testing.assert_allclose(back, rotation, atol=1e-8)


def plain_rows(**changes) -> StageRows:
    """One level row at rest: object straight ahead at 10 m, no lever arms."""
    zero, zero3 = np.zeros(1), np.zeros((1, 3))
    fields = {
        "time_s": zero,
        "position_m": zero3,
        "rotation": np.eye(3)[None],
        "euler_rad": zero3,
        "velocity_mps": zero3,
        "acceleration_mps2": zero3,
        "rate_radps": zero3,
        "range_m": np.array([10.0]),
        "azimuth_rad": zero,
        "elevation_rad": zero,
        "antenna_m": zero3,
        "ranging_m": zero3,
        "target_m": np.array([[10.0, 0.0, 0.0]]),
    }
    fields.update({k: np.atleast_1d(np.asarray(v, dtype=float)) for k, v in changes.items()})
    return StageRows(**fields)


def error_of(rows: StageRows, position_s: float = 0.0, attitude_s: float = 0.0) -> np.ndarray:
    quiet = no_noise(1)
    noise = ChainNoise(
        *(getattr(quiet, f) for f in ChainNoise.__slots__[:5]),
        np.array([position_s]),
        np.array([attitude_s]),
        np.zeros(1),
    )
    motion = ConstantTwist(rows.rotation, rows.velocity_mps, rows.rate_radps)
    return stage_error(rows, motion, noise)[0]


def test_pure_rotation() -> None:
    """10 ms at 90 deg/s and 10 m: chord 2 d sin(w tau / 2) = 15.7 cm, to the right."""
    error = error_of(plain_rows(rate_radps=[[0, 0, 90 * DEG]]), attitude_s=0.01)
    angle = 0.9 * DEG
    np.testing.assert_allclose(
        error, [10 * math.cos(angle) - 10, 10 * math.sin(angle), 0], atol=1e-15
    )
    assert np.linalg.norm(error) == pytest.approx(0.157, abs=5e-4)
    assert np.linalg.norm(error) == pytest.approx(20 * math.sin(angle / 2), rel=1e-12)


def test_pure_translation() -> None:
    """100 ms at 5 km/h: 13.9 cm, straight ahead."""
    error = error_of(plain_rows(velocity_mps=[[5 / 3.6, 0, 0]]), position_s=0.1)
    np.testing.assert_allclose(error, [5 / 36, 0, 0], atol=1e-15)
    assert np.linalg.norm(error) == pytest.approx(0.14, abs=2e-3)


def test_a_quarter_circle() -> None:
    """Speed v, turn rate w: after a quarter turn the vehicle is at (v/w, v/w)."""
    rows = plain_rows(velocity_mps=[[2.0, 0, 0]], rate_radps=[[0, 0, 0.5]])
    error = error_of(rows, position_s=math.pi)
    np.testing.assert_allclose(error, [4.0, 4.0, 0.0], atol=1e-14)


def test_antenna_on_a_lever_arm_swings() -> None:
    """l_G ahead by 2 m, position a quarter turn late: antenna off by (-2, 2)."""
    rows = plain_rows(antenna_m=[[2.0, 0, 0]], rate_radps=[[0, 0, math.pi / 2]])
    np.testing.assert_allclose(error_of(rows, position_s=1.0), [-2, 2, 0], atol=1e-14)


def test_common_shift_of_a_pure_rotation_turns_the_whole() -> None:
    """Both late by the same: the estimate is where the object would be after the turn."""
    rows = plain_rows(antenna_m=[[2.0, 0, 0]], rate_radps=[[0, 0, math.pi / 2]])
    np.testing.assert_allclose(error_of(rows, 1.0, 1.0), [-10, 10, 0], atol=1e-14)


def test_object_straight_down() -> None:
    """Elevation is positive upward in n = [.., .., -sin el]: -90 deg is down; roll moves it."""
    rows = plain_rows(elevation_rad=-math.pi / 2, rate_radps=[[math.pi / 2, 0, 0]])
    np.testing.assert_allclose(error_of(rows, attitude_s=1.0), [0, -10, -10], atol=1e-14)


@pytest.mark.parametrize("shift_s", [0.0, 1e-9, 10.0])
def test_nothing_moves_without_velocity_and_rate(shift_s: float) -> None:
    rows = plain_rows(antenna_m=[[1.0, 2.0, 3.0]], ranging_m=[[0.1, 0.2, 0.3]])
    np.testing.assert_array_less(np.abs(error_of(rows, shift_s, -shift_s)), 1e-14)


@pytest.mark.parametrize("system", [fixed_wing(), survey()], ids=["wing", "survey"])
def test_no_shift_and_no_noise_is_no_error(system) -> None:
    draw = drawn(system)
    for field in (draw.mu_position_s, draw.mu_attitude_s, draw.mu_ranging_s):
        field[:] = 0.0
    for field in (draw.position_noise_m, draw.angle_noise_rad, draw.range_noise_m):
        field[:] = 0.0
    distance = system.stages[0].platform.distance_m
    assert np.abs(kernel.stage_error(draw)).max() < 4e-15 * distance


@pytest.mark.parametrize("changes", [{"v_max_mps": 0.0}, {"omega_max_radps": 0.0}])
def test_zero_speed_and_zero_rate(changes) -> None:
    draw = drawn(altered(fixed_wing(), **changes))
    rows, motion, noise = level_rows(draw)
    expected = stage_error(rows, motion, noise).T
    np.testing.assert_allclose(kernel.stage_error(draw), expected, atol=1e-10, rtol=0)


def linearised(rows: StageRows, s_p: np.ndarray, s_a: np.ndarray) -> np.ndarray:
    """The paper's first-order equations without noise.

    eq:meas_gnss: p + R (v + S(w) l_G) mu; eq:meas_ins: R + R S(w) mu;
    eq:analytic_direct_georef puts them together.
    """
    out = np.empty((len(rows), 3))
    for k in range(len(rows)):
        R, w = rows.rotation[k], rows.rate_radps[k]
        S = np.cross(np.eye(3), w)
        l_g, l_l = rows.antenna_m[k], rows.ranging_m[k]
        b = rows.range_m[k] * bearing_of(rows.azimuth_rad[k], rows.elevation_rad[k])
        gnss = R @ l_g + R @ (rows.velocity_mps[k] + S @ l_g) * s_p[k]
        ins = R + R @ S * s_a[k]
        out[k] = gnss + ins @ (l_l - l_g + b) - R @ (l_l + b)
    return out


def test_remainder_of_the_linearised_equations_has_slope_two() -> None:
    """|nonlinear - linearised| falls with tau squared: slope 2 +- 0.02 over three decades."""
    rng = np.random.default_rng(5)
    count = 40
    rows = random_rows(rng, count, rng.uniform(-1, 1, (count, 3)))
    motion = ConstantTwist(rows.rotation, rows.velocity_mps, rows.rate_radps)
    zero = no_noise(count)
    taus = np.array([1e-2, 1e-3, 1e-4, 1e-5])
    remainders = []
    for tau in taus:
        s_p, s_a = np.full(count, tau), np.full(count, -0.7 * tau)
        noise = ChainNoise(
            zero.position_m, zero.attitude_rad, zero.range_m, zero.range_m, zero.range_m,
            s_p, s_a, zero.range_m,
        )  # fmt: skip
        difference = stage_error(rows, motion, noise) - linearised(rows, s_p, s_a)
        remainders.append(np.linalg.norm(difference))
    slopes = np.diff(np.log(remainders)) / np.diff(np.log(taus))
    np.testing.assert_allclose(slopes, 2.0, atol=0.02)


def test_series_and_closed_form_meet() -> None:
    """Rotation and displacement terms on both sides of every switch, against mpmath."""
    import mpmath

    mpmath.mp.dps = 40
    angles = np.array([0.0, 1e-12, 1e-5, 0.3, 0.999, 1.001, 3.1, 40.0])
    found = kernel.rotation_terms(angles**2)
    alone = [kernel.rotation_terms(np.array([a * a])) for a in angles]
    for i, angle in enumerate(angles):
        a = mpmath.mpf(float(angle))
        expected = (
            [mpmath.mpf(1), mpmath.mpf(1) / 2, mpmath.mpf(1) / 6]
            if a == 0
            else [mpmath.sin(a) / a, (1 - mpmath.cos(a)) / a**2, (a - mpmath.sin(a)) / a**3]
        )
        for term in range(3):
            assert abs(float(found[term][i] - expected[term])) < 1.5e-15
            assert abs(float(alone[i][term][0] - expected[term])) < 1.5e-15


def test_rotation_exp_and_screw_against_scipy() -> None:
    rng = np.random.default_rng(6)
    vectors = rng.normal(size=(50, 3)) * np.logspace(-9, 1, 50)[:, None]
    expected = Rotation.from_rotvec(vectors).as_matrix()
    np.testing.assert_allclose(rotation_exp(vectors), expected, atol=1e-13)
    v = rng.normal(size=(50, 3))
    slow = [
        quad_vec(lambda u, w=w: Rotation.from_rotvec(w * u).as_matrix(), 0, 1, epsabs=1e-13)[0] @ x
        for w, x in zip(vectors, v, strict=True)
    ]
    np.testing.assert_allclose(screw_displacement(v, vectors, np.ones(50)), slow, atol=1e-11)


def test_sin_cos_of_small_and_large_angles() -> None:
    for scale in (1e-8, 1e-3, 0.05, 0.9, 5.0):
        angles = np.linspace(-scale, scale, 401)
        sine, cosine = kernel.sin_cos(angles)
        np.testing.assert_allclose(sine, np.sin(angles), atol=2e-16, rtol=3e-15)
        np.testing.assert_allclose(cosine, np.cos(angles), atol=1.2e-15)
