"""Plain Monte Carlo: closed forms, timing draws, reproducibility, intervals, decisions.

Seeds are fixed, so no test flickers; what is stated is how likely a correct program would have
been to fail for a seed picked blindly.
"""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
from scipy import stats

from syncline_design.effects import registry
from syncline_design.machine.random_numbers import generator
from syncline_design.model.known import EffectEntry
from syncline_design.model.system import Platform, Sensor, Stage, System
from syncline_design.model.timing import NO_ERROR, Constant, Empirical, Normal, TimingError, Uniform
from syncline_design.simulation import (
    SimulationError,
    SimulationSettings,
    cross_check,
    decide,
    run,
    sample_errors,
    sampling,
    simulate,
    worker,
    worst_cases,
)
from syncline_design.simulation.distribution import Binned, ErrorValues, add_counts, no_counts
from syncline_design.simulation.draws import RandomSource, timing_draw, timing_draws
from syncline_design.simulation.intervals import proportion_interval
from syncline_design.simulation.run import look_sizes, quantile_estimates
from tests.simulation_systems import fixed_wing, position_only, sensor, survey

SIGMA = 0.02


def gaussian_ball() -> System:
    """At rest: |error| is SIGMA times chi with three degrees of freedom."""
    platform = Platform(0.0, 0.0, 50.0)
    return System((Stage("post", "post", platform, sensor("position", (SIGMA,) * 3), None, None),))


def exact_quantile(quantile: float) -> float:
    return float(SIGMA * stats.chi(3).ppf(quantile))


def test_position_noise_alone_is_chi_distributed() -> None:
    """Kolmogorov-Smirnov at level 1e-4."""
    errors = sample_errors(gaussian_ball(), SimulationSettings(samples=50_000, seed=1))
    lengths = np.linalg.norm(errors, axis=1) / SIGMA
    assert stats.kstest(lengths, stats.chi(3).cdf).pvalue > 1e-4


def test_sensor_noise_alone_has_the_linear_covariance() -> None:
    """Small noises, no motion, object ahead: across and along variances add up; each within 5 sd.

    The sample variance of n normals has standard deviation variance * sqrt(2/n).
    """
    platform = Platform(0.0, 0.0, 100.0)
    roles = (
        sensor("position", (0.01, 0.02, 0.03)),
        sensor("attitude", (1e-4, 2e-4, 3e-4)),
        sensor("ranging", (0.05, 1e-4, 4e-4)),
    )
    system = System((Stage("s", "s", platform, *roles),))
    n = 200_000
    errors = sample_errors(system, SimulationSettings(samples=n, seed=2))
    # isotropic line of sight: each turn about an axis acts on 2/3 of d^2 in all, range on all
    turn = (1e-4**2 + 2e-4**2 + 3e-4**2) * 100.0**2 * 2.0 / 3.0
    bearing = 100.0**2 * (4e-4**2 + 1e-4**2 * 2.0 / 3.0)
    expected = 0.01**2 + 0.02**2 + 0.03**2 + turn + bearing + 0.05**2
    found = float(np.mean(np.sum(errors**2, axis=1)))
    spread = float(np.std(np.sum(errors**2, axis=1))) / math.sqrt(n)
    assert abs(found - expected) < 5 * spread


def test_constant_latency_at_the_limits_has_a_known_mean_square() -> None:
    """Position late by s only: |dp| = v s when the rate is 0, whatever the direction."""
    platform = Platform(7.0, 0.0, 50.0)
    quiet = Sensor("p", "position", (0.0,) * 3, TimingError(Constant(-0.05)))
    rest = (
        Sensor("a", "attitude", (0.0,) * 3, NO_ERROR),
        Sensor("r", "ranging", (0.0,) * 3, NO_ERROR),
    )
    system = System((Stage("s", "s", platform, quiet, *rest),))
    lengths = np.linalg.norm(sample_errors(system, SimulationSettings(samples=1000)), axis=1)
    np.testing.assert_allclose(lengths, 0.35, rtol=1e-12)
    inside = sample_errors(system, SimulationSettings(samples=50_000, envelope="inside"))
    share = np.linalg.norm(inside, axis=1) / 0.35
    assert stats.kstest(share, stats.uniform.cdf).pvalue > 1e-4


