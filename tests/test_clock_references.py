"""What a clock is held against: a server without UTC, its own pulse, several that disagree."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.clocks.result import Timing
from syncline_design.clocks.study import TimingSettings, study_logs
from tests import clock_logs as made
from tests.clock_logs import START, write

ROWS = 60


def _times(k: int) -> np.ndarray:
    times: np.ndarray = START + 86400.0 * k + 64.0 * np.arange(ROWS)
    return times


def _late(k: int) -> np.ndarray:
    late: np.ndarray = np.random.default_rng(k).normal(0.0, 1e-5, ROWS)
    return late


def _tracked(folder: Path, *, stratum: int = 2, deep_rows: int = ROWS, **more: object) -> Timing:
    """Six sessions; the clock's own stratum in so many rows of each, 2 else."""
    paths = []
    for k in range(6):
        lines = [made.tracking_line(t, x, hard_s=6e-4, **more)  # type: ignore[arg-type]
                 for t, x in zip(_times(k), _late(k), strict=True)]  # fmt: skip
        for n in range(deep_rows):
            head, _, tail = lines[n].partition(" 2 -3.114")
            lines[n] = f"{head} {stratum:2d} -3.114{tail}"
        paths.append(write(folder / f"tracking_{k}.log", lines))
    return study_logs(paths, TimingSettings()).timing


@pytest.mark.parametrize(
    ("stratum", "rows", "reference", "doubted"),
    [
        (3, ROWS, "192.0.2.1", False),
        (9, ROWS, "192.0.2.1", False),
        (10, ROWS, "127.127.1.1", True),
        (11, ROWS, "192.0.2.1", True),
        (11, 10, "192.0.2.1", True),
    ],
)
def test_a_server_that_follows_nothing_gives_no_utc(
    stratum: int, rows: int, reference: str, doubted: bool, tmp_path: Path
) -> None:
    found = _tracked(tmp_path, stratum=stratum, deep_rows=rows, reference=reference)
    assert found.claim.made is not doubted
    assert any("follows no UTC" in said for said in found.doubts) is doubted


@pytest.mark.parametrize(("reference", "whole"), [("192.0.2.1", True), ("2001:db8::1", True),
                                                  ("PPS", False), ("GPS0", False)])  # fmt: skip
def test_a_clock_that_follows_a_pulse_does_not_show_it(
    reference: str, whole: bool, tmp_path: Path
) -> None:
    found = _tracked(tmp_path, reference=reference)
    assert found.source.whole_way is whole
    said = [note for note in found.notes if "its own reference" in note]
    assert len(said) == (not whole)
    assert all(reference in note for note in said)


def test_ntpd_s_own_clock_is_no_reference(tmp_path: Path) -> None:
    """peerstats of the local driver, LOCAL(0): always at 0."""
    paths = []
    for k in range(6):
        lines = [made.peerstats_line(t, x).replace("192.0.2.1", "127.127.1.0")
                 for t, x in zip(_times(k), _late(k), strict=True)]  # fmt: skip
        paths.append(write(tmp_path / f"peerstats_{k}", lines))
    found = study_logs(paths, TimingSettings()).timing
    assert any("ntpd's own clock" in said for said in found.doubts)
