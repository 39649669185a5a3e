"""As how many tries the search over effects counts: by Sidak's formula where they are independent,
as one where they are the same, and false names as often as is allowed, no oftener.
"""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.campaign.naming import Naming
from syncline_design.campaign.pool import Pool, pool_of
from syncline_design.campaign.tries import tries_of
from syncline_design.diagnosis.sufficient import Sufficient

LABELS = (
    ("latency", "position", 0, "latency_s"),
    ("latency", "attitude", 0, "latency_s"),
    ("latency", "ranging", 0, "latency_s"),
    ("range_bias", "ranging", 0, "bias_m"),
    ("range_scale", "ranging", 0, "scale"),
    ("heading_drift", "attitude", 0, "rate_radps"),
)
UNITS = np.array([1e-3, 1e-3, 1e-3, 1e-2, 1e-3, 1e-6])
ROWS = 256


def pool(rng: np.random.Generator, alike: float) -> Pool:
    """A log of unit noise and nothing else; alike: cosine of any two columns."""
    common = rng.standard_normal((ROWS, 1))
    columns = np.sqrt(alike) * common + np.sqrt(1.0 - alike) * rng.standard_normal((ROWS, 6))
    if alike == 0.0:
        columns = np.sqrt(ROWS) * np.linalg.qr(columns)[0]
    columns /= UNITS
    normal = columns.T @ columns
    score = columns.T @ rng.standard_normal(ROWS)
    return pool_of([Sufficient(LABELS, normal, score, float(ROWS), normal / ROWS, ())], [0])


def test_the_effects_are_known() -> None:
    assert len(pool(np.random.default_rng(0), 0.0).terms) == len(LABELS)


@pytest.mark.parametrize("rate", [0.05, 0.2])
def test_independent_effects_count_each_and_equal_ones_once(rate: float) -> None:
    """Sidak: q = 1 - (1 - rate)^(1/n).  4000 draws know q to 7 % at 5 %."""
    rng = np.random.default_rng(1)
    own = pool(rng, 0.0)
    sidak = rate / (1.0 - (1.0 - rate) ** (1.0 / 6.0))
    assert tries_of(own, own.terms, rate) == pytest.approx(sidak, rel=0.2)
    one = pool(rng, 1.0 - 1e-9)
    assert tries_of(one, one.terms, rate) == pytest.approx(1.0, abs=0.1)
    some = tries_of(pool(rng, 0.9), own.terms, rate)
    assert 1.3 < some < 5.0


def test_tries_do_not_depend_on_units_or_the_order_of_rounding() -> None:
    own = pool(np.random.default_rng(2), 0.7)
    first = tries_of(own, own.terms, 0.05)
    turned = Pool(own.labels, own.normal * (1.0 + 1e-14), own.score, own.gram, own.less, own.starts)
    assert tries_of(turned, turned.terms, 0.05) == pytest.approx(first, rel=1e-6)


def test_clean_logs_are_named_as_often_as_allowed() -> None:
    """Six effects of cosine 0.95 in 600 logs of noise: 5 % are 30, more than 47 have a chance of
    0.1 %; Bonferroni's charge of six names in some 2 % (fewer than 17 here have one of 0.3 %)."""
    rng, named = np.random.default_rng(3), 0
    for _ in range(600):
        own = pool(rng, 0.95)
        named += bool(Naming(own, 0.05, 4).named().terms)
    assert 17 <= named <= 47
