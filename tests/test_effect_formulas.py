"""Effects with a formula of their own against physics done another way: an integrated filter, an
accelerometer on a sampled path, delays across an array, the density of a mixture."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp
from scipy.spatial.transform import Rotation
from scipy.stats import norm, t

from syncline_design.effects import registry
from syncline_design.effects.record import ActsOn, Basis, StageRows
from syncline_design.model.horizon import Horizon
from syncline_design.model.known import EffectEntry
from syncline_design.model.system import Platform, Sensor, Stage, System
from syncline_design.model.timing import NO_ERROR
from syncline_design.simulation import SimulationSettings
from syncline_design.simulation.chain import ConstantTwist, stage_error
from syncline_design.simulation.sampling import sample_errors
from syncline_design.verdict.verify import CheckSettings
from tests.checked import check_file
from tests.simulation_systems import no_noise

Array = NDArray[np.float64]
GRAVITY = 9.80665


def state(**given: Array) -> StageRows:
    """One row at the origin, level and at rest unless said otherwise."""
    zero, zero3 = np.zeros(1), np.zeros((1, 3))
    fields = {
        "time_s": zero, "position_m": zero3, "rotation": np.eye(3)[None], "euler_rad": zero3,
        "velocity_mps": zero3, "acceleration_mps2": zero3, "rate_radps": zero3, "range_m": zero,
        "azimuth_rad": zero, "elevation_rad": zero, "antenna_m": np.zeros(3),
        "ranging_m": np.zeros(3), "target_m": zero3,
    }  # fmt: skip
    return StageRows(**(fields | given))


def error_of(rows: StageRows, name: str, sensor: str, values: dict[str, float]) -> Array:
    """The error that an effect alone makes by the nonlinear chain [m]."""
    departed = registry()[name].depart(rows, values, sensor, None)  # type: ignore[arg-type]
    motion = ConstantTwist(rows.rotation, rows.velocity_mps, rows.rate_radps)
    return stage_error(rows, motion, no_noise(len(rows)), departed)[0]


# ------------------------------------------------------------------ a first-order lag


def lag_by_integration(
    rate: Array,
    velocity: Array,
    change: Array,
    arm: Array,
    turned: Rotation,
    time_constant_s: float,
) -> Array:
    """y - x at t = 0 of T dy/dt + y = x(t), integrated from 30 time constants before.

    x: antenna at `arm` of a vehicle with body rate w, body velocity v + t dv/dt and R = turned at
    0, whose position is integrated beside the filter.
    """

    def slopes(at: float, values: Array) -> Array:
        now = turned * Rotation.from_rotvec(at * rate)
        antenna = values[:3] + now.apply(arm)
        return np.concatenate(
            [now.apply(velocity + at * change), (antenna - values[3:]) / time_constant_s]
        )

    start = -30.0 * time_constant_s
    first = np.concatenate([np.zeros(3), (turned * Rotation.from_rotvec(start * rate)).apply(arm)])
    found = solve_ivp(slopes, (start, 0.0), first, "DOP853", rtol=1e-10, atol=1e-9)
    lag: Array = found.y[3:, -1] - found.y[:3, -1] - turned.apply(arm)
    return lag


TURNS = {
    "level turn": ([0.0, 0.0, 1.0], [8.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
    "side slip and climb": ([0.0, 0.0, -1.0], [5.0, -2.0, 1.5], [0.0, 0.0, 0.0]),
    "tilted axis": ([0.6, -0.48, 0.64], [4.0, 3.0, -2.0], [0.0, 0.0, 0.0]),
    "speeding up in a turn": ([0.0, 0.0, 1.0], [8.0, 0.0, 0.0], [0.4, 0.1, -0.2]),
}


@pytest.mark.parametrize("omega_t", [0.05, 0.5, 2.0, 5.0])
@pytest.mark.parametrize("name", TURNS)
def test_filter_lag_is_the_filter(name: str, omega_t: float) -> None:
    """Within 1e-6 of the integrated filter, whatever the turn within a time constant."""
    axis, v, dv = (np.array(x) for x in TURNS[name])
    rate, time_constant = 0.7 * axis, omega_t / 0.7
    turned = Rotation.from_rotvec([0.3, -0.2, 2.0])
    arm = np.array([1.5, -0.5, -2.0])
    rows = state(
        rotation=turned.as_matrix()[None], euler_rad=turned.as_euler("ZYX")[None, ::-1],
        velocity_mps=v[None], rate_radps=rate[None],
        acceleration_mps2=(dv + np.cross(rate, v))[None], antenna_m=arm,
    )  # fmt: skip
    expected = lag_by_integration(rate, v, dv, arm, turned, time_constant)
    departed = registry()["filter_lag"].depart(
        rows, {"time_constant_s": time_constant}, "position", None
    )
    np.testing.assert_allclose(departed.position_m[0], expected, atol=1e-6)


@pytest.mark.parametrize("omega_t", [0.05, 0.5, 2.0, 5.0])
def test_filter_lag_of_a_straight_path_of_a_yawing_vehicle(omega_t: float) -> None:
    """A path that does not turn with the body lags by T V; only the arm's circle is shortened."""
    rate, velocity, arm = 1.0, np.array([6.0, -2.0, 1.0]), np.array([1.5, -0.5, -2.0])
    time_constant = omega_t / rate

    def lagging(at: float, output: Array) -> Array:
        antenna = velocity * at + Rotation.from_rotvec([0.0, 0.0, rate * at]).apply(arm)
        slope: Array = (antenna - output) / time_constant
        return slope

    start = -30.0 * time_constant
    found = solve_ivp(lagging, (start, 0.0), velocity * start, "DOP853", rtol=1e-10, atol=1e-9)
    rows = state(
        velocity_mps=velocity[None],
        rate_radps=np.array([[0.0, 0.0, rate]]),
        antenna_m=arm,
    )
    departed = registry()["filter_lag"].depart(
        rows, {"time_constant_s": time_constant}, "position", None
    )
    np.testing.assert_allclose(departed.position_m[0], found.y[:, -1] - arm, atol=1e-6)