@pytest.mark.parametrize(
    ("distribution", "cdf"),
    [
        (Uniform(-2e-3, 5e-3), stats.uniform(-2e-3, 7e-3).cdf),
        (Normal(1e-3, 2e-4), stats.norm(1e-3, 2e-4).cdf),
    ],
)
def test_timing_draws_follow_their_distribution(distribution, cdf) -> None:
    """Kolmogorov-Smirnov at level 1e-4."""
    source = RandomSource(generator(3, 0), 50_000)
    drawn = timing_draw(TimingError(distribution), source)
    assert stats.kstest(drawn, cdf).pvalue > 1e-4


def test_constant_and_empirical_timing_draws() -> None:
    source = RandomSource(generator(4, 0), 30_000)
    assert np.all(timing_draw(TimingError(Constant(3e-3)), source) == 3e-3)
    values = (-1e-3, 0.0, 0.0, 4e-3)
    drawn = timing_draw(TimingError(Empirical(values)), source)
    counts = [int(np.sum(drawn == value)) for value in (-1e-3, 0.0, 4e-3)]
    assert stats.chisquare(counts, [7500, 15000, 7500]).pvalue > 1e-4


def test_calibrated_mean_leaves_its_remainder() -> None:
    """Normal about 30 ms, calibrated to 2 ms: mean 0, variance std^2 + (2 ms)^2/3, within 5 sd."""
    error = TimingError(Normal(0.03, 1e-3), calibrated_s=2e-3)
    drawn = timing_draw(error, RandomSource(generator(5, 0), 100_000))
    expected = 1e-6 + 4e-6 / 3.0
    assert abs(drawn.mean()) < 5 * math.sqrt(expected / 1e5)
    assert drawn.var() == pytest.approx(expected, rel=5 * math.sqrt(2 / 1e5))


def clocked(position_timeline: str, ranging_timeline: str) -> System:
    """Perfect sensors on timelines whose clocks are a second off."""
    platform = Platform(7.0, 0.0, 50.0)
    position = Sensor("p", "position", (0.0,) * 3, NO_ERROR, position_timeline)
    attitude = Sensor("a", "attitude", (0.0,) * 3, NO_ERROR, ranging_timeline)
    ranging = Sensor("r", "ranging", (0.0,) * 3, NO_ERROR, ranging_timeline)
    clocks = (
        ("host:a", TimingError(Constant(1.0))),
        ("host:b", TimingError(Constant(0.75))),
    )
    return System((Stage("s", "s", platform, position, attitude, ranging),), clock_offsets=clocks)


@pytest.mark.parametrize(
    ("position", "ranging", "shift_s"),
    [("host:a", "host:a", 0.0), ("host:a", "host:b", 0.25), ("utc", "host:b", 0.75)],
)
def test_a_shared_timeline_cancels_and_two_do_not(
    position: str, ranging: str, shift_s: float
) -> None:
    errors = sample_errors(clocked(position, ranging), SimulationSettings(samples=100))
    np.testing.assert_allclose(np.linalg.norm(errors, axis=1), 7.0 * shift_s, atol=1e-12)


def test_one_clock_draw_is_shared_by_the_sensors_on_it() -> None:
    system = fixed_wing(Constant(0.0))
    random_clock = ("host:vehicle", TimingError(Normal(0.0, 1.0)))
    system = dataclasses.replace(system, clock_offsets=(random_clock,))
    shifts = timing_draws(system, RandomSource(generator(6, 0), 1000))
    drawn = [shifts["uav", role] for role in ("position", "attitude", "ranging")]
    assert np.std(drawn[0]) > 0.5
    np.testing.assert_array_equal(drawn[0], drawn[1])
    np.testing.assert_array_equal(drawn[0], drawn[2])


@pytest.mark.parametrize("envelope", ["limits", "inside", "trajectory"])
@pytest.mark.parametrize("system", [fixed_wing(), survey()], ids=["wing", "survey"])
def test_workers_do_not_change_a_bit(system: System, envelope) -> None:
    runs = [
        sample_errors(
            system, SimulationSettings(samples=30_000, seed=7, envelope=envelope, workers=workers)
        )
        for workers in (1, 2, 8)
    ]
    assert runs[0].tobytes() == runs[1].tobytes() == runs[2].tobytes()
    other = sample_errors(system, SimulationSettings(samples=30_000, seed=8, envelope=envelope))
    assert not np.any(other == runs[0])


