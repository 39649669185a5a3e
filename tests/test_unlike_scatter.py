"""Odd logs or another value in every log: `--joint` where one effect scatters.

Oracles: dense normal densities of the values by log, sets of logs drawn here.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from syncline_design.campaign import odd_or_scattering
from syncline_design.campaign.odd_or_scattering import DIFFERING, ODD, SIZES, rather_scatters
from syncline_design.campaign.pool import Pool, Term
from syncline_design.campaign.unlike import unlike_logs
from tests.test_joint import UNITS
from tests.test_unlike_logs import logs_of

SIGMA = 1.0 / 8.0  # of a unit: what one log of 64 rows leaves unsure


def arm(pool: Pool) -> Term:
    (found,) = (t for t in pool.terms if t.label[0] == "lever_arm")
    return found


def along_y(rng: np.random.Generator, values: np.ndarray) -> Pool:
    """Logs whose lever arm has these values along y, in standard deviations of one log."""
    own = [np.array([0.0, 0.0, SIGMA * v, 0.0, 0.0]) * UNITS for v in values]
    return logs_of(own, rng)[0]


@pytest.mark.parametrize("seed", range(6))
def test_the_odds_are_those_of_dense_densities(seed: int) -> None:
    """Estimates by log, normal about a common arm of any size, with values of their own in some."""
    rng = np.random.default_rng(seed)
    moved = np.where(np.arange(5) == 4, 6.0, 0.3) if seed % 2 else 3.0 * rng.standard_normal(5)
    pool = along_y(rng, moved)
    term, odd = arm(pool), np.array([4])
    normal = pool.normal[:, term.index[:, None], term.index]
    score = pool.score[:, term.index]
    values = np.concatenate([np.linalg.solve(n, s) for n, s in zip(normal, score, strict=True)])
    noise, common = np.zeros((15, 15)), np.tile(np.diag(50.0 * UNITS[1:4]), (5, 1))
    for k in range(5):
        noise[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = np.linalg.inv(normal[k])

    def log_apart(rows: np.ndarray) -> float:
        found = []
        for axes, share in (([0, 1, 2], 1.0), ([0], 1 / 3), ([1], 1 / 3), ([2], 1 / 3)):
            usual = np.linalg.inv(normal.mean(axis=0)[np.ix_(axes, axes)])
            for size in SIZES:
                cover = noise + common @ common.T
                for k in rows:
                    at = [3 * k + a for a in axes]
                    cover[np.ix_(at, at)] += size**2 * usual
                units = np.tile(UNITS[1:4], 5)  # densities in units near one
                scaled = multivariate_normal(cov=cover / np.outer(units, units))
                found.append(np.log(share) + scaled.logpdf(values / units))
        return float(np.logaddexp.reduce(found))

    every = np.log(DIFFERING) + log_apart(np.arange(5))
    alone = np.log(ODD) + log_apart(odd)
    assert abs(every - alone) > 0.1  # the oracle is asked where it has an answer
    assert rather_scatters(pool, (), odd, term) == (every > alone)
    told = odd_or_scattering._log_apart(normal, score, term, np.arange(5))
    told -= odd_or_scattering._log_apart(normal, score, term, odd)
    assert told == pytest.approx(log_apart(np.arange(5)) - log_apart(odd), abs=1e-2)


def test_of_logs_that_scatter_none_is_left_out() -> None:
    """Nine logs, one axis of an arm another in each by eight standard deviations of a log: some
    would be left out, and the mean of those that agree told as the build's, in half of such sets.
    Of 20 more than three with a chance of 1.6 % where one in twenty is."""
    rng = np.random.default_rng(21)
    sets = [along_y(rng, 8.0 * rng.standard_normal(9)) for _ in range(20)]
    assert sum(bool(unlike_logs(pool, [arm(pool)])) for pool in sets) <= 3


@pytest.mark.parametrize(("logs", "odd"), [(6, 1), (9, 2), (9, 3)])
def test_what_moved_in_few_logs_is_found_in_these(logs: int, odd: int) -> None:
    """Ten standard deviations in some logs; of 20 sets fewer than 16 with a chance of 1.1 % where
    nine in ten are found."""
    rng = np.random.default_rng(logs + odd)
    moved = np.where(np.arange(logs) < odd, 10.0 * (-1.0) ** np.arange(logs), 0.0)
    sets = [along_y(rng, 24.0 + moved) for _ in range(20)]
    right = [
        sorted(one.run for one in unlike_logs(pool, [arm(pool)])) == list(range(odd))
        for pool in sets
    ]
    assert sum(right) >= 16
