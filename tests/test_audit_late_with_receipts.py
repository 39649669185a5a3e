"""Stamps that are late together with their receipts: what the audit leaves open is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from syncline_design.auditing.result import StreamAudit
from syncline_design.auditing.run import audit

ROWS, RATE_HZ = 3000, 10.0
WORDS = "late here and there, or wander, with their receipts"


def _heard(folder: Path, late_s: NDArray[np.float64], rng: np.random.Generator) -> StreamAudit:
    stamp = 100.0 + np.arange(ROWS) / RATE_HZ + late_s + 1e-4 * rng.standard_normal(ROWS)
    receive = stamp + 3e-4 + 2e-4 * rng.exponential(size=ROWS)
    path = folder / "ranging.csv"
    np.savetxt(path, np.column_stack([stamp, receive]), delimiter=",", fmt="%.6f",
               header="stamp_s,receive_s", comments="")  # fmt: skip
    (stream,) = audit([path]).streams
    return stream


@pytest.mark.parametrize("share", [0.02, 0.97])
def test_a_few_stamps_that_are_late_with_their_receipts_are_told(
    tmp_path: Path, share: float
) -> None:
    """20 ms in one message of fifty (or in all others): receipts bound no more than 2 ms of it."""
    rng = np.random.default_rng(4)
    stream = _heard(tmp_path, 0.02 * (rng.random(ROWS) < share), rng)
    assert stream.residual_s.bound is not None
    assert stream.residual_s.bound < 0.01
    (said,) = [words for words in stream.cannot_show if WORDS in words]
    assert " 20." in said or " 21." in said


def test_stamps_that_wander_with_their_receipts_are_told(tmp_path: Path) -> None:
    """First-order Gauss-Markov of 5 ms and a minute."""
    rng = np.random.default_rng(5)
    keep, wander = np.exp(-1.0 / (60.0 * RATE_HZ)), rng.standard_normal(ROWS)
    for k in range(1, ROWS):
        wander[k] = keep * wander[k - 1] + np.sqrt(1.0 - keep**2) * wander[k]
    stream = _heard(tmp_path, 5e-3 * wander, rng)
    assert any(WORDS in words for words in stream.cannot_show)


def test_stamps_that_keep_their_rhythm_are_not(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    stream = _heard(tmp_path, np.zeros(ROWS), rng)
    assert stream.faults == ()
    assert not any(WORDS in words for words in stream.cannot_show)
