"""Whole verdicts of random specs against plain enumeration, which shares no code with the package:
no false PASS, no false INFEASIBLE, the cheapest design, the figures of every requirement.

60 specs without one disagreement bound the rate of wrong verdicts by 5 % with 95 % confidence
(3 / N); `benchmarks/choice.py` takes the same question to 10 000 problems.
"""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest
import yaml

from plain_enumeration import Enumeration, Outcome, failed
from syncline_design.spec.load import load
from syncline_design.verdict.verify import CheckSettings, check_loaded
from test_random_specs import MOST_DESIGNS, draw_spec, size

WITHOUT_SIMULATION = CheckSettings(monte_carlo=False)


def with_accuracy(
    spec: dict[str, Any], outcomes: list[Outcome], rng: random.Random
) -> dict[str, Any]:
    """The spec with an accuracy limit that some of its designs meet and others don't."""
    totals = sorted(outcome.total_m for outcome in outcomes)
    limit = rng.choice(totals) * rng.choice([0.999, 1.001, 1.2])
    accuracy = {"id": "A", "kind": "accuracy", "limit": f"{limit!r} m"}
    return {**spec, "requirements": [*spec["requirements"], accuracy]}


def matching(verdict: dict[str, Any], outcomes: list[Outcome]) -> Outcome:
    """The enumerated design that a verdict shows."""
    chosen = [
        (entry["sensor"], entry["timestamping"], entry["primitive"])
        for stage in verdict["design"]["stages"]
        for role in ("position", "attitude", "ranging")
        if (entry := stage["roles"].get(role)) is not None
    ]
    clocks = {clock["id"] for clock in verdict["design"]["clocks"]}
    (found,) = [
        outcome
        for outcome in outcomes
        if [(o.sensor, o.method, o.primitive) for o in outcome.options] == chosen
        and {clock for clock in outcome.clocks if clock is not None} == clocks
        and outcome.cost == pytest.approx(verdict["design"]["cost"], rel=1e-12)
        and outcome.total_m == pytest.approx(verdict["syncline"]["total_m"], rel=1e-9)
    ][:1]
    return found


def test_whole_verdicts_of_random_specs(tmp_path: Path) -> None:
    rng = random.Random(7)
    words: list[str] = []
    while len(words) < 60:
        drawn = draw_spec(rng)
        if not 1 <= size(drawn) <= MOST_DESIGNS:
            continue
        outcomes = list(Enumeration(drawn))  # an accuracy limit takes away none of them
        spec = with_accuracy(drawn, outcomes, rng)
        path = tmp_path / f"{len(words)}.yaml"
        path.write_text(yaml.safe_dump(spec, sort_keys=False), "utf-8")
        verdict = check_loaded(load(path), WITHOUT_SIMULATION).to_json()
        good = [outcome for outcome in outcomes if not failed(spec, outcome)]
        words.append(verdict["verdict"])
        if Enumeration(spec, gnss_everywhere=True).count > 1:
            assert verdict["verdict"] == ("meets" if good else "infeasible"), path.read_text()
        else:
            assert verdict["verdict"] == ("meets" if good else "fails"), path.read_text()
        if good:
            assert verdict["design"]["cost"] == pytest.approx(min(o.cost for o in good), rel=1e-12)
            outcome = matching(verdict, outcomes)
            assert verdict["syncline"]["tau_s"] == pytest.approx(outcome.tau_s, rel=1e-12)
            values = {r["id"]: r["value"] for r in verdict["requirements"]}
            assert values["S"] == pytest.approx(outcome.sync, rel=1e-9)
    assert min(words.count("meets"), words.count("infeasible")) >= 10
