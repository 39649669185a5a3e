"""Checks before names, an honest gap, and answers that neither size nor threads can upset.

Oracles: the hidden world's motion, statistics of the raw columns, plain arithmetic.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from syncline_design.comparison.meaning import with_design
from syncline_design.diagnosis import Diagnosis, DiagnosisSettings, diagnose
from syncline_design.diagnosis.checks import Check, log_checks
from syncline_design.diagnosis.covariance import inverse_3x3
from syncline_design.diagnosis.gap import closed_share
from syncline_design.diagnosis.gap_result import Fit, Gap, HeldOut
from syncline_design.diagnosis.scatter import scatter
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.system import measured
from syncline_design.logs.log import LogKind
from syncline_design.report.diagnoses import render_diagnose
from syncline_design.report.on_diagnosis import on_diagnosis
from syncline_design.report.on_gap import closed_text
from syncline_design.report.render_console import console
from syncline_design.spec.load import BadInput, load
from tests.world import Hidden, WorldLog, hidden, make_log, scenario

Array = NDArray[np.float64]
Change = Callable[[dict[str, Array]], None]
LEVER = hidden("lever_arm", "position", x_m=0.3, y_m=-0.2, z_m=0.1)
DELAY = hidden("latency", "position", latency_s=0.05)


def times(stem: str, factor: float) -> Change:
    def change(columns: dict[str, Array]) -> None:
        for name in [n for n in columns if n.startswith(stem)]:
            columns[name] = factor * columns[name]

    return change


def swapped(columns: dict[str, Array]) -> None:
    north, east = "velocity_north_mps", "velocity_east_mps"
    columns[north], columns[east] = columns[east], columns[north]


def in_body(columns: dict[str, Array]) -> None:
    """Forward and right instead of north and east, by the heading alone."""
    yaw = np.radians(columns["yaw_deg"])
    north, east = columns["velocity_north_mps"], columns["velocity_east_mps"]
    columns["velocity_north_mps"] = np.cos(yaw) * north + np.sin(yaw) * east
    columns["velocity_east_mps"] = -np.sin(yaw) * north + np.cos(yaw) * east


def written(log: WorldLog, folder: Path, change: Change | None = None, limits: str = "") -> Path:
    text = log.spec_yaml()
    if limits:
        key = limits.split(":")[0]
        start = text.index(f"{key}: ")
        text = text[:start] + limits + text[text.index(",", start) :]
    (folder / "spec.yaml").write_text(text, encoding="utf-8")
    if change is not None:
        change(log.columns)
    log.to_csv(folder / "log.csv")
    return folder


def run_of(platform: str, *effects: Hidden, kind: str = "georeference", seed: int = 7) -> WorldLog:
    return make_log(scenario(platform, seed, 80.0, 5.0, kind), effects)


def checked(folder: Path) -> tuple[Check, ...]:
    inputs = measured(load(folder / "spec.yaml"), [folder / "log.csv"])
    return log_checks(scene(inputs.system, inputs.log, inputs.known))


def asked(folder: Path, **settings: Any) -> Diagnosis:
    return diagnose(folder / "spec.yaml", [folder / "log.csv"], DiagnosisSettings(**settings))


@pytest.mark.parametrize("platform", ["multirotor_lines", "car_stops", "vessel_figure_eights"])
@pytest.mark.parametrize("effect", [None, LEVER, hidden("latency", "position", latency_s=0.25),
                                    hidden("latency", "attitude", latency_s=0.2)])  # fmt: skip
@pytest.mark.parametrize("kind", ["georeference", "position"])
def test_sound_logs_pass(platform: str, effect: Hidden | None, kind: str, tmp_path: Path) -> None:
    if effect is not None and (kind == "position" and effect.sensor == "attitude"):
        effect = None
    log = run_of(platform, *(() if effect is None else (effect,)), kind=kind)
    found = checked(written(log, tmp_path))
    assert not [c for c in found if c.severity == "contradiction"]


@pytest.mark.parametrize("seed", [3, 8])
@pytest.mark.parametrize("effect", [
    hidden("noise_understated", "ranging", stage="vessel", factor=8.0),
    hidden("latency", "attitude", stage="vessel", latency_s=0.12),
    hidden("latency", "ranging", stage="vessel", latency_s=0.3),
])  # fmt: skip
def test_a_chain_that_measures_coarsely_does_not_contradict_itself(
    seed: int, effect: Hidden, tmp_path: Path
) -> None:
    """The places of a later stage are as good as the chain before it: no motion of their own."""
    log = make_log(scenario("survey_chain", seed, 100.0, 5.0), (effect,))
    found = checked(written(log, tmp_path))
    assert not [c for c in found if c.code.endswith("columns")]


def test_columns_of_a_chain_that_contradict_it_are_said(tmp_path: Path) -> None:
    log = make_log(scenario("survey_chain", 3, 100.0, 5.0))
    found = checked(written(log, tmp_path, times("auv_velocity_", 1.3)))
    (check,) = [c for c in found if c.code == "velocity_columns"]
    assert (check.stage, check.value) == ("auv", pytest.approx(1.3, rel=0.02))


def test_a_later_stage_without_a_velocity_is_told_why_it_needs_one(tmp_path: Path) -> None:
    def dropped(columns: dict[str, Array]) -> None:
        for name in [n for n in columns if n.startswith("auv_velocity_")]:
            del columns[name]

    log = make_log(scenario("survey_chain", 3, 20.0, 5.0))
    with pytest.raises(BadInput, match="only the first stage of a chain has places"):
        checked(written(log, tmp_path, dropped))


def test_columns_of_a_stage_behind_another_sign_are_told_the_underscore(tmp_path: Path) -> None:
    """`auv.range_m` stood in the list of what was found, without a word on what is wrong."""

    def dotted(columns: dict[str, Array]) -> None:
        for name in [n for n in columns if n.startswith("auv_")]:
            columns[name.replace("auv_", "AUV.", 1)] = columns.pop(name)

    log = make_log(scenario("survey_chain", 3, 20.0, 5.0))
    with pytest.raises(BadInput) as refused:
        checked(written(log, tmp_path, dotted))
    words = str(refused.value)
    assert "columns are missing: auv_range_m" in words
    assert "AUV.range_m would be auv_range_m (and 2 more so)" in words
    assert "map them in the spec: log: {columns: {auv_range_m: AUV.range_m}}" in words


def late(stem: str, by_s: float) -> Change:
    def change(columns: dict[str, Array]) -> None:
        stamps = columns["time_s"]
        for name in [n for n in columns if n.startswith(stem)]:
            columns[name] = np.interp(stamps - by_s, stamps, columns[name])

    return change


@pytest.mark.parametrize(("platform", "by_s"), [("multirotor_lines", 0.35),
                                                ("multirotor_lines", 0.8),
                                                ("fixed_wing_circuits", 0.9)])  # fmt: skip
@pytest.mark.parametrize(("stem", "code"), [("velocity_", "velocity_columns"),
                                            ("rate_", "rate_columns")])  # fmt: skip
def test_columns_that_come_late_are_said(
    platform: str, stem: str, code: str, by_s: float, tmp_path: Path
) -> None:
    """Positions and attitudes are not late; nothing else in the log would show it."""
    found = checked(written(run_of(platform), tmp_path, late(stem, by_s)))
    (check,) = [c for c in found if c.code == code]
    assert check.severity == "contradiction"
    said = check.message.split("they come about ")[1]
    figure, unit = said.split()[:2]
    assert float(figure) * {"ms": 1e-3, "s": 1.0}[unit] == pytest.approx(by_s, abs=0.051)


def noisy(stem: str, sigma: float) -> Change:
    def change(columns: dict[str, Array]) -> None:
        rng = np.random.default_rng(1)
        for name in [n for n in columns if n.startswith(stem)]:
            columns[name] = columns[name] + sigma * rng.standard_normal(columns[name].shape)

    return change


@pytest.mark.parametrize(("times_place", "severity"), [(0.2, None), (0.75, "caution"),
                                                       (2.0, "contradiction")])  # fmt: skip
@pytest.mark.parametrize("platform", ["multirotor_lines", "car_stops"])
def test_velocities_that_scatter_are_said(
    platform: str, times_place: float, severity: str | None, tmp_path: Path
) -> None:
    """In 0.1 s by so many times the places' noise; found to 15 % of what was added."""
    log = run_of(platform, DELAY)
    sensors = log.run.carriers[0].sensors
    assert sensors.position_m is not None
    added = 10.0 * times_place * float(np.sqrt(np.mean(np.square(sensors.position_m))))
    found = checked(written(log, tmp_path, noisy("velocity_", added)))
    seen = [c for c in found if c.code == "velocity_columns"]
    assert [c.severity for c in seen] == ([] if severity is None else [severity])
    for check in seen:
        assert "scatter" in check.message
        assert check.value == pytest.approx(added, rel=0.15)


