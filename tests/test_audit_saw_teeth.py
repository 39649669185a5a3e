"""Clocks that run off and are set back again and again, by less than one delay tells.

Every world says itself by how much its clock ran off and when it was set; what is named has to be
that, and a clock that is left alone is sound.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.auditing.result import StreamAudit
from syncline_design.auditing.run import audit

BEGAN = 1_790_000_000 * 10**9
LENGTH_S = 120.0


def ns(times: np.ndarray) -> np.ndarray:
    return np.asarray(np.rint(times * 1e9), np.int64) + BEGAN


def said(folder: Path, stamp: np.ndarray, receive: np.ndarray) -> StreamAudit:
    rows = [f"{s},{r}" for s, r in zip(ns(stamp).tolist(), ns(receive).tolist(), strict=True)]
    path = folder / "x.csv"
    path.write_text("\n".join(["stamp_ns,receive_ns", *rows, ""]), "utf-8")
    return audit([path]).streams[0]


def sensor(seed: int, rate: float, jitter_s: float) -> tuple[np.ndarray, np.ndarray]:
    """When it measured, and when its messages came: 1 ms and gamma delays of 2 ms in the mean."""
    rng = np.random.default_rng(seed)
    t = rng.uniform(0.0, 1.0) + np.arange(int(rate * LENGTH_S)) / rate
    t = t + jitter_s * rng.standard_normal(t.size)
    return t, np.maximum.accumulate(t + 0.001 + rng.gamma(2.0, 0.001, t.size))


def run_off(t: np.ndarray, ppm: float, period_s: float) -> np.ndarray:
    """What the clock is ahead by: it runs off, and is set right every period."""
    return 1e-6 * ppm * ((t - t[0]) % period_s)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("jitter_s", [0.0, 2e-5])
@pytest.mark.parametrize(
    ("rate", "ppm", "period_s"),
    [(50.0, 100.0, 10.0), (100.0, 200.0, 10.0), (100.0, -150.0, 8.0), (50.0, 200.0, 15.0)],
)
def test_drift_and_resets_are_named_and_nothing_else(
    tmp_path: Path, rate: float, ppm: float, period_s: float, jitter_s: float, seed: int
) -> None:
    t, receive = sensor(seed, rate, jitter_s)
    row = said(tmp_path, t + run_off(t, ppm, period_s), receive)
    named = {fault.fault: fault for fault in row.faults if fault.counts}
    assert set(named) == {"drift", "step"}
    assert named["drift"].parameters["ppm"] == pytest.approx(ppm, rel=0.03)
    reset = named["step"].parameters
    assert reset["seconds"] == pytest.approx(-1e-6 * ppm * period_s, abs=1e-4)
    assert reset["interval_s"] == pytest.approx(period_s, rel=0.01)
    assert reset["count"] == (LENGTH_S - 1.0 / rate) // period_s
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - t), rel=0.1)


def test_a_lone_reset_has_its_own_size_wherever_it_is_named(tmp_path: Path) -> None:
    """Where what the clock ran off by may be transport's, the reset still is as large as it was."""
    sizes = []
    for seed in range(1, 7):
        t, receive = sensor(seed, 100.0, 0.0)
        row = said(tmp_path, t + run_off(t, 50.0, 60.0), receive)
        sizes += [f.parameters["seconds"] for f in row.faults if f.fault == "step"]
    assert sizes
    assert sizes == pytest.approx([-3e-3] * len(sizes), rel=0.15)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("jitter_s", [0.0, 2e-5, 2e-4])
def test_a_sound_clock_is_left_alone(tmp_path: Path, jitter_s: float, seed: int) -> None:
    """Also where measurements are lost, and where some are made late."""
    rng = np.random.default_rng([seed, 7])
    t, receive = sensor(100 + seed, 50.0, jitter_s)
    late = np.where(rng.random(t.size) < 0.002, 0.001, 0.0)  # now and then 1 ms, by itself
    kept = rng.random(t.size) > 0.01
    row = said(tmp_path, (t + late)[kept], np.maximum.accumulate(receive + late)[kept])
    assert [
        f.fault for f in row.faults if f.counts and f.fault in ("step", "drift", "relock")
    ] == []
