"""Delays of devices that put one stamp on poses and their slopes; whose stamps slopes carry."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from syncline_design.diagnosis.scene import Scene, acting, scene
from syncline_design.diagnosis.shared_stamps import (
    rates_apart,
    velocities_apart,
    with_shared_stamps,
)
from syncline_design.diagnosis.system import measured
from syncline_design.effects.record import Array
from syncline_design.spec.load import load
from tests.test_diagnose_world import Document, ask
from tests.world import SILENT, WorldLog, hidden, make_log, scenario

Sensor = Literal["position", "attitude", "ranging"]
LATE_S = 0.06


def seen(log: WorldLog, folder: Path) -> Scene:
    """The log beside its spec, with what it says of its stamps."""
    (folder / "spec.yaml").write_text(log.spec_yaml(), "utf-8")
    inputs = measured(load(folder / "spec.yaml"), [log.to_csv(folder / "log.csv")])
    view = scene(inputs.system, inputs.log, inputs.known)
    return scene(inputs.system, with_shared_stamps(inputs.log, view), inputs.known)


@pytest.mark.parametrize("platform", ["multirotor_lines", "car_stops", "vessel_figure_eights"])
@pytest.mark.parametrize("shared", [True, False])
def test_a_log_tells_whose_stamps_its_slopes_carry(
    platform: str, shared: bool, tmp_path: Path
) -> None:
    """Of delays of 60 and 45 ms; 12 comparisons within 5 s: missed once in 140 000."""
    late = (hidden("latency", "position", latency_s=LATE_S),
            hidden("latency", "attitude", latency_s=0.045))  # fmt: skip
    run = scenario(platform, 5, 120.0, 10.0)
    view = seen(make_log(run, late, shared_stamps=shared), tmp_path)
    own = view.log.stages[0]
    assert (own.velocity_of_position, own.rate_of_attitude) == (shared, shared)
    pairs = ((velocities_apart(view, 0), LATE_S), (rates_apart(view, 0), 0.045))
    for found, size in pairs:
        assert found is not None
        true = 0.0 if shared else -size
        assert abs(found.later_s - true) < 5.0 * found.uncertainty_s + 1e-4
        assert found.uncertainty_s < 5e-3


@pytest.mark.parametrize("sensor", ["position", "attitude", "ranging"])
@pytest.mark.parametrize("shared", [True, False])
def test_a_delay_of_one_device_is_undone_to_the_second_order(
    sensor: Sensor, shared: bool, tmp_path: Path
) -> None:
    """Of a log without noise nothing is left; slopes of another clock leave a t^2, a: what turns or
    speeds up, in one log of a bank and a turn some millimetres.
    """
    quiet = replace(SILENT, velocity_mps=0.0, rate_radps=0.0)
    run = scenario("multirotor_lines", 5, 120.0, 20.0)
    hidden_one = hidden("latency", sensor, latency_s=LATE_S)
    view = seen(make_log(run, (hidden_one,), quiet, shared_stamps=shared), tmp_path)
    one = acting("latency", sensor, 0, {"latency_s": LATE_S})
    left, whole = (_rms(view.error(each)) for each in ((one,), ()))
    assert whole > 0.1
    assert left < 1.5e-3
    stages = tuple(
        replace(each, velocity_of_position=not shared, rate_of_attitude=not shared)
        for each in view.log.stages
    )
    wrong = scene(view.system, replace(view.log, stages=stages))
    if sensor != "ranging":
        assert _rms(wrong.error((one,))) > 4.0 * left


def of_its_antenna(log: WorldLog, late_s: float) -> WorldLog:
    """The same with the slope of the antenna's true path, by central differences, as velocities."""
    path, arm_m = log.run.carriers[0].path, log.run.carriers[0].sensors.antenna_arm_m

    def place(time_s: Array) -> Array:
        return path.position(time_s) + path.rotation(time_s).apply(arm_m)

    time_s, half_s = log.columns["time_s"] - late_s, 1e-3
    slope = (place(time_s + half_s) - place(time_s - half_s)) / (2.0 * half_s)
    names = [f"velocity_{axis}_mps" for axis in ("north", "east", "down")]
    return replace(log, columns=log.columns | dict(zip(names, slope.T, strict=True)))


