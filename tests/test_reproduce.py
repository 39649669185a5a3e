"""`reproduce`: every cell accounted for, and nothing accounted for that is wrong."""

from __future__ import annotations

import json
import math
from fractions import Fraction

import pytest

from syncline_design.model.budget import budget
from syncline_design.model.quantity import Dimension, Quantity, parse_quantity
from syncline_design.paper.errata import ERRATA
from syncline_design.paper.plots import (
    FIGURE_2_PAYLOAD,
    SURVEY_PAYLOAD,
    PaperPlot,
    plots,
    survey_system,
)
from syncline_design.paper.printed import PRINTED
from syncline_design.paper.reproduce import (
    SCHEMA,
    PrintedCell,
    Reproduction,
    reproduce,
    tau_crit_cells,
)
from syncline_design.report.on_paper import on_paper
from syncline_design.report.render_console import console
from syncline_design.spec.catalog import Catalog
from syncline_design.spec.load import load_builtin


@pytest.fixture(scope="module")
def catalog() -> Catalog:
    return load_builtin()


@pytest.fixture(scope="module")
def result(catalog: Catalog) -> Reproduction:
    return reproduce(catalog, seed=0)


def without_simulation(catalog: Catalog) -> Reproduction:
    return reproduce(catalog, simulate=False, seed=0)


def cell_of(result: Reproduction, *key: str) -> PrintedCell:
    cells = (*result.cells, *result.inputs)
    return next(c for c in cells if (c.table, c.row, c.column) == key)


def with_platform(catalog: Catalog, name: str, **figures: Quantity) -> Catalog:
    entry = catalog.platforms[name].model_copy(update=figures)
    return catalog.model_copy(update={"platforms": {**catalog.platforms, name: entry}})


def with_sensor(catalog: Catalog, name: str, **figures: object) -> Catalog:
    entry = catalog.sensors[name].model_copy(update=figures)
    return catalog.model_copy(update={"sensors": {**catalog.sensors, name: entry}})


def test_every_cell_of_the_paper_is_accounted_for(result: Reproduction) -> None:
    assert len(tau_crit_cells(result.cells)) == 46
    assert len(result.cells) == 50  # and two system tau_crit, the survey roof, figure 1
    assert len(result.inputs) == 7 * 4 + 4 + 3 * 3 + 8 * 3
    assert result.ok


def test_only_the_documented_cells_are_errata(result: Reproduction) -> None:
    found = {(c.table, c.row, c.column) for c in result.cells if c.status == "erratum"}
    assert found == {
        ("tau_crit_georeferencing", "riegl_vux1uav", "uav_fixed_wing"),
        ("tau_crit_survey", "kongsberg_m3", "auv"),
        ("text", "survey_roof", "both_sv"),
    }
    disputed = {(c.row, c.column) for c in result.inputs if c.status == "erratum"}
    assert disputed == {("auv", "v_max"), ("auv", "distance")}
    for cell in (*result.cells, *result.inputs):
        assert bool(cell.note) or cell.status == "agrees"


@pytest.mark.parametrize(
    ("table", "row", "column", "printed"),
    [  # typed in from the paper, each kind of cell once
        ("tau_crit_georeferencing", "ublox_f9p_pvt", "car", "86 ms"),
        ("tau_crit_georeferencing", "kongsberg_mru5", "uav_multi_rotor", "9 us"),
        ("tau_crit_georeferencing", "riegl_vux1uav", "uav_fixed_wing", "157 us"),
        ("tau_crit_survey", "ublox_f9p_pvt", "large_sv", "1039.230 ms"),
        ("tau_crit_survey", "kongsberg_m3", "auv", "82.776 ms"),
        ("tau_crit_survey", "sonardyne_usbl7000", "small_sv", "3.333 ms"),
        ("text", "survey_tau_crit", "large_sv", "16 ms"),
        ("text", "survey_tau_crit", "small_sv", "4 ms"),
        ("text", "survey_roof", "both_sv", "1.67 m"),
        ("platforms", "auv", "distance", "5 m"),
        ("sensors", "kongsberg_m3", "azimuth", "0.9 deg"),
    ],
)
def test_printed_figures_are_the_papers(
    result: Reproduction, table: str, row: str, column: str, printed: str
) -> None:
    cell = cell_of(result, table, row, column)
    assert cell.printed_text == printed
    assert f"{cell.printed:g}" == f"{float(printed.split()[0]):g}"
    assert cell.unit == printed.split()[1]


