"""Covariance, noise fit, selection threshold: against dense matrices, closed forms, simulation."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2, multivariate_normal

from syncline_design.diagnosis.covariance import factored, inverse_3x3
from syncline_design.diagnosis.gross import whole_seconds
from syncline_design.diagnosis.noise import (
    Directed,
    NoiseLevel,
    Slow,
    Structure,
    White,
    first_guess,
    marginal_variance,
    precision,
    spec_bounds,
)
from syncline_design.diagnosis.noise_fit import fit_noise
from syncline_design.diagnosis.noise_slopes import _blocks
from syncline_design.diagnosis.scene import acting
from syncline_design.diagnosis.scores import Gram, clean_threshold, log_p_of
from syncline_design.diagnosis.tails import tails_of
from syncline_design.diagnosis.trajectory import pieces
from syncline_design.effects.acting import Acting
from syncline_design.effects.kinematics import gauss_markov
from syncline_design.effects.record import ActsOn
from syncline_design.model.figure_text import format_estimate

Array = NDArray[np.float64]


def dense(white: Array, loading: Array, time_s: Array, constants_s: Array) -> Array:
    """The covariance (3 n, 3 n) written out element by element."""
    n = len(time_s)
    total = np.zeros((n, 3, n, 3))
    for i in range(n):
        total[i, :, i, :] = white[i]
        for j in range(n):
            for k, constant in enumerate(constants_s):
                decay = np.exp(-abs(time_s[i] - time_s[j]) / constant)
                total[i, :, j, :] += decay * np.outer(loading[i, :, k], loading[j, :, k])
    return total.reshape(3 * n, 3 * n)


def example(n: int = 15, m: int = 4) -> tuple[Array, Array, Array, Array]:
    rng = np.random.default_rng(1)
    root = rng.standard_normal((n, 3, 3))
    white = root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(3)
    time_s = np.sort(rng.uniform(0, 40, n))
    return white, rng.standard_normal((n, 3, m)), time_s, np.array([0.5, 5.0, 30.0, 200.0])[:m]


@pytest.mark.parametrize("m", [0, 1, 4])
def test_banded_algebra_is_the_dense_one(m: int) -> None:
    white, loading, time_s, constants = example(m=m)
    rng = np.random.default_rng(2)
    known, full = factored(white, loading, time_s, constants), dense(*example(m=m))
    series = rng.standard_normal((15, 3, 5))
    expected = np.linalg.solve(full, series.reshape(45, 5)).reshape(15, 3, 5)
    assert known.solve(series) == pytest.approx(expected, abs=1e-10)
    many = np.tile(series, 25)  # solved side by side
    assert known.solve(many) == pytest.approx(np.tile(expected, 25), abs=1e-10)
    told = series.reshape(45, 5).T @ expected.reshape(45, 5)
    assert known.information(series) == pytest.approx(told, abs=1e-9)
    assert known.squares(series) == pytest.approx(np.diag(told), abs=1e-9)
    assert known.information(many) == pytest.approx(np.tile(told, (25, 25)), abs=1e-9)
    error = series[:, :, 0]
    density = multivariate_normal(np.zeros(45), full).logpdf(error.ravel())
    assert known.negative_log_likelihood(error) == pytest.approx(-density, rel=1e-10)


@pytest.mark.parametrize("repeated", [False, True])
def test_many_columns_are_solved_as_each_alone(repeated: bool) -> None:
    """200 columns at once and five at a time, rows that share stamps, gaps, time constants from
    nothing to a year beside steps of 10 ms: to 1e-9 of the largest of their column."""
    rng = np.random.default_rng(5)
    n, constants = 400, np.array([0.0, 0.0, 0.5, 60.0, 3.0e7, 3.0e7])
    step = rng.choice([0.01, 0.02, 30.0], n, p=[0.6, 0.39, 0.01])
    time_s = np.cumsum(step if not repeated else np.where(np.arange(n) % 3, 0.0, step))
    root = rng.standard_normal((n, 3, 3))
    white = root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(3)
    known = factored(white, rng.standard_normal((n, 3, 6)), time_s, constants)
    series = rng.standard_normal((n, 3, 200))
    together = known.solve(series)
    alone = np.concatenate([known.solve(series[:, :, k : k + 5]) for k in range(0, 200, 5)], axis=2)
    assert np.all(np.abs(together - alone) < 1e-9 * np.max(np.abs(alone), axis=(0, 1)))
    told = np.einsum("nij,nik->jk", series, alone)
    scale = np.sqrt(np.diag(told))
    assert np.all(np.abs(known.information(series) - told) < 1e-9 * scale[:, None] * scale)
    assert known.squares(series) == pytest.approx(np.diag(told), rel=1e-9)


@pytest.mark.parametrize("n", [1, 2, 3, 7, 15])
def test_states_vary_as_the_whole_matrix_says(n: int) -> None:
    """Covariances of each stamp, and of a process with itself at the next, by a dense inverse."""
    white, loading, time_s, constants = example(n, 3)
    prior, seen = np.zeros((2, n, 3, n, 3))
    for i in range(n):
        seen[i, :, i] = loading[i].T @ np.linalg.solve(white[i], loading[i])
        for j in range(n):
            prior[i, :, j] = np.diag(np.exp(-abs(time_s[i] - time_s[j]) / constants))
    flat = (3 * n, 3 * n)
    whole = np.linalg.inv(np.linalg.inv(prior.reshape(flat)) + seen.reshape(flat))
    blocks = whole.reshape(n, 3, n, 3)
    same, following = _blocks(factored(white, loading, time_s, constants))
    assert same == pytest.approx(np.array([blocks[i, :, i] for i in range(n)]), abs=1e-9)
    expected = [np.diagonal(blocks[i + 1, :, i]) for i in range(n - 1)]
    assert following == pytest.approx(np.array(expected).reshape(-1, 3), abs=1e-9)


def test_the_slow_part_is_the_conditional_mean() -> None:
    white, loading, time_s, constants = example()
    error = np.random.default_rng(3).standard_normal((15, 3))
    slow_only = dense(0 * white, loading, time_s, constants)
    expected = slow_only @ np.linalg.solve(dense(*example()), error.ravel())
    found = factored(white, loading, time_s, constants).slow_part(error)
    assert found.ravel() == pytest.approx(expected, abs=1e-9)


def common_noise(time_s: Array, own: Array, common: Array, slow: Array, last_s: float) -> Array:
    """Covariance (3 n, 3 n) of rows that share stamps, written out pair by pair.

    own (n, 3, 3): a row's own; common (n, 3, k): one draw a stamp; slow (n, 3, m): Gauss-Markov.
    """
    n = len(time_s)
    total = np.zeros((n, 3, n, 3))
    for i in range(n):
        total[i, :, i, :] += own[i]
        for j in range(n):
            if time_s[i] == time_s[j]:
                total[i, :, j, :] += common[i] @ common[j].T
            decay = np.exp(-abs(time_s[i] - time_s[j]) / last_s)
            total[i, :, j, :] += decay * slow[i] @ slow[j].T
    return total.reshape(3 * n, 3 * n)


STAMPS = (
    (0.0, 0.0, 0.0, 0.1, 0.3, 0.3, 5.0, 9.0, 9.0, 9.0, 9.0),
    (0.0, 1.0, 1.0),
    (2.0, 2.0),
    (0.0, 0.5, 1.0, 1.5),
)


@pytest.mark.parametrize("stamps", STAMPS, ids=len)
def test_rows_of_one_stamp_share_the_vehicle_s_noise(stamps: tuple[float, ...]) -> None:
    """Position, attitude and timing scatter are one draw a stamp, ranging one a row."""
    rng, time_s, n = np.random.default_rng(6), np.array(stamps), len(stamps)
    roots = [rng.standard_normal((n, 3, 3)) for _ in range(3)]
    timing, direction = rng.standard_normal((n, 3, 1)), rng.standard_normal((n, 3, 1))
    squares = [root @ np.swapaxes(root, 1, 2) for root in roots]
    parts = Structure(
        time_s,
        tuple(
            White(("uav", role), square, None if role == "ranging" else root)
            for role, square, root in zip(
                ("position", "attitude", "ranging"), squares, roots, strict=True
            )
        ),
        (Slow(("uav", "position"), roots[0], True),),
        0.01 * np.broadcast_to(np.eye(3), (n, 3, 3)),
        (Directed("timestamp_jitter/attitude/0", direction),),
        timing,
    )
    level = NoiseLevel((0.8, 1.1, 0.9), ((0.5, 0.4, 0.3),), ((3.0, 3.0, 3.0),), (0.7,))
    full = common_noise(
        time_s,
        0.01 * np.eye(3) + 0.9**2 * squares[2],
        np.concatenate([0.8 * roots[0], 1.1 * roots[1], timing, 0.7 * direction], axis=2),
        1.0 * roots[0] * np.sqrt([0.5, 0.4, 0.3]),
        3.0,
    )
    known, series = precision(parts, level), rng.standard_normal((n, 3, 4))
    expected = np.linalg.solve(full, series.reshape(3 * n, 4)).reshape(n, 3, 4)
    assert known.solve(series) == pytest.approx(expected, rel=1e-8, abs=1e-9)
    error = series[:, :, 0]
    density = multivariate_normal(np.zeros(3 * n), full).logpdf(error.ravel())
    assert known.negative_log_likelihood(error) == pytest.approx(-density, rel=1e-10)
    own = [full.reshape(n, 3, n, 3)[i, :, i, :].diagonal() for i in range(n)]
    assert marginal_variance(parts, level) == pytest.approx(np.array(own))


def test_cofactors_invert() -> None:
    white = example()[0]
    inverse, determinant = inverse_3x3(white)
    assert inverse == pytest.approx(np.linalg.inv(white), rel=1e-9)
    assert determinant == pytest.approx(np.linalg.det(white), rel=1e-9)


def structure(n: int, step_s: float = 0.2) -> Structure:
    time_s = np.arange(n) * step_s
    eye = np.broadcast_to(np.eye(3), (n, 3, 3))
    return Structure(
        time_s,
        (White(("uav", "position"), 1e-4 * eye),),
        (Slow(("uav", "position"), 1e-2 * eye, True),),
        np.zeros((n, 3, 3)),
    )


def test_the_noise_fit_finds_white_and_slow_noise() -> None:
    """800 rows, half of the variance slow with T = 8 s.

    The white factor is known to 1.5 %; the slow variance, from 160 s = 20 T on three axes, to
    about 20 %: both are allowed four standard errors.
    """
    rng, n = np.random.default_rng(4), 800
    parts = structure(n)
    slow = gauss_markov(parts.time_s, 8.0, rng.standard_normal((n, 3)))
    error = 1e-2 * np.sqrt(0.5) * (slow + rng.standard_normal((n, 3)))
    level, _ = fit_noise(parts, error, spec_bounds(parts), first_guess(parts))
    assert level.factor[0] == pytest.approx(np.sqrt(0.5), rel=0.06)
    assert np.mean(level.slow[0]) == pytest.approx(0.5, rel=0.8)
    assert 8.0 / 3 < level.time_constant_s[0][0] < 8.0 * 3


def test_white_noise_stays_white() -> None:
    rng, n = np.random.default_rng(5), 800
    parts = structure(n)
    error = 1e-2 * rng.standard_normal((n, 3))
    level, nll = fit_noise(parts, error, spec_bounds(parts), first_guess(parts))
    assert level.factor[0] == pytest.approx(1.0, rel=0.06)
    assert max(level.slow[0]) < 0.05
    assert nll == pytest.approx(precision(parts, level).negative_log_likelihood(error))


@pytest.mark.parametrize("step_s", [0.5, 1.0, 5.0])
def test_slow_noise_does_not_pass_for_white_noise_in_rows_far_apart(step_s: float) -> None:
    """Noise that is forgotten from row to row is white: of twice the spec's size, all of it.

    800 rows tell the factor to 1.5 %, four standard errors are allowed.
    """
    rng, n = np.random.default_rng(6), 800
    parts = structure(n, step_s)
    error = 2e-2 * rng.standard_normal((n, 3))
    bounds = spec_bounds(parts).opened(parts, ("uav", "position"), "factor")
    level, _ = fit_noise(parts, error, bounds, first_guess(parts))
    assert level.factor[0] == pytest.approx(2.0, rel=0.06)
    kept, _ = fit_noise(parts, error, spec_bounds(parts), first_guess(parts))
    assert kept.time_constant_s[0][0] >= 1.99 * step_s


def test_the_threshold_is_what_clean_scores_reach() -> None:
    """Three correlated candidates: the stated 5 % against fresh draws.

    20 000 draws give 5 % with a standard error of 0.15 %, the threshold's own 3000 draws add
    0.4 %: four of the two together are 1.7 %.
    """
    rng = np.random.default_rng(6)
    root = rng.standard_normal((5, 5))
    normal = root @ root.T + np.eye(5)
    groups = (slice(0, 1), slice(1, 2), slice(2, 5))
    threshold = clean_threshold(Gram(np.zeros(5), normal, groups, 0.0), 0.05, rng)
    draws = np.random.default_rng(7).multivariate_normal(np.zeros(5), normal, 20_000)
    least = np.zeros(20_000)
    for g in groups:
        squares = np.einsum("ni,ij,nj->n", draws[:, g], np.linalg.inv(normal[g, g]), draws[:, g])
        least = np.minimum(least, chi2.logsf(squares, g.stop - g.start))
    assert np.mean(least < threshold) == pytest.approx(0.05, abs=0.017)


@pytest.mark.parametrize("freedom", [1, 2, 3])
def test_log_p_far_out_follows_mpmath(freedom: int) -> None:
    import mpmath

    for statistic in (3.0, 300.0, 20_000.0):
        upper = mpmath.gammainc(mpmath.mpf(freedom) / 2, mpmath.mpf(statistic) / 2)
        exact = float(mpmath.log(upper / mpmath.gamma(mpmath.mpf(freedom) / 2)))
        assert log_p_of(statistic, freedom) == pytest.approx(exact, rel=1e-3)


def test_tails_are_told_from_normal_noise() -> None:
    """3 x 2000 draws: nu = 3 is known to about 5 %; normal noise gains nothing beyond luck."""
    rng = np.random.default_rng(8)
    heavy = tails_of(rng.standard_t(3.0, (2000, 3)))
    assert heavy.gain > 200
    assert heavy.degrees_of_freedom == pytest.approx(3.0, rel=0.25)
    assert heavy.freedom_uncertainty < 0.5
    normal = tails_of(rng.standard_normal((2000, 3)))
    assert normal.gain < 10
    assert normal.outlier_rate < 0.002
    struck = rng.standard_normal((2000, 3))
    struck[:40] *= 12.0
    assert tails_of(struck).outlier_rate == pytest.approx(0.02, abs=0.006)


@pytest.mark.parametrize(
    ("freedom", "rate"),
    [(3.0, 0.0), (5.0, 0.0), (2.3, 0.0), (200.0, 0.03), (200.0, 0.1), (6.0, 0.05)],
)
def test_far_rows_are_tails_or_outliers_and_not_both(freedom: float, rate: float) -> None:
    """What the fit charges is the deviation of what was drawn, known to 15 % from the mixture.

    3000 rows of three axes; a row is normal with ten times the deviation, or Student's t.  At
    nu = 2.3 the deviation itself hangs on the last draws: there only the share is judged.
    """
    rng = np.random.default_rng(int(freedom * 10 + 1000 * rate))
    drawn = rng.standard_t(freedom, (3000, 3))
    struck = rng.random(3000) < rate
    drawn[struck] = 10.0 * rng.standard_normal((int(struck.sum()), 3))
    found = tails_of(drawn)
    assert found.outlier_rate == pytest.approx(rate, abs=0.01)
    if freedom > 2.5:
        variance = (1 - rate) * freedom / (freedom - 2) + 100 * rate
        nu = found.degrees_of_freedom
        fitted = (1 - found.outlier_rate) * nu / (nu - 2) + 100 * found.outlier_rate
        assert np.sqrt(fitted) == pytest.approx(np.sqrt(variance), rel=0.15)


def late(seconds: float, sensor: ActsOn = "position") -> Acting:
    return acting("latency", sensor, 0, {"latency_s": seconds})


def test_whole_seconds_are_a_slip_and_others_a_latency() -> None:
    slip = whole_seconds(late(1.0005), 0.0001)
    assert slip is not None
    assert slip.label == ("integer_second_slip", "position", 0)
    assert slip.values == {"seconds": 1.0}
    assert whole_seconds(late(-17.9999), 0.001) is not None
    assert whole_seconds(late(0.88), 0.03) is None
    assert whole_seconds(late(0.0001), 0.001) is None
    assert whole_seconds(late(1.0, "attitude"), 0.001) is None
    assert whole_seconds(acting("filter_lag", "position", 0, {"time_constant_s": 1.0}), 0.1) is None


def test_splines_stop_at_gaps_and_hold_beyond_ends() -> None:
    time_s = np.concatenate([np.arange(0, 5, 0.1), np.arange(20, 25, 0.1)])
    series = np.stack([np.sin(time_s), np.cos(time_s), time_s], axis=1)
    made = pieces(time_s, series)
    assert len(made.starts) == 2
    inside = made.integral(time_s[5:40], time_s[5:40] + 0.25, time_s[5:40])
    exact = np.cos(time_s[5:40]) - np.cos(time_s[5:40] + 0.25)
    assert inside[:, 0] == pytest.approx(exact, abs=1e-6)
    last = made.integral(time_s[49:50], time_s[49:50] + 2.0, time_s[49:50])
    assert last[0] == pytest.approx(2.0 * series[49], abs=1e-9)


def test_figures_read_as_people_write_them() -> None:
    assert format_estimate(0.0871, 0.0003, "s") == "87.1 ± 0.3 ms"
    assert format_estimate(-0.37, 0.004, "m") == "-37.0 ± 0.4 cm"
    assert format_estimate(0.01745329252, 0.0001745, "rad") == "1.000 ± 0.010 deg"
    assert format_estimate(2.5, 0.12) == "2.50 ± 0.12"
    assert format_estimate(659e-6, 5317e-6, "m") == "1 ± 5 mm"
    assert format_estimate(768e-6, 937e-6, "m") == "768 ± 937 um"
    assert format_estimate(0.0, None, "s") == "0 s"