def test_filter_lag_of_a_straight_start() -> None:
    """x = a t^2 / 2 + v t: the filter settles at a T^2 - v T behind."""
    rows = state(velocity_mps=np.array([[3.0, 0, 0]]), acceleration_mps2=np.array([[0.5, 0, 0]]))
    departed = registry()["filter_lag"].depart(rows, {"time_constant_s": 2.0}, "position", None)
    np.testing.assert_allclose(departed.position_m, [[0.5 * 4.0 - 6.0, 0.0, 0.0]], atol=1e-12)


def test_simulated_lag_stays_below_the_latency_it_is_charged_as() -> None:
    """Turning axis across the speed, the lag is v T / sqrt(1 + (w T)^2); along it, v T.

    20 000 isotropic draws come within 1 % of both ends.
    """
    alone = Stage(
        "car", "car", Platform(10.0, 1.0, 1.0), Sensor("p", "position", (0.0,) * 3, NO_ERROR),
        None, None,
    )  # fmt: skip
    lag = EffectEntry("filter_lag", "position", "car", (("time_constant_s", 2.0),))
    found = sample_errors(System((alone,), effects=(lag,)), SimulationSettings(samples=20_000))
    length = np.linalg.norm(found, axis=1)
    assert float(length.max()) == pytest.approx(20.0, rel=0.01)
    assert float(length.min()) == pytest.approx(20.0 / math.sqrt(5.0), rel=0.01)


# ------------------------------------------------------------------ flexure


def felt(path: Callable[[float], Array], turned: Rotation) -> Array:
    """What an accelerometer at rest in the vehicle reads [m/s2]: the path's second difference
    less gravity, in body axes."""
    h = 1e-3
    acceleration = (path(h) - 2.0 * path(0.0) + path(-h)) / h**2
    return np.asarray(turned.inv().apply(acceleration - [0.0, 0.0, GRAVITY]))


