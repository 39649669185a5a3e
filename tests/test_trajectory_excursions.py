"""A file that leaves the platform's limits or the horizon: said, since the Syncline stops there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncline_design.report.checks import render_checks
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.render_console import console
from syncline_design.spec.load import load
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import CheckSettings, check_loaded

SPEC = """\
syncline: 1
name: long line
requirements: [{{id: ACC, kind: accuracy, limit: 4 m}}]
monte_carlo: {{samples: 3000, envelope: trajectory, trajectory: {trajectory}}}
horizon: {{duration: 20 min, extent: 14 km, tilt: 12 deg}}
effects: {effects}
stages:
  - name: boat
    platform: {{v_max: 11 m/s, omega_max: 3 deg/s, distance: 1 m, baseline: 0 m}}
    position:
      sensor: {{modality: position, sigma_position: 1 cm, primitives: [pps]}}
      timestamping: {{error: {{distribution: uniform, low: -1 ms, high: 1 ms}}}}
      lever_arm: [0 m, 0 m, 0 m]
    attitude:
      sensor: {{modality: attitude, sigma_attitude: 0.01 deg, primitives: [pps]}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}}}
    ranging:
      sensor: {{modality: ranging, sigma_range: 1 cm, sigma_bearing: 0.01 deg, primitives: [pps]}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}}}
"""
GRID = "[{effect: grid_scale, sensor: target, parameters: {scale: 0.0002}}]"
DRIFT = "[{effect: clock_drift, sensor: position, parameters: {rate: 0.0001}}]"
FLEXURE = "[{effect: flexure, sensor: ranging, parameters: {x: 0.1, y: 0, z: 0}}]"
CODE = "trajectory-outside"
SIGHT = ",range_m,azimuth_deg,elevation_deg"


def write(
    folder: Path, last_s: float, speed: float, pitch: float, wobble: float, sight: str
) -> None:
    """North at `speed`; the yaw rises and falls by `wobble` deg every second row of 2 s."""
    head = "time_s,position_north_m,position_east_m,position_down_m,roll_deg,pitch_deg,yaw_deg"
    lines = [head + (SIGHT if sight else "")]
    for number, t in enumerate(np.arange(0.0, last_s + 1.0, 2.0)):
        yaw = wobble * (number % 2)
        lines.append(f"{900 + t},{speed * t},0,0,0,{pitch},{yaw}{sight}")
    (folder / "line.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


def check(folder: Path, effects: str = "[]", trajectory: str = "{file: line.csv}") -> Verdict:
    spec = folder / "line.yaml"
    spec.write_text(SPEC.format(effects=effects, trajectory=trajectory), encoding="utf-8")
    return check_loaded(load(spec), CheckSettings())


def said(verdict: Verdict) -> str:
    return " ".join(w.message for w in verdict.warnings if w.code == CODE)


@pytest.mark.parametrize(
    ("path", "effects", "words"),
    [
        ((1190.0, 10.0, 5.0, 4.0, ""), DRIFT, ()),
        ((2400.0, 10.0, 5.0, 4.0, ""), "[]", ()),  # nothing depends on when or where
        ((2400.0, 5.0, 5.0, 4.0, ""), DRIFT, ("lasts 40 min", "duration is 20 min")),
        ((1190.0, 10.9, 5.0, 4.0, ",1,0,0"), GRID, ()),
        ((1190.0, 12.0, 5.0, 4.0, ""), GRID, ("12 m/s, 11", "14280 m, 14000")),
        ((1190.0, 10.0, 15.0, 4.0, ""), "[]", ("15 deg, 12",)),
        ((1190.0, 10.0, 0.0, 7.0, ""), "[]", ("3.5 deg/s, 3",)),
        ((1190.0, 10.0, 5.0, 4.0, ",2.5,0,0"), "[]", ("2.5 m, 1",)),
    ],
)
def test_what_leaves_the_limits_is_said_and_nothing_else(
    tmp_path: Path, path: tuple[Any, ...], effects: str, words: tuple[str, ...]
) -> None:
    write(tmp_path, *path)
    found = said(check(tmp_path, effects))
    assert bool(found) == bool(words)
    assert found.count(" is allowed for") + found.count("lasts") == len(
        [w for w in words if w != "duration is 20 min"]
    )
    for text in words:
        assert text in found


def test_a_long_file_exceeds_its_own_bound_and_every_format_says_why(tmp_path: Path) -> None:
    """10 m/s for 2 h: grid errors of 2e-4 times 0 .. 72 km; median 7.2 m, the budget's 2.8 m."""
    write(tmp_path, 7200.0, 10.0, 0.0, 0.0, "")
    found = check(tmp_path, GRID)
    assert found.verdict == "meets"
    assert found.monte_carlo.quantiles["0.5"].value_m == pytest.approx(7.2, rel=0.05)
    assert found.monte_carlo.worst_case.bound_m < 4.0
    for form in ("json", "html", "junit", "sarif", "github", "markdown"):
        assert CODE in render_checks(form, [found])
    shown = " ".join(console(on_verdict(found), colour=False).split())
    assert CODE in shown
    assert "place within" not in shown  # times and places are the file's
    assert "from the file" in shown


