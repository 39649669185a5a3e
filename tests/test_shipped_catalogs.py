"""The built-in catalogs: the paper's figures as printed, a source or a basis at every figure."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from plain_enumeration import CATALOGS, bound_of, clock_bound, number, read_catalog
from syncline_design.model.timing import Normal, TimingError, Uniform, bound
from syncline_design.spec.catalog import CatalogFile
from syncline_design.spec.load import load_builtin
from syncline_design.spec.yaml_text import read

FILES = ("platforms", "sensors", "timestamping")
SECTIONS = ("platforms", "sensors", "timestamping", "infrastructure", "clocks")
MONEY_MASS_POWER = ("cost", "mass", "power")

# Table "Robot platform parameters" of the paper as printed: v_max m/s, omega_max deg/s, d m, b m.
PRINTED_PLATFORMS = {
    "uav_fixed_wing": ("21", "77.9", "100", "1"),
    "uav_multi_rotor": ("5", "311.8", "5", "0.5"),
    "usv": ("5", "17", "30", "5"),
    "auv_printed": ("30", "8.7", "5", "5"),
    "car": ("30", "17.3", "50", "3"),
    "large_sv": ("2.5", "4.5", "1000", "50"),
    "small_sv": ("4", "17", "1000", "10"),
}
# Table "Sensor noise" of the paper, in m and deg.
PRINTED_SENSORS: dict[str, tuple[str, tuple[float, ...]]] = {
    "ublox_f9p_pvt": ("position", (1.5,)),
    "ublox_f9p_rtk": ("position", (0.01,)),
    "trimble_r12_dgnss": ("position", (0.25,)),
    "trimble_r12_rtk": ("position", (0.008,)),
    "sbg_ellipse": ("attitude", (0.1, 0.1, 0.2)),
    "sbg_apogee": ("attitude", (0.008, 0.008, 0.03)),
    "kongsberg_mru5": ("attitude", (0.002, 0.002, 0.002)),
    "velodyne_alpha_prime": ("ranging", (0.04, 0.1, 0.2)),
    "velodyne_hdl32e": ("ranging", (0.02, 0.08, 0.08)),
    "riegl_vux1uav": ("ranging", (0.01, 0.006, 0.006)),
    "faro_focus_plus": ("ranging", (0.001, 0.005, 0.005)),
    "kongsberg_hipap502": ("ranging", (0.02, 0.06, 0.06)),
    "sonardyne_usbl7000": ("ranging", (0.015, 0.04, 0.04)),
    "kongsberg_m3": ("ranging", (0.01, 0.9, 0.5)),
    "r2sonic_2026": ("ranging", (0.001, 0.45, 0.45)),
}
# Bounds tau_i [s] at k = 3, from the figures that the sources give, worked out by hand.
BOUNDS_S = {
    "hardware": 10e-9,
    "mcu_capture": 14e-9,
    "mcu_interrupt": 2e-6,
    "gpio": 12.08e-6,  # 6.92 + 3 * 1.72
    "gpio_rt": 160e-6,
    "pps_gnss": 530e-9,  # 30 + 500
    "pps_gnss_50us": 50e-6,
    "ptp": 1e-6,
    "ptp_host": 1e-6,
    "ptp_software": 1e-3,
    "ntp": 2e-3,
    "ntp_chrony": 90e-6,
    "ntp_internet": 5e-3,
    "arrival": 16e-3,
    "arrival_uart": 10e-3,
    "arrival_usb_serial": 16e-3,
    "arrival_usb_serial_calibrated": 10e-3,  # half of 16 ms, and 2 ms of the mean
    "arrival_usb_serial_1ms": 2e-3,
    "arrival_ethernet": 3e-3,
    "arrival_ros": 20e-3,
    "arrival_gnss_serial": 120e-3,
    "arrival_usb_camera": 900e-3,
}
CATALOG = read_catalog()
ENTRIES = [(section, name) for section in SECTIONS for name in CATALOG[section]]
BOUGHT = [(section, name) for section, name in ENTRIES if section != "platforms"]


@pytest.mark.parametrize("name", FILES)
def test_a_catalog_file_reads_without_a_problem(name: str) -> None:
    document = read(CATALOGS / f"{name}.yaml")
    assert document.problems == ()
    CatalogFile.model_validate(document.data)


def test_names_tell_the_entries_of_a_section_apart() -> None:
    for section in SECTIONS:
        names = [entry["name"] for entry in CATALOG[section].values()]
        assert len(names) == len(set(names)), section


@pytest.mark.parametrize(("section", "name"), ENTRIES)
def test_every_entry_has_a_source_or_says_that_it_is_assumed(section: str, name: str) -> None:
    entry = CATALOG[section][name]
    assert entry.get("source") or entry["basis"] == "assumption"


@pytest.mark.parametrize(("section", "name"), BOUGHT)
def test_cost_mass_and_power_are_given_and_accounted_for(section: str, name: str) -> None:
    entry = CATALOG[section][name]
    basis = entry.get("basis", {})
    for figure in MONEY_MASS_POWER:
        nothing = number(entry[figure]) == 0.0  # no hardware, nothing to account for
        assumed = basis == "assumption" or figure in basis
        assert nothing or assumed or figure in entry["source"], figure


@pytest.mark.parametrize("name", PRINTED_PLATFORMS)
def test_platforms_are_as_printed(name: str) -> None:
    v, w, d, b = PRINTED_PLATFORMS[name]
    entry = CATALOG["platforms"][name]
    figures = tuple(entry[key] for key in ("v_max", "omega_max", "distance", "baseline"))
    assert figures == (f"{v} m/s", f"{w} deg/s", f"{d} m", f"{b} m")


def test_the_auv_is_corrected_and_says_so() -> None:
    auv, printed = CATALOG["platforms"]["auv"], CATALOG["platforms"]["auv_printed"]
    assert (auv["v_max"], auv["distance"]) == ("2.0779 m/s", "30 m")
    assert (auv["omega_max"], auv["baseline"]) == (printed["omega_max"], printed["baseline"])
    assert "erratum" in auv["note"].lower()
    assert "auv_printed" in auv["note"]


def test_the_corrected_auv_gives_the_survey_table() -> None:
    """Three AUV cells of table "Critical synchronization error" [ms], sigma / (v + d omega)."""
    auv = CATALOG["platforms"]["auv"]
    v, w, d = (number(auv[key]) for key in ("v_max", "omega_max", "distance"))
    deg = math.pi / 180
    ellipse = math.sqrt(0.1**2 + 0.1**2 + 0.2**2) * deg * d
    hipap = 0.02 + math.sqrt(2) * 0.06 * deg * d
    sonic = 0.001 + math.sqrt(2) * 0.45 * deg * d
    for error, printed_ms in ((ellipse, 19.335), (hipap, 9.713), (sonic, 50.385)):
        assert 1e3 * error / (v + d * w) == pytest.approx(printed_ms, abs=1e-3)


@pytest.mark.parametrize("name", PRINTED_SENSORS)
def test_sensors_are_as_printed(name: str) -> None:
    modality, printed = PRINTED_SENSORS[name]
    entry = CATALOG["sensors"][name]
    assert entry["modality"] == modality
    if modality == "position":
        figures: tuple[Any, ...] = (number(entry["sigma_position"]),)
    elif modality == "attitude":
        figures = tuple(float(text.removesuffix(" deg")) for text in entry["sigma_attitude"])
    else:
        bearing = (float(text.removesuffix(" deg")) for text in entry["sigma_bearing"])
        figures = (number(entry["sigma_range"]), *bearing)
    assert figures == pytest.approx(printed, rel=1e-15)


def test_all_sensors_of_the_paper_name_it_as_their_source() -> None:
    from_paper = {n for n, s in CATALOG["sensors"].items() if "The Syncline Model" in s["source"]}
    assert from_paper == set(PRINTED_SENSORS)


def test_the_doubtful_inertial_figure_is_flagged() -> None:
    note = CATALOG["sensors"]["kongsberg_mru5"]["note"]
    assert "0.002 deg" in note
    assert "0.03 deg" in note


@pytest.mark.parametrize("name", CATALOG["timestamping"])
def test_the_bound_of_a_method_is_what_its_source_gives(name: str) -> None:
    error = CATALOG["timestamping"][name]["error"]
    assert bound(_timing_error(error)) == pytest.approx(BOUNDS_S[name], rel=1e-12)
    assert bound_of(error, 3) == pytest.approx(BOUNDS_S[name], rel=1e-12)


def _timing_error(error: dict[str, Any]) -> TimingError:
    left = number(error["calibrated"]) if "calibrated" in error else None
    if error["distribution"] == "normal":
        return TimingError(Normal(number(error["mean"]), number(error["std"])), left)
    assert error["distribution"] == "uniform"
    return TimingError(Uniform(number(error["low"]), number(error["high"])), left)


@pytest.mark.parametrize("name", CATALOG["timestamping"])
def test_data_stamped_on_arrival_are_older_than_their_stamp(name: str) -> None:
    """mu = valid time minus stamp: whatever arrives late, and an interrupt, has mu <= 0."""
    error = CATALOG["timestamping"][name]["error"]
    if error["distribution"] == "normal":
        ends = (number(error["mean"]), number(error["mean"]))
    else:
        ends = (number(error["low"]), number(error["high"]))
    late = name.startswith("arrival") or name in {"gpio", "gpio_rt", "mcu_interrupt"}
    assert (ends[0] < 0.0 and ends[1] <= 0.0) if late else ends[0] == -ends[1]


def test_methods_serve_the_primitives_that_the_paper_gives_them() -> None:
    for name, entry in CATALOG["timestamping"].items():
        served = set(entry["primitives"])
        if name.startswith("arrival"):
            assert served == {"arrival"}
        elif name.startswith(("ptp", "ntp")):
            assert served == {"network"}
        elif name.startswith("pps_"):
            assert served == {"pps"}
        else:
            assert served == {"pps", "tov", "trigger"}


def test_only_stamps_from_gnss_stand_on_utc() -> None:
    utc = {n for n, e in CATALOG["timestamping"].items() if e.get("timeline") == "utc"}
    assert utc == {"pps_gnss", "pps_gnss_50us", "ptp", "ntp_internet"}


def test_shared_hardware_that_is_required_exists() -> None:
    for section in ("timestamping", "clocks"):
        for entry in CATALOG[section].values():
            assert set(entry.get("requires", {})) <= set(CATALOG["infrastructure"])
    assert CATALOG["timestamping"]["hardware"]["requires"] == {"timing_board": 1}


def test_every_sensor_primitive_has_a_method() -> None:
    served = {p for e in CATALOG["timestamping"].values() for p in e["primitives"]}
    for sensor in CATALOG["sensors"].values():
        assert set(sensor["primitives"]) <= served
        assert "arrival" not in sensor["primitives"]  # every sensor has it anyway


def test_clocks_cover_vessel_and_dive() -> None:
    assert {"free_running", "ntp", "ptp", "pps_gpio", "pps_hardware", "tcxo", "ocxo"} <= set(
        CATALOG["clocks"]
    )
    for name, drift_s in (("free_running", 0.288), ("tcxo", 0.0216), ("ocxo", 72e-6)):
        clock = CATALOG["clocks"][name]
        assert number(clock["drift"]) * number(clock["holdover"]) == pytest.approx(drift_s)


def test_clocks_that_are_named_for_a_time_without_gnss_say_so_in_figures() -> None:
    words = {"one day": 86400.0, "four hours": 14400.0, "three days": 259200.0, "a week": 604800.0}
    seen = 0
    for clock in load_builtin().clocks.values():
        told = [s for w, s in words.items() if clock.name.endswith(f" {w} without GNSS")]
        if told:
            seen += 1
            assert clock.alone_s == told[0], clock.name
    assert seen == 19


def test_money_converted_from_dollars_is_right() -> None:
    rate = 0.92
    for name, usd, more in (
        ("ublox_f9p_pvt", 219.95, 0.0),
        ("ublox_f9p_rtk", 219.95, 600.0),
        ("velodyne_alpha_prime", 75000.0, 0.0),
    ):
        entry = CATALOG["sensors"][name]
        assert number(entry["cost"]) == pytest.approx(usd * rate + more, abs=0.005)
        assert "0.92 EUR per USD" in entry["note"]
    board = CATALOG["infrastructure"]["microcontroller"]
    assert number(board["cost"]) == pytest.approx(26.85 * rate, abs=0.005)


def _table(heading: str) -> dict[str, list[str]]:
    """Rows of the table under a heading of the guide: id -> the other cells."""
    guide = (Path(__file__).parent.parent / "docs" / "catalogs.md").read_text("utf-8")
    section = guide.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    lines = [line.strip("|").split("|") for line in section.splitlines() if line.startswith("| `")]
    return {cells[0].strip(" `"): [cell.strip() for cell in cells[1:]] for cells in lines}


def test_the_guide_lists_every_method_with_its_bound_and_mark() -> None:
    rows = _table("Timestamping methods")
    assert set(rows) == set(CATALOG["timestamping"])
    for name, entry in CATALOG["timestamping"].items():
        assert number(rows[name][1]) == pytest.approx(BOUNDS_S[name], rel=1e-9), name
        assert (rows[name][-1] == "assumption") == ("error" in entry.get("basis", {})), name


def test_the_guide_lists_every_clock_with_its_bound() -> None:
    rows = _table("Host clocks")
    assert set(rows) == set(CATALOG["clocks"])
    for name, entry in CATALOG["clocks"].items():
        assert number(rows[name][1]) == pytest.approx(clock_bound(entry, 3), rel=1e-5), name
