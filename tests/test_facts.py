"""Facts of catalog entries: what is taken, what is refused, and where the message points."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from syncline_design.spec.catalog import CatalogFile, SensorEntry
from syncline_design.spec.load import BadInput, load_text
from syncline_design.spec.validation import validate
from syncline_design.spec.yaml_text import parse

ROOT = Path(__file__).resolve().parent.parent
LIDAR = """\
sensors:
  my_lidar:
    modality: ranging
    type: lidar
    sigma_range: 2 cm
    sigma_bearing: 0.1 deg
    primitives: [pps]
"""
FIGURE = "{figure: 2 cm, kind: 1 sigma, source: Data sheet, read: 2026-11-22}"


def lidar(extra: str) -> SensorEntry:
    document = parse(f"{LIDAR}    {extra}\n", "mine.yaml")
    model, problems = validate(CatalogFile, document)
    assert not problems, problems
    assert model is not None
    return model.sensors["my_lidar"]


def complaints(extra: str) -> list[str]:
    _, problems = validate(CatalogFile, parse(f"{LIDAR}    {extra}\n", "mine.yaml"))
    return [str(problem) for problem in problems]


def test_facts_are_si_and_remember_their_text() -> None:
    one = lidar(
        "reach: {min: 0.1 m, max: 70 m, at: 80 % reflectivity}\n"
        "    medium: air\n"
        "    field_of_view: {azimuth: -180 deg .. 180 deg, elevation: -7 deg .. 52 deg}\n"
        "    rate: 10 Hz\n"
        "    corrects: [travel_time]\n"
        "    depth_rating: 300 m\n"
        "    temperature: -20 degC .. 55 degC\n"
        "    lead_time: 84 d\n"
        "    price_class: 600 EUR .. 900 EUR\n"
        "    lifecycle: {status: discontinued, read: 2026-11-22, successor: newer}"
    )
    assert one.reach is not None
    assert one.reach.min == 0.1
    assert one.reach.farthest() == 70.0
    assert one.field_of_view is not None
    assert one.field_of_view.elevation is not None
    assert one.field_of_view.elevation.high == pytest.approx(math.radians(52))
    assert one.temperature is not None
    assert (one.temperature.low, one.temperature.high) == (-20.0, 55.0)
    assert one.rate == 10.0
    assert one.lead_time == 84 * 86400
    assert one.price_class is not None
    assert (one.price_class.low, one.price_class.high) == (600.0, 900.0)
    assert one.lifecycle is not None
    assert one.lifecycle.successor == "newer"


def test_a_table_of_reach_counts_with_its_smallest_row_unless_the_target_is_known() -> None:
    reach = lidar("reach: {max: {10 %: 40 m, 80 %: 70 m, 50 %: 60 m}}").reach
    assert reach is not None
    assert reach.farthest() == 40.0
    assert [reach.farthest(share) for share in (0.1, 0.49, 0.5, 0.8, 1.0)] == [40, 40, 60, 70, 70]
    assert reach.farthest(0.05) is None  # darker than any row: nobody says
    echo = lidar("reach: {max: {-30 dB: 90 m, -10 dB: 200 m}}").reach
    assert echo is not None
    assert echo.farthest() == 90.0
    assert echo.farthest(0.8) is None


@pytest.mark.parametrize(
    ("column", "extra", "words"),
    [
        (18, "reach: {min: 80 m, max: 70 m}", "min above max"),
        (18, "reach: {min: 50 m, max: {10 %: 40 m, 80 %: 70 m}}", "found min 50 m, max 40 m"),
        (37, "reach: {max: {10 %: 80 m, 80 %: 70 m}}", "a brighter target is seen less far"),
        (12, "reach: {at: here}", "missing; expected min, max or both"),
        (18, "reach: {max: 70 deg}", "wrong dimension"),
        (18, "reach: {max: -70 m}", "out of range"),
        (25, "reach: {max: {dark: 4 m}}", "not a target"),
        (18, "reach: {max: {}}", "empty table"),
        (12, "reach: 70 m", "not a mapping"),
        (13, "medium: vacuum", "expected air or water or both"),
        (13, "medium: watr", "did you mean water?"),
        (30, "field_of_view: {azimuth: 90 deg}", "not an interval"),
        (30, "field_of_view: {azimuth: 90 deg .. -90 deg}", "ends swapped"),
        (30, "field_of_view: {azimuth: -200 deg .. 200 deg}", "wider than a turn"),
        (11, "rate: 0 Hz", "more than 0"),
        (11, "rate: 100 ms", "wrong dimension"),
        (16, "corrects: [drift]", "travel_time"),
        (18, "temperature: -20 C .. 55 C", "did you mean degC?"),
        (18, "temperature: 20 degC", "not an interval"),
        (25, "lifecycle: {status: gone, read: 2026-11-22}", "active or discontinued"),
        (39, "lifecycle: {status: active, read: yesterday}", "not a date"),
        (16, "lifecycle: {status: active}", "missing key"),
        (18, "price_class: 600 EUR", "not an interval"),
        (27, f"figures: {{sigma_rage: {FIGURE}}}", "did you mean sigma_range?"),
        (34, f"figures: {{sigma_bearing.yaw: {FIGURE}}}", "no such part"),
        (49, "figures: {sigma_range: {figure: 2 cm, kind: guess, source: A, read: 2026-11-22}}",
         "no such kind of figure"),
        (28, "figures: {sigma_range: {figure: 2 cm, kind: rms, read: 2026-11-22}}",
         "source: missing key"),
        (30, "basis: {sigma_range.far: assumption}", "no such figure"),
    ],
)  # fmt: skip
def test_a_wrong_fact_is_refused_where_it_stands(column: int, extra: str, words: str) -> None:
    lines = complaints(extra)
    assert len(lines) == 1, lines
    assert lines[0].startswith(f"mine.yaml:8:{column}:"), lines
    assert words in lines[0]


def test_a_spec_that_draws_the_fault_in_is_refused_too(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(f"{LIDAR}    reach: {{min: 80 m, max: 70 m}}\n", "utf-8")
    spec = (ROOT / "specs" / "usv_mapping.yaml").read_text("utf-8") + "catalogs: [mine.yaml]\n"
    with pytest.raises(BadInput, match=r"mine\.yaml:8:18: .*min above max"):
        load_text(spec, tmp_path / "spec.yaml")


def test_figures_may_be_given_by_part() -> None:
    named = ["sigma_range", "sigma_bearing.azimuth", "reach.min", "reach.max"]
    one = lidar(f"figures: {{{', '.join(f'{key}: {FIGURE}' for key in named)}}}")
    assert list(one.figures) == named
    (line,) = complaints(f"figures: {{reach.far: {FIGURE}}}")
    assert "figures.reach.far: no such figure" in line


def test_a_basis_is_that_of_the_part_or_else_of_the_whole() -> None:
    one = lidar("basis: {sigma_bearing: transcript, sigma_bearing.azimuth: assumption}")
    assert one.basis_of("sigma_bearing.azimuth") == "assumption"
    assert one.basis_of("sigma_bearing.elevation") == "transcript"
    assert one.basis_of("cost") is None
