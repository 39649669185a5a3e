"""What all streams of a recording share: a link that is congested, a file that was split.

Every world is written down here.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.auditing.run import audit
from tests.test_audit_clocks import even, names, transported, written

SENSORS = {"imu": (100.0, 7e-4), "camera": (20.0, 4e-3), "gnss": (5.0, 4e-3), "odom": (50.0, 1e-3)}
SWELLS = ((20.0, 5.0), (48.0, 7.0), (52.0, 6.0))  # when, how long: two of them overlap


def swell(t: np.ndarray, most_s: float) -> np.ndarray:
    """How much later messages come over a link whose queue fills and drains."""
    late = np.zeros(t.size)
    for begin, length in SWELLS:
        inside = (t > begin) & (t < begin + length)
        late[inside] += most_s * np.sin(np.pi * (t[inside] - begin) / length)
    return late


def slow_link(t: np.ndarray, most_s: float) -> np.ndarray:
    """The same where the link carries a third of what comes in for a while, and then catches up."""
    for begin, length in SWELLS[:2]:
        filled = np.clip(t - begin, 0.0, length) / length
        drained = np.clip((t - begin - length) / 3.0, 0.0, 1.0)
        t = t + most_s * np.where(t > begin, filled - drained, 0.0)
    return t


@pytest.mark.parametrize("most_s", [0.02, 0.1, 0.3])
@pytest.mark.parametrize("how", ["swell", "queue"])
def test_a_congested_link_is_no_clock_of_the_recorder(
    tmp_path: Path, most_s: float, how: str
) -> None:
    paths = []
    for seed, (name, (rate, scale)) in enumerate(SENSORS.items()):
        t = even(rate, 90.0, 0.01 + 0.007 * seed)
        got = transported(t, scale, seed)
        later = got + swell(t, most_s) if how == "swell" else slow_link(got, most_s)
        paths.append(written(tmp_path / f"{name}.csv", t, np.maximum.accumulate(later)))
    rows = audit(paths).streams
    assert {row.name: names(row) for row in rows} == {name: [] for name in SENSORS}


ENDS = {  # how much later, as a share of the most: seconds since the first and before the last
    "a queue drains as it begins": lambda since, left: np.clip(1.0 - since / 1.6, 0.0, 1.0),
    "a decay as it begins": lambda since, left: np.exp(-since / 0.8),
    "a swell as it begins": lambda since, left: np.sin(
        np.pi * np.clip((since + 2.0) / 4.0, 0.0, 1.0)
    ),
    "a swell soon after": lambda since, left: np.sin(
        np.pi * np.clip((since - 2.0) / 4.0, 0.0, 1.0)
    ),
    "a swell as it ends": lambda since, left: np.sin(np.pi * np.clip((left + 2.0) / 4.0, 0.0, 1.0)),
}


@pytest.mark.parametrize("how", ENDS)
@pytest.mark.parametrize("most_s", [0.06, 0.15])
def test_a_log_that_begins_or_ends_in_a_swell_is_no_clock(
    tmp_path: Path, most_s: float, how: str
) -> None:
    paths = []
    for seed, (name, (rate, scale)) in enumerate(SENSORS.items()):
        t = even(rate, 60.0, 0.01 + 0.007 * seed)
        late = most_s * ENDS[how](t - t[0], t[-1] - t)
        got = np.maximum.accumulate(transported(t, scale, seed) + late)
        paths.append(written(tmp_path / f"{name}.csv", t, got))
    rows = audit(paths).streams
    assert {row.name: names(row) for row in rows} == {name: [] for name in SENSORS}


@pytest.mark.parametrize("ahead_s", [0.08, -0.08])
@pytest.mark.parametrize("at_s", [2.0, 58.0])
def test_a_recorder_that_is_set_near_an_end_is_named(
    tmp_path: Path, at_s: float, ahead_s: float
) -> None:
    """From one message to the next, as no queue does."""
    paths = []
    for seed, (name, (rate, scale)) in enumerate(SENSORS.items()):
        t = even(rate, 60.0, 0.01 + 0.007 * seed)
        got = transported(t, scale, seed)
        paths.append(written(tmp_path / f"{name}.csv", t, got + ahead_s * (got >= at_s)))
    rows = {row.name: names(row) for row in audit(paths).streams}
    assert "recorder_clock" in rows["imu"]
    assert "recorder_clock" in rows["odom"]


def in_parts(folder: Path, cut: float, apart: float = 0.0, hole: float = 1.0) -> list[Path]:
    """An IMU, set back by 50 ms where the file was split, with 3 s of it missing a second later (or
    `hole`), and a GNSS, in two folders, the second as of a run that much later."""
    paths = []
    for seed, (name, rate) in enumerate((("imu", 100.0), ("gnss", 10.0))):
        t = even(rate, 60.0)
        t = t[(t < cut + hole) | (t > cut + hole + 3.0)] if name == "imu" else t
        got = transported(t, 1e-3, seed)
        stamp = t - 0.05 * (got >= cut) * (name == "imu")
        for part, inside in (("a", got < cut), ("b", got >= cut)):
            (folder / part).mkdir(exist_ok=True)
            later = apart * (part == "b")
            one = written(folder / part / f"{name}.csv", stamp[inside] + later, got[inside] + later)
            paths.append(one)
    return paths


def test_what_goes_wrong_where_a_file_was_split_is_seen(tmp_path: Path) -> None:
    found = audit(in_parts(tmp_path, 30.0))
    assert {row.name: names(row) for row in found.streams} == {"imu": ["step", "gap"], "gnss": []}
    assert [row.messages for row in found.streams if row.name == "gnss"] == [600]
    assert len(found.evidence) == 4
    assert all("parts of one recording" in " ".join(row.notes) for row in found.streams)


@pytest.mark.parametrize("hole", [-3.5, -3.0, -1.5, 0.0])
def test_a_stream_that_is_missing_where_a_file_was_split_is_one(
    tmp_path: Path, hole: float
) -> None:
    """Up to it, from it on, or about it: the others go on, as in a bag."""
    found = audit(in_parts(tmp_path, 30.0, hole=hole))
    rows = {row.name: row for row in found.streams}
    assert set(names(rows["imu"])) == {"step", "gap"}
    assert names(rows["gnss"]) == []
    (gap,) = (fault for fault in rows["imu"].faults if fault.fault == "gap")
    assert gap.parameters["interval_s"] == pytest.approx(3.0, abs=0.1)


def test_two_runs_are_two_recordings(tmp_path: Path) -> None:
    found = audit(in_parts(tmp_path, 30.0, apart=600.0))
    assert len(found.streams) == 4
    assert {name for row in found.streams for name in names(row)} == {"gap"}