def test_results_are_the_same_for_any_number_of_workers() -> None:
    asked = SimulationSettings(30_000, tau_grid_s=(1e-5, 0.1))
    found = [
        json.dumps(simulate(fixed_wing(), dataclasses.replace(asked, workers=w)).to_json())
        for w in (1, 2, 8)
    ]
    assert found[0] == found[1] == found[2]


@pytest.mark.parametrize("parts", [1, 2, 8])
def test_processes_do_not_change_a_count(monkeypatch, parts: int) -> None:
    """Real child processes, shares of every size: the same counts as threads."""
    settings = SimulationSettings(samples=50_001, seed=15, workers=parts)
    expected = worker.tally(survey(), dataclasses.replace(settings, workers=1), 0, 50_001, 1.0)
    monkeypatch.setattr(worker, "WORTH_PROCESSES", 1)
    counts, within = worker.tally(survey(), settings, 0, 50_001, 1.0)
    assert int(counts.sum()) == 50_001
    assert within == expected[1]
    np.testing.assert_array_equal(counts, expected[0])


def test_a_failing_process_is_reported(monkeypatch) -> None:
    monkeypatch.setattr(worker, "WORTH_PROCESSES", 1)
    settings = SimulationSettings(samples=20_000, workers=2)
    with pytest.raises(RuntimeError, match="a simulation process failed"):
        worker.tally(System(()), settings, 0, 20_000, 1.0)


def test_a_longer_run_begins_with_the_shorter_one() -> None:
    short = sample_errors(fixed_wing(), SimulationSettings(samples=9_000))
    long = sample_errors(fixed_wing(), SimulationSettings(samples=20_001))
    assert long.shape == (20_001, 3)
    np.testing.assert_array_equal(short, long[:9_000])


@pytest.mark.parametrize("envelope", ["limits", "inside", "trajectory"])
@pytest.mark.parametrize("effect", ["", "latency", "heavy_tails"])
def test_part_of_a_job_is_the_beginning_of_the_whole(envelope, effect: str) -> None:
    """Bit for bit, whatever acts: what scatters is drawn row by row."""
    settings = SimulationSettings(samples=sampling.JOB, envelope=envelope)
    parameters = {
        "latency": (("latency_s", 0.01),),
        "heavy_tails": (("degrees_of_freedom", 4.0), ("outlier_rate", 0.1)),
    }
    effects = [EffectEntry(effect, "position", "vessel", parameters[effect])] if effect else []
    system = dataclasses.replace(survey(), effects=tuple(effects))
    whole = sampling.job_errors(system, settings, 1)
    for count in (1, 500, sampling.JOB - 1):
        part = sampling.job_errors(system, settings, 1, count)
        np.testing.assert_array_equal(part, whole[:, :count])


def test_jobs_are_independent_streams() -> None:
    """Neighbouring jobs are uncorrelated: |r| < 5 / sqrt(n)."""
    system, settings = gaussian_ball(), SimulationSettings()
    first, second = (sampling.job_errors(system, settings, job) for job in (0, 1))
    correlation = np.corrcoef(first.ravel(), second.ravel())[0, 1]
    assert abs(correlation) < 5 / math.sqrt(first.size)


def test_many_samples_are_binned_and_agree_with_kept_ones(monkeypatch) -> None:
    """Above KEPT_VALUES only counts are kept; order statistics agree to a bin, 0.025 %."""
    settings = SimulationSettings(samples=100_000, seed=9, limit_m=0.04)
    kept = run.error_distribution(fixed_wing(), settings)
    monkeypatch.setattr(run, "KEPT_VALUES", 1000)
    binned = run.error_distribution(fixed_wing(), settings)
    assert isinstance(kept, ErrorValues)
    assert isinstance(binned, Binned)
    assert binned.count == kept.count == 100_000
    for rank in (1, 10, 50_000, 95_000, 99_999, 100_000):
        assert binned.order_statistics([rank])[0] == pytest.approx(
            kept.order_statistics([rank])[0], rel=2.5e-4
        )
    assert abs(binned.within(0.04) - kept.within(0.04)) < 30
    for (e, d), (f, g) in [(kept.histogram(40), binned.histogram(40))]:
        np.testing.assert_allclose(e, f, rtol=3e-4)
        np.testing.assert_allclose(d, g, rtol=0.05, atol=0.1)


