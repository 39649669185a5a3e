"""Bounds over sessions: printed factors, draws of known families, whole claims."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from syncline_design.clocks.study import TimingSettings, study_logs
from syncline_design.clocks.tolerance import (
    normal_factor,
    range_factor,
    sessions_of_order_statistic,
    tolerance_bound,
)
from tests.clock_logs import sessions_csv
from tests.clocked_specs import run


# Factors of ISO 16269-6, table D.4 (one-sided, unknown variance), p = 95 %, confidence 95 %
@pytest.mark.parametrize(
    ("count", "factor"), [(5, 4.203), (6, 3.708), (10, 2.911), (20, 2.396), (60, 2.022)]
)
def test_the_tolerance_factor_is_the_printed_one(count: int, factor: float) -> None:
    assert normal_factor(count, 0.95, 0.95) == pytest.approx(factor, abs=1.5e-3)


def test_the_order_statistic_needs_what_wilks_says() -> None:
    assert sessions_of_order_statistic(0.95, 0.95) == 59
    assert sessions_of_order_statistic(0.99, 0.95) == 299
    assert sessions_of_order_statistic(0.5, 0.5) == 1


def _factor_by_chance(count: int, confidence: float) -> float:
    """k such that mean + k s of `count` normal values exceeds z_0.95 with this confidence."""
    source = np.random.default_rng(1)
    x = source.normal(size=(400_000, count))
    k = (1.6448536 - x.mean(axis=1)) / x.std(axis=1, ddof=1)
    return float(np.quantile(k, confidence))


def test_sessions_that_differ_by_orders_of_magnitude_are_bounded_by_their_logarithms() -> None:
    half = 3.0 * np.array([0.05, 0.2, 0.35, 0.6, 0.9])
    logs = -11.0 + np.concatenate([half, -half])
    bound, method = tolerance_bound(np.exp(logs), 0.95, 0.95)
    k = _factor_by_chance(10, 0.95)
    assert method == "range"
    assert math.log(bound) == pytest.approx(-11.0 + k * logs.std(ddof=1), abs=0.03)
    ranged = np.exp(logs.max()) + range_factor(10, 0.95, 0.95) * np.ptp(np.exp(logs))
    assert bound > ranged


@pytest.mark.parametrize(
    ("count", "share", "confidence"),
    [(3, 0.95, 0.95), (5, 0.95, 0.95), (20, 0.95, 0.95), (58, 0.95, 0.95), (5, 0.9, 0.99),
     (200, 0.99, 0.95)],
)  # fmt: skip
def test_the_range_bounds_a_heavy_tail_with_just_the_confidence(
    count: int, share: float, confidence: float
) -> None:
    """(u^(-1/3) - 1) of even u is Pareto's with the tail of Student's t of 3 degrees of freedom; at
    58 the largest alone holds in 94.9 %."""
    studies = np.random.default_rng(2).random((20_000, count)) ** (-1.0 / 3.0) - 1.0
    truth = (1.0 - share) ** (-1.0 / 3.0) - 1.0
    largest = studies.max(axis=1)
    bounds = largest + range_factor(count, share, confidence) * (largest - studies.min(axis=1))
    away = math.sqrt(confidence * (1.0 - confidence) / 20_000)
    assert float(np.mean(bounds >= truth)) == pytest.approx(confidence, abs=4.0 * away)


@pytest.mark.parametrize("count", [59, 400])
def test_from_as_many_sessions_on_as_the_largest_needs_the_range_adds_nothing(count: int) -> None:
    assert range_factor(count, 0.95, 0.95) == 0.0


def test_a_tiny_session_hardly_widens_the_bound_and_a_large_one_does() -> None:
    """By logarithms alone a session of 1 ns among 19 of 10 us would make it a hundredfold."""
    usual = 1e-5 * np.exp(0.2 * np.random.default_rng(3).normal(size=19))
    bounds = [tolerance_bound(np.append(usual, one), 0.95, 0.95)[0] for one in (1e-9, 1e-5, 1e-3)]
    assert bounds[0] < 2.0 * bounds[1]
    assert bounds[2] >= 1e-3


@pytest.mark.parametrize(("count", "share"), [(7, 0.348), (20, 0.139), (59, 0.0495)])
def test_what_no_session_held_may_be_true_of_that_many(
    count: int, share: float, tmp_path: Path
) -> None:
    """A share p of bad starts leaves n sessions without one in (1 - p)^n of campaigns: in 5 %."""
    rng = np.random.default_rng(5)
    lucky = np.mean(np.all(rng.random((20_000, count)) >= share, axis=1))
    assert lucky == pytest.approx(0.05, abs=4.0 * math.sqrt(0.05 * 0.95 / 20_000))
    logs = sessions_csv(tmp_path, [1e-5] * count, count=30)
    claim = study_logs(logs, TimingSettings()).timing.claim
    assert claim.unseen_share == pytest.approx(share, abs=6e-4)
    said = " ".join(run("timing", *logs).stdout.split())
    assert (f"up to {100.0 * share:.1f} % of all starts (95 % confidence)" in said) == (count < 59)


def test_the_largest_session_carries_it_from_59_on() -> None:
    source = np.random.default_rng(8)
    many = np.exp(source.normal(-11.0, 0.4, 59))
    many[7] = 3.0 * many.max()
    assert tolerance_bound(many, 0.95, 0.95) == (float(many.max()), "order statistic")
    assert tolerance_bound(many[:58], 0.95, 0.95)[1] == "range"


@pytest.mark.parametrize("count", [3, 5, 20, 60])
def test_a_new_bias_at_each_start_is_bounded_without_waste(count: int) -> None:
    """|normal| biases, 95 % below 1.96: held as above, at most twice as wide at 20."""
    studies = np.abs(np.random.default_rng(4).normal(size=(400, count))) + 0.1
    bounds = np.array([tolerance_bound(q, 0.95, 0.95)[0] for q in studies])
    share = float(np.mean(bounds >= 2.06))
    assert share - 1.96 * math.sqrt(share * (1.0 - share) / 400) > (0.88 if count <= 5 else 0.92)
    assert np.median(bounds) / 2.06 < {3: 30.0, 5: 6.0, 20: 2.1, 60: 1.6}[count]


@pytest.mark.parametrize("count", [5, 20, 60])
def test_the_claim_holds_for_sessions_that_are_heavier_than_log_normal(count: int) -> None:
    """Logs of skewness 0.4, as flicker noise makes them; 400 studies: the lower 95 % limit of the
    share that holds is above 88 % (5 sessions) or 92 %.

    The true shares are 98 % and more.  Widths are asked for from 20 sessions on; of 5 it is stated.
    """
    source = np.random.default_rng(17)
    truth = math.exp(0.04 * 33.75)  # chi2.ppf(0.95, 50) / 2 = 33.752
    studies = np.exp(0.04 * source.gamma(25.0, size=(400, count)))
    bounds = np.array([tolerance_bound(q, 0.95, 0.95)[0] for q in studies])
    held = int(np.sum(bounds >= truth))
    share = held / 400
    low = share - 1.96 * math.sqrt(share * (1.0 - share) / 400)
    assert low > (0.88 if count == 5 else 0.92), share
    assert np.median(bounds) / truth < {5: 3.0, 20: 1.6, 60: 1.5}[count]


def _of_bias(
    bias: Callable[[np.random.Generator, int], np.ndarray], source: np.random.Generator, count: int
) -> np.ndarray:
    """What sessions of 240 samples keep to for 95 %: white noise of 1 about a new bias each."""
    noise = source.normal(size=(count, 240))
    figures: np.ndarray = np.quantile(np.abs(bias(source, count)[:, None] + noise), 0.95, axis=1)
    return figures


@pytest.mark.parametrize("count", [5, 7, 20, 40])
@pytest.mark.parametrize(
    "bias",
    [
        lambda source, count: source.normal(0.0, 0.6, count),
        lambda source, count: source.laplace(0.0, 0.45, count),
        lambda source, count: 0.4 * source.standard_t(3, count),
        lambda source, count: source.exponential(0.5, count),
    ],
    ids=["normal", "Laplace", "Student t3", "one-sided"],
)
def test_the_claim_holds_for_biases_as_large_as_the_noise(
    bias: Callable[[np.random.Generator, int], np.ndarray], count: int
) -> None:
    """A floor of noise, and beyond it what some starts bring: 1000 studies, lower 95 % limit.

    The true shares are 95 % and more; a log-normal bound holds in 74 to 90 %.
    """
    source = np.random.default_rng(23)
    truth = float(np.quantile(_of_bias(bias, source, 40_000), 0.95))
    studies = _of_bias(bias, source, 1000 * count).reshape(1000, count)
    bounds = np.array([tolerance_bound(q, 0.95, 0.95)[0] for q in studies])
    share = float(np.mean(bounds >= truth))
    assert share - 1.96 * math.sqrt(share * (1.0 - share) / 1000) > 0.92, share
    assert np.median(bounds) / truth < {5: 3.0, 7: 2.5, 20: 1.8, 40: 1.5}[count]
