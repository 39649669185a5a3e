"""What is no cause is not called one: waves in one reading, and steps that stand for a delay."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis import DiagnosisSettings, diagnose
from syncline_design.diagnosis.finding import finding
from syncline_design.diagnosis.fitting import fit
from syncline_design.diagnosis.result import Diagnosis, Estimate
from syncline_design.diagnosis.run import stand_ins
from syncline_design.diagnosis.searched import prepared
from syncline_design.diagnosis.system import measured
from syncline_design.effects import registry
from syncline_design.spec.load import load
from tests.test_long_memories import SPEC
from tests.test_unlike_axes import wandering
from tests.world import hidden, make_log, scenario

Columns = dict[str, np.ndarray]


def heave(log: Columns) -> None:
    log["position_down_m"] = log["position_down_m"] + 0.06 * np.sin(log["time_s"] * 2 * np.pi / 7.0)


def cyclic(log: Columns) -> None:
    log["range_m"] = log["range_m"] + 0.03 * np.cos(log["range_m"] * 2 * np.pi / 0.8)


def soft_iron(log: Columns) -> None:
    twice = 2.0 * np.radians(log["yaw_deg"])
    log["yaw_deg"] = log["yaw_deg"] + 0.25 * np.sin(twice + 0.4)


def three_a_turn(log: Columns) -> None:
    thrice = 3.0 * np.radians(log["yaw_deg"])
    log["yaw_deg"] = log["yaw_deg"] + 0.25 * np.sin(thrice + 0.4)


WAVES: dict[str, tuple[Callable[[Columns], None], str, dict[str, float], str]] = {
    "heave": (heave, "position", {"period_s": 7.0, "amplitude_m": 0.06}, "down"),
    "cyclic": (cyclic, "ranging", {"wavelength_m": 0.8, "amplitude_m": 0.03}, "range"),
    "three times a turn": (
        three_a_turn, "attitude", {"harmonic": 3.0, "amplitude_rad": np.radians(0.25)}, "yaw"),
}  # fmt: skip


def asked(plant: Callable[[Columns], None] | None, folder: Path) -> Diagnosis:
    log = make_log(scenario("car_stops", 4, 100.0, 5.0))
    columns = {name: values.astype(float) for name, values in log.columns.items()}
    if plant is not None:
        plant(columns)
    spec = folder / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    return diagnose(spec, [replace(log, columns=columns).to_csv(folder / "log.csv")])


@pytest.mark.parametrize("name", WAVES)
def test_a_wave_is_a_stand_in_with_its_pace_and_channel(name: str, tmp_path: Path) -> None:
    plant, sensor, truth, channel = WAVES[name]
    found = asked(plant, tmp_path)
    (one,) = found.findings
    assert (one.effect, one.sensor, one.kind) == ("spectral_line", sensor, "stand_in")
    assert one.parameters["channel"].value == channel
    for key, value in truth.items():
        close = 0.01 if not key.startswith("amplitude") else 0.15
        assert one.parameters[key].value == pytest.approx(value, rel=close)
    assert found.verdict == "unexplained"
    assert found.effects_entries() == ()


def test_twice_a_turn_is_soft_iron(tmp_path: Path) -> None:
    (one,) = asked(soft_iron, tmp_path).findings
    assert (one.effect, one.sensor, one.kind) == ("heading_soft_iron", "attitude", "cause")
    sizes = [one.parameters[name].value for name in ("sin_rad", "cos_rad")]
    assert np.hypot(*sizes) == pytest.approx(np.radians(0.25), rel=0.15)


def test_noise_makes_no_wave(tmp_path: Path) -> None:
    assert asked(None, tmp_path).findings == ()


def test_a_step_as_early_as_is_looked_for_stands_for_a_delay(tmp_path: Path) -> None:
    """A delay that the dictionary must not name acts from the first row on."""
    late = hidden("latency", "position", latency_s=0.01)
    log = make_log(scenario("multirotor_lines", 9, 100.0, 5.0), (late,))
    spec = tmp_path / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    less = ("latency", "packetised_timestamps", "filter_lag")
    settings = DiagnosisSettings(exclude_effects=less)
    found = diagnose(spec, [log.to_csv(tmp_path / "log.csv")], settings)
    assert found.verdict == "unexplained"
    assert all(one.kind == "stand_in" for one in found.findings if one.effect == "timestamp_step")
    assert found.effects_entries() == ()


def test_a_drift_that_may_not_be_named_is_no_step_of_the_clock(tmp_path: Path) -> None:
    """A clock that runs away is half a step off at both ends: the step says something else."""
    drift = hidden("clock_drift", "position", rate=3e-4)
    log = make_log(scenario("car_stops", 6, 60.0, 8.0), (drift,))
    spec = tmp_path / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    without = DiagnosisSettings(exclude_effects=("clock_drift",), unseen_block=False)
    found = diagnose(spec, [log.to_csv(tmp_path / "log.csv")], without)
    steps = [one for one in found.findings if one.effect == "timestamp_step"]
    assert steps
    assert {one.kind for one in steps} == {"stand_in"}
    assert found.verdict == "unexplained"


def test_a_step_of_the_clock_keeps_its_name(tmp_path: Path) -> None:
    step = hidden("timestamp_step", "position", step_s=0.04, time_s=33.0)
    log = make_log(scenario("car_stops", 6, 60.0, 8.0), (step,))
    spec = tmp_path / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    settings = DiagnosisSettings(unseen_block=False)
    (one,) = diagnose(spec, [log.to_csv(tmp_path / "log.csv")], settings).findings
    assert (one.effect, one.sensor, one.kind) == ("timestamp_step", "position", "cause")
    assert one.parameters["step_s"].value == pytest.approx(0.04, rel=0.1)
    assert one.parameters["time_s"].value == pytest.approx(
        33.0, abs=2.0
    )  # it stands still around then


@pytest.mark.parametrize(("left_m", "kind"), [(22.0, "stand_in"), (2.0, "cause")])
def test_a_slip_that_leaves_most_of_the_error_is_no_cause(
    left_m: float, kind: str, tmp_path: Path
) -> None:
    """It made 8 m of the error: an eighth of 8^2 + 22^2, all but a sixteenth of 8^2 + 2^2."""
    draws = np.random.default_rng(1).standard_normal((60, 3))
    columns = wandering((1.0, 1.0, 1.0), draws)
    (tmp_path / "spec.yaml").write_text(SPEC.replace("ARM", "0"))
    table = np.stack(list(columns.values()), axis=1)
    np.savetxt(tmp_path / "log.csv", table, "%.7f", ",", header=",".join(columns), comments="")
    inputs = measured(load(tmp_path / "spec.yaml"), [tmp_path / "log.csv"])
    data = prepared(inputs, inputs.log)
    slip = finding(registry()["integer_second_slip"], "position", "boat",
                   {"seconds": Estimate(-2.0, None, "s", True, "-2")}, "", 9.0)  # fmt: skip
    off = data.error(()) + np.array([8.0, 0.0, 0.0])
    (told,) = stand_ins([slip], data, fit(data), left_m, off)
    assert told.kind == kind


def test_a_step_near_an_end_of_a_log_is_a_cause(tmp_path: Path) -> None:
    """60 ms of a clock in eight of a hundred seconds stands out by far, wherever they lie.

    Of four intervals of 95 % fewer than three hold in 1.4 % of choices of seeds.
    """
    held = 0
    for at_s, seed in product((8.0, 92.0), (9, 10)):
        step = hidden("timestamp_step", "position", step_s=0.06, time_s=at_s)
        log = make_log(scenario("multirotor_lines", seed, 100.0, 5.0), (step,))
        spec = tmp_path / "spec.yaml"
        spec.write_text(log.spec_yaml(), encoding="utf-8")
        found = diagnose(spec, [log.to_csv(tmp_path / "log.csv")])
        named = [one for one in found.findings if one.kind == "cause" and one.material]
        assert found.verdict == "explained"
        (one,) = named  # the step, or what is the same, a delay from then on
        size, since = (
            ("step_s", one.parameters["time_s"].value)
            if one.effect == "timestamp_step"
            else ("latency_s", one.from_s)
        )
        low, high = one.parameters[size].interval95 or (0.0, 0.0)
        assert (one.effect, one.sensor) in {("timestamp_step", "position"), ("latency", "position")}
        held += low <= 0.06 <= high
        assert abs(float(since or 0.0) - at_s) < 1.0
    assert held >= 3