def test_distributions_of_odd_errors() -> None:
    """Zero, tiny, huge and NaN errors: NaN is never within a limit and sorts last."""
    errors = np.array([0.0, 1e-300, 1e-3, 1e9, math.inf, math.nan])
    counts = no_counts()
    add_counts(counts, errors)
    for found in (ErrorValues(errors), Binned(counts)):
        assert found.count == 6
        assert found.order_statistics([0])[0] == 0.0
        assert found.order_statistics([7])[0] == math.inf
        assert found.within(1.0) == 3
        assert not found.order_statistics([6])[0] <= 1e300
    assert ErrorValues(np.array([math.nan])).within(math.inf) == 0


def test_quantile_intervals_cover() -> None:
    """1000 seeds, 500 samples each: the 95 % intervals of three quantiles cover the exact one.

    They cover with at least 95 %; a correct program fails one of these with probability below
    0.0025 each (binomial: fewer than 930 of 1000), and one that covers 90 % fails almost surely.
    """
    quantiles = (0.5, 0.9, 0.95)
    exact = [exact_quantile(q) for q in quantiles]
    covered = np.zeros(3, dtype=int)
    below = np.zeros(3, dtype=int)
    inside = 0
    limit = exact_quantile(0.9)
    for seed in range(1000):
        settings = SimulationSettings(500, seed=seed, quantiles=quantiles, limit_m=limit, workers=1)
        kept = sampling.job_errors(gaussian_ball(), settings, 0, 500)
        found = ErrorValues(np.linalg.norm(kept, axis=0))
        for k, quantile in enumerate(quantiles):
            estimate = quantile_estimates(found, (quantile,), 0.95)[0]
            covered[k] += estimate.low_m <= exact[k] <= estimate.high_m
            below[k] += exact[k] < estimate.value_m
        low, high = proportion_interval(found.within(limit), 500)
        inside += low <= 0.9 <= high
    assert np.all(covered >= 930)
    assert np.all(covered <= 990)  # nor are they needlessly wide
    assert inside >= 930
    assert np.all(np.abs(below - 500) < 80)  # the estimates are not off to one side


def test_quantiles_without_enough_samples_are_open() -> None:
    found = cross_check(gaussian_ball(), SimulationSettings(samples=50)).monte_carlo
    assert found.quantile(0.997).high_m == math.inf
    assert found.to_json()["quantiles"]["0.997"]["high_m"] is None


def test_decisions() -> None:
    """0.95 quantile against a limit 1 % above, 1 % below, and on the quantile itself."""
    settings = SimulationSettings(samples=20_000, seed=10)
    exact = exact_quantile(0.95)
    passing = decide(gaussian_ball(), settings, 0.95, 1.01 * exact)
    failing = decide(gaussian_ball(), settings, 0.95, 0.99 * exact)
    open_ = decide(gaussian_ball(), settings, 0.95, exact, cap_samples=60_000)
    assert (passing.status, failing.status, open_.status) == ("pass", "fail", "indeterminate")
    assert open_.samples == 60_000
    assert open_.looks == 2
    assert passing.within.low >= 0.95 > failing.within.high
    assert failing.estimate.low_m > 0.99 * exact


def test_a_decision_samples_on_until_it_is_clear() -> None:
    settings = SimulationSettings(samples=2_000, seed=11)
    limit = 1.006 * exact_quantile(0.95)
    found = decide(gaussian_ball(), settings, 0.95, limit, cap_samples=1_000_000)
    assert found.status == "pass"
    assert 2_000 < found.samples <= 1_000_000
    again = decide(
        gaussian_ball(), settings, 0.95, limit, 1_000_000, cross_check(gaussian_ball(), settings)
    )
    assert again == found


def test_a_first_run_is_used_as_it_stands() -> None:
    settings = SimulationSettings(samples=30_000, seed=12)
    first = cross_check(gaussian_ball(), settings)
    limit = 1.02 * exact_quantile(0.95)
    found = decide(gaussian_ball(), settings, 0.95, limit, first=first)
    assert found == decide(gaussian_ball(), settings, 0.95, limit)
    assert found.samples == 30_000


def test_a_first_run_of_other_settings_is_not_used() -> None:
    limit = 1.02 * exact_quantile(0.95)
    settings = SimulationSettings(samples=5_000, seed=12)
    other = cross_check(gaussian_ball(), dataclasses.replace(settings, samples=20_000, seed=3))
    expected = decide(gaussian_ball(), settings, 0.95, limit)
    assert decide(gaussian_ball(), settings, 0.95, limit, first=other) == expected


