"""What is hardly ever met in a class: charged by hand, and named after what is usual."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.campaign.naming import Naming
from syncline_design.campaign.pool import pool_of
from syncline_design.diagnosis.sufficient import Sufficient
from syncline_design.diagnosis.unusual import UNUSUAL_NATS, unusual_nats
from syncline_design.effects import registry

LATE, FAST = ("latency", "position", 0, "latency_s"), ("clock_drift", "position", 0, "rate")
LATE_S, ALIKE = 1e-4, 0.97  # standard uncertainty of the latency; correlation with the drift


@pytest.mark.parametrize(
    ("rate", "spread", "nats"),
    [
        (5e-5, 1e-5, 0.0),  # usual: a crystal of 50 ppm
        (1.1e-4, 1e-5, 0.5),  # one standard uncertainty beyond 100 ppm
        (-1.2e-4, 1e-5, 2.0),  # two, and its sign does not matter
        (4e-4, 1e-5, UNUSUAL_NATS),
        (4e-4, 4e-4, 0.28125),  # (3 / 4)^2 / 2: it may as well be a usual one
        (4e-4, 0.0, 0.0),  # not seen
    ],
)
def test_a_drift_beyond_what_crystals_do_is_charged(
    rate: float, spread: float, nats: float
) -> None:
    effect = registry()["clock_drift"]
    assert unusual_nats(effect, np.array([rate]), np.array([spread])) == pytest.approx(nats)


def test_what_has_no_usual_size_is_not_charged() -> None:
    effect = registry()["latency"]
    assert unusual_nats(effect, np.array([1.9]), np.array([1e-6])) == 0.0


@pytest.mark.parametrize(("rate_s", "named"), [(4e-5, "latency"), (4e-6, "clock_drift")])
def test_a_class_is_led_by_what_is_usual(rate_s: float, named: str) -> None:
    """Drift fits 2.5 nat better (10.2 against 9.95 deviations) in both; it is 408 or 41 ppm."""
    spread = np.array([LATE_S, rate_s])
    normal = np.array([[1.0, ALIKE], [ALIKE, 1.0]]) / np.outer(spread, spread)
    score = np.array([9.95, 10.2]) / spread
    one = Sufficient((LATE, FAST), normal, score, 0.0, np.eye(2), ())
    (found,) = Naming(pool_of([one], [1]), 0.05, 4).named().terms
    assert found.scoped.term.label[0] == named
    (rival,) = found.rivals
    less = 0.5 * (10.2**2 - 9.95**2)
    expected = {"latency": UNUSUAL_NATS - less, "clock_drift": less}
    assert rival.worse == pytest.approx(expected[named])
