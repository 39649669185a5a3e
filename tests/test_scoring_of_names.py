"""What the study of `diagnose` takes for the right name."""

from __future__ import annotations

from typing import Any

import pytest

from benchmarks.study_scoring import stands_for
from tests.world import hidden, make_log, scenario


@pytest.mark.parametrize(
    ("change", "right"),
    [
        ({}, True),
        ({"sensor": "attitude"}, False),
        ({"effect": "filter_lag"}, False),
        ({"from_s": 45.0}, False),
        ({"to_s": 50.0}, False),
        ({"from_s": None, "to_s": None}, False),
    ],
    ids=["as it is", "sensor", "effect", "from", "to", "all along"],
)
def test_a_delay_from_a_steps_moment_to_the_end_is_that_step(
    change: dict[str, Any], right: bool
) -> None:
    step = hidden("timestamp_step", "position", step_s=0.04, time_s=33.0)
    log = make_log(scenario("car_stops", 6, 60.0, 2.0), (step,))
    delay = {"effect": "latency", "sensor": "position", "aliases": [], "from_s": 33.5, "to_s": 59.5}
    assert stands_for(log, step, {**delay, **change}) is right