def test_the_survey_tables_add_up_to_the_papers_columns() -> None:
    """Column sums typed in from the paper's rows guard the transcription as a whole."""
    columns = {"large_sv": 0.0, "small_sv": 0.0, "auv": 0.0}
    for row in PRINTED["tau_crit_survey"].values():
        for column, printed in row.items():
            columns[column] += float(printed.split()[0])
    assert columns["large_sv"] == pytest.approx(
        1039.230 + 6.928 + 52.754 + 0.746 + 18.521 + 12.368 + 137.071 + 221.857
    )
    assert columns["small_sv"] == pytest.approx(
        649.519 + 4.330 + 14.217 + 0.201 + 4.991 + 3.333 + 36.940 + 59.790
    )
    assert columns["auv"] == pytest.approx(19.335 + 0.273 + 9.713 + 6.727 + 50.385 + 82.776)


# What is wrong does not pass


def test_a_wrong_sensor_figure_fails_its_cells_and_its_input(catalog: Catalog) -> None:
    worse = parse_quantity("0.0021 deg", Dimension.ANGLE)
    wrong = without_simulation(with_sensor(catalog, "kongsberg_mru5", sigma_attitude=worse))
    assert not wrong.ok
    assert cell_of(wrong, "sensors", "kongsberg_mru5", "yaw").status == "differs"
    assert cell_of(wrong, "tau_crit_survey", "kongsberg_mru5", "large_sv").status == "differs"
    said = console(on_paper(wrong))
    assert "Some printed figures differ" in said
    assert "\u2717 differs, neither agrees nor is a documented erratum" in said


@pytest.mark.parametrize(
    ("platform", "key", "written", "dimension"),
    [
        ("usv", "v_max", "5.0000001 m/s", Dimension.SPEED),
        ("large_sv", "baseline", "51 m", Dimension.LENGTH),
        ("auv", "distance", "29.9 m", Dimension.LENGTH),
        ("auv", "v_max", "30 m/s", Dimension.SPEED),
    ],
)
def test_a_wrong_platform_figure_fails(
    catalog: Catalog, platform: str, key: str, written: str, dimension: Dimension
) -> None:
    wrong = without_simulation(
        with_platform(catalog, platform, **{key: parse_quantity(written, dimension)})
    )
    assert not wrong.ok


def test_an_erratum_excuses_only_the_documented_value(catalog: Catalog) -> None:
    slower = parse_quantity("70 deg/s", Dimension.ANGULAR_RATE)
    wrong = without_simulation(with_platform(catalog, "uav_fixed_wing", omega_max=slower))
    cell = cell_of(wrong, "tau_crit_georeferencing", "riegl_vux1uav", "uav_fixed_wing")
    assert cell.status == "differs"
    assert "documented as 158.06" in cell.note


# The reasons given for the errata are true


def test_reason_fixed_wing_rate(catalog: Catalog) -> None:
    """45 sqrt(3) deg/s gives the printed 157 us within one unit."""
    degrees = 45.0 * math.sqrt(3.0)
    rate = parse_quantity(f"{degrees:.9f} deg/s", Dimension.ANGULAR_RATE)
    unrounded = without_simulation(with_platform(catalog, "uav_fixed_wing", omega_max=rate))
    cell = cell_of(unrounded, "tau_crit_georeferencing", "riegl_vux1uav", "uav_fixed_wing")
    assert cell.status == "agrees"
    assert cell.computed == pytest.approx(157.99, abs=5e-3)


@pytest.mark.parametrize("speed", ["2.07795 m/s", "2.07797 m/s", "2.078 m/s"])
def test_reason_auv_speed_digits(catalog: Catalog, speed: str) -> None:
    """Every printed AUV cell is the rounded value of what these speeds give."""
    found = without_simulation(
        with_platform(catalog, "auv", v_max=parse_quantity(speed, Dimension.SPEED))
    )
    cells = [c for c in found.cells if c.column == "auv"]
    assert len(cells) == 6
    for cell in cells:
        assert abs(cell.computed - cell.printed) < 0.51e-3
        assert cell.status == "agrees"


@pytest.mark.parametrize("speed", ["2.0779 m/s", "2.0781 m/s"])
def test_other_auv_speeds_miss_the_last_digit(catalog: Catalog, speed: str) -> None:
    auv = with_platform(catalog, "auv", v_max=parse_quantity(speed, Dimension.SPEED))
    cells = [c for c in without_simulation(auv).cells if c.column == "auv"]
    assert any(abs(cell.computed - cell.printed) > 0.51e-3 for cell in cells)


