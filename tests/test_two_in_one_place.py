"""Short drives on which one effect looks like another one, or like two of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.plan import one_plan
from syncline_design.diagnosis.candidates import Candidate, Signature
from syncline_design.diagnosis.pairs import SLACK_NATS, SLACK_SHARE, in_the_place
from syncline_design.diagnosis.scores import Gram
from syncline_design.effects import registry

LABELS = ("lever_arm", "position"), ("range_bias", "ranging"), ("latency", "position")


def test_two_that_do_better_than_one_are_ranked_by_least_squares() -> None:
    """An arm along which a bias and a delay lie, two figures beside one: sums of squares that
    numpy's least squares leave say by how much the pair is better."""
    rng = np.random.default_rng(3)
    bias, delay, noise = rng.standard_normal((3, 400))
    arm = 0.8 * bias + 0.6 * delay + 0.3 * rng.standard_normal(400)
    columns, error = np.stack([arm, bias, delay], axis=1), 0.8 * bias + 0.6 * delay + noise
    free = [
        Signature(Candidate(registry()[effect], sensor, 0), {}, np.zeros((400, 3, 1)))  # type: ignore[arg-type]
        for effect, sensor in LABELS
    ]
    scores = Gram(
        columns.T @ error, columns.T @ columns, tuple(slice(k, k + 1) for k in range(3)), 0.0
    )

    def left(at: list[int]) -> float:
        return float(np.linalg.lstsq(columns[:, at], error, rcond=None)[1][0])

    def free_of_charge(figures: int) -> float:
        return 0.0

    level = object()
    (found,) = in_the_place([(level, scores)], free, (*LABELS[0], 0), free_of_charge)  # type: ignore[list-item]
    assert {s.candidate.label[:2] for s in found.pair} == {LABELS[1], LABELS[2]}
    assert found.more == pytest.approx(0.5 * (left([0]) - left([1, 2])), rel=1e-6)
    small = Gram(scores.score * np.array([9.0, 1.0, 1.0]), scores.normal, scores.groups, 0.0)
    slack = max(SLACK_NATS, SLACK_SHARE * 0.5 * (float(error @ error) - left([0])))
    for worth, there in ((found.more + slack - 0.1, True), (found.more + slack + 0.1, False)):
        again = in_the_place([(level, scores)], free, (*LABELS[0], 0), lambda figures: worth)  # type: ignore[list-item] # noqa: B023
        assert bool(again) is there
    assert not in_the_place([(level, small)], free, (*LABELS[0], 0), free_of_charge)  # type: ignore[list-item]


@pytest.mark.parametrize("number", [74, 159])
def test_a_range_bias_beside_a_delay_is_not_told_as_an_arm(number: int, tmp_path: Path) -> None:
    """Ships that look down for 8 s: an arm alone gains more than either of the two, and both
    together gain 7 to 14 nat more than the arm, with a figure less."""
    row = one_plan(number, tmp_path)
    assert row["resolved"] == [True, True]
    assert all(abs(z) < 4.0 for _, z, _ in row["z"])  # type: ignore[attr-defined]


def test_what_falls_makes_way_for_what_stands(tmp_path: Path) -> None:
    """A ship's antenna arm off by 4.6 cm: an error of the speed of sound fits as well in the
    model's noise, and is nothing that slow noise would not show; the log must not agree."""
    row = one_plan(26, tmp_path)
    assert row["verdict"] == "explained"
    assert row["resolved"] == [True]
