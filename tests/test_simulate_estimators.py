"""Special functions, exact intervals, lattices, and the conditioned estimator against the plain."""

from __future__ import annotations

import dataclasses
import math

import mpmath
import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad

from syncline_design.model.system import EffectEntry, System
from syncline_design.simulation import SimulationError, SimulationSettings, cross_check
from syncline_design.simulation.conditioned import (
    Rays,
    conditional_moments,
    conditioned_monte_carlo,
    lattice_size,
    noise_curvature_m,
    rays,
)
from syncline_design.simulation.draws import RandomSource, generator, stage_draw, timing_draws
from syncline_design.simulation.intervals import (
    binomial_cdf,
    binomial_quantile,
    incomplete_beta,
    proportion_interval,
    quantile_ranks,
)
from syncline_design.simulation.kernel import stage_error
from syncline_design.simulation.quadrature import (
    LatticeSource,
    chi3_cdf,
    generating_vector,
    normal_quantile,
    student_quantile,
)
from syncline_design.simulation.sampling import error_distribution, job_errors
from syncline_design.simulation.worst_case import WorstCase
from tests.simulation_systems import DEG, fixed_wing, survey

UNUSED = WorstCase(0.0, 1.0, 1.0, 1.0, 1.0, 0.0)


def test_normal_quantile_against_mpmath() -> None:
    """Stated: relative error below 1.2e-9, both tails down to 1e-16."""
    mpmath.mp.dps = 40
    p = np.concatenate(
        [np.logspace(-16, -1.4, 60), np.linspace(0.03, 0.97, 41), 1 - np.logspace(-12, -1.4, 30)]
    )
    found = normal_quantile(p)
    for probability, z in zip(p, found, strict=True):
        exact = mpmath.sqrt(2) * mpmath.erfinv(2 * mpmath.mpf(float(probability)) - 1)
        assert abs(z - float(exact)) <= 1.2e-9 * abs(float(exact)) + 1e-15


def test_chi_square_probability_against_mpmath() -> None:
    """Stated: error below 1.5e-7."""
    s = np.concatenate([np.linspace(0.0, 8.0, 161), [50.0, 1e6]])
    found = chi3_cdf(s, np.exp(-0.5 * s * s))
    for length, value in zip(s, found, strict=True):
        exact = mpmath.gammainc(1.5, 0, mpmath.mpf(float(length)) ** 2 / 2, regularized=True)
        assert abs(value - float(exact)) <= 1.6e-7


@pytest.mark.parametrize("freedom", [15, 31, 200])
def test_student_quantile_against_scipy(freedom: int) -> None:
    """Stated: error below 0.002 from 15 degrees of freedom on (up to the 0.999 quantile)."""
    for p in (0.01, 0.5, 0.9, 0.975, 0.999):
        assert student_quantile(p, freedom) == pytest.approx(stats.t.ppf(p, freedom), abs=2e-3)


@pytest.mark.parametrize("scale", [1.0, 10.0, 1e3, 1e5, 1e6])
def test_incomplete_beta_against_mpmath(scale: float) -> None:
    """Stated: error below 1e-9 up to a + b = 2e5, 5e-9 up to 2e6."""
    mpmath.mp.dps = 40
    for a, b in ((0.5, 1.0), (1.0, 0.05), (0.3, 0.7)):
        p, q = a * scale, b * scale
        middle, spread = p / (p + q), math.sqrt(p * q / (p + q) ** 2 / (p + q + 1))
        for shift in (-3.0, -0.5, 0.0, 0.5, 2.0):
            x = min(max(middle + shift * spread, 1e-9), 1 - 1e-9)
            exact = stats.beta.cdf(x, p, q)
            if scale <= 1e3:
                exact = float(mpmath.betainc(p, q, 0, x, regularized=True))
            assert abs(incomplete_beta(p, q, x) - exact) < (1e-9 if scale < 1e6 else 5e-9)


