"""Whether a stretch holds a constant or slow noise, on made rows whose truth is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from syncline_design.comparison.by_stretch import InStretches
from syncline_design.comparison.on_paper import OnPaper
from syncline_design.diagnosis.noise_course import CourseRows, OverNoise, over_noise
from syncline_design.diagnosis.stretches import Stands, Stretches
from syncline_design.effects.record import Array
from syncline_design.machine.linear_algebra import one_thread

SEEDS = range(3)
TIME_S = np.arange(0.0, 100.0, 0.2)
FROM_S, TO_S = 40.0, 59.8
BESIDE = (TIME_S >= FROM_S) & (TIME_S <= TO_S)
ENOUGH = 4.5 + math.log(3.0 * 100.0 / 20.0)  # nat, of the best of three places a length


def _rows(value: Array, source: np.random.Generator, delay_s: float = 0.0) -> CourseRows:
    """Rows that tell a sensor's readings (n, 3) by three components, and what it is late by.

    Its rates, by which a delay turns what it tells, come and go over 17 s.
    """
    noise = source.normal(size=(len(value), 3, 3))
    rate = np.sin(2.0 * math.pi * TIME_S / 17.0)[:, None] * np.array([0.2, -0.3, 1.0])
    late = np.einsum("nij,nj->ni", noise, rate)
    left = np.einsum("nij,nj->ni", noise, value) + source.normal(size=value.shape)
    left += delay_s * late * BESIDE[:, None]
    other = source.normal(size=(len(value), 3, 3))  # another sensor's
    return CourseRows(TIME_S, left, (noise, other), (late[:, :, None] if delay_s else noise,))


def _over(rows: CourseRows) -> OverNoise:
    with one_thread():
        return over_noise(rows, FROM_S, TO_S)


def _walk(source: np.random.Generator, memory_s: float) -> Array:
    keep = math.exp(-0.2 / memory_s)
    made = source.normal(size=(len(TIME_S), 3))
    for k in range(1, len(made)):
        made[k] = keep * made[k - 1] + math.sqrt(1.0 - keep**2) * made[k]
    return made


@pytest.mark.parametrize("memory_s", [10.0, 20.0])
@pytest.mark.parametrize("only_there", [True, False])
def test_slow_noise_is_no_constant(memory_s: float, only_there: bool) -> None:
    found = []
    for seed in SEEDS:
        source = np.random.default_rng([seed, 3])
        value = 2.0 * _walk(source, memory_s) * (BESIDE[:, None] if only_there else 1.0)
        found.append(_over(_rows(value, source)))
    assert all(one.gain < ENOUGH for one in found)
    assert all(one.behind[0] == 0.0 and one.behind[1] > 4.5 for one in found)  # whose it is


@pytest.mark.parametrize("size", [2.0, 4.0])
def test_turn_for_a_while_is_a_constant(size: float) -> None:
    gains = []
    for seed in SEEDS:
        source = np.random.default_rng([seed, 3])
        value = np.zeros((len(TIME_S), 3))
        value[BESIDE, 2] = size
        gains.append(_over(_rows(value, source)).gain)
    assert min(gains) > ENOUGH


@pytest.mark.parametrize("delay", [1.0, 4.0])
def test_delay_for_a_while_is_a_constant(delay: float) -> None:
    """Although a course of the readings follows what a delay makes of slow turns."""
    gains = []
    for seed in SEEDS:
        source = np.random.default_rng([seed, 3])
        still = np.zeros((len(TIME_S), 3))
        gains.append(_over(_rows(still, source, delay)).gain)
    assert min(gains) > ENOUGH


def test_course_is_as_likely_as_the_density_of_its_rows() -> None:
    """A course alone, and beside a constant, by the covariance of all rows written out."""
    from syncline_design.diagnosis.noise_course import _likelihoods, _Sums

    source = np.random.default_rng(5)
    noise, constant = source.normal(size=(6, 3, 2)), source.normal(size=(6, 3, 1))
    left = source.normal(size=(6, 3))
    root = np.linalg.cholesky(0.7**2 * np.exp(-np.abs(np.subtract.outer(range(6), range(6))) / 3.0))
    normal = np.einsum("nij,nik->njk", noise, noise)
    sums = _Sums(
        normal,
        np.einsum("nij,ni->nj", noise, left),
        np.einsum("nij,nik->njk", noise, constant),
        np.einsum("nij,nik->jk", constant, constant),
        np.einsum("nij,ni->j", constant, left),
    )
    alone, more = _likelihoods(sums, root, [1])
    loading = np.zeros((18, 12))
    for k in range(6):
        loading[3 * k : 3 * k + 3, 2 * k : 2 * k + 2] = noise[k]
    covariance = np.eye(18) + loading @ np.kron(root @ root.T, np.eye(2)) @ loading.T
    e, x = left.reshape(-1), constant.reshape(-1)
    known = np.linalg.solve(covariance, np.stack([e, x], axis=1))
    density = -0.5 * e @ known[:, 0] - 0.5 * np.linalg.slogdet(covariance)[1]
    assert alone == pytest.approx(density + 0.5 * e @ e, rel=1e-9)
    assert more[0] == pytest.approx(0.5 * (x @ known[:, 0]) ** 2 / (x @ known[:, 1]), rel=1e-9)


@pytest.mark.parametrize("whose", [(), ("attitude",)])
def test_what_slow_noise_does_as_well_is_not_said_to_be_broken(
    whose: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(OnPaper, "turned", lambda *_: True)
    monkeypatch.setattr(InStretches, "_together", lambda *_: [])
    label = ("mounting", "attitude", 0)
    stands = Stands(label, "van", 10.0, 30.0, ("x_rad",), (0.01,), (0.001,), -40.0, True,
                    inside=False, share=1.0, noise_of=whose)  # fmt: skip
    paper = OnPaper.__new__(OnPaper)
    parts = InStretches(paper, lambda *_: True, 100.0, Stretches((stands,)))
    doubts = list(parts.in_doubt())
    assert [each.may_be_sound for each in doubts] == ([True] if whose else [])
    if whose:
        (doubt,) = doubts
        assert [way.name for way in doubt.ways] == [
            "mounting (attitude)", "noise_understated (attitude)"
        ]  # fmt: skip