def along_circle(at: float) -> Array:
    return np.array([20.0 * math.sin(0.4 * at), 20.0 - 20.0 * math.cos(0.4 * at), 0.0])


def still(at: float) -> Array:
    return np.zeros(3)


def lift(at: float) -> Array:
    return np.array([0.0, 0.0, -0.5 * 3.0 * at * at])


@pytest.mark.parametrize("path", [still, along_circle, lift])
@pytest.mark.parametrize("lean", [[0.0, 0.0, 0.0], [0.6, 0.0, 0.0], [-0.2, 0.4, 1.0]])
def test_flexure_follows_the_specific_force(path: Callable, lean: list[float]) -> None:
    """The true sensor sits at l + C f; the estimate believes l, so it is off by -R C f."""
    turned = Rotation.from_euler("ZYX", lean[::-1])
    h = 1e-3
    acceleration = (path(h) - 2.0 * path(0.0) + path(-h)) / h**2
    rows = state(
        rotation=turned.as_matrix()[None], euler_rad=np.array([lean]),
        acceleration_mps2=turned.inv().apply(acceleration)[None],
        ranging_m=np.array([1.0, 0.2, -0.5]),
    )  # fmt: skip
    bend = np.array([2e-3, -3e-3, 1e-3])
    expected = -turned.apply(bend * felt(path, turned))
    found = error_of(rows, "flexure", "ranging", dict(zip("xyz", bend.tolist(), strict=True)))
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_mast_sags_when_the_vehicle_heels() -> None:
    """2 mm per m/s2 athwart, heeled by 30 degrees at rest: 9.81 mm, and nothing when level."""
    values = {"x": 0.0, "y": 2e-3, "z": 0.0}
    heel = Rotation.from_euler("x", 30, degrees=True)
    rows = state(rotation=heel.as_matrix()[None], euler_rad=np.array([[math.pi / 6, 0.0, 0.0]]))
    size = np.linalg.norm(error_of(rows, "flexure", "ranging", values))
    assert size == pytest.approx(2e-3 * GRAVITY * 0.5, rel=1e-9)
    assert np.linalg.norm(error_of(state(), "flexure", "ranging", values)) == 0.0


@pytest.mark.parametrize("bend", [(1e-3, -4e-3, 2e-3), (1e-3, 0.0, 5e-3), (3e-3, 3e-3, 0.0)])
@pytest.mark.parametrize("tilt_deg", [0.0, 20.0, 85.0])
def test_flexure_is_charged_for_every_attitude_of_the_horizon(
    bend: tuple[float, float, float], tilt_deg: float
) -> None:
    """No tilt and no turn of 200 000 drawn bends more than the charge; some reach 97 % of it."""
    rng = np.random.default_rng(5)
    n = 200_000
    lean = np.radians(tilt_deg) * np.sqrt(rng.uniform(0, 1, n))
    lean[::4] = np.radians(tilt_deg)
    around = rng.uniform(0, 2 * math.pi, n)
    down = np.stack(
        [np.sin(lean) * np.cos(around), np.sin(lean) * np.sin(around), np.cos(lean)], axis=-1
    )
    pull = rng.standard_normal((n, 3))
    pull *= 0.3 / np.linalg.norm(pull, axis=1, keepdims=True)  # v omega = 0.3 m/s2
    worst = np.linalg.norm(np.array(bend) * (pull - GRAVITY * down), axis=1).max()
    platform = Platform(3.0, 0.1, 10.0)
    charged = registry()["flexure"].contribute(
        Stage("v", "v", platform, None, None, None),
        dict(zip("xyz", bend, strict=True)),
        "ranging",
        Basis(horizon=Horizon(tilt_rad=math.radians(tilt_deg))),
    )
    assert 0.97 * charged.systematic_m < worst <= charged.systematic_m * (1 + 1e-12)