@pytest.mark.parametrize(
    ("vessel", "printed", "as_printed_ms"), [("large_sv", 16, 10.1), ("small_sv", 4, 3.4)]
)
def test_reason_auv_row(catalog: Catalog, vessel: str, printed: int, as_printed_ms: float) -> None:
    """The printed AUV row misses the printed system tau_crit, the corrected one meets it."""
    row = survey_system(catalog, vessel, SURVEY_PAYLOAD, auv="auv_printed")
    tau_crit_ms = budget(row).tau_crit_s * 1e3
    assert tau_crit_ms == pytest.approx(as_printed_ms, abs=0.05)
    corrected_ms = budget(survey_system(catalog, vessel, SURVEY_PAYLOAD)).tau_crit_s * 1e3
    assert abs(corrected_ms - printed) < 1.0


def test_reason_survey_roof(catalog: Catalog) -> None:
    """1.67 m would give 19 and 5.4 ms, not the printed 16 and 4."""
    for vessel, printed in (("large_sv", 16), ("small_sv", 4)):
        rate = budget(survey_system(catalog, vessel, SURVEY_PAYLOAD)).sync_rate_mps
        assert abs(1.67 / rate * 1e3 - printed) > 1.0


def test_reason_lever_arm(catalog: Catalog) -> None:
    position = budget(survey_system(catalog, "large_sv", SURVEY_PAYLOAD)).sensors[0]
    assert position.tau_crit_s / position.tau_crit_lever_arm_s == pytest.approx(2.6, abs=0.05)


# Output


def test_json_has_the_agreed_keys_and_is_plain(result: Reproduction) -> None:
    data = json.loads(json.dumps(result.to_json(), allow_nan=False))
    assert data["schema"] == SCHEMA == "syncline-design/reproduction/v1"
    assert data["ok"] is True
    keys = {"table", "row", "column", "printed", "computed", "unit", "status", "note"}
    for cell in data["cells"]:
        assert keys <= set(cell)
        assert cell["status"] in ("agrees", "erratum")
    assert data["counts"]["tau_crit"] == {
        "printed": 46, "agrees": 44, "erratum": 2, "differs": 0,
    }  # fmt: skip
    assert len(data["errata"]) == len(ERRATA)
    assert [figure["number"] for figure in data["figures"]] == [1, 2, 3, 4, 5, 6, 7]
    assert [bool(figure["simulated"]) for figure in data["figures"]] == [
        False, False, True, False, False, False, True,
    ]  # fmt: skip


def test_text_says_the_counts_first_and_shows_every_cell(result: Reproduction) -> None:
    lines = console(on_paper(result)).splitlines()
    assert lines[0].endswith("\u2713 Every printed figure is accounted for")
    told = [" ".join(line.split()) for line in lines[:8]]
    assert "\u03c4_crit cells 44 of 46 agree, 2 documented errata" in told
    assert "Figures in the text 3 of 4 agree, 1 documented errata" in told
    assert "Platform and sensor figures 63 of 65 agree, 2 documented errata" in told
    rows = [line.replace("\u00b5", "u").split()[:4] for line in lines]
    for cell in result.cells:
        assert [cell.row, cell.column, *cell.printed_text.split(" ")] in rows


def test_same_bytes_twice(catalog: Catalog, result: Reproduction) -> None:
    assert json.dumps(reproduce(catalog, seed=0).to_json()) == json.dumps(result.to_json())


# Figures


@pytest.fixture(scope="module")
def plotted(catalog: Catalog) -> dict[int, PaperPlot]:
    return {figure.number: figure for figure in plots(catalog)}


def test_curves_double_at_tau_crit_and_rise(plotted: dict[int, PaperPlot]) -> None:
    for figure in plotted.values():
        grid = figure.tau_grid_s()
        assert len(grid) == 61
        for curve in figure.curves:
            (at_crit,) = curve.error_m([curve.tau_crit_s])
            assert at_crit == pytest.approx(2.0 * curve.sensor_error_m, rel=1e-12)
            errors = curve.error_m(grid)
            assert list(errors) == sorted(errors)
            assert errors[0] < 1.011 * curve.sensor_error_m  # the roof is in view
            assert errors[-1] > 100.0 * curve.sensor_error_m  # and so is the slope


