"""Some rows of a log are what they were in the whole of it."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from syncline_design.diagnosis.scene import cut_rows
from syncline_design.effects.record import StageRows


def test_rows_that_are_cut_keep_what_lags_behind_them() -> None:
    rng = np.random.default_rng(8)
    names = [
        f.name for f in fields(StageRows) if f.name not in ("start_s", "independent", "lagged")
    ]
    whole = StageRows(**{n: rng.normal(size=(9, 3)) for n in names})
    chosen = np.array([1, 4, 8])
    alone = cut_rows(whole, chosen)
    assert alone.lagged is None
    assert np.array_equal(alone.target_m, whole.target_m[[1, 4, 8]])
    path, turns = rng.normal(size=(9, 3)), rng.normal(size=(9, 3, 3))
    smoothed = replace(whole, lagged=lambda t: (path * t, turns * t))
    found = cut_rows(smoothed, chosen).lagged
    assert found is not None
    place, turn = found(2.0)
    assert np.array_equal(place, 2.0 * path[[1, 4, 8]])
    assert np.array_equal(turn, 2.0 * turns[[1, 4, 8]])


def test_what_a_log_does_not_know_stays_unknown_in_its_rows() -> None:
    """A log says nothing of how the path bends between its rows; some of its rows neither."""
    rng = np.random.default_rng(9)
    unknown = ("start_s", "independent", "lagged", "pull", "twist")
    names = [f.name for f in fields(StageRows) if f.name not in unknown]
    whole = StageRows(**{n: rng.normal(size=(9, 3)) for n in names})
    cut = cut_rows(whole, np.array([0, 5]))
    assert len(cut) == 2
    assert cut.pull is None
    assert cut.twist is None
    bent = replace(whole, pull=rng.normal(size=(9, 3)))
    pulled = cut_rows(bent, np.array([0, 5])).pull
    assert pulled is not None
    assert np.array_equal(pulled, bent.pull[[0, 5]])
