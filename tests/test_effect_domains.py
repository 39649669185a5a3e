"""Parameters that no effect can have are refused at their place, in every command's way in.

Oracle: the table below, by what the words mean (a factor of a standard deviation is positive, a
share lies between 0 and 1, a duration or a standard deviation is not negative, a whole-second slip
is whole, a scale of -1 leaves nothing).
"""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from scipy.stats import t as student
from typer.testing import CliRunner

from syncline_design.cli.app import app
from syncline_design.spec.load import BadInput
from syncline_design.verdict.verify import CheckSettings
from tests.checked import check_file

SPEC = """\
syncline: 1
name: domains
requirements:
  - {id: A, kind: accuracy, limit: 1 km}
  - {id: S, kind: sync, limit: 1000000}
stages:
  - name: boat
    platform: {v_max: 4 m/s, omega_max: 20 deg/s, distance: 30 m, baseline: 1 m}
    position:
      sensor: {modality: position, sigma_position: 5 cm, primitives: []}
      timestamping: arrival
    attitude:
      sensor: {modality: attitude, sigma_attitude: 0.1 deg, primitives: []}
      timestamping: arrival
    ranging:
      sensor: {modality: ranging, type: mbes, sigma_range: 1 cm, sigma_bearing: 0.1 deg,
               primitives: []}
      timestamping: arrival
monte_carlo: {samples: 500}
effects:
"""
LINE = SPEC.count("\n") + 1

IMPOSSIBLE = [
    ("noise_understated", "position", "factor: -3"),
    ("noise_understated", "attitude", "factor: 0"),
    ("noise_understated", "ranging", "factor: -0.5"),
    ("noise_episode", "ranging", "factor: 0, from_s: 1 s, to_s: 2 s"),
    ("noise_episode", "position", "factor: 3, from_s: -1 s, to_s: 2 s"),
    ("heavy_tails", "position", "degrees_of_freedom: 3, outlier_rate: -0.5"),
    ("heavy_tails", "position", "degrees_of_freedom: 3, outlier_rate: 1.5"),
    ("heavy_tails", "position", "degrees_of_freedom: 0, outlier_rate: 0.1"),
    ("heavy_tails", "position", "degrees_of_freedom: -4, outlier_rate: 0.1"),
    ("timestamp_jitter", "attitude", "std_s: -10 ms"),
    ("packetised_timestamps", "position", "interval_s: -0.1"),
    ("filter_lag", "position", "time_constant_s: -0.1"),
    ("correlated_noise", "position", "std_m: -0.1, time_constant_s: 10"),
    ("correlated_noise", "position", "std_m: 0.1, time_constant_s: -10"),
    ("height_drift", "position", "std_m: -0.3, time_constant_s: 10"),
    ("integer_second_slip", "position", "seconds: 0.4"),
    ("range_scale", "ranging", "scale: -1.5"),
    ("sound_speed", "ranging", "relative_error: -1"),
    ("grid_scale", "target", "scale: -2"),
]
POSSIBLE = [
    ("noise_understated", "position", "factor: 0.2"),
    ("heavy_tails", "position", "degrees_of_freedom: 0.8, outlier_rate: 1"),
    ("heavy_tails", "position", "degrees_of_freedom: 30, outlier_rate: 0"),
    ("heavy_tails", "position", "degrees_of_freedom: 2.001, outlier_rate: 0"),
    ("timestamp_jitter", "position", "std_s: 0"),
    ("packetised_timestamps", "attitude", "interval_s: 0"),
    ("integer_second_slip", "position", "seconds: -18"),
    ("range_scale", "ranging", "scale: -0.2"),
    ("latency", "position", "latency_s: -3 ms"),
    ("timestamp_step", "position", "step_s: -0.1, time_s: -5"),
]


def written(folder: Path, effect: str, sensor: str, values: str) -> Path:
    path = folder / "spec.yaml"
    entry = f"  - {{effect: {effect}, sensor: {sensor}, parameters: {{{values}}}}}\n"
    path.write_text(SPEC + entry)
    return path