def test_incomplete_beta_of_many_samples() -> None:
    """Stated: error below 1e-6 at a + b = 1e8."""
    for x in (0.94998, 0.95, 0.95002):
        exact = stats.beta.cdf(x, 95e6, 5e6)
        assert abs(incomplete_beta(95e6, 5e6, x) - exact) < 1e-6
    assert incomplete_beta(2.0, 3.0, 0.0) == 0.0
    assert incomplete_beta(2.0, 3.0, 1.0) == 1.0


def test_binomial_against_scipy() -> None:
    for n in (1, 2, 10, 333, 100_000):
        for p in (0.003, 0.5, 0.95, 0.997):
            law = stats.binom(n, p)
            for k in {0, n // 2, round(n * p), n - 1, n}:
                assert binomial_cdf(k, n, p) == pytest.approx(law.cdf(k), abs=1e-9)
            for level in (0.025, 0.4, 0.975):
                assert binomial_quantile(level, n, p) == law.ppf(level)


def test_clopper_pearson_against_scipy() -> None:
    for n, k in ((1, 0), (1, 1), (10, 0), (10, 3), (10, 10), (5000, 4700), (200_000, 199_999)):
        for confidence in (0.9, 0.95, 0.9875):
            exact = stats.binomtest(k, n).proportion_ci(confidence, "exact")
            found = proportion_interval(k, n, confidence)
            np.testing.assert_allclose(found, (exact.low, exact.high), atol=1e-9)


def test_quantile_ranks_enclose_with_the_stated_probability_and_no_more() -> None:
    """Exact coverage P(low <= B < high), B ~ Bin(n, p), and neither end can move inward."""
    for n in (40, 1000, 12_345):
        for p in (0.5, 0.95):
            low, middle, high = quantile_ranks(p, n)
            law = stats.binom(n, p)
            assert law.cdf(high - 1) - law.cdf(low - 1) >= 0.95
            assert law.cdf(low) > 0.025
            assert law.cdf(high - 2) < 0.975
            assert low <= middle <= high


def test_lattice_covers_evenly_and_copies_are_independent() -> None:
    """Each dimension of each copy: one point in every 1/n interval before the tent map folds it.

    After the fold two points share an interval of 2/n.  The mean of x y z ... over the cube is
    met closer than by 20 000 random points.
    """
    source = LatticeSource(generator(1, 0), 256, 16, generating_vector(8, 256))
    cube = source.uniform(8)
    assert cube.shape == (8, 4096)
    assert cube.min() >= 0.0
    assert cube.max() <= 1.0
    for copy in range(16):
        counts = np.histogram(cube[3, copy * 256 : (copy + 1) * 256], 64, (0, 1))[0]
        assert np.all(np.abs(counts - 4) <= 1)
    smooth = np.prod(1.0 + 0.5 * (cube - 0.5), axis=0).reshape(16, 256).mean(axis=1)
    random = np.random.default_rng(0).random((8, 16, 256))
    rough = np.prod(1.0 + 0.5 * (random - 0.5), axis=0).mean(axis=1)
    assert np.std(smooth) < 0.1 * np.std(rough)
    assert abs(smooth.mean() - 1.0) < 1e-3


def test_rays_give_the_distribution_of_a_gaussian_vector() -> None:
    """|m + L g| by rays against direct integration of the noncentral chi-square (C = s^2 I)."""
    count = 1 << 14
    source = LatticeSource(generator(2, 0), 1024, 16, generating_vector(2, 1024))
    height, turn = source.uniform(2)
    z = 2 * height - 1
    radius = np.sqrt(1 - z * z)
    u = np.stack([radius * np.cos(2 * np.pi * turn), radius * np.sin(2 * np.pi * turn), z])
    m, s = np.array([0.3, -0.2, 0.9])[:, None], 0.5
    flat = [np.sum((s * u) ** 2, 0), np.sum(m * s * u, 0), np.full(count, float(np.sum(m**2)))]
    found = Rays(*(x.reshape(16, 1024) for x in flat))
    law = stats.ncx2(3, float(np.sum(m**2)) / s**2)
    for q in (0.2, 0.9, 1.0, 1.7, 3.0):
        share, density = found.probability(q)
        assert share.mean() == pytest.approx(law.cdf((q / s) ** 2), abs=2e-4)
        # a sphere that leaves the mean outside is met by few rays, some of them grazing it
        exact, rough = law.pdf((q / s) ** 2) * 2 * q / s**2, 0.1 if q < 0.97 else 0.02
        assert density.mean() == pytest.approx(exact, rel=rough)
    exact = s * math.sqrt(law.ppf(0.95))
    assert found.quantile(0.95).mean() == pytest.approx(exact, rel=2e-4)
    assert quad(lambda q: law.pdf((q / s) ** 2) * 2 * q / s**2, 0, 9)[0] == pytest.approx(1.0)


def test_conditional_moments_are_those_of_the_noise() -> None:
    """Fix the kinematics, draw only the noise: mean and covariance of the exact chain's error.

    Each element within 5 standard errors plus the second order of the noise.
    """
    system = survey()
    stage = system.stages[0]
    count = 100_000
    settings = SimulationSettings()
    mean, covariance = conditional_moments(
        System((stage,)), settings, RandomSource(generator(3, 0), 1)
    )
    single = RandomSource(generator(3, 0), 1)
    shifts = timing_draws(System((stage,)), single)
    fixed = stage_draw(System((stage,)), 0, shifts, single, False, False, True)
    rng = np.random.default_rng(4)
    repeated = {
        f.name: np.repeat(np.broadcast_to(getattr(fixed, f.name), value.shape), count, axis=-1)
        for f in dataclasses.fields(fixed)
        for value in [getattr(fixed, f.name)]
    }
    sigma = np.array([*stage.attitude.sigma, *stage.ranging.sigma[1:]])
    repeated["angle_noise_rad"] = rng.normal(size=(5, count)) * sigma[:, None]
    repeated["range_noise_m"] = rng.normal(size=count) * stage.ranging.sigma[0]
    noise = rng.normal(size=(3, count)) * np.array(stage.position.sigma)[:, None]
    repeated["position_noise_m"] = noise
    errors = stage_error(type(fixed)(**repeated))
    curvature = noise_curvature_m(System((stage,)))
    found = np.cov(errors)
    xx, xy, xz, yy, yz, zz = (float(part[0]) for part in covariance)
    expected = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    size = float(np.trace(expected))
    np.testing.assert_allclose(found, expected, atol=5 * size * math.sqrt(2 / count))
    shift = np.abs(errors.mean(axis=1) - mean[:, 0])
    assert np.all(shift < 5 * math.sqrt(size / count) + 2 * curvature)


SYSTEMS = {"wing": fixed_wing(), "survey": survey()}


@pytest.mark.parametrize(
    ("name", "envelope"), [("wing", "limits"), ("survey", "limits"), ("survey", "inside")]
)
def test_fast_and_plain_estimators_agree(name: str, envelope) -> None:
    """z-scores of their difference over 200 seeds are standard normal.

    Their mean within 4 / sqrt(200), their spread between 0.8 and 1.25 (chi-square: beyond 4.5 sd),
    Kolmogorov-Smirnov at level 1e-4, for three quantiles.
    """
    system = SYSTEMS[name]
    quantiles = (0.5, 0.95, 0.99)
    scores = np.empty((200, 3))
    for seed in range(200):
        settings = SimulationSettings(1024, seed=seed, envelope=envelope, quantiles=quantiles)
        fast = conditioned_monte_carlo(system, settings, UNUSED)
        plain = np.sort(np.linalg.norm(job_errors(system, settings, 0), axis=0))
        for k, quantile in enumerate(quantiles):
            middle = round(quantile * plain.size)
            spread = math.sqrt(plain.size * quantile * (1 - quantile))
            low, high = plain[round(middle - 1.5 * spread)], plain[round(middle + 1.5 * spread)]
            own = (fast.quantiles[k].high_m - fast.quantiles[k].low_m) / (2 * 2.131)
            error = math.hypot((high - low) / 3.0, own)
            scores[seed, k] = (fast.quantiles[k].value_m - plain[middle]) / error
    assert np.all(np.abs(scores.mean(axis=0)) < 4 / math.sqrt(200))
    assert np.all((scores.std(axis=0) > 0.8) & (scores.std(axis=0) < 1.25))
    for k in range(3):
        assert stats.kstest(scores[:, k], stats.norm.cdf).pvalue > 1e-4


def test_conditioned_intervals_cover() -> None:
    """200 seeds against 2 million plain samples: 95 % intervals of 0.95 and of P(error <= limit).

    Fewer than 178 of 200 has probability below 5e-4 where coverage is 95 %.
    """
    system = fixed_wing()
    reference = error_distribution(system, SimulationSettings(2_000_000, seed=99))
    exact, limit = reference.order_statistics([1_900_000])[0], 0.05
    share = reference.within(limit) / 2e6
    covered = inside = 0
    for seed in range(200):
        settings = SimulationSettings(1024, seed=seed, quantiles=(0.95,), limit_m=limit)
        found = conditioned_monte_carlo(system, settings, UNUSED)
        covered += found.quantiles[0].low_m <= exact <= found.quantiles[0].high_m
        inside += found.within_target.low <= share <= found.within_target.high
    assert covered >= 178
    assert inside >= 178


def test_effective_samples_are_worth_what_they_say() -> None:
    """Spread of the 0.95 quantile over 100 seeds against that of as many plain samples.

    The estimate of a spread from 16 copies is itself rough: within a factor of 1.6.
    """
    system = survey()
    found = [
        conditioned_monte_carlo(system, SimulationSettings(1024, seed=s), UNUSED)
        for s in range(100)
    ]
    spread = np.std([f.quantile(0.95).value_m for f in found])
    worth = float(np.median([f.effective_samples for f in found]))
    plain = error_distribution(system, SimulationSettings(1_000_000, seed=5))
    low, high = (
        plain.order_statistics([949_346])[0],
        plain.order_statistics([950_654])[0],
    )  # +- 3 sd
    expected = (high - low) / 6.0 * math.sqrt(1e6 / worth)
    assert 1 / 1.6 < spread / expected < 1.6
    assert worth > 4 * 1024


def test_conditioned_result_says_what_it_is() -> None:
    settings = SimulationSettings(samples=4096, estimator="conditioned", limit_m=2.0)
    found = cross_check(survey(), settings)
    assert found.estimator == "conditioned"
    assert found.samples == 4096
    assert found.effective_samples > 4096
    edges, density = found.histogram.edges_m, found.histogram.density
    assert np.sum(np.diff(edges) * density) == pytest.approx(0.9999, abs=2e-4)
    again = cross_check(survey(), settings)
    assert again == found


def test_lattice_sizes() -> None:
    assert lattice_size(1) == (16, 1)
    assert lattice_size(1024) == (64, 1)
    assert lattice_size(8192) == (512, 1)
    assert lattice_size(200_000) == (512, 25)


def test_conditioned_without_any_noise_or_motion() -> None:
    """Everything zero but the range: no error, no warning, quantiles zero."""
    system = fixed_wing()
    stage = system.stages[0]
    changed = {
        role: dataclasses.replace(getattr(stage, role), sigma=(0.0,) * 3)
        for role in ("position", "attitude", "ranging")
    }
    platform = dataclasses.replace(stage.platform, v_max_mps=0.0, omega_max_radps=0.0)
    still = System((dataclasses.replace(stage, platform=platform, **changed),))
    found = rays(still, SimulationSettings(estimator="conditioned"), 16, 0)
    assert np.all(found.quantile(0.95) < 1e-12)


def test_conditioned_refuses_effects() -> None:
    entry = EffectEntry("range_bias", "ranging", "uav", (("bias_m", 1.0),))
    system = dataclasses.replace(fixed_wing(), effects=(entry,))
    with pytest.raises(SimulationError, match="use 'plain'"):
        cross_check(system, SimulationSettings(estimator="conditioned"))


def test_curvature_of_the_noise() -> None:
    """Half the squared angular noise times the range: 30 m at 0.45 deg twice gives 1.85 mm."""
    alone = dataclasses.replace(survey().stages[1], position=survey().stages[0].position)
    assert noise_curvature_m(System((alone,))) == pytest.approx(
        15.0 * (2 * (0.45 * DEG) ** 2 + 3 * (0.002 * DEG) ** 2), rel=1e-12
    )
