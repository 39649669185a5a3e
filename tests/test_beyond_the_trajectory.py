"""Shifts that lead beyond the ends of a trajectory: manoeuvres go on, files go on as they end."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from syncline_design.model.known import EffectEntry
from syncline_design.model.system import Platform, Sensor, Stage, System
from syncline_design.model.timing import NO_ERROR
from syncline_design.simulation import SimulationSettings, sample_errors

SPEED, TURN = 4.0, 1.0
PLATFORM = Platform(SPEED, TURN, 10.0)
SWING = 2.404825557695773  # first zero of J_0


def system(effect: str, **values: float) -> System:
    """No noise, no timestamp errors but the effect's."""
    roles = [Sensor(r, r, (0.0,) * 3, NO_ERROR) for r in ("position", "attitude", "ranging")]  # type: ignore[arg-type]
    entry = EffectEntry(effect, "position", "s", tuple(values.items()))
    return System((Stage("s", "s", PLATFORM, *roles),), effects=(entry,))


def errors_m(what: System, trajectory: str | Path, samples: int = 4000) -> NDArray[np.float64]:
    settings = SimulationSettings(samples, envelope="trajectory", trajectory=trajectory)
    size: NDArray[np.float64] = np.linalg.norm(sample_errors(what, settings), axis=1)
    return size


def write(path: Path, time_s: NDArray[np.float64], turn: float, yaw: float) -> Path:
    """A circle at 4 m/s whose path turns at `turn`, the vehicle at `yaw` rad/s."""
    north, east = SPEED / turn * np.sin(turn * time_s), -SPEED / turn * np.cos(turn * time_s)
    zero = np.zeros_like(time_s)
    heading = np.degrees(np.unwrap(yaw * time_s))
    table = np.column_stack([time_s, north, east, zero, zero, zero, heading])
    header = "time_s,position_north_m,position_east_m,position_down_m,roll_deg,pitch_deg,yaw_deg"
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.12g")
    return path


@pytest.mark.parametrize(
    ("effect", "values", "late_s"),
    [
        ("latency", {"latency_s": 3.0}, 3.0),
        ("latency", {"latency_s": -2.2}, -2.2),
        ("integer_second_slip", {"seconds": 9.0}, 9.0),
        ("integer_second_slip", {"seconds": -18.0}, -18.0),
    ],
)
def test_a_circle_goes_on_for_ever(effect: str, values: dict[str, float], late_s: float) -> None:
    """The chord 2 (v / w) |sin(w s / 2)| in every row."""
    chord = 2.0 * SPEED / TURN * abs(math.sin(0.5 * TURN * late_s))
    found = errors_m(system(effect, **values), "circle")
    np.testing.assert_allclose(found, chord, rtol=1e-6)


def test_a_figure_of_eight_goes_on_for_ever() -> None:
    """Late by 9 s: distances of the path's own integral, over two and a half periods."""
    time_s = np.linspace(-20.0, 20.0, 400_001)
    heading = SWING * np.sin(TURN / SWING * time_s)
    step = time_s[1] - time_s[0]
    path = np.cumsum(SPEED * step * np.stack([np.cos(heading), np.sin(heading)]), axis=1)
    period = round(2.0 * math.pi * SWING / TURN / step)
    start, late = 100_000, round(9.0 / step)
    now = np.arange(start, start + period)
    expected = np.hypot(*(path[:, now - late] - path[:, now]))
    found = errors_m(system("integer_second_slip", seconds=9.0), "figure_eight", 20_000)
    assert found.max() == pytest.approx(expected.max(), rel=1e-3)
    for share in (0.1, 0.5, 0.9):  # five standard errors of 20 000 draws are 1.5 % of the share
        below = np.mean(found < np.quantile(expected, share))
        assert below == pytest.approx(share, abs=0.018)


@pytest.mark.parametrize("yaw", [1.0, -0.4])
@pytest.mark.parametrize("late_s", [6.0, -6.0])
def test_a_file_goes_on_as_it_ends(tmp_path: Path, yaw: float, late_s: float) -> None:
    """Ten seconds of a circle, 6 s late or early: no row is farther off than the chord.

    Whatever its heading does, a path that turned so all along is on the circle still.
    """
    path = write(tmp_path / "circle.csv", np.arange(0.0, 10.0, 0.05), 0.8, yaw)
    found = errors_m(system("latency", latency_s=late_s), path)
    chord = 2.0 * SPEED / 0.8 * abs(math.sin(0.4 * late_s))
    # slopes at the ends of a file are one-sided: half a row's turn, 0.02 rad, off over 24 m
    np.testing.assert_allclose(found, chord, atol=0.5)


def test_a_straight_file_goes_on_straight(tmp_path: Path) -> None:
    """18 s late on a line of 4 s: 72 m behind in every row."""
    path = write(tmp_path / "line.csv", np.arange(0.0, 4.0, 0.1), 1e-9, 0.0)
    found = errors_m(system("integer_second_slip", seconds=18.0), path)
    np.testing.assert_allclose(found, 18.0 * SPEED, rtol=1e-6)


def test_shifts_within_the_file_are_as_before(tmp_path: Path) -> None:
    """0.5 s late: where the row before lies in the file, it is the file's."""
    path = write(tmp_path / "circle.csv", np.arange(0.0, 200.0, 0.05), 0.8, 0.8)
    found = errors_m(system("latency", latency_s=0.5), path)
    chord = 2.0 * SPEED / 0.8 * math.sin(0.2)
    assert np.quantile(np.abs(found - chord), 0.99) < 1e-4


def test_the_effect_is_what_moves(tmp_path: Path) -> None:
    """Without the shift there is no error: the tests above measure it alone."""
    path = write(tmp_path / "circle.csv", np.arange(0.0, 10.0, 0.05), 0.8, 0.8)
    still = dataclasses.replace(system("latency", latency_s=0.0))
    np.testing.assert_allclose(errors_m(still, path, 100), 0.0, atol=1e-9)
