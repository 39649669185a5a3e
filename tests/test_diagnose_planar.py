"""Logs with one or two components: axes that never vary have no noise and no tails.

The logs are made here, by plane geometry; scipy's own fit of Student's t is the oracle.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from syncline_design.diagnosis import Diagnosis, DiagnosisSettings, diagnose
from syncline_design.spec.load import BadInput

Array = NDArray[np.float64]
Draw = Callable[[np.random.Generator, int], Array]
SIGMA_M, ROWS, STEP_S = 0.05, 900, 0.2
FEW = 500  # rows, for what is far beyond its bound
TWO_AXES, ONE_AXIS = ("north", "east"), ("north",)

SPEC = f"""syncline: 1
name: robot
requirements: [{{id: ACC-1, kind: accuracy, limit: 5 m}}]
stages:
  - name: robot
    platform: {{v_max: 3 m/s, omega_max: 90 deg/s, distance: 12 m, baseline: 0.5 m}}
    position:
      sensor: {{modality: position, type: gnss, sigma_position: {SIGMA_M} m, primitives: [pps]}}
      primitive: pps
      timestamping: {{error: {{distribution: uniform, low: -1 us, high: 1 us}}}}
"""
SCANNER = """    attitude:
      sensor: {modality: attitude, type: ins, sigma_attitude: 0.05 deg, primitives: [pps]}
      primitive: pps
      timestamping: {error: {distribution: uniform, low: -1 us, high: 1 us}}
    ranging:
      sensor: {modality: ranging, type: lidar, sigma_range: 1 cm, sigma_bearing: 0.05 deg,
               primitives: []}
      primitive: arrival
      timestamping: {error: {distribution: uniform, low: -1 us, high: 1 us}}
"""


def normal(rng: np.random.Generator, rows: int) -> Array:
    return SIGMA_M * rng.standard_normal((rows, 2))


def student(freedom: float) -> Draw:
    """Scaled so that the core is as wide as the spec says and the tails are all that is amiss."""
    return lambda rng, rows: SIGMA_M * rng.standard_t(freedom, (rows, 2))


def drive(rows: int) -> dict[str, Array]:
    """A robot on wavy ground tracks, level for ever; nothing but zeros in the third axis."""
    time_s = STEP_S * np.arange(rows)
    north, east = 8.0 * np.sin(0.13 * time_s), 11.0 * np.sin(0.087 * time_s + 0.4)
    v_north, v_east = 1.04 * np.cos(0.13 * time_s), 0.957 * np.cos(0.087 * time_s + 0.4)
    yaw = np.unwrap(np.arctan2(v_east, v_north))
    zero = np.zeros(rows)
    return {
        "time_s": time_s, "velocity_north_mps": v_north, "velocity_east_mps": v_east,
        "velocity_down_mps": zero, "roll_deg": zero, "pitch_deg": zero, "yaw_deg": np.degrees(yaw),
        "rate_x_degps": zero, "rate_y_degps": zero,
        "rate_z_degps": np.degrees(np.gradient(yaw, time_s)),
        "north": north, "east": east,
    }  # fmt: skip


def write(folder: Path, columns: dict[str, Array], scanner: bool) -> tuple[Path, Path]:
    spec, log = folder / "spec.yaml", folder / "log.csv"
    spec.write_text(SPEC + (SCANNER if scanner else ""), encoding="utf-8")
    rows = np.stack(list(columns.values()), axis=1)
    np.savetxt(log, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    return spec, log


def scanned(
    folder: Path,
    draw: Draw,
    seed: int,
    height_m: float = 0.0,
    turned_deg: float = 0.0,
    rows: int = ROWS,
) -> tuple[Path, Path]:
    """A plane scan of walls around: range and azimuth, elevation zero, target down zero."""
    rng = np.random.default_rng(seed)
    moved = drive(rows)
    north, east, yaw = moved.pop("north"), moved.pop("east"), np.radians(moved["yaw_deg"])
    bearing, distance = rng.uniform(-2.0, 2.0, rows), rng.uniform(2.0, 11.0, rows)
    zero = np.zeros(rows)
    noise = draw(rng, rows)
    moved["yaw_deg"] = moved["yaw_deg"] + turned_deg
    azimuth = bearing + np.radians(0.05) * rng.standard_normal(rows)
    columns = moved | {
        "position_north_m": north + noise[:, 0], "position_east_m": east + noise[:, 1],
        "position_down_m": zero + height_m,
        "range_m": distance + 0.01 * rng.standard_normal(rows),
        "azimuth_deg": np.degrees(azimuth), "elevation_deg": zero,
        "target_north_m": north + distance * np.cos(yaw + bearing),
        "target_east_m": east + distance * np.sin(yaw + bearing), "target_down_m": zero,
    }  # fmt: skip
    return write(folder, columns, True)


def tracked(
    folder: Path, draw: Draw, seed: int, axes: tuple[str, ...], rows: int = ROWS
) -> tuple[Path, Path]:
    """A tachymeter knows some axes of the robot's place; the others are not in the log."""
    rng = np.random.default_rng(seed)
    moved = drive(rows)
    place = {"north": moved.pop("north"), "east": moved.pop("east"), "down": np.zeros(rows)}
    noise = draw(rng, rows)
    columns = moved | {
        "position_north_m": place["north"] + noise[:, 0],
        "position_east_m": place["east"] + noise[:, 1],
        "position_down_m": place["down"],
    }
    return write(folder, columns | {f"reference_{a}_m": place[a] for a in axes}, False)