@pytest.mark.parametrize("rate_hz", [0.4, 0.7, 1.0, 2.0, 10.0])
def test_motion_that_the_rows_miss_is_not_called_noise(rate_hz: float, tmp_path: Path) -> None:
    """A vessel in waves, sampled ever more coarsely."""
    log = make_log(scenario("vessel_figure_eights", 4, 300.0, rate_hz))
    assert not [c for c in checked(written(log, tmp_path)) if c.code == "velocity_columns"]


def test_scatter_beside_a_swing() -> None:
    """Stamps up to a tenth off, a roll of 4 s, noise of 0.2 m/s: found within 10 %."""
    rng = np.random.default_rng(2)
    t = np.arange(800) * 0.1 + rng.uniform(-0.01, 0.01, 800)
    swing = np.stack([np.sin(1.57 * t), np.cos(1.57 * t + 1.0), 0.4 * np.sin(1.8 * t)], axis=1)
    assert scatter(t, 0.8 * swing) < 0.02
    found = scatter(t, 0.8 * swing + 0.2 * rng.standard_normal((800, 3)))
    assert found == pytest.approx(0.2, rel=0.1)


COLUMNS = (
    ("velocity_columns", times("velocity_", 1.2), 1.2),
    ("velocity_columns", times("velocity_", 0.9), 0.9),
    ("velocity_columns", times("velocity_", 1.943844), 1.943844),
    ("velocity_columns", times("velocity_", -1.0), -1.0),
    ("velocity_columns", swapped, 1.0),
    ("velocity_columns", in_body, 1.0),
    ("rate_columns", times("rate_", 1.25), 1.25),
    ("rate_columns", times("rate_", -1.0), -1.0),
    ("rate_columns", times("rate_", float(np.pi / 180.0)), float(np.pi / 180.0)),
)


