"""What a log could have hidden and still turns the verdict: against whole checks and draws."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from syncline_design.comparison.on_paper import OnPaper
from syncline_design.diagnosis.consequence import promise_of
from syncline_design.diagnosis.judged import Judged
from syncline_design.diagnosis.result import (
    Smallest,
)
from syncline_design.diagnosis.sight import _both, left_within
from syncline_design.model.known import EffectEntry
from syncline_design.spec.load import load
from syncline_design.verdict.verify import CheckSettings, check_loaded
from tests.acceptance_samples import EXAMPLE


@pytest.mark.parametrize(
    ("kind", "latency_s"),
    [("thu", 3.2e-3), ("monte_carlo, quantile: 0.95", 3.2e-3), ("rmse, axis: 3d", 1e-4)],
)
def test_what_turns_any_kind_of_requirement_may_not_stay_hidden(
    kind: str, latency_s: float, tmp_path: Path
) -> None:
    """As `check` says of the same spec with the latency listed; SYNC is relaxed out of the way."""
    limit = "0.10 m" if kind == "thu" else "0.098 m"  # rmse is 6 cm
    text = EXAMPLE.read_text("utf-8").replace(
        "{id: ACC-1, kind: accuracy, limit: 0.3 m}",
        f"{{id: S, kind: sync, limit: 1000}}\n  - {{id: R, kind: {kind}, limit: {limit}}}",
    )
    plain, listed = tmp_path / "plain.yaml", tmp_path / "listed.yaml"
    plain.write_text(text, "utf-8")
    listed.write_text(
        f"{text}effects: [{{effect: latency, sensor: position, stage: multirotor, "
        f"parameters: {{latency_s: {latency_s} s}}}}]\n", "utf-8")  # fmt: skip
    fails = check_loaded(load(listed), CheckSettings()).verdict != "meets"
    assert fails == (latency_s > 1e-3)
    shown = Smallest("latency", "position", "multirotor", "latency_s", 0.7 * latency_s, latency_s)
    paper = OnPaper(load(plain), ())
    assert paper.sound
    assert paper.hides(shown) == fails


def test_where_a_hidden_size_begins_to_turn_the_verdict(tmp_path: Path) -> None:
    """By bisection of whole specs, each with the latency listed."""
    case = load(EXAMPLE)
    low, high = 1e-3, 1e-2
    while high > 1.01 * low:
        middle = math.sqrt(low * high)
        path = tmp_path / "listed.yaml"
        path.write_text(
            EXAMPLE.read_text("utf-8")
            + "effects: [{effect: latency, sensor: position, stage: multirotor, "
            f"parameters: {{latency_s: {middle} s}}}}]\n", "utf-8")  # fmt: skip
        kept = check_loaded(load(path), CheckSettings(monte_carlo=False)).verdict == "meets"
        low, high = (middle, high) if kept else (low, middle)
    shown = Smallest("latency", "position", "multirotor", "latency_s", 0.02, 0.03)
    assert OnPaper(case, ()).turns_at(shown) == pytest.approx(high, rel=0.05)


def test_nearly_all_logs_show_what_is_said_to_be_sure() -> None:
    """The statistic of logs with that true value, drawn: beyond its threshold in 19 of 20."""
    covariance = np.array([[4e-6, 1e-6], [1e-6, 9e-6]])
    half, sure = _both(covariance, math.log(1e-4))
    rng = np.random.default_rng(2)
    limit = chi2.isf(1e-4, 2)
    for k in range(2):
        for size, least, most in ((half[k], 0.5, 0.6), (sure[k], 0.95, 0.98)):
            true = np.zeros(2)
            true[k] = size
            drawn = rng.multivariate_normal(true, covariance, size=20_000)
            statistic = np.einsum("ni,ij,nj->n", drawn, np.linalg.inv(covariance), drawn)
            assert least - 0.01 < np.mean(statistic > limit) < most


@pytest.mark.parametrize("scatter", [1.0, 2.0])
def test_what_is_there_is_left_open_in_19_of_20_logs(scatter: float) -> None:
    """Means of 16 blocks of a log whose departure is +-1; the states know half of their scatter."""
    rng, blocks, logs = np.random.default_rng(4), 16, 4000
    kept = np.zeros(2)
    for k in range(logs):
        truth = np.array([1.0, -1.0]) * (-1) ** k
        means = truth + scatter * rng.standard_normal((blocks, 2))
        mean = means.mean(0)
        less = (blocks * mean - means) / (blocks - 1)
        spread = (blocks - 1) / blocks * (less - less.mean(0)).T @ (less - less.mean(0))
        judged = Judged(mean, np.eye(2) * (0.5 * scatter) ** 2 / blocks, ((spread, blocks),))
        kept += left_within(judged) >= 1.0
    assert (kept / logs > 0.94).all()
    assert (kept / logs < 0.98).all()  # the larger of two spreads
    known = Judged(np.array([0.2, 0.0]), np.diag([0.01, 0.0]))
    assert left_within(known) == pytest.approx([0.2 + 1.645 * 0.1, math.inf], rel=1e-4)


def test_what_a_log_excludes_need_not_stand_out() -> None:
    """The lesser of what would have shown and of what is left open is held against the verdict."""
    paper = OnPaper(load(EXAMPLE), ())
    shown = Smallest("latency", "position", "multirotor", "latency_s", 0.02, 0.03)
    assert paper.hides(shown)
    assert not paper.hides(replace(shown, within=1e-4))
    assert paper.hides(replace(shown, within=0.02))


@pytest.mark.parametrize("latency_s", [1e-3, 4e-3])
def test_what_turns_the_sync_limit_that_nobody_wrote_turns_the_promise(
    latency_s: float, tmp_path: Path
) -> None:
    """As `check` says of the same spec with the latency listed; its one requirement is ACC-1."""
    case = load(EXAMPLE)
    promise = promise_of(case)
    assert promise is not None
    entry = EffectEntry("latency", "position", "multirotor", (("latency_s", latency_s),))
    listed = EXAMPLE.read_text("utf-8") + (
        "effects: [{effect: latency, sensor: position, stage: multirotor, "
        f"parameters: {{latency_s: {latency_s} s}}}}]\n"
    )
    path = tmp_path / "listed.yaml"
    path.write_text(listed, "utf-8")
    verdict = check_loaded(load(path), CheckSettings(monte_carlo=False))
    assert promise.turned([entry]) == (verdict.verdict != "meets") == (latency_s > 2.7e-3)
    at = promise.turns_at(entry, "latency_s", 4e-3)
    sides = [replace(entry, parameters=(("latency_s", at * share),)) for share in (1 - 1e-9, 1.0)]
    assert [promise.turned([one]) for one in sides] == [False, True]
