"""Catalog entries: what they take, what they refuse, what they mean."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from syncline_design.spec.case import usable_primitives
from syncline_design.spec.catalog import Catalog, ClockEntry, SensorEntry, TimestampingEntry
from syncline_design.spec.load import load_builtin
from syncline_design.spec.timestamp_errors import (
    ConstantError,
    EmpiricalError,
    NormalError,
    UniformError,
    read_error,
)
from syncline_design.spec.validation import validate
from syncline_design.spec.yaml_text import parse

SENSOR = "modality: attitude, sigma_attitude: 0.1 deg, primitives: [pps, tov]"
METHOD = "primitives: [pps], error: {distribution: constant, value: 0 s}"


def entry(model: type[Any], text: str) -> Any:
    document = parse("{" + text + "}", "f.yaml")
    value, problems = validate(model, document)
    assert not problems, problems
    return value


def complaints(model: type[Any], text: str) -> list[str]:
    document = parse("{" + text + "}", "f.yaml")
    value, problems = validate(model, document)
    assert value is None
    return [str(problem) for problem in problems]


def test_sensor_figures_are_si_and_remember_their_text() -> None:
    sensor = entry(SensorEntry, SENSOR + ", cost: 400.10 EUR, mass: 90 g, power: 600 mW")
    assert sensor.sigma_attitude == pytest.approx(0.0017453292519943296, rel=1e-15)
    assert (sensor.mass, sensor.power) == (0.09, 0.6)
    assert sensor.cost.text == "400.10 EUR"
    assert sensor.cost.exact * 10 == 4001


def test_one_sigma_or_one_per_axis() -> None:
    axes = entry(SensorEntry, SENSOR.replace("0.1 deg", "[0.1 deg, 0.1 deg, 0.2 deg]"))
    assert len(axes.sigma_attitude) == 3
    assert axes.sigma_attitude[2] == 2 * axes.sigma_attitude[0]
    for count in (0, 1, 2, 4):
        figures = ", ".join(["0.1 deg"] * count)
        (line,) = complaints(SensorEntry, SENSOR.replace("0.1 deg", f"[{figures}]"))
        assert "roll, pitch, yaw" in line


def test_tolerance_is_kept_on_sigmas_only() -> None:
    sensor = entry(SensorEntry, SENSOR.replace("0.1 deg", "0.1 deg +/- 20 %"))
    assert sensor.sigma_attitude.high / sensor.sigma_attitude == pytest.approx(1.2, rel=1e-15)
    (line,) = complaints(SensorEntry, SENSOR + ", cost: 400 EUR +/- 20 %")
    assert "tolerance" in line


@pytest.mark.parametrize("modality", ["position", "attitude", "ranging"])
def test_each_modality_needs_its_sigmas_and_no_other(modality: str) -> None:
    own = {
        "position": ("sigma_position: 1 cm",),
        "attitude": ("sigma_attitude: 1 deg",),
        "ranging": ("sigma_range: 1 cm", "sigma_bearing: 1 deg"),
    }
    base = f"modality: {modality}, primitives: []"
    entry(SensorEntry, ", ".join((base, *own[modality])))
    lines = complaints(SensorEntry, base)
    assert len(lines) == len(own[modality])
    for other in set(own) - {modality}:
        text = ", ".join((base, *own[modality], *own[other]))
        assert len(complaints(SensorEntry, text)) == len(own[other])


def test_arrival_is_a_primitive_of_every_sensor() -> None:
    assert entry(SensorEntry, SENSOR).serves == ("pps", "tov", "arrival")
    bare = entry(SensorEntry, SENSOR.replace("[pps, tov]", "[]"))
    assert bare.serves == ("arrival",)
    named = entry(SensorEntry, SENSOR.replace("[pps, tov]", "[arrival, pps]"))
    assert named.serves == ("arrival", "pps")


@pytest.mark.parametrize(
    ("primitives", "served", "pinned", "usable"),
    [
        ("[pps, tov]", "[pps, tov, trigger]", None, ("pps", "tov")),
        ("[pps]", "[network]", None, ()),
        ("[]", "[pps]", None, ()),
        ("[pps]", "[arrival]", None, ("arrival",)),
        ("[pps]", "[arrival]", "pps", ("pps",)),
        ("[pps]", "[arrival]", "tov", ()),
        ("[pps, tov]", "[pps, tov]", "tov", ("tov",)),
        ("[network]", "[network]", "network", ("network",)),
        ("[pps]", "[network]", "pps", ()),
    ],
)
def test_primitives_that_a_method_can_use(
    primitives: str, served: str, pinned: Any, usable: tuple[str, ...]
) -> None:
    sensor = entry(SensorEntry, SENSOR.replace("[pps, tov]", primitives))
    method = entry(TimestampingEntry, METHOD.replace("[pps]", served))
    assert usable_primitives(sensor, method, pinned) == usable


def test_timestamp_errors_by_distribution() -> None:
    for text, model in (
        ("distribution: uniform, low: -10 ns, high: 10 ns", UniformError),
        ("distribution: normal, mean: -7 us, std: 2 us, calibrated: 2 ms", NormalError),
        ("distribution: constant, value: -16 ms", ConstantError),
        ("distribution: empirical, values: [1 ms, 2 ms]", EmpiricalError),
    ):
        error = read_error(parse("{" + text + "}").data)
        assert type(error) is model
    assert error.values == (0.001, 0.002)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        ("{distribution: uniform, low: 0 s}", "error.high: missing key"),
        ("{distribution: unifrom, low: 0 s, high: 1 s}", "did you mean uniform?"),
        ("{low: 0 s, high: 1 s}", "missing key distribution"),
        ("{distribution: uniform, low: 0 s, high: 1 s, std: 1 s}", "unknown key"),
        ("{distribution: normal, mean: 0 s, std: 5 mm}", "wrong dimension"),
        ("{distribution: empirical}", "values, or a file"),
        ("{distribution: empirical, values: []}", "an empty list"),
        ("{distribution: 3}", "unknown distribution"),
        ("10 ms", "not a timestamp error"),
    ],
)
def test_a_wrong_timestamp_error_gets_one_message(error: str, words: str) -> None:
    text = f"primitives: [pps], error: {error}"
    lines = complaints(TimestampingEntry, text)
    assert len(lines) == 1
    assert words in lines[0]


def test_a_clock_has_drift_and_holdover_or_neither() -> None:
    offset = "offset: {distribution: constant, value: 0 s}"
    clock = entry(ClockEntry, f"{offset}, drift: 20 ppm, holdover: 4 h")
    assert clock.drift * clock.holdover == pytest.approx(0.288, rel=1e-15)
    assert "holdover" in complaints(ClockEntry, f"{offset}, drift: 20 ppm")[0]
    assert "drift" in complaints(ClockEntry, f"{offset}, holdover: 4 h")[0]
    both = complaints(ClockEntry, f"{offset}, drift: 20 ppm, holdover: 4 h, offset_after: 1 h")
    assert "offset_after" in both[0]


def test_a_clock_says_for_how_long_without_a_reference_its_figures_are() -> None:
    offset = "offset: {distribution: constant, value: 0 s}"
    assert entry(ClockEntry, offset).alone_s is None
    assert entry(ClockEntry, f"{offset}, drift: 20 ppm, holdover: 4 h").alone_s == 14400.0
    assert entry(ClockEntry, f"{offset}, offset_after: 24 h").alone_s == 86400.0


def test_basis_marks_all_or_single_figures() -> None:
    assert entry(SensorEntry, SENSOR + ", basis: assumption").basis_of("cost") == "assumption"
    part = entry(SensorEntry, SENSOR + ", basis: {cost: assumption}")
    assert part.basis_of("cost") == "assumption"
    assert part.basis_of("mass") != "assumption"
    assert entry(SensorEntry, SENSOR).basis_of("cost") != "assumption"
    assert (
        "did you mean cost?" in complaints(SensorEntry, SENSOR + ", basis: {costs: assumption}")[0]
    )
    assert complaints(SensorEntry, SENSOR + ", basis: guess")


def test_all_errors_of_an_entry_come_together() -> None:
    lines = complaints(
        SensorEntry,
        "modality: attitude, sigma_atitude: 1 deg, primitives: [pps, ppps], cost: -1 EUR,"
        " mass: 3 m",
    )
    assert len(lines) == 4
    for words in ("did you mean sigma_attitude?", "did you mean pps?", "0 or more", "length"):
        assert any(words in line for line in lines)


def test_entries_are_frozen() -> None:
    sensor = entry(SensorEntry, SENSOR)
    with pytest.raises(ValidationError):
        sensor.cost = None


def test_channels_are_whole_and_positive() -> None:
    for count in ("0", "-1", "1.5", "true", '"1"'):
        assert complaints(TimestampingEntry, f"{METHOD}, requires: {{board: {count}}}")


def test_builtin_catalogs_load_as_one() -> None:
    catalog = load_builtin()
    assert isinstance(catalog, Catalog)
    for section in (catalog.platforms, catalog.sensors, catalog.timestamping, catalog.clocks):
        assert section
    for identity in ("uav_fixed_wing", "small_sv"):
        assert identity in catalog.platforms