@pytest.mark.parametrize("quantile", [0.0, 1.0, math.nan])
def test_a_quantile_that_makes_no_sense_is_refused(quantile: float) -> None:
    with pytest.raises(SimulationError, match="quantile"):
        decide(gaussian_ball(), SimulationSettings(samples=100), quantile, 1.0)


def test_wrong_decisions_are_rare() -> None:
    """A limit just below the quantile must not pass: 200 seeds, at most 5 % each by design.

    Expected below 10; more than 20 has probability below 0.002 for a correct program.
    """
    limit = 0.9999 * exact_quantile(0.95)
    passes = sum(
        decide(gaussian_ball(), SimulationSettings(2_000, seed=s), 0.95, limit, 8_000).status
        == "pass"
        for s in range(200)
    )
    assert passes <= 20


def test_errors_that_are_no_numbers_never_pass(monkeypatch) -> None:
    broken = np.full((3, sampling.JOB), math.nan)
    monkeypatch.setattr(sampling, "job_errors", lambda *_: broken)
    settings = SimulationSettings(samples=1000, limit_m=1.0)
    assert decide(gaussian_ball(), settings, 0.5, 1e9, 1000).status == "fail"
    found = cross_check(gaussian_ball(), settings).monte_carlo
    assert found.probability_within_target is not None
    assert found.probability_within_target.value == 0.0
    assert found.to_json()["quantiles"]["0.5"]["value_m"] is None


def test_look_sizes_end_at_the_cap() -> None:
    assert look_sizes(1000, 10_000) == [1000, 4000, 10_000]
    assert look_sizes(1000, 1000) == [1000]
    assert look_sizes(5000, 1000) == [5000]


def test_known_effects_act_in_the_simulator() -> None:
    """A range bias of 3 m on a still vehicle shifts every error by 3 m along the line of sight."""
    platform = Platform(0.0, 0.0, 100.0)
    roles = [Sensor(r, r, (0.0,) * 3, NO_ERROR) for r in ("position", "attitude", "ranging")]
    entry = EffectEntry("range_bias", "ranging", "s", (("bias_m", 3.0),))
    system = System((Stage("s", "s", platform, *roles),), effects=(entry,))
    lengths = np.linalg.norm(sample_errors(system, SimulationSettings(samples=500)), axis=1)
    np.testing.assert_allclose(lengths, 3.0, rtol=1e-12)


def test_a_known_latency_equals_a_constant_timing_error() -> None:
    """latency = -mu: both roads give the same errors, sample by sample."""
    plain = fixed_wing(Constant(0.0))
    late = dataclasses.replace(
        plain, effects=(EffectEntry("latency", "attitude", "uav", (("latency_s", 0.02),)),)
    )
    stage = plain.stages[0]
    timed = dataclasses.replace(stage.attitude, timing=TimingError(Constant(-0.02)))
    other = dataclasses.replace(plain, stages=(dataclasses.replace(stage, attitude=timed),))
    settings = SimulationSettings(samples=2000, seed=13)
    np.testing.assert_allclose(
        sample_errors(late, settings), sample_errors(other, settings), atol=1e-10
    )


@pytest.mark.parametrize("name", sorted(registry()))
def test_every_effect_of_the_dictionary_acts_and_is_bounded(name: str) -> None:
    """At a plausible size: errors change and stay finite; no worst case is above its bound.

    A convention mistaken for another (discrete) is mended, not budgeted, so it has no bound; level
    flight cannot show what needs roll and pitch.
    """
    effect = registry()[name]
    for role in effect.sensors:
        parameters = []
        for parameter in effect.parameters:
            size: float | str = math.sqrt(max(parameter.low, 0.0) * parameter.high) or 1.0
            if parameter.choices:
                size = {"position": "enu", "attitude": "yaw_180"}.get(role, "azimuth_sign")
            elif parameter.located:
                size = 1e6 if parameter.name == "to_s" else 0.5  # a moment within the manoeuvre
            elif parameter.whole:
                size = float(round(size))
            parameters.append((parameter.name, size))
        entry = EffectEntry(name, role, "uav", tuple(parameters))
        system = dataclasses.replace(fixed_wing(), effects=(entry,))
        settings = SimulationSettings(samples=300, envelope="trajectory", trajectory="circle")
        plain, acted = (sample_errors(s, settings) for s in (fixed_wing(), system))
        assert np.all(np.isfinite(acted))
        assert np.array_equal(plain, acted) == (name == "induced_heave")
        if effect.kind == "discrete":
            continue
        (worst,) = worst_cases(system, np.array([1e-3]), starts=2, iterations=5, seed=0)
        assert worst.value_m <= worst.bound_m * (1 + 1e-12)