@pytest.mark.parametrize(("code", "change", "factor"), COLUMNS)
@pytest.mark.parametrize("platform", ["fixed_wing_circuits", "constant_speed_eights"])
def test_columns_that_contradict_the_poses_are_said(
    platform: str, code: str, change: Change, factor: float, tmp_path: Path
) -> None:
    found = checked(written(run_of(platform, DELAY), tmp_path, change))
    (check,) = [c for c in found if c.code == code]
    assert check.severity == "contradiction"
    assert check.value == pytest.approx(factor, rel=0.02)


def still(*names: str) -> Change:
    def change(columns: dict[str, Array]) -> None:
        for name in names:
            columns[name] = np.zeros_like(columns[name])

    return change


def offset(name: str, by: float) -> Change:
    def change(columns: dict[str, Array]) -> None:
        columns[name] = columns[name] + by

    return change


VELOCITY = ("velocity_north_mps", "velocity_east_mps", "velocity_down_mps")
RATES = ("rate_x_degps", "rate_y_degps", "rate_z_degps")
UNLIKE = (
    ("velocity_columns", still(*VELOCITY), "0 % of the motion"),
    ("velocity_columns", still("velocity_north_mps"), "motion along the first axis"),
    ("velocity_columns", still("velocity_east_mps"), "motion along the second axis"),
    ("velocity_columns", offset("velocity_east_mps", 4.0), "m/s along the second axis"),
    ("velocity_columns", offset("velocity_down_mps", -1.5), "m/s along the third axis"),
    ("rate_columns", still(*RATES), "0 % of the motion"),
    ("rate_columns", still("rate_z_degps"), "motion along the third axis"),
)