def test_named_manoeuvres_keep_the_limits(tmp_path: Path) -> None:
    for name in ("straight", "circle", "lawnmower", "figure_eight"):
        assert not said(check(tmp_path, DRIFT, f"{{manoeuvre: {name}}}"))


TILT = "[{effect: acceleration_tilt, sensor: attitude, parameters: {gain: 0.5}}]"


@pytest.mark.parametrize(
    ("effects", "period_s", "said_as"),
    [
        (TILT, 20.0, "accelerates at up to 3.1"),  # 2 pi / 20 s * 10 m/s = 3.14 m/s2
        (FLEXURE, 35.0, "accelerates at up to 1.7"),
        (TILT, 120.0, ""),  # 0.524 m/s2, below v_max omega_max = 0.576
        (DRIFT, 20.0, ""),  # does not go by acceleration
    ],
)
def test_a_file_that_speeds_up_harder_than_it_turns_is_said(
    tmp_path: Path, effects: str, period_s: float, said_as: str
) -> None:
    """To and fro along north at up to 10 m/s, within v_max and omega_max; v_max omega_max 0.576."""
    head = "time_s,position_north_m,position_east_m,position_down_m,roll_deg,pitch_deg,yaw_deg\n"
    angular = 2.0 * np.pi / period_s
    with (tmp_path / "line.csv").open("w", encoding="utf-8") as file:
        file.write(head)
        for t in np.arange(0.0, 600.0, 0.5):
            file.write(f"{t},{10.0 / angular * np.sin(angular * t):.6f},0,0,0,0,0\n")
    found = said(check(tmp_path, effects))
    assert (said_as in found) if said_as else not found
    if said_as:
        assert "m/s2, 0.576 is allowed for" in found


@pytest.mark.parametrize("step_s", [0.1, 0.5, 1.0])
def test_accelerations_along_a_coarse_file_are_those_of_the_path(
    tmp_path: Path, step_s: float
) -> None:
    """A circle of 60 m at 10 m/s: centripetal 1.667 m/s2 always; flexure of 0.1 m per m/s2."""
    head = "time_s,position_north_m,position_east_m,position_down_m,roll_deg,pitch_deg,yaw_deg\n"
    with (tmp_path / "line.csv").open("w", encoding="utf-8") as file:
        file.write(head)
        for t in np.arange(0.0, 300.0, step_s):
            turn = t / 6.0
            north, east = 60.0 * np.sin(turn), -60.0 * np.cos(turn)
            file.write(f"{t},{north:.6f},{east:.6f},0,0,0,{np.degrees(turn):.6f}\n")
    effect = "[{effect: flexure, sensor: ranging, parameters: {x: 0, y: 0.1, z: 0}}]"
    spread = check(tmp_path, effect).monte_carlo.quantiles
    assert spread["0.5"].value_m == pytest.approx(1.0 / 6.0, rel=0.03)
    assert spread["0.997"].value_m < 0.1667 + 0.06  # noise of 1 cm an axis