def test_json_has_what_a_verdict_needs() -> None:
    simulated = cross_check(fixed_wing(), SimulationSettings(samples=5000, limit_m=0.05))
    found = simulated.monte_carlo.to_json()
    assert set(found["quantiles"]) == {"0.5", "0.95", "0.997"}
    assert set(found["quantiles"]["0.5"]) == {"value_m", "low_m", "high_m"}
    assert {"value", "low", "high"} <= set(found["probability_within_target"])
    assert {"value_m", "ratio_to_syncline", "bound_m", "certificate"} <= set(found["worst_case"])
    edges, density = found["histogram"]["edges_m"], found["histogram"]["density"]
    assert np.sum(np.diff(edges) * density) == pytest.approx(1.0, abs=1e-3)
    json.dumps(found, allow_nan=False)


def test_full_result_as_json() -> None:
    result = simulate(survey(), SimulationSettings(samples=2000, tau_grid_s=(0.0, 1e-3, 10.0)))
    found = result.to_json()
    assert found["schema"] == "syncline-design/simulation/v1"
    assert [row["tau_s"] for row in found["grid"]] == [0.0, 1e-3, 10.0]
    assert all({"worst_case_m", "syncline_m", "ratio", "reason"} <= set(r) for r in found["grid"])
    json.dumps(found, allow_nan=False)


def test_a_chain_carries_the_error_of_the_stage_before() -> None:
    """Perfect AUV under a vessel with position noise only: the noise passes through unchanged."""
    platform = Platform(1.0, 0.2, 100.0)
    perfect = [Sensor(r, r, (0.0,) * 3, NO_ERROR) for r in ("attitude", "ranging")]
    vessel = Stage("v", "v", platform, sensor("position", (SIGMA,) * 3, Constant(0.0)), *perfect)
    vehicle = Stage("a", "a", platform, None, *perfect)
    errors = sample_errors(System((vessel, vehicle)), SimulationSettings(samples=40_000, seed=14))
    lengths = np.linalg.norm(errors, axis=1) / SIGMA
    assert stats.kstest(lengths, stats.chi(3).cdf).pvalue > 1e-4


def test_a_later_stage_is_shifted_against_the_ranging_before_it() -> None:
    """Vessel ranging late by 0.1 s: the AUV's transponder is read 0.1 s late, at 2 m/s."""
    platform, moving = Platform(0.0, 0.0, 100.0), Platform(2.0, 0.0, 30.0)

    def perfect(role: str, late_s: float = 0.0) -> Sensor:
        return Sensor(role, role, (0.0,) * 3, TimingError(Constant(-late_s)))  # type: ignore[arg-type]

    vessel = Stage(
        "v", "v", platform, perfect("position"), perfect("attitude"), perfect("ranging", 0.1)
    )
    vehicle = Stage("a", "a", moving, None, perfect("attitude"), perfect("ranging"))
    errors = sample_errors(System((vessel, vehicle)), SimulationSettings(samples=200))
    np.testing.assert_allclose(np.linalg.norm(errors, axis=1), 0.2, rtol=1e-12)


def test_position_only_system_refers_to_true_time() -> None:
    """A stamp 5 s ahead of UTC (host - UTC) and valid 10 ms after it: error v (10 ms - 5 s)."""
    system = position_only()
    stage = dataclasses.replace(
        system.stages[0],
        platform=Platform(30.0, 0.0, 50.0),
        position=Sensor("p", "position", (0.0,) * 3, TimingError(Constant(0.01)), "host:car"),
    )
    clock = (("host:car", TimingError(Constant(5.0))),)
    errors = sample_errors(System((stage,), clock_offsets=clock), SimulationSettings(samples=50))
    np.testing.assert_allclose(np.linalg.norm(errors, axis=1), 30.0 * 4.99, rtol=1e-12)


def test_ten_seconds_of_shift_and_gimbal_lock_work() -> None:
    for system in (fixed_wing(Constant(10.0)), survey(Uniform(-10.0, 10.0))):
        errors = sample_errors(system, SimulationSettings(samples=5000))
        assert np.all(np.isfinite(errors))
