"""Straight lines and rocking hulls: sound logs in which noise or coning once passed for a fault.

The logs are made here from closed forms: heading, roll and pitch are sums of sines, the place is
the integral of a constant speed along the heading, rates are central differences of the poses.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from diagnosis_samples import LATENCY, diagnosis
from syncline_design.comparison.meaning import with_design
from syncline_design.diagnosis import Diagnosis, DiagnosisSettings, diagnose
from syncline_design.diagnosis.checks import Check, log_checks
from syncline_design.diagnosis.result import Rival
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.system import measured
from syncline_design.effects import registry
from syncline_design.model.figure_text import format_estimate
from syncline_design.report.on_diagnosis import on_diagnosis
from syncline_design.report.render_console import console
from syncline_design.report.render_markdown import markdown
from syncline_design.spec.load import load

Array = NDArray[np.float64]
SIGMA_DEG = (0.04, 0.04, 0.1)
SPEC = """
syncline: 1
name: lines
requirements: [{id: ACC-1, kind: accuracy, limit: 5 m}]
stages:
  - name: boat
    platform: {v_max: 20 m/s, omega_max: 60 deg/s, distance: 60 m, baseline: 0.5 m}
    position:
      sensor: {modality: position, type: gnss, sigma_position: 0.02 m, primitives: [pps]}
      primitive: pps
      timestamping: {error: {distribution: uniform, low: -10 ns, high: 10 ns}}
    attitude:
      sensor: {modality: attitude, sigma_attitude: [0.04 deg, 0.04 deg, 0.1 deg], primitives: [pps]}
      primitive: pps
      timestamping: {error: {distribution: uniform, low: -10 ns, high: 10 ns}}
    ranging:
      sensor: {modality: ranging, type: lidar, sigma_range: 0.02 m,
               sigma_bearing: [0.02 deg, 0.02 deg], primitives: [pps]}
      primitive: pps
      timestamping: {error: {distribution: uniform, low: -10 ns, high: 10 ns}}