def names(found: Diagnosis) -> list[str]:
    return [f.effect for f in found.findings]


def oracle_freedom(draw: Draw) -> float:
    """Degrees of freedom that scipy fits to very many draws of the same noise."""
    freedom, _, _ = stats.t.fit(draw(np.random.default_rng(9), 20_000).ravel(), floc=0.0)
    return float(freedom)


def test_plane_logs_of_normal_noise_agree(tmp_path: Path) -> None:
    """Four logs at 5 % each: more than one at fault in 1.4 % of choices of seeds."""
    logs = [scanned(tmp_path, normal, 1), scanned(tmp_path, normal, 2, height_m=0.01)]
    found = []
    for spec, log in logs:
        found.append(diagnose(spec, [log]))
    for axes in (TWO_AXES, ONE_AXIS):
        spec, log = tracked(tmp_path, normal, 3, axes, FEW)
        found.append(diagnose(spec, [log]))
    assert not any("heavy_tails" in names(one) for one in found)
    assert sum(one.verdict != "agrees" for one in found) <= 1, [names(one) for one in found]


@pytest.mark.parametrize("freedom", [2.2, 3.0])
@pytest.mark.parametrize("kind", ["scan", "one axis"])
def test_tails_of_plane_logs_are_those_of_their_noise(
    kind: str, freedom: float, tmp_path: Path
) -> None:
    """900 or 1800 draws know the freedom to 8 to 15 %; range noise in a scan raises it a little."""
    draw = student(freedom)
    if kind == "scan":
        spec, log = scanned(tmp_path, draw, 5)
    else:
        spec, log = tracked(tmp_path, draw, 5, ONE_AXIS)
    found = diagnose(spec, [log])
    tails = [f for f in found.findings if f.effect == "heavy_tails"]
    assert len(tails) == 1
    fitted = float(tails[0].parameters["degrees_of_freedom"].value)
    assert fitted == pytest.approx(oracle_freedom(draw), rel=0.45)


@pytest.mark.parametrize("most", [1, 2, 4])
def test_no_effect_is_named_twice(most: int, tmp_path: Path) -> None:
    """Tails, a hidden latency and a lever arm: each once, and no name uses up two places."""
    spec, log = scanned(tmp_path, student(2.2), 7, rows=FEW)
    table = np.genfromtxt(log, delimiter=",", names=True)
    yaw = np.radians(table["yaw_deg"])
    table["position_north_m"] -= 0.3 * table["velocity_north_mps"] - 0.4 * np.cos(yaw)
    table["position_east_m"] -= 0.3 * table["velocity_east_mps"] - 0.4 * np.sin(yaw)
    header = ",".join(table.dtype.names or ())
    np.savetxt(log, table, delimiter=",", header=header, comments="", fmt="%.9g")
    found = diagnose(spec, [log], DiagnosisSettings(max_effects=most))
    labels = Counter((f.effect, f.sensor, f.stage) for f in found.findings)
    assert max(labels.values()) == 1
    assert len(labels) == min(most, 3), labels


def test_a_height_that_is_wrong_everywhere_is_still_found(tmp_path: Path) -> None:
    """0.8 m in an axis without any scatter: far beyond the spec's 5 cm, so not left out."""
    spec, log = scanned(tmp_path, normal, 4, height_m=0.8, rows=FEW)
    found = diagnose(spec, [log])
    assert found.verdict != "agrees"
    values = [
        float(f.parameters[name].value)
        for f in found.findings
        for name in ("down_m", "z_m")
        if name in f.parameters
    ]
    assert [abs(v) for v in values] == pytest.approx([0.8], abs=0.02)