def test_figure_1_is_the_car_with_its_tau_crit_by_hand(plotted: dict[int, PaperPlot]) -> None:
    """0.1 m / (30 m/s + 50 m * 0.301942 rad/s) = 0.1 m / 45.0971 m/s = 2.21744 ms."""
    (curve,) = plotted[1].curves
    assert 1.0 / curve.sensor_error_m == 10.0
    assert curve.tau_crit_s == pytest.approx(2.21744e-3, rel=3e-6)


def test_figure_5_same_roof_and_the_large_vessels_is_longer(plotted: dict[int, PaperPlot]) -> None:
    large, small = plotted[5].curves
    assert large.sensor_error_m == small.sensor_error_m
    assert large.tau_crit_s > 3.0 * small.tau_crit_s


def test_figure_6_a_better_gnss_does_little_beside_a_better_ins_or_usbl(
    plotted: dict[int, PaperPlot],
) -> None:
    base, gnss, ins, usbl = (curve.sensor_error_m for curve in plotted[6].curves)
    assert 0.0 < base - gnss < 0.01 * (base - ins)
    assert base - gnss < 0.01 * (base - usbl)


def test_figures_use_the_papers_payloads(plotted: dict[int, PaperPlot]) -> None:
    for curve in plotted[2].curves:
        assert curve.system is not None
        (stage,) = curve.system.stages
        assert tuple(sensor.id for sensor in stage.sensors()) == FIGURE_2_PAYLOAD
    system = plotted[7].curves[0].system
    assert system is not None
    assert [sensor.id for stage in system.stages for sensor in stage.sensors()] == [
        "ublox_f9p_rtk", "kongsberg_mru5", "kongsberg_hipap502", "kongsberg_mru5", "r2sonic_2026",
    ]  # fmt: skip
    assert [figure.number for figure in plotted.values() if figure.simulated] == [3, 7]


@pytest.mark.parametrize("number", [3, 7])
def test_simulated_points_stay_near_the_syncline(
    result: Reproduction, plotted: dict[int, PaperPlot], number: int
) -> None:
    """The paper finds no significant deviation.

    From above: lever arms of the baseline's length are in the simulation and not in the Syncline;
    they add at most b omega to the position's rate and, turning with the attitude, to its own
    (2 b omega per stage), and b sigma_Theta to the noise: the bound below.  From below: range noise
    is at a right angle to every bearing and attitude error, so terms cannot all line up.
    """
    (curve,) = plotted[number].curves
    system = curve.system
    assert system is not None
    moving, noise = 0.0, 0.0
    for stage in system.stages:
        assert stage.attitude is not None
        moving += 2.0 * stage.platform.baseline_m * stage.platform.omega_max_radps
        noise += stage.platform.baseline_m * math.hypot(*stage.attitude.sigma)
    points = next(f for f in result.figures if f.number == number).simulated
    assert len(points) == 13
    for point, syncline_m in zip(points, curve.error_m([p.tau_s for p in points]), strict=True):
        lever = noise + moving * point.tau_s
        assert 0.8 * syncline_m < point.worst_case_m < syncline_m + lever
        assert point.ratio_to_syncline == pytest.approx(point.worst_case_m / syncline_m)
    assert len({round(point.ratio_to_syncline, 3) for point in points}) > 5


def test_a_single_bearing_sigma_holds_for_both_axes(catalog: Catalog, result: Reproduction) -> None:
    one = parse_quantity("0.45 deg", Dimension.ANGLE)
    short = with_sensor(catalog, "r2sonic_2026", sigma_bearing=one)
    assert [c.computed for c in without_simulation(short).cells] == [
        c.computed for c in result.cells
    ]


def test_one_display_unit_is_exact() -> None:
    """The comparison is made in fractions: 577.35 us against 577 us, one unit being 1 us."""
    from syncline_design.paper.reproduce import _cell

    key = ("tau_crit_georeferencing", "ublox_f9p_rtk", "car")

    def status(printed: str, microseconds: str) -> str:
        value = parse_quantity(f"{microseconds} us", Dimension.TIME)
        assert value.exact == Fraction(microseconds) / 10**6
        return _cell(key, printed, value).status

    assert status("577 us", "577.999999999999999") == "agrees"
    assert status("577 us", "578") == "differs"
    assert status("577 us", "576.000000000000001") == "agrees"
    assert status("577.0 us", "577.1") == "differs"