@pytest.mark.parametrize("platform", ["multirotor_lines", "vessel_figure_eights"])
@pytest.mark.parametrize("seed", range(3))
def test_velocities_of_the_antenna_are_told_from_those_of_the_vehicle(
    platform: str, seed: int, tmp_path: Path
) -> None:
    """Of a receiver 60 ms late, places and velocities alike: nothing is of another clock."""
    run = scenario(platform, 20 + seed, 120.0, 5.0)
    late = (hidden("latency", "position", latency_s=LATE_S),)
    whole = make_log(run, late, shared_stamps=True)
    for log, antenna in ((whole, False), (of_its_antenna(whole, LATE_S), True)):
        view = seen(log, tmp_path)
        said = [note for note in view.log.notes if "its antenna's" in note]
        assert len(said) == antenna
        assert not [note for note in view.log.notes if "another clock" in note]
        assert view.log.stages[0].velocity_of_position
        truth = run.carriers[0].path.velocity(log.columns["time_s"] - LATE_S)
        assert _rms(view.log.stages[0].velocity_mps - truth) < 0.05


@pytest.mark.parametrize("platform", ["car_stops", "vessel_figure_eights"])
@pytest.mark.parametrize("seed", range(3))
def test_so_are_they_in_a_log_of_positions(platform: str, seed: int, tmp_path: Path) -> None:
    """Of places 60 ms late beside a better system; an arm that is not there at all is no sweep."""
    run = scenario(platform, 20 + seed, 120.0, 5.0, "position")
    arm_m = run.carriers[0].sensors.antenna_arm_m
    none = dict(zip(("x_m", "y_m", "z_m"), (-one for one in arm_m), strict=True))
    late = hidden("latency", "position", latency_s=LATE_S)
    whole, bare = make_log(run, (late,)), make_log(run, (hidden("lever_arm", "position", **none),))
    truth = run.carriers[0].path.velocity(whole.columns["time_s"])
    for log, antenna in ((whole, False), (bare, False), (of_its_antenna(whole, 0.0), True)):
        view = seen(log, tmp_path)
        assert len([note for note in view.log.notes if "its antenna's" in note]) == antenna
        assert _rms(view.log.stages[0].velocity_mps - truth) < 0.05


def test_a_delay_of_places_beside_velocities_of_the_antenna_is_the_true_one(tmp_path: Path) -> None:
    """On a vessel, whose antenna swings as fast as the vessel goes."""
    run = scenario("vessel_figure_eights", 21, 120.0, 5.0, "position")
    late = hidden("latency", "position", latency_s=LATE_S)
    found: Document = ask(of_its_antenna(make_log(run, (late,)), 0.0), tmp_path)
    (finding,) = (one for one in found["findings"] if one["material"])
    assert (finding["effect"], finding["sensor"]) == ("latency", "position")
    value = finding["parameters"]["latency_s"]
    assert abs(value["value"] - LATE_S) < 4.0 * value["standard_uncertainty"]


@pytest.mark.parametrize("forward_m", [0.4, -0.4])
def test_an_arm_that_is_off_is_no_lag_of_the_velocities(forward_m: float, tmp_path: Path) -> None:
    """In a turn the antenna ahead of where it is taken to be passes every place earlier."""
    run = scenario("multirotor_lines", 5, 120.0, 5.0)
    off = (hidden("lever_arm", "position", x_m=forward_m, y_m=0.0, z_m=0.0),)
    view = seen(make_log(run, off, shared_stamps=True), tmp_path)
    assert not [note for note in view.log.notes if "another clock" in note]
    assert view.log.stages[0].velocity_of_position


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


@pytest.mark.parametrize("sensor", ["position", "attitude", "ranging"])
def test_a_device_that_is_late_is_named_alone(sensor: Sensor, tmp_path: Path) -> None:
    """An INS whose one stamp is late, a receiver's: no other sensor is blamed for a t^2."""
    run = scenario("multirotor_lines", 11, 120.0, 5.0)
    late = hidden("latency", sensor, latency_s=0.04)
    found: Document = ask(make_log(run, (late,), shared_stamps=True), tmp_path)
    assert found["verdict"] == "explained"
    (finding,) = (one for one in found["findings"] if one["material"])
    assert (finding["effect"], finding["sensor"]) == ("latency", sensor)
    value = finding["parameters"]["latency_s"]
    assert abs(value["value"] - 0.04) < 5.0 * value["standard_uncertainty"]