def test_what_a_plane_log_does_not_show_has_no_figure(tmp_path: Path) -> None:
    """A lever arm in the plane: its part along the plane's normal is not seen, not 0 +- 0."""
    rng = np.random.default_rng(31)
    columns = drive(ROWS)
    yaw, noise = np.radians(columns["yaw_deg"]), normal(rng, ROWS)
    north, east = columns.pop("north"), columns.pop("east")
    arm_x, arm_y = 0.20, -0.12
    columns["position_north_m"] = north + arm_x * np.cos(yaw) - arm_y * np.sin(yaw) + noise[:, 0]
    columns["position_east_m"] = east + arm_x * np.sin(yaw) + arm_y * np.cos(yaw) + noise[:, 1]
    columns["position_down_m"] = np.zeros(ROWS)
    columns |= {"reference_north_m": north, "reference_east_m": east}
    columns["reference_down_m"] = np.zeros(ROWS)
    settings = DiagnosisSettings(max_effects=1)
    found = diagnose(*(p if k == 0 else [p] for k, p in enumerate(write(tmp_path, columns, False))),
                     settings)  # fmt: skip
    (finding,) = found.findings
    assert finding.effect == "lever_arm"
    data = found.to_json()
    shown = data["findings"][0]["parameters"]
    assert shown["x_m"]["value"] == pytest.approx(arm_x, abs=0.01)
    assert shown["y_m"]["value"] == pytest.approx(arm_y, abs=0.01)
    assert shown["z_m"]["standard_uncertainty"] is None
    assert not shown["z_m"]["seen"]
    assert "0 m down" not in finding.sentence
    assert "(not seen) down" in finding.sentence
    assert "lever_arm (position): z_m" in data["unseen"]


def test_a_heading_that_is_off_is_not_a_mounting_with_three_angles(tmp_path: Path) -> None:
    """All three fit a turn about the vertical; the one that can do nothing else is named.

    The height that is off beside it is an arm's or a datum's, not that of a mount that bends.
    """
    spec, log = scanned(tmp_path, normal, 6, height_m=0.4, turned_deg=1.5, rows=FEW)
    found = diagnose(spec, [log])
    turned, height = sorted(found.findings, key=lambda one: one.sensor)
    assert turned.effect == "heading_bias"
    low, high = turned.parameters["bias_rad"].interval95 or (np.nan, np.nan)
    assert low <= np.radians(1.5) <= high
    assert height.effect in ("lever_arm", "datum_offset")
    assert {one.effect for one in turned.aliases} >= {"boresight", "mounting"}


def without(log: Path, *names: str) -> Path:
    """The log less some columns."""
    lines = [line.split(",") for line in log.read_text("utf-8").splitlines()]
    kept = [k for k, name in enumerate(lines[0]) if name not in names]
    text = "\n".join(",".join(line[k] for k in kept) for line in lines)
    log.write_text(text + "\n", "utf-8")
    return log


def seen_from(folder: Path, height_m: float) -> tuple[Path, Path]:
    """A scan of points below the robot at their true elevations; level at no height."""
    spec, log = scanned(folder, normal, 3, rows=FEW)
    table = np.genfromtxt(log, delimiter=",", names=True)
    names = list(table.dtype.names or ())
    columns = {name: np.array(table[name]) for name in names}
    level = columns["range_m"]
    columns["position_down_m"] = columns["position_down_m"] - height_m
    columns["range_m"] = np.hypot(level, height_m)
    columns["elevation_deg"] = -np.degrees(np.arctan2(height_m, level))
    rows = np.stack(list(columns.values()), axis=1)
    np.savetxt(log, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    return spec, log


def test_elevations_that_are_left_out_and_were_not_zero_are_no_noise(tmp_path: Path) -> None:
    """From 6 m above what it sees, ranges were "70 times" as loud without them."""
    spec, log = seen_from(tmp_path, 6.0)
    assert diagnose(spec, [log], DiagnosisSettings(seed=0)).verdict == "agrees"
    with pytest.raises(BadInput, match=r"column is missing: elevation_deg") as refused:
        diagnose(spec, [without(log, "elevation_deg")], DiagnosisSettings(seed=0))
    assert "log.csv:1:1" in str(refused.value)


def test_a_level_scan_may_leave_its_elevations_out_beside_heights(tmp_path: Path) -> None:
    spec, log = seen_from(tmp_path, 0.0)
    found = diagnose(spec, [without(log, "elevation_deg")], DiagnosisSettings(seed=0))
    assert found.verdict == "agrees"
    assert any("taken as zero: elevation_deg" in note for note in found.log.notes)