@pytest.mark.parametrize(("code", "change", "words"), UNLIKE)
@pytest.mark.parametrize("platform", ["fixed_wing_circuits", "constant_speed_eights"])
def test_columns_without_part_in_the_motion_are_said(
    platform: str, code: str, change: Change, words: str, tmp_path: Path
) -> None:
    """Columns of zeros, and a constant that the places do not follow, have no wrong factor."""
    found = checked(written(run_of(platform, DELAY), tmp_path, change))
    (check,) = [c for c in found if c.code == code]
    assert check.severity == "contradiction"
    assert words in check.message


@pytest.mark.parametrize("platform", ["multirotor_lines", "car_stops", "vessel_figure_eights",
                                      "fixed_wing_circuits"])  # fmt: skip
@pytest.mark.parametrize("effect", [
    hidden("lever_arm", "position", x_m=1.5, y_m=-1.0, z_m=0.8),
    hidden("noise_understated", "position", factor=8.0),
    hidden("timestamp_step", "position", step_s=1.0, time_s=40.0),
    hidden("heading_hard_iron", "attitude", sin_rad=0.2, cos_rad=-0.15),
])  # fmt: skip
def test_faults_of_the_dictionary_are_no_contradiction(
    platform: str, effect: Hidden, tmp_path: Path
) -> None:
    """What has a name is to be named: large faults leave places and columns in agreement."""
    found = checked(written(run_of(platform, effect), tmp_path))
    assert "velocity_columns" not in [c.code for c in found]


@pytest.mark.parametrize(("limits", "code", "column"), [
    ("v_max: 1 m/s", "speed", "velocity_"), ("omega_max: 2 deg/s", "turn_rate", "rate_"),
    ("distance: 12 m", "range", "range_m"),
])  # fmt: skip
def test_a_log_beyond_the_limits_says_so(
    limits: str, code: str, column: str, tmp_path: Path
) -> None:
    """The share beyond the limit against a plain count of the raw rows."""
    log = run_of("multirotor_lines")
    (check,) = [c for c in checked(written(log, tmp_path, None, limits)) if c.code == code]
    assert check.severity == "contradiction"
    parts = [v for n, v in log.columns.items() if n.startswith(column)]
    size = np.sqrt(np.sum(np.square(parts), axis=0))
    limit = float(limits.split()[1])
    assert check.share == pytest.approx(np.mean(size > limit), abs=0.12)


def test_the_points_at_which_two_trajectories_are_compared_are_no_ranges(tmp_path: Path) -> None:
    """They lie where both sensors' noise counts alike, whatever the spec's distance is."""
    folder = written(run_of("multirotor_lines"), tmp_path, None, "distance: 12 m")
    inputs = measured(load(folder / "spec.yaml"), [folder / "log.csv"])
    for kind, codes in (("georeference", ["range"]), ("pose", [])):
        log = replace(inputs.log, kind=cast(LogKind, kind))
        assert [c.code for c in log_checks(scene(inputs.system, log, inputs.known))] == codes


@pytest.mark.parametrize("kind", ["georeference", "position"])
def test_a_device_that_hangs_is_told_from_when_to_when(kind: str, tmp_path: Path) -> None:
    """Rows 200 to 214 repeat row 199; how far that is off against the raw columns."""
    log = run_of("vessel_figure_eights", kind=kind)
    names = [f"position_{axis}_m" for axis in ("north", "east", "down")]
    before = np.array([log.columns[name].copy() for name in names])

    def hung(columns: dict[str, Array]) -> None:
        for name in names:
            columns[name][200:215] = columns[name][199]

    assert not [c for c in checked(written(log, tmp_path)) if c.code == "frozen_readings"]
    (one,) = [c for c in checked(written(log, tmp_path, hung)) if c.code == "frozen_readings"]
    time_s = log.columns["time_s"]
    assert (one.severity, one.share) == ("caution", pytest.approx(15 / len(time_s)))
    assert one.value == pytest.approx(time_s[214] - time_s[199])
    off_m = float(np.max(np.linalg.norm(before[:, 200:215] - before[:, 199:200], axis=0)))
    words = one.message
    assert words.startswith("position (")
    assert f"from {time_s[199]:.4g} s to {time_s[214]:.4g} s" in words
    told = float(words.rpartition(" old and ")[2].split()[0])
    assert told == pytest.approx(off_m, rel=0.1)