# ------------------------------------------------------------------ sound speed


def heard(direction: Array, used: float) -> Array:
    """Direction that a flat array in the x-y plane gives: delays of sound at 1480 m/s between
    elements 20 cm apart, turned into cosines with 1480 m/s times `used`."""
    delays = 0.2 * direction[:2] / 1480.0
    cosines = 1480.0 * used * delays / 0.2
    return np.array([*cosines, math.copysign(math.sqrt(1.0 - cosines @ cosines), direction[2])])


@pytest.mark.parametrize("error", [0.01, -0.02, 0.001])
@pytest.mark.parametrize("elevation_deg", [-90.0, -75.0, -45.0, -20.0, 50.0])
def test_sound_speed_turns_the_directions_of_a_flat_array(
    elevation_deg: float, error: float
) -> None:
    azimuth, elevation = 0.7, math.radians(elevation_deg)
    direction = np.array(
        [
            math.cos(azimuth) * math.cos(elevation),
            math.sin(azimuth) * math.cos(elevation),
            -math.sin(elevation),
        ]
    )
    expected = 60.0 * (1.0 + error) * heard(direction, 1.0 + error) - 60.0 * direction
    rows = state(
        range_m=np.array([60.0]), azimuth_rad=np.array([azimuth]),
        elevation_rad=np.array([elevation]),
    )  # fmt: skip
    found = error_of(rows, "sound_speed", "ranging", {"relative_error": error})
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_one_per_cent_of_sound_speed_is_1_4_per_cent_of_range_at_45_degrees() -> None:
    rows = state(range_m=np.array([100.0]), elevation_rad=np.array([-math.pi / 4]))
    off = np.linalg.norm(error_of(rows, "sound_speed", "ranging", {"relative_error": 1e-4}))
    assert off / 100.0 == pytest.approx(1e-4 * math.sqrt(2.0), rel=1e-3)


@pytest.mark.parametrize("error", [0.01, -0.01, -0.05, 0.1, 1e-4])
def test_sound_speed_is_charged_for_every_direction(error: float) -> None:
    """The largest displacement over a fine sweep of elevations, the array's plane included."""
    elevation = np.concatenate(
        [np.linspace(-math.pi / 2, 0.0, 20_001), -np.geomspace(1e-9, 1, 999)]
    )
    level = np.minimum(np.cos(elevation) * (1 + error), 1.0)
    seen = np.stack([(1 + error) * level, (1 + error) * np.sqrt(1 - level**2)])
    true = np.stack([np.cos(elevation), -np.sin(elevation)])
    worst = 30.0 * float(np.linalg.norm(seen - true, axis=0).max())
    charged = registry()["sound_speed"].contribute(
        Stage("v", "v", Platform(1.0, 1.0, 30.0), None, None, None),
        {"relative_error": error},
        "ranging",
        Basis(distance_m=30.0),
    )
    assert worst == pytest.approx(charged.systematic_m, rel=1e-3)
    assert worst <= charged.systematic_m * (1 + 1e-9)


# ------------------------------------------------------------------ heavy tails