"""


def poses(t: Array, yaw_deg: float, rock_deg: float) -> Array:
    """Roll, pitch, yaw [rad]: rocking about two axes a quarter turn apart, yaw around 40 deg."""
    roll = rock_deg * np.sin(1.3 * t)
    pitch = rock_deg * np.cos(1.3 * t)
    yaw = 40.0 + yaw_deg * (np.sin(0.5 * t) + 0.5 * np.sin(1.7 * t))
    return np.radians(np.stack([roll, pitch, yaw], axis=1))


def turned(angles: Array) -> Rotation:
    return Rotation.from_euler("ZYX", angles[:, ::-1])


def straight(
    seed: int, rows: int, yaw_deg: float, rock_deg: float, down_sign: float = 1.0
) -> dict[str, Array]:
    """A log at 10 Hz without any fault (but, wanted, a vertical velocity of the wrong sign)."""
    draw, speed, step = np.random.default_rng(seed), 8.0, 1e-3
    t = 0.1 * np.arange(rows)
    fine = np.arange(0.0, t[-1] + 0.5 * step, step)
    course = poses(fine, yaw_deg, rock_deg)[:, 2]
    way = [np.cumsum(speed * f(course)) * step for f in (np.cos, np.sin)]
    place = np.stack([*(np.interp(t, fine, w) for w in way), 3.0 * np.sin(0.2 * t) - 20.0], axis=1)
    angles = poses(t, yaw_deg, rock_deg)
    h = 1e-4
    ends = [turned(poses(t + s * h, yaw_deg, rock_deg)) for s in (-1, 1)]
    rate = (ends[0].inv() * ends[1]).as_rotvec() / (2 * h)
    object_at = place + np.stack([*draw.uniform(-30, 30, (2, rows)), 20.0 - np.zeros(rows)], axis=1)
    beam = turned(angles).inv().apply(object_at - place)
    reach = np.linalg.norm(beam, axis=1)
    velocity = [speed * np.cos(angles[:, 2]), speed * np.sin(angles[:, 2])]
    velocity.append(down_sign * 0.6 * np.cos(0.2 * t))
    angles = angles + draw.normal(0.0, 1.0, (rows, 3)) * np.radians(SIGMA_DEG)
    place = place + draw.normal(0.0, 0.02, (rows, 3))
    noise = draw.normal(0.0, 1.0, (3, rows)) * np.array([[0.02], [0.02], [0.02]])
    columns = {"time_s": t, "range_m": reach + noise[0]}
    columns["azimuth_deg"] = np.degrees(np.arctan2(beam[:, 1], beam[:, 0])) + noise[1]
    columns["elevation_deg"] = np.degrees(-np.arcsin(beam[:, 2] / reach)) + noise[2]
    for k, axis in enumerate(("north", "east", "down")):
        columns[f"position_{axis}_m"] = place[:, k]
        columns[f"velocity_{axis}_mps"] = velocity[k] + draw.normal(0.0, 0.01, rows)
        columns[f"target_{axis}_m"] = object_at[:, k]
    for k, (angle, axis) in enumerate(zip(("roll", "pitch", "yaw"), "xyz", strict=True)):
        columns[f"{angle}_deg"] = np.degrees(angles[:, k])
        columns[f"rate_{axis}_degps"] = np.degrees(rate[:, k]) + draw.normal(0.0, 0.05, rows)
    return columns


def written(columns: dict[str, Array], folder: Path) -> tuple[Any, Path]:
    (folder / "s.yaml").write_text(SPEC)
    table = np.stack(list(columns.values()), axis=1)
    path = folder / "l.csv"
    np.savetxt(path, table, "%.6f", delimiter=",", header=",".join(columns), comments="")
    return load(folder / "s.yaml"), path


def checked(columns: dict[str, Array], folder: Path) -> tuple[Check, ...]:
    loaded, path = written(columns, folder)
    inputs = measured(loaded, [path])
    return log_checks(scene(inputs.system, inputs.log))


def asked(columns: dict[str, Array], folder: Path, only: tuple[str, ...]) -> Diagnosis:
    loaded, path = written(columns, folder)
    others = tuple(name for name in registry() if name not in only)
    return diagnose(loaded, [path], DiagnosisSettings(exclude_effects=others))


@pytest.mark.parametrize("seed", [1, 2])
def test_the_noise_of_a_heading_is_no_hard_iron(seed: int, tmp_path: Path) -> None:
    """A heading that varies by 0.2 deg, logged with 0.1 deg, errs with itself: by its noise."""
    found = asked(straight(seed, 800, 0.25, 2.0), tmp_path, ("heading_hard_iron", "range_bias"))
    assert [f.effect for f in found.findings] == []
    assert "heading_hard_iron (attitude)" in found.unseen


def test_hard_iron_is_found_in_turns(tmp_path: Path) -> None:
    """Where the heading swings by 60 deg a true hard iron has its name and its size."""
    columns = straight(3, 800, 60.0, 2.0)
    yaw = np.radians(columns["yaw_deg"])
    columns["yaw_deg"] = columns["yaw_deg"] + np.degrees(0.02 * np.sin(yaw) - 0.01 * np.cos(yaw))
    (finding,) = asked(columns, tmp_path, ("heading_hard_iron", "range_bias")).findings
    for name, truth in (("sin_rad", 0.02), ("cos_rad", -0.01)):
        figure = finding.parameters[name]
        assert figure.standard_uncertainty is not None
        # 5e-4: the truth is of the wrong argument, the logged heading, by 0.02 rad of itself
        assert abs(float(figure.value) - truth) < 4.0 * figure.standard_uncertainty + 5e-4


@pytest.mark.parametrize("rock_deg", [4.0, 8.0, 12.0])
def test_rocking_about_two_axes_is_no_contradiction(rock_deg: float, tmp_path: Path) -> None:
    """Coning: on a straight line the turns about the down axis add up to no change of heading."""
    assert checked(straight(4, 800, 0.25, rock_deg), tmp_path) == ()


def test_a_reversed_vertical_velocity_is_said(tmp_path: Path) -> None:
    (found,) = checked(straight(5, 800, 20.0, 2.0, down_sign=-1.0), tmp_path)
    assert found.code == "velocity_columns"
    assert found.message.endswith("axes or signs: third is -third")


def raw_error(columns: dict[str, Array], ahead_s: float = 0.0) -> Array:
    """Georeferencing error (n, 3) by NumPy and SciPy alone, positions carried ahead."""
    vectors = {
        stem: np.stack([columns[f"{stem}_{axis}{unit}"] for axis in ("north", "east", "down")], 1)
        for stem, unit in (("position", "_m"), ("velocity", "_mps"), ("target", "_m"))
    }
    angles = np.radians(np.stack([columns[f"{a}_deg"] for a in ("roll", "pitch", "yaw")], 1))
    az, el = np.radians(columns["azimuth_deg"]), np.radians(columns["elevation_deg"])
    beam = np.stack([np.cos(az) * np.cos(el), np.sin(az) * np.cos(el), -np.sin(el)], 1)
    seen = turned(angles).apply(columns["range_m"][:, None] * beam)
    return vectors["position"] + ahead_s * vectors["velocity"] + seen - vectors["target"]


def rms_m(error: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


def test_at_best_is_what_the_effects_reach(tmp_path: Path) -> None:
    """Least squares over all rows is the best that a latency can do, however lucky the noise."""
    columns = straight(6, 600, 40.0, 2.0)
    for axis in ("north", "east", "down"):
        late = 0.03 * columns[f"velocity_{axis}_mps"]
        columns[f"position_{axis}_m"] = columns[f"position_{axis}_m"] - late
    found = asked(columns, tmp_path, ("latency", "range_bias"))
    velocity = raw_error(columns, 1.0) - raw_error(columns)
    error = raw_error(columns)
    best_s = -float(np.sum(velocity * error) / np.sum(velocity**2))
    (others,) = found.findings
    assert {a.refitted for a in others.excluded} == {False}
    assert all(a.refitted for a in others.aliases + others.lookalikes)
    told = " ".join(console(on_diagnosis(with_design(found, None))).split())
    assert "with the noise kept" in told
    held_out = found.to_json()["gap"]["held_out"]
    assert held_out["fitted"]["rms_m"] == pytest.approx(rms_m(raw_error(columns, best_s)), rel=2e-3)
    assert held_out["after"]["rms_m"] >= 0.999 * held_out["fitted"]["rms_m"]
    assert found.to_json()["gap"]["regime"]["nll_saved_per_sample"]["standard_error"] is None


def test_more_noise_has_no_better_best(tmp_path: Path) -> None:
    """A finding that only says that the noise is larger leaves the errors as large as they are."""
    columns = straight(7, 600, 40.0, 2.0)
    draw = np.random.default_rng(8)
    for axis in ("north", "east", "down"):
        columns[f"position_{axis}_m"] = columns[f"position_{axis}_m"] + draw.normal(0, 0.08, 600)
    found = asked(columns, tmp_path, ("noise_understated", "range_bias"))
    assert [f.effect for f in found.findings] == ["noise_understated"]
    held_out = found.to_json()["gap"]["held_out"]
    for part in ("before", "after", "fitted"):
        assert held_out[part]["rms_m"] == pytest.approx(rms_m(raw_error(columns)), rel=1e-3)
    best = format_estimate(rms_m(raw_error(columns)), None, "m")
    told = " ".join(console(on_diagnosis(with_design(found, None))).split())
    assert f"RMS at best {best}" in told


def test_what_contradicts_itself_need_not_leave_anything(tmp_path: Path) -> None:
    """Velocities 1.3 times too large on a log without any fault: nothing remains but noise."""
    columns = straight(9, 600, 40.0, 2.0)
    for axis in ("north", "east", "down"):
        columns[f"velocity_{axis}_mps"] = 1.3 * columns[f"velocity_{axis}_mps"]
    found = asked(columns, tmp_path, ("latency", "range_bias"))
    data = found.to_json()
    assert data["verdict"] == "unexplained"
    assert not data["sound"]
    assert not data["findings"]
    assert data["remaining"]["beyond_noise"] is False
    document = on_diagnosis(with_design(found, None))
    text, page = console(document), markdown(document)
    assert "still there" not in text
    assert "still there" not in page
    assert "contradict" in text
    assert "contradict" in page


def test_other_signatures_do_not_look_alike() -> None:
    """The console's words for two that fit worse: one along the named signature, one across it."""
    along = Rival("filter_lag", "position", "boat", 0.999, 31.6)
    across = Rival("flexure", "ranging", "boat", 0.0019, 7.2)
    found = diagnosis(findings=(replace(LATENCY, lookalikes=(along, across), excluded=()),))
    for render in (console, markdown):
        said = " ".join(re.sub(r"\\", "", render(on_diagnosis(found))).split())
        assert "filter lag (position), 31.6 nat worse" in said
        assert "flexure (ranging), of another signature, 7.2 nat worse" in said