def lasting(columns: dict[str, Array]) -> None:
    """A constant that the places do not follow: times a delay, it would look like a datum."""
    columns["velocity_north_mps"] += 0.8
    columns["velocity_east_mps"] -= 0.5


@pytest.mark.parametrize(("change", "limits"), [(times("velocity_", 1.2), ""), (lasting, ""),
                                                (None, "v_max: 1 m/s")])  # fmt: skip
def test_no_unsound_log_agrees_or_is_explained(
    change: Change | None, limits: str, tmp_path: Path
) -> None:
    found = asked(written(run_of("car_stops", DELAY), tmp_path, change, limits))
    document = found.to_json()
    text = " ".join(console(on_diagnosis(with_design(found, None))).split())
    assert found.verdict == "unexplained"
    assert found.exit_code == 1
    assert document["sound"] is False
    said = document["checks"][0]["message"]
    assert text.lower().index(said.lower()) < text.index("What is missing")
    causes = [one for one in found.findings if one.kind == "cause"]
    assert [(one.effect, one.sensor) for one in causes] == [("latency", "position")]
    low, high = causes[0].parameters["latency_s"].interval95 or (0.0, 0.0)
    assert low <= 0.05 <= high, "the wrong columns have a part in the delay"
    for kind in ("html", "markdown"):
        page = render_diagnose(kind, with_design(found, None))
        assert "contradicts itself" in page
        assert page.index(said[6:18]) < page.index("older than")


def test_ranges_in_a_wrong_unit_are_an_answer_not_an_error(tmp_path: Path) -> None:
    """Millimetres are mended; a factor that is no unit stays, and is said."""
    found = asked(written(run_of("car_stops"), tmp_path, times("range_m", 1e3)), max_effects=1)
    assert [one.parameters["convention"].value for one in found.findings] == ["range in mm"]
    assert not found.checks
    folder = written(run_of("car_stops"), tmp_path, times("range_m", 1e6))
    assert "range" in [c.code for c in asked(folder, max_effects=1).checks]


def test_ranges_beyond_the_moon_are_refused(tmp_path: Path) -> None:
    folder = written(run_of("car_stops"), tmp_path, times("range_m", 1e12))
    with pytest.raises(BadInput, match="farther than any sensor sees"):
        asked(folder)


def test_unlike_sizes_are_inverted(tmp_path: Path) -> None:
    """Variances from (1 um)^2 to (1000 km)^2 in one block, against mpmath with 60 digits."""
    import mpmath

    rng = np.random.default_rng(3)
    for scales in ((1e-6, 1.0, 1e6), (1e6, 1e-3, 1e-3), (1e-2, 1e5, 1e-5)):
        root = np.diag(scales) @ (np.eye(3) + 0.3 * rng.standard_normal((3, 3)))
        block = root @ root.T
        block = 0.5 * (block + block.T)
        inverse, determinant = inverse_3x3(block[None])
        with mpmath.workdps(60):
            exact = mpmath.matrix(block.tolist()) ** -1
            size = mpmath.det(mpmath.matrix(block.tolist()))
            wanted = np.array([[float(exact[i, j]) for j in range(3)] for i in range(3)])
        weight = np.outer(scales, scales)
        assert inverse[0] * weight == pytest.approx(wanted * weight, rel=1e-7, abs=1e-7)
        assert determinant[0] == pytest.approx(float(size), rel=1e-7)


