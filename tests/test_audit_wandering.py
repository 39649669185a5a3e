"""A clock that wanders is one fault, and what steps, drifts or settles is not called that."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from syncline_design.auditing.result import StreamAudit
from syncline_design.auditing.run import audit
from syncline_design.auditing.wandering import profiled, smoothed

Array = NDArray[np.float64]
Course = Callable[[Array, float, np.random.Generator], Array]
DELAY_S = 2e-3


def walk(t: Array, size: float, rng: np.random.Generator) -> Array:
    """A random walk that is `size` off after the log, one standard deviation."""
    steps = rng.standard_normal(t.size) * np.sqrt(np.diff(t, prepend=t[0]))
    return size / float(np.sqrt(np.ptp(t))) * np.cumsum(steps)


def gauss_markov(t: Array, size: float, rng: np.random.Generator) -> Array:
    """A first-order Gauss-Markov course of this size whose memory is a tenth of the log."""
    keeps = np.exp(-np.diff(t, prepend=t[0]) / (0.1 * float(np.ptp(t))))
    found = np.zeros(t.size)
    for k in range(1, t.size):
        fresh = float(np.sqrt(1.0 - keeps[k] ** 2)) * rng.standard_normal()
        found[k] = keeps[k] * found[k - 1] + fresh
    return size * found


def step(t: Array, size: float, rng: np.random.Generator) -> Array:
    return np.where(t > t[0] + float(np.ptp(t)) * rng.uniform(0.3, 0.7), size, 0.0)


def ramp(t: Array, size: float, _rng: np.random.Generator) -> Array:
    return size * (t - t[0]) / float(np.ptp(t))


def lock(t: Array, size: float, rng: np.random.Generator) -> Array:
    at = t[0] + float(np.ptp(t)) * rng.uniform(0.2, 0.6)
    return np.where(t > at, size * np.exp(-np.maximum(t - at, 0.0) / (0.1 * float(np.ptp(t)))), 0.0)


def recorded(folder: Path, stamp: Array, receive: Array) -> StreamAudit:
    rows = (f"{round(a * 1e9)},{round(b * 1e9)}" for a, b in zip(stamp, receive, strict=True))
    path = folder / "sensor.csv"
    path.write_text("stamp_ns,receive_ns\n" + "\n".join(rows) + "\n", encoding="utf-8")
    (found,) = audit([path]).streams
    return found


def measured(seed: int) -> tuple[Array, Array, np.random.Generator]:
    """Moments of a regular sensor, 10 to 50 Hz for 60 or 120 s, and when messages of it came."""
    rng = np.random.default_rng(seed)
    rate, length = rng.choice([10.0, 25.0, 50.0]), rng.choice([60.0, 120.0])
    own = 1.0 + rng.uniform(-3e-5, 3e-5)
    t = 1.7e9 + np.arange(int(rate * length)) / rate * own
    t = t + 1e-4 * rng.standard_normal(t.size)
    late = 3e-4 + rng.gamma(1.5, DELAY_S / 1.5, t.size)
    return t, np.maximum.accumulate(t + late), rng


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("course", [walk, gauss_markov], ids=["walk", "gauss_markov"])
def test_a_clock_that_wanders_is_one_drift(course: Course, seed: int, tmp_path: Path) -> None:
    """Ten of ten; before, of 72 such logs 2 were told so and the others as steps and locks."""
    t, receive, rng = measured(700 + seed)
    moved = course(t, 5.0 * DELAY_S, rng)
    found = recorded(tmp_path, t + moved, receive)
    (one,) = found.faults
    assert (one.fault, one.parameters["kind"]) == ("drift", "wandering")
    assert one.parameters["span_s"] == pytest.approx(float(np.ptp(moved)), rel=0.15)
    assert not [one for one in found.cannot_show if "receipts move to and fro" in one]
    true = float(np.ptp(receive - t))
    assert 0.9 * true < (found.residual_s.bound or 0.0) < 1.1 * true + 1e-3


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("course", "name"),
    [(step, "step"), (ramp, "drift"), (lock, "relock")],
    ids=["step", "drift", "relock"],
)
def test_what_has_a_shape_of_its_own_does_not_wander(
    course: Course, name: str, seed: int, tmp_path: Path
) -> None:
    t, receive, rng = measured(800 + seed)
    found = recorded(tmp_path, t + course(t, 5.0 * DELAY_S, rng), receive)
    assert [(one.fault, one.parameters.get("kind")) for one in found.faults] == [(name, None)]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("whose", ["transport", "sensor"])
def test_what_wanders_beside_stamps_is_no_fault_of_theirs(
    whose: str, seed: int, tmp_path: Path
) -> None:
    """Delays that wander while stamps are even; a sensor that measures unevenly and says so."""
    t, receive, rng = measured(900 + seed)
    moved = gauss_markov(t, 5.0 * DELAY_S, rng)
    moved -= moved.min()
    stamp = t + moved if whose == "sensor" else t
    found = recorded(tmp_path, stamp, np.maximum.accumulate(receive + moved))
    assert not [one for one in found.faults if one.parameters.get("kind") == "wandering"]


@pytest.mark.parametrize("ratio", [0.0, 0.03, 4.0])
def test_the_likelihood_of_a_walk_is_that_of_its_dense_covariance(ratio: float) -> None:
    """Of differences, at the likeliest variance; the constant n (log 2 pi + 1) is left out."""
    rng = np.random.default_rng(5)
    dt = rng.uniform(0.5, 1.5, 40)
    apart = rng.standard_normal(40)
    difference = np.diff(np.eye(41), axis=0)
    times = np.concatenate([[0.0], np.cumsum(dt)])
    level = ratio * np.minimum.outer(times, times) + np.eye(41)  # a walk from 0, and white
    shape = difference @ level @ difference.T
    fit, r = profiled(apart, dt, ratio)
    dense = multivariate_normal(np.zeros(40), r * shape).logpdf(apart)
    assert fit + 40.0 * (np.log(2.0 * np.pi) + 1.0) == pytest.approx(-2.0 * dense, rel=1e-9)
    for other in (0.9 * r, 1.1 * r):
        assert multivariate_normal(np.zeros(40), other * shape).logpdf(apart) < dense


def test_the_walk_that_is_taken_out_is_the_mean_of_the_dense_posterior() -> None:
    """Away from the ends, where the log has no walk to go on from: 300 messages, 0.1 s apart."""
    rng = np.random.default_rng(6)
    time_s = 0.1 * np.arange(300)
    q, jitter = 4e-6, 1e-3
    truth = np.cumsum(np.sqrt(0.1 * q) * rng.standard_normal(300))
    told = truth + jitter * rng.standard_normal(300)
    r = 0.5 * (float(np.var(np.diff(told))) - 0.1 * q)  # as it is estimated
    walked = 0.1 * q * np.minimum.outer(np.arange(300) + 1e6, np.arange(300) + 1e6)
    dense = walked @ np.linalg.solve(walked + r * np.eye(300), told)
    found = smoothed(told, time_s, q)
    assert found[60:-60] == pytest.approx(dense[60:-60], abs=0.02 * float(np.std(truth)))
