"""A store tells that a spec describes another system by place, with figures in units."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from math import radians

import pytest

from syncline_design.diagnosis.same_system import description, differences
from syncline_design.model.known import EffectEntry
from syncline_design.model.system import Look, Platform, Sensor, Stage, System
from syncline_design.model.timing import Normal, TimingError, Uniform

STILL = TimingError(Uniform(0.0, 1e-8))
GNSS = Sensor("g", "position", (0.012, 0.012, 0.02), STILL, lever_arm_m=(0.1, 0.0, -1.2))
GYRO = Sensor("a", "attitude", tuple(map(radians, (0.03, 0.03, 0.1))), STILL)  # type: ignore[arg-type]
LIDAR = Sensor("l", "ranging", (0.02, radians(0.1), radians(0.1)), STILL, rate_hz=10.0)
BUILT = System((Stage("s", "v", Platform(9.0, radians(20.0), 100.0), GNSS, GYRO, LIDAR),))
SLOW = EffectEntry("latency", "attitude", "s", (("latency_s", 0.02),))


def told(other: System, kept: System = BUILT) -> list[str]:
    both = (json.loads(json.dumps(description(one))) for one in (kept, other))
    return [one.words("the store") for one in differences(*both)]


def with_stage(**changes: object) -> System:
    return replace(BUILT, stages=(replace(BUILT.stages[0], **changes),))  # type: ignore[arg-type]


def timed(error: TimingError) -> System:
    return with_stage(position=replace(GNSS, timing=error))


@pytest.mark.parametrize(
    ("other", "line"),
    [
        (with_stage(attitude=replace(GYRO, sigma=(radians(0.04), *GYRO.sigma[1:]))),
         "stage 1, the attitude sensor, its sigma, roll: 0.03 deg in the store, 0.04 deg in the"),
        (with_stage(position=replace(GNSS, sigma=(0.012, 0.012, 0.025))),
         "stage 1, the position sensor, its sigma, down: 20 mm in the store, 25 mm in the spec"),
        (with_stage(ranging=replace(LIDAR, sigma=(0.03, *LIDAR.sigma[1:]))),
         "stage 1, the ranging sensor, its sigma, range: 20 mm in the store, 30 mm in the spec"),
        (with_stage(platform=Platform(8.0, radians(20.0), 100.0)),
         "stage 1, the platform, v_max: 9 m/s in the store, 8 m/s in the spec"),
        (with_stage(platform=Platform(9.0, radians(25.0), 100.0)),
         "omega_max: 20 deg/s in the store, 25 deg/s in the spec"),
        (timed(TimingError(Uniform(0.0, 1.5e-8))),
         "the position sensor, its timing error, at most: 10 ns in the store, 15 ns in the spec"),
        (with_stage(position=replace(GNSS, lever_arm_m=(0.1, 0.0, -1.3))),
         "the position sensor, lever arm, down: -1.2 m in the store, -1.3 m in the spec"),
        (with_stage(ranging=replace(LIDAR, rate_hz=20.0)),
         "the ranging sensor, its rate: 10 Hz in the store, 20 Hz in the spec"),
        (with_stage(platform=Platform(9.0, radians(20.0), 100.0, acceleration_mps2=2.5)),
         "the platform, acceleration: 0 m/s^2 in the store, 2.5 m/s^2 in the spec"),
        (with_stage(look=Look((0.0, radians(10.0)))), "stage 1, where it looks: nothing in the"),
        (replace(BUILT, effects=(SLOW,)), "the listed effects: () in the store, (effect latency"),
    ],
)  # fmt: skip
def test_a_difference_is_told_with_place_and_units(other: System, line: str) -> None:
    (found,) = told(other)
    assert line in found


def test_a_parameter_of_an_effect_is_called_by_its_name() -> None:
    slower = replace(SLOW, parameters=(("latency_s", 0.025),))
    (found,) = told(replace(BUILT, effects=(slower,)), replace(BUILT, effects=(SLOW,)))
    assert found == "the listed effects, number 1, latency: 20 ms in the store, 25 ms in the spec"


def test_figures_that_round_alike_are_told_apart() -> None:
    (found,) = told(with_stage(position=replace(GNSS, sigma=(0.01200001, 0.012, 0.02))))
    assert found.endswith("north: 12 mm in the store, 12.00001 mm in the spec")


def test_another_kind_of_distribution_leaves_no_key_and_no_bare_figure() -> None:
    found = told(timed(TimingError(Normal(0.0, 5e-9))))
    assert any("kind: Uniform in the store, Normal in the spec" in one for one in found)
    assert any("standard deviation: nothing in the store, 5 ns in the spec" in one for one in found)
    assert not [one for one in found if re.search(r"_(s|m|rad)\b|\de-\d", one)]


def test_what_a_system_is_called_makes_no_difference() -> None:
    renamed = with_stage(name="t", vehicle="w", position=replace(GNSS, id="h"))
    assert told(renamed) == []