@pytest.mark.parametrize(("effect", "sensor", "values"), IMPOSSIBLE)
def test_a_value_that_no_effect_can_have_is_refused_at_its_place(
    tmp_path: Path, effect: str, sensor: str, values: str
) -> None:
    with pytest.raises(BadInput, match="out of range; expected a") as refused:
        check_file(written(tmp_path, effect, sensor, values), CheckSettings(monte_carlo=False))
    assert [problem.line for problem in refused.value.problems] == [LINE]


@pytest.mark.parametrize("command", ["check", "simulate", "optimize"])
def test_a_negative_factor_ends_every_command_as_bad_input(tmp_path: Path, command: str) -> None:
    """It used to draw three times the noise and charge nothing for it."""
    path = written(tmp_path, *IMPOSSIBLE[0])
    result = CliRunner().invoke(app, [command, str(path)])
    assert result.exit_code == 2
    assert f"spec.yaml:{LINE}:" in result.stderr
    assert "expected a number more than 0, found -3" in result.stderr


@pytest.mark.parametrize(("effect", "sensor", "values"), POSSIBLE)
def test_values_up_to_the_ends_of_what_exists_are_taken(
    tmp_path: Path, effect: str, sensor: str, values: str
) -> None:
    verdict = check_file(written(tmp_path, effect, sensor, values), CheckSettings()).to_json()
    assert verdict["verdict"] == "meets"


MEANT = {  # what each sensor's columns can be written in by mistake, by what they hold
    "position": {"enu", "up"},
    "attitude": {"enu", "yaw_sign", "yaw_180", "transposed", "radians", "degrees"},
    "ranging": {"azimuth_sign", "elevation_sign", "radians", "degrees"},
}


@pytest.mark.parametrize("sensor", sorted(MEANT))
def test_a_convention_that_a_sensor_cannot_have_is_refused_at_its_place(
    tmp_path: Path, sensor: str
) -> None:
    for convention in sorted(set().union(*MEANT.values())):
        path = written(tmp_path, "frame_convention", sensor, f"convention: {convention}")
        if convention in MEANT[sensor]:
            assert check_file(path, CheckSettings(monte_carlo=False)).to_json()["effects"]
            continue
        with pytest.raises(BadInput, match=f"found {convention}") as refused:
            check_file(path, CheckSettings())
        (problem,) = refused.value.problems
        assert problem.line == LINE
        assert set(problem.expected.removeprefix("one of ").split(", ")) == MEANT[sensor]
        assert CliRunner().invoke(app, ["simulate", str(path)]).exit_code == 2


ENDLESS = ["degrees_of_freedom: 2, outlier_rate: 0", "degrees_of_freedom: 1.2, outlier_rate: 0.3"]


@pytest.mark.parametrize("command", ["check", "optimize", "simulate"])
@pytest.mark.parametrize("values", ENDLESS)
def test_tails_without_a_standard_deviation_have_no_place_in_a_budget(
    tmp_path: Path, values: str, command: str
) -> None:
    """They were budgeted as 2.1 degrees of freedom without a word."""
    path = written(tmp_path, "heavy_tails", "position", values)
    result = CliRunner().invoke(app, [command, str(path)])
    assert result.exit_code == 2
    assert f"spec.yaml:{LINE}:" in result.stderr
    assert "no standard deviation" in result.stderr
    assert "outlier_rate, or" in result.stderr


@pytest.mark.parametrize("freedom", [2.001, 2.03, 2.1, 3.0])
def test_tails_are_charged_with_the_standard_deviation_of_students_t(
    tmp_path: Path, freedom: float
) -> None:
    """Oracle: scipy's standard deviation; just above 2 the charge stopped at that of 2.1."""
    values = f"degrees_of_freedom: {freedom}, outlier_rate: 0"
    path = written(tmp_path, "heavy_tails", "position", values)
    verdict = check_file(path, CheckSettings(monte_carlo=False)).to_json()
    rows = {row["term"]: row["value_m"] for row in verdict["syncline"]["ledger"]}
    noise = rows["sigma_p"] + rows["heavy_tails (position)"]
    assert noise == pytest.approx(math.sqrt(3.0) * 0.05 * float(student.std(freedom)), rel=1e-9)
