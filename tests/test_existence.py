"""Rules of what can exist: figures of both sides in the reason, angles against sampled ones."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest

from syncline_design.model.quantity import Dimension, parse_quantity
from syncline_design.spec.catalog import SensorEntry
from syncline_design.spec.existence import Surroundings, lies_within, not_told, ruled_out
from syncline_design.spec.facts import FieldOfView
from syncline_design.spec.load import load_builtin

LIDAR: dict[str, Any] = {
    "modality": "ranging",
    "type": "lidar",
    "sigma_range": "2 cm",
    "sigma_bearing": "0.1 deg",
    "primitives": (),
}


def lidar(**facts: Any) -> SensorEntry:
    return SensorEntry.model_validate({**LIDAR, **facts})


def metres(text: str) -> float:
    return parse_quantity(text, Dimension.LENGTH)


def around(near: str = "120 m", far: str = "", **more: Any) -> Surroundings:
    return Surroundings("uav", metres(near), metres(far or near), **more)


def codes(sensor: SensorEntry, place: Surroundings, allow: bool = False) -> list[str]:
    return [one.code for one in ruled_out("it", sensor, place, allow)]


def test_a_reason_says_both_figures() -> None:
    (one,) = ruled_out("livox_mid360", lidar(reach={"max": "70 m"}), around("120 m"))
    assert one.reason == "livox_mid360: reaches 70 m, uav.distance is 120 m"
    assert (one.code, one.figure, one.limit) == ("reach", "reach: 70 m", "distance: 120 m")


@pytest.mark.parametrize(
    ("near", "far", "reach", "ok"),
    [
        ("70 m", "70 m", {"max": "70 m"}, True),
        ("70.001 m", "70.001 m", {"max": "70 m"}, False),
        ("0.5 m", "0.5 m", {"min": "0.5 m", "max": "70 m"}, True),
        ("0.49 m", "0.49 m", {"min": "0.5 m", "max": "70 m"}, False),
        ("20 m", "120 m", {"min": "1 m", "max": "120 m"}, True),
        ("20 m", "120 m", {"min": "30 m", "max": "200 m"}, False),
        ("20 m", "120 m", {"min": "1 m", "max": "100 m"}, False),
        ("20 m", "120 m", {"min": "30 m"}, False),
    ],
)
def test_reach_contains_the_whole_distance(
    near: str, far: str, reach: dict[str, str], ok: bool
) -> None:
    assert codes(lidar(reach=reach), around(near, far)) == ([] if ok else ["reach"])


def test_a_table_of_reach_counts_with_its_smallest_row_unless_the_target_is_told() -> None:
    sensor = lidar(reach={"max": {"10 %": "40 m", "80 %": "70 m"}})
    assert codes(sensor, around("60 m")) == ["reach"]
    assert codes(sensor, around("60 m", reflectivity=0.8)) == []
    assert codes(sensor, around("60 m", reflectivity=0.5)) == ["reach"]
    dark = around("30 m", reflectivity=0.05)
    assert codes(sensor, dark) == []
    assert [one.key for one in not_told("it", sensor, dark)] == ["reach"]
    beyond = around("40.1 m", reflectivity=0.05)  # it reaches less far than at 10 %
    assert codes(sensor, beyond) == ["reach"]
    assert not list(not_told("it", sensor, beyond))  # so that there is nothing to look up


def test_a_reach_that_names_its_target_is_that_of_brighter_ones_at_most() -> None:
    sensor = lidar(reach={"max": "70 m", "at": "80 % reflectivity"})
    assert codes(sensor, around("60 m")) == []
    dark = around("60 m", reflectivity=0.1)
    assert codes(sensor, dark) == []
    assert [one.key for one in not_told("it", sensor, dark)] == ["reach"]
    assert codes(sensor, around("71 m", reflectivity=0.1)) == ["reach"]
    assert not list(not_told("it", sensor, around("60 m", reflectivity=0.9)))


@pytest.mark.parametrize("mine", ["air", "water", "both", None])
@pytest.mark.parametrize("asked", ["air", "water", "both", None])
def test_medium_has_to_match(mine: Any, asked: Any) -> None:
    sensor = lidar(medium=mine) if mine else lidar()
    wrong = {mine, asked} == {"air", "water"}
    assert codes(sensor, around(medium=asked)) == (["medium"] if wrong else [])


def test_look_lies_in_the_field_of_view_as_samples_do() -> None:
    """4000 pairs: an interval is inside where every one of 37 samples of it is, modulo a turn."""
    draw = random.Random(15)
    seen = {True: 0, False: 0}
    for _ in range(4000):
        low, width = draw.randrange(-360, 361), draw.randrange(0, 361)
        start, span = draw.randrange(-360, 361), draw.choice((0, 5, 40, 90, 200, 360))
        goes_round = draw.random() < 0.5
        outer = parse_quantity(f"{low} deg .. {low + width} deg", Dimension.ANGLE)
        inner = parse_quantity(f"{start} deg .. {start + span} deg", Dimension.ANGLE)
        shifts = range(-3, 4) if goes_round else (0,)
        samples = [start + span * i / 36 for i in range(37)]
        inside = any(
            all(low <= one + 360 * k <= low + width for one in samples) for k in shifts
        ) or (goes_round and width == 360)
        assert lies_within(inner, outer, goes_round) is inside, (low, width, start, span)
        seen[inside] += 1
    assert min(seen.values()) > 300


def test_look_is_asked_axis_by_axis() -> None:
    view = FieldOfView.model_validate({"azimuth": "-60 deg .. 60 deg"})
    sensor = lidar(field_of_view={"azimuth": "-60 deg .. 60 deg"})
    down = FieldOfView.model_validate(
        {"azimuth": "-10 deg .. 10 deg", "elevation": "-90 deg .. -60 deg"}
    )
    behind = FieldOfView.model_validate({"azimuth": "170 deg .. 190 deg"})
    assert codes(sensor, around(look=view)) == []
    assert codes(sensor, around(look=behind)) == ["field_of_view"]
    assert codes(sensor, around(look=down)) == []
    untold = [one.key for one in not_told("it", sensor, around(look=down))]
    assert untold == ["reach", "field_of_view.elevation"]


@pytest.mark.parametrize(
    ("facts", "asked", "code"),
    [
        ({"depth_rating": "300 m"}, {"depth": 300.0}, None),
        ({"depth_rating": "300 m"}, {"depth": 300.5}, "depth"),
        ({"depth_rating": "300 m"}, {"depth": 0.0}, None),
        ({"temperature": "-20 degC .. 55 degC"}, {"temperature": "-20 degC .. 55 degC"}, None),
        ({"temperature": "-20 degC .. 55 degC"}, {"temperature": "-21 degC .. 30 degC"},
         "temperature"),
        ({"temperature": "-20 degC .. 55 degC"}, {"temperature": "0 degC .. 56 degC"},
         "temperature"),
        ({"lifecycle": {"status": "active", "read": "2026-11-22"}}, {}, None),
        ({"lifecycle": {"status": "discontinued", "read": "2026-11-22"}}, {}, "discontinued"),
        ({"lifecycle": {"status": "announced", "read": "2026-11-22"}}, {}, "discontinued"),
    ],
)  # fmt: skip
def test_depth_temperature_and_lifecycle(
    facts: dict[str, Any], asked: dict[str, Any], code: str | None
) -> None:
    if "temperature" in asked:
        asked = {"temperature": parse_quantity(asked["temperature"], Dimension.TEMPERATURE)}
    sensor = lidar(**facts)
    assert codes(sensor, around("1 m", **asked)) == ([code] if code else [])
    assert codes(sensor, around("1 m", **asked), allow=True) == (
        [code] if code and code != "discontinued" else []
    )


def test_what_is_not_told_rules_nothing_out_and_is_named() -> None:
    cold = parse_quantity("0 degC .. 10 degC", Dimension.TEMPERATURE)
    place = around(medium="water", depth=40.0, temperature=cold)
    assert codes(lidar(), place) == []
    untold = list(not_told("it", lidar(), place))
    assert [one.key for one in untold] == ["medium", "reach", "depth_rating", "temperature"]
    assert untold[1].reason == "it gives no reach, uav.distance is 120 m: look this up first"
    assert list(not_told("it", lidar(medium="air", reach={"max": "1 km"}), around())) == []


def test_position_and_attitude_sensors_are_not_asked_for_reach_or_medium() -> None:
    ins = SensorEntry.model_validate(
        {"modality": "attitude", "sigma_attitude": "0.1 deg", "primitives": ()}
    )
    place = around(medium="water", depth=40.0)
    assert codes(ins, place) == []
    assert [one.key for one in not_told("it", ins, place)] == ["depth_rating"]


def test_the_sea_floor_500_m_below_is_out_of_reach_of_every_shipped_lidar() -> None:
    """The case that this is for: what is left of ranging sensors are sonars, or says too little."""
    place = Surroundings("vessel", 500.0, 500.0, medium="water")
    for identity, sensor in load_builtin().sensors.items():
        if sensor.modality != "ranging":
            continue
        out = list(ruled_out(identity, sensor, place))
        assert sensor.medium is not None, identity
        if sensor.medium == "air":
            assert "medium" in [one.code for one in out]
        else:
            assert sensor.type in ("usbl", "mbes", "single_beam", "imaging_sonar")
            far = sensor.reach.farthest() if sensor.reach else None
            assert bool(out) is (far is not None and far < 500.0), identity
            assert math.isinf(far or math.inf) is any(not_told(identity, sensor, place))
