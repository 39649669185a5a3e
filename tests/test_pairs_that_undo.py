"""Two departures that nearly undo each other: found together, and said where they stand in."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from syncline_design.diagnosis import proposals, search
from syncline_design.diagnosis.candidates import Candidate, Signature
from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.instead import InQuestion, others_in_place
from syncline_design.diagnosis.noise import NoiseLevel, as_specified
from syncline_design.diagnosis.pairs import in_the_place, promising
from syncline_design.diagnosis.scores import Gram, gram
from syncline_design.diagnosis.settings import DiagnosisSettings
from syncline_design.effects import registry
from tests.test_accept_stretches import settled, world
from tests.world import hidden, make_log

Array = NDArray[np.float64]


def named(effect: str, sensor: str) -> Candidate:
    return Candidate(registry()[effect], sensor, 0)  # type: ignore[arg-type]


def drive(seed: int, nearly: float) -> tuple[Array, Array, Array, Array]:
    """Of 600 rows: a delay, an arm that undoes it but for `nearly`, another delay, the noise."""
    rng = np.random.default_rng(seed)
    delay, own, noise = (rng.standard_normal(600) for _ in range(3))
    arm = -delay + nearly * rng.standard_normal(600)
    return delay, arm, own, noise


def test_nothing_stands_in_the_place_of_what_has_no_signature() -> None:
    """A line of the spectrum, of half a second of late angles: it ended in a traceback."""
    signs = [
        Signature(named("latency", sensor), {}, np.zeros((60, 3, 1)))
        for sensor in ("position", "attitude", "ranging")
    ]
    groups = tuple(slice(k, k + 1) for k in range(3))
    scored = [(object(), Gram(np.ones(3), np.eye(3), groups, 0.0))]
    assert in_the_place(scored, signs, ("spectral_line", "ranging", 0), lambda _: 0.0) == []  # type: ignore[arg-type]
    assert in_the_place(scored, signs, ("latency", "ranging", 0), lambda _: 0.0)  # type: ignore[arg-type]


def test_what_two_save_together_is_that_of_least_squares() -> None:
    """A delay and an arm: 1 of each leaves a tenth; by the sums of squares that a fit leaves."""
    delay, arm, other, noise = drive(1, 0.4)
    columns = np.stack([delay, arm, other], axis=1)
    error = noise + delay + arm
    signs = [
        Signature(named(*key), {}, np.zeros((600, 3, 1)))
        for key in (("latency", "position"), ("range_bias", "ranging"), ("latency", "attitude"))
    ]
    groups = tuple(slice(k, k + 1) for k in range(3))
    found = Gram(columns.T @ error, columns.T @ columns, groups, 0.0)
    level = object()
    ranked = promising([(level, found)], signs, 0.0)  # type: ignore[list-item]
    assert [s.candidate.label[:2] for s in ranked[0].pair] == [
        ("latency", "position"), ("range_bias", "ranging"),
    ]  # fmt: skip

    def left(at: list[int]) -> float:
        return float(np.linalg.lstsq(columns[:, at], error, rcond=None)[1][0])

    saved = 0.5 * (float(error @ error) - left([0, 1]))
    chance = -saved + np.log(3.0)  # chi-square of two has the tail exp(-x / 2); three pairs
    assert ranked[0].log_p == pytest.approx(chance, rel=1e-6)
    assert 0.5 * (float(error @ error) - left([0])) < 0.5 * saved


@pytest.mark.parametrize(("nearly", "told_apart"), [(0.003, False), (0.9, True)])
def test_a_pair_that_does_as_well_is_said_in_the_place_of_a_delay(
    nearly: float, told_apart: bool
) -> None:
    """The attitude's delay is a ranging delay beside an arm, but for a little: by construction."""
    rng = np.random.default_rng(2)
    ranging, arm, position = rng.standard_normal((3, 600))
    attitude = 0.7 * ranging - 0.7 * arm + nearly * rng.standard_normal(600)
    scale = 5.0
    columns = scale * np.stack([attitude, ranging, arm, position], axis=1)
    error = columns[:, 0] * 2.0 + rng.standard_normal(600)
    labels = (
        ("latency", "attitude", 0), ("latency", "ranging", 0), ("lever_arm", "ranging", 0),
        ("latency", "position", 0),
    )  # fmt: skip
    asked = InQuestion(
        labels, ("latency", "latency", "lever_arm", "latency"), ((0,), (1,), (2,), (3,)),
        columns.T @ columns, columns.T @ error,
    )  # fmt: skip
    found = others_in_place(asked, 0, frozenset())
    if told_apart:
        assert found is None
    else:
        assert found is not None
        assert found[0] == {1, 2}
        assert found[1] < 3.0


def test_a_delay_and_the_arm_that_hides_it_show_together(tmp_path: Path) -> None:
    """30 ms of ranging delay at some 6 m/s and an arm of 0.2 m: 1.5 bounds each, many together."""
    effects = (
        hidden("latency", "ranging", latency_s=0.02),
        hidden("lever_arm", "ranging", x_m=0.1, y_m=0.0, z_m=0.0),
    )
    run = world("car_stops", 3, 60.0, 4.0)
    spec = tmp_path / "spec.yaml"
    log = make_log(run, effects)
    spec.write_text(log.spec_yaml(), "utf-8")
    data, model, free = settled(spec, log.to_csv(tmp_path / "log.csv"))
    level = as_specified(data.structure)
    best, *_ = promising([(level, gram(data, model, free, level))], free, -5.0)
    kinds = {s.candidate.effect.breaks for s in best.pair}
    assert kinds == {"latency", "lever_arm"}


def test_one_look_scores_each_noise_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Effects alone and two by two are looked for in the same scores."""
    log = make_log(world("car_stops", 4, 60.0, 4.0))
    spec = tmp_path / "spec.yaml"
    spec.write_text(log.spec_yaml(), "utf-8")
    data, model, free = settled(spec, log.to_csv(tmp_path / "log.csv"))
    looked = search.start_search(data, DiagnosisSettings(), lambda _: None).proposals
    scores = gram(data, model, free, model.level)
    scored: list[NoiseLevel] = []

    def counted(data: Data, model: Model, of: Sequence[Signature], level: NoiseLevel) -> Gram:
        scored.append(level)
        return gram(data, model, of, level)

    monkeypatch.setattr(proposals, "gram", counted)
    assert looked.moving(model, scores, looked.threshold(scores)) is None
    assert len(scored) == len(set(scored)) == 1
