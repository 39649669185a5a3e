"""Known effects that scatter in the statistical figures: closed forms, and an own long sampling."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize, stats

from syncline_design.model.known import EffectEntry
from syncline_design.model.system import Platform, Sensor, Stage, System
from syncline_design.model.timing import NO_ERROR
from syncline_design.simulation.ascent import chosen
from syncline_design.simulation.figures import error_statistics, worst_case_m
from syncline_design.simulation.situations import Situations
from syncline_design.simulation.statistical import Wanted, exact, statistical_figures
from test_statistical_figures import ALL, chain, drawn, sampled_figure, stage_part

SIGMA = 0.02


def buoy(effect: str, speed: float = 0.0, **parameters: float) -> System:
    """A position alone, 2 cm per axis, with one effect."""
    gnss = Sensor("gnss", "position", (SIGMA,) * 3, NO_ERROR)
    stage = Stage("buoy", "buoy", Platform(speed, 0.0, 1.0), gnss, None, None)
    return System((stage,), effects=(entry(effect, "buoy", "position", **parameters),))


def entry(effect: str, stage: str, sensor: str, **parameters: float) -> EffectEntry:
    return EffectEntry(effect, sensor, stage, tuple(parameters.items()))


def figures(system: System) -> list[float]:
    wanted = (Wanted("3d"), *(Wanted(axis, 0.95) for axis in ("horizontal", "vertical", "3d")))
    return [found.value_m for found in statistical_figures(system, wanted, seed=0)]


@pytest.mark.parametrize(
    ("system", "sigma"),
    [
        (buoy("noise_understated", factor=3.0), 3.0 * SIGMA),
        (buoy("correlated_noise", std_m=0.05, time_constant_s=60.0), math.hypot(SIGMA, 0.05)),
    ],
)
def test_what_is_normal_stays_normal(system: System, sigma: float) -> None:
    chi = [math.sqrt(3.0), *(math.sqrt(stats.chi2.ppf(0.95, k)) for k in (2, 1, 3))]
    assert figures(system) == pytest.approx([sigma * one for one in chi], rel=1e-3)


def test_heights_that_wander_count_in_the_vertical() -> None:
    found = figures(buoy("height_drift", std_m=0.05, time_constant_s=60.0))
    assert found[1] == pytest.approx(SIGMA * math.sqrt(stats.chi2.ppf(0.95, 2)), rel=1e-3)
    assert found[2] == pytest.approx(1.959964 * math.hypot(SIGMA, 0.05), rel=1e-3)


@pytest.mark.parametrize(("freedom", "rate"), [(3.0, 0.0), (5.0, 0.04)])
def test_tails_keep_their_shape(freedom: float, rate: float) -> None:
    """Of k axes |e|^2 / (k sigma^2) is F(k, nu); outliers are normal with ten times sigma."""

    def quantile(axes: int) -> float:
        def short(r: float) -> float:
            tails = stats.f.cdf(r * r / axes, axes, freedom)
            return float((1.0 - rate) * tails + rate * stats.chi2.cdf((r / 10.0) ** 2, axes) - 0.95)

        return SIGMA * float(optimize.brentq(short, 1.0, 40.0))

    system = buoy("heavy_tails", degrees_of_freedom=freedom, outlier_rate=rate)
    found = figures(system)
    assert found[1:] == pytest.approx([quantile(2), quantile(1), quantile(3)], rel=5e-3)
    variance = (1.0 - rate) * freedom / (freedom - 2.0) + 100.0 * rate
    assert found[0] == pytest.approx(SIGMA * math.sqrt(3.0 * variance), rel=2e-2)


def test_jitter_and_packets_along_the_motion() -> None:
    """At 5 m/s straight down: e = N(0, sigma) + 5 m/s times a normal, or a uniform age."""
    found = figures(buoy("timestamp_jitter", 5.0, std_s=0.01))
    assert found[2] == pytest.approx(1.959964 * math.hypot(SIGMA, 0.05), rel=1e-3)
    shares = error_statistics(buoy("timestamp_jitter", 5.0, std_s=0.01), seed=0).worst_at[1].shares
    variances = {"noise of buoy.position": SIGMA**2, "timestamp_jitter of buoy.position": 0.05**2}
    whole = SIGMA**2 + 0.05**2
    assert {one.source: one.share for one in shares} == pytest.approx(
        {name: one / whole for name, one in variances.items()}, rel=1e-6
    )
    found = figures(buoy("packetised_timestamps", 5.0, interval_s=0.04))

    def short(r: float) -> float:
        ages = np.linspace(0.0, 0.2, 20_001)
        inside = stats.norm.cdf((r - ages) / SIGMA) - stats.norm.cdf((-r - ages) / SIGMA)
        return float(np.trapezoid(inside, ages) / 0.2 - 0.95)

    assert found[2] == pytest.approx(float(optimize.brentq(short, 0.01, 1.0)), rel=1e-3)
    assert found[0] == pytest.approx(math.sqrt(3 * SIGMA**2 + 0.2**2 / 3.0), rel=1e-3)


EFFECTS = (
    entry("timestamp_jitter", "ship", "attitude", std_s=0.02),
    entry("packetised_timestamps", "ship", "position", interval_s=0.05),
    entry("noise_understated", "auv", "ranging", factor=2.0),
    entry("heavy_tails", "ship", "position", degrees_of_freedom=6.0, outlier_rate=0.02),
    entry("correlated_noise", "ship", "position", std_m=0.03, time_constant_s=10.0),
)


def scattered(system: System, point: np.ndarray, n: int, seed: int) -> np.ndarray:
    """n errors (3, n) at a situation of a chain: the plain chain of the figures' own test, with
    the effects of EFFECTS drawn here."""
    rng = np.random.default_rng(seed)
    blocks = Situations(system).blocks
    offsets = {name: drawn(error, rng, n) for name, error in system.clock_offsets}
    mu = {}
    for stage in system.stages:
        for sensor in stage.sensors():
            at_clock = offsets.get(sensor.timeline, 0.0)
            mu[stage.name, sensor.role] = drawn(sensor.timing, rng, n) - at_clock
    mu["ship", "attitude"] = mu["ship", "attitude"] + rng.normal(0.0, 0.02, n)
    mu["ship", "position"] = mu["ship", "position"] - rng.uniform(0.0, 0.05, n)
    tails = np.where(rng.random(n) < 0.02, 10.0, np.sqrt(6.0 / rng.chisquare(6.0, n)))
    total = rng.normal(0.0, 0.03, (3, n))
    for index, stage in enumerate(system.stages):
        own = {name: rows[:, 0] for name, rows in chosen(blocks, point[:, None], index).items()}
        before = (stage.name, "position") if index == 0 else (system.stages[0].name, "ranging")
        shift_p = mu[before] - mu[stage.name, "ranging"]
        shift_a = mu[stage.name, "attitude"] - mu[stage.name, "ranging"]
        z = rng.standard_normal((9, n))
        if index == 0:
            z[:3] *= tails
        else:
            z[6:] *= 2.0
        total += stage_part(system, stage, own, (shift_p, shift_a), z, index == 0)
    return total


@pytest.mark.parametrize("seed", [4])
def test_a_chain_with_five_of_them_against_sampling(seed: int) -> None:
    """60 000 draws of an own chain; 2 % is five standard errors of a sampled 95 % quantile."""
    system = replace(chain(seed), effects=EFFECTS)
    situations = Situations(system)
    point = situations.starting_points(seed, 1)
    moments = situations.moments(point, situations.nodes(16381))
    error = scattered(system, point[:, 0], 60_000, seed)
    for wanted in ALL:
        found = exact(moments, wanted, situations.dimensions)
        assert found == pytest.approx(sampled_figure(error, wanted), rel=0.02)


def test_the_certified_worst_case_takes_what_wanders_at_k() -> None:
    """|e| <= k (|sigma| + sqrt(3) std), by hand."""
    system = buoy("correlated_noise", std_m=0.05, time_constant_s=60.0)
    by_hand = math.sqrt(3.0) * (SIGMA + 0.05)
    assert worst_case_m(system, 1.0) == pytest.approx(by_hand)
    assert worst_case_m(system, 3.0) == pytest.approx(3.0 * by_hand)
