"""Columns in a unit in which they hardly move hang nowhere; what hangs in them still does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis import diagnose
from syncline_design.diagnosis.hanging_rows import without_hanging
from tests.test_diagnose_hanging import QUICK, ROWS, log_of, read, written

ANGLES = ("roll_deg", "pitch_deg", "yaw_deg")


def _in_radians(folder: Path, names: tuple[str, ...] = ()) -> Path:
    log = log_of()
    for name in names:
        log.columns[name][ROWS] = log.columns[name][ROWS.start - 1]
    for name in ANGLES:
        log.columns[name] = np.radians(log.columns[name])
    return written(log, folder)


def test_angles_in_radians_are_no_device_that_hangs(tmp_path: Path) -> None:
    """An attitude that tells radians in a column of degrees turns by a sixtieth of what the turn
    rates say, which rests within its noise for many rows; the convention is all that is told."""
    folder = _in_radians(tmp_path)
    inputs = read(folder)
    less, hanging = without_hanging(inputs)
    assert less is inputs
    assert hanging.found == ()
    found = diagnose(folder / "spec.yaml", [folder / "log.csv"], QUICK).to_json()
    assert [one["code"] for one in found["checks"]] == []
    assert found["log"]["used"] == found["log"]["rows"]
    (one,) = [each for each in found["findings"] if each["material"]]
    assert "radians" in one["sentence"]


def test_an_attitude_in_radians_that_hangs_does(tmp_path: Path) -> None:
    inputs = read(_in_radians(tmp_path, ANGLES))
    less, hanging = without_hanging(inputs)
    assert hanging.left_out
    kept = np.isin(inputs.log.time_s, less.log.time_s)
    assert not np.any(kept[ROWS])


@pytest.mark.parametrize("name", ANGLES)
def test_one_angle_in_radians_that_hangs_does(name: str, tmp_path: Path) -> None:
    """All angles rest within their noise; in degrees the one that hangs is left behind."""
    inputs = read(_in_radians(tmp_path, (name,)))
    less, hanging = without_hanging(inputs)
    (one,) = hanging.found
    assert (one.sensor, one.reading) == ("attitude", name.removesuffix("_deg"))
    assert hanging.left_out
    assert np.array_equal(less.log.time_s, np.delete(inputs.log.time_s, ROWS))