@pytest.mark.parametrize("offset_degps", [-2.0, 3.0])
@pytest.mark.parametrize("axis", "xyz")
def test_a_constant_part_of_the_rates_is_said(
    axis: str, offset_degps: float, tmp_path: Path
) -> None:
    columns = straight(10, 600, 6.0, 2.0)
    columns[f"rate_{axis}_degps"] = columns[f"rate_{axis}_degps"] + offset_degps
    (found,) = checked(columns, tmp_path)
    assert found.code == "rate_columns"
    which = {"x": "first", "y": "second", "z": "third"}[axis]
    words = re.search(r"a constant (\S+) deg/s about the (\w+) axis", found.message)
    assert words is not None
    assert float(words[1]) == pytest.approx(offset_degps, abs=0.1)
    assert words[2] == which


@pytest.mark.parametrize("offset_degps", [0.0, 0.2])
def test_the_bias_of_a_gyro_is_no_contradiction(offset_degps: float, tmp_path: Path) -> None:
    """0.2 deg/s turns an attitude by 0.01 deg in a delay of 50 ms: nothing that a name rests on."""
    columns = straight(11, 600, 6.0, 2.0)
    columns["rate_z_degps"] = columns["rate_z_degps"] + offset_degps
    assert checked(columns, tmp_path) == ()
