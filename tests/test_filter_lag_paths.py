"""A smoothed position along a path: the low pass of the path that was travelled.

Oracle: the same filter, stepped at a millisecond over the antenna's path written as a formula, from
long before the first row (scipy.signal.lfilter; exact for a path that is straight from step to
step).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from syncline_design.verdict.verify import CheckSettings
from tests.checked import check_file

Array = NDArray[np.float64]
Path3 = Callable[[Array], tuple[Array, Array, Array]]  # north, east, yaw of the time
SPEC = """\
syncline: 1
name: smoothed
requirements: [{{id: ACC, kind: accuracy, limit: 1 km}}, {{id: S, kind: sync, limit: 1.0e9}}]
monte_carlo: {{samples: 16000, envelope: trajectory, trajectory: {trajectory}}}
effects: [{{effect: filter_lag, sensor: position, parameters: {{time_constant_s: {lag}}}}}]
stages:
  - name: boat
    platform: {{v_max: 6.1 m/s, omega_max: {omega} rad/s, distance: 1 m, baseline: 0 m}}
    position:
      sensor: {{modality: position, sigma_position: 1 um, primitives: []}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}}}
      lever_arm: [{arm} m, 0 m, 0 m]
"""
STEP_S = 1e-3


def circle(turn: float, yaw: float) -> Path3:
    """At 6 m/s, the path turning at `turn` and the vehicle at `yaw` rad/s."""
    return lambda t: (6.0 / turn * np.sin(turn * t), -6.0 / turn * np.cos(turn * t), yaw * t)


def sway(t: Array) -> tuple[Array, Array, Array]:
    return 6.0 * np.sin(t), np.zeros_like(t), np.zeros_like(t)


def weave(t: Array) -> tuple[Array, Array, Array]:
    """Sideways across a straight line, the bow swinging at another rhythm."""
    return 4.0 * t, 3.0 * np.sin(1.2 * t), 0.3 * np.sin(0.7 * t)


def lag_of(path: Path3, lag_s: float, arm: float, last_s: float) -> Array:
    """|y - x| at every millisecond of 0 .. last_s."""
    t = np.arange(-30.0 * lag_s, last_s, STEP_S)
    north, east, yaw = path(t)
    antenna = np.stack([north + arm * np.cos(yaw), east + arm * np.sin(yaw)])
    kept = math.exp(-STEP_S / lag_s)
    mean = (1.0 - kept) * lag_s / STEP_S
    new, old = 1.0 - mean, mean - kept
    begin = (1.0 - new) * antenna[:, :1]
    smooth = lfilter([new, old], [1.0, -kept], antenna, axis=1, zi=begin)[0]
    return np.hypot(*(smooth - antenna))[t >= 0.0]


def check(folder: Path, trajectory: str, lag_s: float, arm: float, omega: float) -> dict[str, Any]:
    spec = folder / "boat.yaml"
    text = SPEC.format(trajectory=trajectory, lag=lag_s, arm=arm, omega=omega)
    spec.write_text(text, encoding="utf-8")
    return check_file(spec, CheckSettings()).to_json()


def agrees(verdict: dict[str, Any], expected: Array, shares: tuple[str, ...]) -> None:
    """Quantiles of 16 000 moments: 1 % of the largest lag."""
    found = verdict["monte_carlo"]["quantiles"]
    for share in shares:
        wanted = float(np.quantile(expected, float(share)))
        assert found[share]["value_m"] == pytest.approx(wanted, abs=0.01 * expected.max())
    assert found["0.997"]["high_m"] <= 1.001 * verdict["monte_carlo"]["worst_case"]["bound_m"]


@pytest.mark.parametrize(
    ("path", "lag_s", "arm", "step_s"),
    [
        (circle(0.5, 0.0), 2.0, 0.0, 0.1),  # round a point, heading held: 8.49 m, not 16.97 m
        (circle(0.5, -0.5), 2.0, 1.5, 0.1),  # turning against its path
        (circle(0.5, 0.25), 2.0, 1.5, 0.1),
        (circle(0.4, 0.4), 3.0, 1.0, 1.0),  # a coordinated turn, a row a second
        (sway, 1.0, 0.0, 0.1),
        (weave, 0.8, 2.0, 0.1),
        (weave, 0.02, 0.0, 0.1),  # the filter far faster than the rows
    ],
)
def test_the_lag_along_a_file_is_that_of_its_path(
    tmp_path: Path, path: Path3, lag_s: float, arm: float, step_s: float
) -> None:
    t = np.arange(0.0, 200.0 + step_s / 2, step_s)
    north, east, yaw = path(t)
    table = np.stack([t, north, east, 0 * t, 0 * t, 0 * t, np.degrees(yaw)], axis=1)
    head = "time_s,position_north_m,position_east_m,position_down_m,roll_deg,pitch_deg,yaw_deg"
    np.savetxt(tmp_path / "path.csv", table, fmt="%.6f", delimiter=",", header=head, comments="")
    verdict = check(tmp_path, "{file: path.csv}", lag_s, arm, 0.6)
    agrees(verdict, lag_of(path, lag_s, arm, 200.0), ("0.5", "0.95"))


def test_the_lag_along_a_figure_of_eight_is_that_of_one_that_goes_on(tmp_path: Path) -> None:
    """Heading A sin(w t / A) at v_max, gone through again and again."""
    speed, omega, swing = 6.1, 0.6, 2.404825557695773
    period = 2.0 * math.pi / omega * swing

    def path(t: Array) -> tuple[Array, Array, Array]:
        yaw = swing * np.sin(omega / swing * t)
        moved = STEP_S * speed * np.stack([np.cos(yaw), np.sin(yaw)])
        north, east = np.cumsum(moved, axis=1) - 0.5 * moved
        return north, east, yaw

    verdict = check(tmp_path, "{manoeuvre: figure_eight}", 4.0, 1.0, omega)
    agrees(verdict, lag_of(path, 4.0, 1.0, period), ("0.5", "0.95", "0.997"))