@pytest.mark.parametrize("freedom", [2.5, 4.0, 12.0])
@pytest.mark.parametrize("rate", [0.0, 0.02, 0.3])
def test_heavy_tails_are_charged_by_the_mixtures_deviation(freedom: float, rate: float) -> None:
    """sqrt of the second moment of (1 - rate) t_nu + rate N(0, 10^2), by quadrature, less one."""

    def density(x: float) -> float:
        return float((1 - rate) * t.pdf(x, freedom) + rate * norm.pdf(x, scale=10.0))

    # the tail beyond 1e4 by its power law: t_nu falls as c x^-(nu + 1)
    far = 1e4
    inner = sum(
        quad(lambda x: 2 * x * x * density(x), a, b, limit=400)[0]
        for a, b in ((0.0, 5.0), (5.0, 100.0), (100.0, far))
    )
    outer = 2 * (1 - rate) * float(t.pdf(far, freedom)) * far**3 / (freedom - 2.0)
    position = Sensor("p", "position", (0.01, 0.02, 0.03), NO_ERROR)
    ranging = Sensor("r", "ranging", (0.05, 1e-3, 1e-3), NO_ERROR)
    sizes: dict[ActsOn, float] = {"position": math.hypot(0.01, 0.02, 0.03), "ranging": 0.05}
    for sensor, sigma_m in sizes.items():  # of a range: along the line of sight alone
        charged = registry()["heavy_tails"].contribute(
            Stage("v", "v", Platform(1.0, 1.0, 1.0), position, None, ranging),
            {"degrees_of_freedom": freedom, "outlier_rate": rate},
            sensor,
            Basis(distance_m=50.0),
        )
        expected = (math.sqrt(inner + outer) - 1.0) * sigma_m
        assert charged.total_m(Basis(distance_m=50.0)) == pytest.approx(expected, rel=1e-4)


def test_no_row_is_an_outlier_of_students_tails() -> None:
    """200 000 draws at nu = 3, a fifth outliers: quantiles of the mixture, within 2 %.

    2 % is at least 4 standard errors at these quantiles (0.4 % at the median).
    """
    n, rng = 200_000, np.random.default_rng(8)
    rows = state(**{"time_s": np.zeros(n)})
    values = {"degrees_of_freedom": 3.0, "outlier_rate": 0.2}
    departed = registry()["heavy_tails"].depart(rows, values, "position", rng)
    drawn = np.abs((1.0 + departed.position_noise) * rng.standard_normal(n))
    for x in (0.5, 1.0, 3.0, 10.0, 25.0, 35.0):
        share = 0.8 * 2 * t.sf(x, 3.0) + 0.2 * 2 * norm.sf(x / 10.0)
        spread = 5.0 * math.sqrt(share / n)
        assert abs(float(np.mean(drawn > x)) - share) < spread, x


# ------------------------------------------------------------------ jitter

SPEC = """\
syncline: 1
name: jitter
requirements: [{{id: ACC-1, kind: accuracy, limit: 1 km}}]
coverage_factor: {k}
stages:
  - name: car
    platform: {{v_max: 20 m/s, omega_max: 10 deg/s, distance: 10 m, baseline: 0 m}}
    position:
      sensor: {{modality: position, sigma_position: 1 cm, primitives: [pps]}}
      timestamping: {{error: {{distribution: normal, mean: 0 s, std: 1 ms}}}}
effects: [{{effect: timestamp_jitter, sensor: position, parameters: {{std_s: 2 ms}}}}]
"""


@pytest.mark.parametrize("k", ["1", "2.5", "3", "6"])
def test_jitter_is_covered_as_every_normal_error(k: str, tmp_path: Path) -> None:
    path = tmp_path / "car.yaml"
    path.write_text(SPEC.format(k=k))
    found = check_file(path, CheckSettings(monte_carlo=False)).to_json()["syncline"]["total_m"]
    assert found == pytest.approx(math.sqrt(3) * 0.01 + 20.0 * float(k) * (1e-3 + 2e-3), rel=1e-12)


# ------------------------------------------------------------------ echoes


def test_an_echo_stamped_at_its_return_is_of_the_moment_before() -> None:
    """A boat at 5 m/s over a target 300 m below: an echo back 0.2 s later was there 1 m before.

    The vector of then is added to the place of now, so the target comes out ahead.
    """
    rows = state(
        velocity_mps=np.array([[5.0, 0.0, 0.0]]),
        range_m=np.array([300.0]),
        elevation_rad=np.array([-0.5 * math.pi]),
        target_m=np.array([[0.0, 0.0, 300.0]]),
    )
    found = error_of(rows, "echo_delay", "ranging", {"share": 1.0})
    np.testing.assert_allclose(found, [5.0 * 300.0 / 1500.0, 0.0, 0.0], atol=1e-9)