def test_noise_alone_closes_no_gap(tmp_path: Path) -> None:
    """Nothing is held out when only the noise's size is fitted."""
    louder = hidden("noise_understated", "position", factor=3.0)
    found = asked(written(run_of("car_stops", louder), tmp_path), max_effects=2)
    assert {f.effect for f in found.findings} <= {"noise_understated", "heavy_tails"}
    assert found.gap.held_out is not None
    assert found.gap.closed_fraction is None
    text = console(on_diagnosis(with_design(found, None)))
    assert "Gap closed" not in text
    assert "times what the spec expects" in text


@pytest.mark.parametrize("exclude", [(), ("latency", "filter_lag", "packetised_timestamps")])
def test_closed_is_never_more_than_the_rms_shows(exclude: tuple[str, ...], tmp_path: Path) -> None:
    """With the true name and without it; before, after and the spec's noise by hand."""
    folder = written(run_of("multirotor_lines", DELAY), tmp_path)
    document = asked(folder, exclude_effects=exclude).to_json()
    gap = document["gap"]
    before, after = (gap["held_out"][key]["rms_m"] for key in ("before", "after"))
    expected = gap["expected_rms_m"]
    if gap["closed_fraction"] is not None:
        by_hand = (before - after) / (before - min(expected, after))
        assert gap["closed_fraction"] <= by_hand + 1e-3
    if not exclude:
        assert gap["closed_fraction"] > 0.95
        assert after == pytest.approx(expected, rel=0.1)
    bars = [step["held_out"]["after"]["rms_m"] for step in document["steps"]]
    assert len(bars) == len(document["findings"])
    if bars:
        assert bars[-1] == pytest.approx(after)


CLOSED = (  # RMS [m] and NLL before, after, floor; the share by hand
    ((0.03633, 0.03623, 0.03621), (2.1, 1.9, 1.88), None),  # 0.3 % of the RMS
    ((1.746, 1.858, 1.838), (3.0, 2.9, 2.8), None),  # it rose
    ((0.4, 0.1, 0.05), (9.0, 1.0, 1.0), 6 / 7),
    ((0.4, 0.05, 0.05), (9.0, 3.0, 1.0), 3 / 4),
    ((0.4, 0.5, 0.05), (9.0, 3.0, 1.0), -2 / 7),
)


@pytest.mark.parametrize(("rms_m", "nll", "share"), CLOSED)
def test_a_share_of_next_to_nothing_is_not_given(
    rms_m: tuple[float, ...], nll: tuple[float, ...], share: float | None
) -> None:
    before, after, floor = (Fit(r, 1.0, n, 0.95) for r, n in zip(rms_m, nll, strict=True))
    scores = HeldOut(before, after, floor, floor)
    closed = closed_share(scores)
    assert closed == (None if share is None else pytest.approx(share))
    text = closed_text(Gap(expected_rms_m=0.05, closed_fraction=closed), scores)
    assert ("too little for a share" in text) == (share is None)
    assert text.endswith("%") == (share is not None and share > 0.0)


SCRIPT = """
import sys
from syncline_design.diagnosis import DiagnosisSettings, diagnose
from syncline_design.report.json_out import json_text
settings = DiagnosisSettings(max_effects=1)
print(json_text(diagnose(sys.argv[1], [sys.argv[2]], settings).to_json()))
"""


def test_threads_change_no_digit(tmp_path: Path) -> None:
    """Used as a library, where nothing has set the environment.

    One effect is enough: without the guard its digits differ for one thread and two.
    """
    folder = written(run_of("constant_speed_eights", DELAY, LEVER), tmp_path)
    printed = []
    for threads in ("1", "2"):
        environment = os.environ | {f"{n}_NUM_THREADS": threads for n in ("OMP", "OPENBLAS")}
        command = [sys.executable, "-c", SCRIPT, folder / "spec.yaml", folder / "log.csv"]
        printed.append(subprocess.run(command, env=environment, capture_output=True, check=True))
    assert printed[0].stdout == printed[1].stdout
