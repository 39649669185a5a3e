"""Specs and their catalogs as a whole: what they mean, how they refer, what they write back."""

from __future__ import annotations

import datetime
import math
import re
from fractions import Fraction
from pathlib import Path

import pytest
from pydantic import ValidationError

from syncline_design.model.quantity import UNITS, Quantity
from syncline_design.spec.case import IN_PLACE, Case
from syncline_design.spec.choices import InlineTimestamping, RoleChoice
from syncline_design.spec.load import BadInput, load, load_text
from syncline_design.spec.spec import EffectChoice, Waiver, split_column

SPECS = Path(__file__).parent.parent / "specs"
SHIPPED = sorted(SPECS.glob("*.yaml"))

HEAD = """syncline: 1
name: Test
requirements:
  - {id: ACC-1, kind: accuracy, limit: 0.50 m}
"""
STAGE = """stages:
  - name: uav
    platform: uav_fixed_wing
    position: {candidates: [ublox_f9p_pvt, ublox_f9p_rtk], lever_arm: [0.3 m, 0 m, -0.2 m]}
    attitude: {candidates: {modality: attitude}}
    ranging: {sensor: riegl_vux1uav, primitive: pps, timestamping: hardware}
timestamping: {candidates: [hardware, gpio]}
"""


def loaded(text: str, folder: Path | None = None) -> Case:
    return load_text(text, (folder or Path("nowhere")) / "spec.yaml")


def complaint(text: str) -> str:
    with pytest.raises(BadInput) as caught:
        loaded(text)
    return str(caught.value)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.stem)
def test_shipped_specs_load(path: Path) -> None:
    spec = load(path)
    assert spec.spec.name
    assert spec.position(("requirements", 0)) == spec.positions["requirements", 0]
    assert spec.position(("requirements", 0, "nothing", 7)) == spec.positions["requirements", 0]
    assert len(spec.spec_sha256) == len(spec.catalogs_sha256) == 64


def test_the_sketch_of_a_spec_reads_as_meant() -> None:
    text = (
        HEAD
        + """  - {id: SYNC-1, kind: sync, limit: 1.0}
  - {id: COST-1, kind: cost, limit: 400000 EUR}
  - {id: MASS-1, kind: mass, limit: 30 kg}
  - {id: POW-1, kind: power, limit: 300 W}
  - {id: MC-1, kind: monte_carlo, quantile: 0.95, limit: 0.30 m}
sync_model: per_sensor
coverage_factor: 2
objective: mass
monte_carlo: {samples: 1000, envelope: inside}
effects: []
"""
        + STAGE
    )
    spec = loaded(text).spec
    assert [float(r.limit) for r in spec.requirements] == [0.5, 1.0, 4e5, 30.0, 300.0, 0.3]
    assert all(isinstance(r.limit, Quantity) for r in spec.requirements)
    assert spec.requirements[5].quantile == 0.95
    stage = spec.stages[0]
    assert stage.position is not None
    assert stage.position.lever_arm == (0.3, 0.0, -0.2)
    assert (spec.sync_model, spec.coverage_factor, spec.objective) == ("per_sensor", 2.0, "mass")
    assert (spec.monte_carlo.samples, spec.monte_carlo.envelope) == (1000, "inside")
    assert stage.vehicle_name == "uav"


def test_defaults_are_those_of_the_interface() -> None:
    spec = loaded(HEAD + STAGE).spec
    assert (spec.currency, spec.sync_model, spec.objective) == ("EUR", "syncline", "cost")
    assert (spec.coverage_factor, spec.monte_carlo.samples) == (3.0, 50_000)
    assert spec.monte_carlo.envelope == "limits"


def test_a_platform_may_be_named_overridden_or_given() -> None:
    named = loaded(HEAD + STAGE)
    platform = named.stages[0].platform.entry
    assert (platform.v_max, platform.distance) == (21.0, 100.0)
    text = STAGE.replace(
        "platform: uav_fixed_wing", "platform: {use: uav_fixed_wing, distance: 60 m}"
    )
    over = loaded(HEAD + text)
    changed = over.stages[0].platform.entry
    assert (changed.v_max, changed.distance) == (21.0, 60.0)
    own = "{v_max: 1 m/s, omega_max: 20 deg/s, distance: 6 m, baseline: 0.8 m}"
    given = loaded(HEAD + STAGE.replace("platform: uav_fixed_wing", f"platform: {own}"))
    entry = given.stages[0].platform.entry
    assert entry.omega_max == pytest.approx(math.radians(20), rel=1e-15)


def test_candidates_follow_the_spec_and_queries_the_catalog() -> None:
    spec = loaded(HEAD + STAGE)
    position, attitude, _ = spec.stages[0].roles
    assert [one.id for one in position.sensors] == ["ublox_f9p_pvt", "ublox_f9p_rtk"]
    wanted = [i for i, s in spec.catalog.sensors.items() if s.modality == "attitude"]
    assert [one.id for one in attitude.sensors] == wanted
    assert len(wanted) >= 3
    assert all(one.entry is spec.catalog.sensors[one.id] for one in attitude.sensors)
    assert all(one.origin == spec.origins["sensors", one.id] for one in attitude.sensors)


def test_a_query_matches_every_key_given() -> None:
    text = HEAD + STAGE.replace(
        "ranging: {sensor: riegl_vux1uav, primitive: pps, timestamping: hardware}",
        "ranging: {candidates: {type: lidar, max_cost: 20000 EUR}}",
    )
    spec = loaded(text)
    ranging = spec.stages[0].role("ranging")
    assert ranging is not None
    assert ranging.sensors
    wanted = {
        identity
        for identity, sensor in spec.catalog.sensors.items()
        if sensor.modality == "ranging"
        and sensor.type == "lidar"
        and sensor.cost is not None
        and sensor.cost <= 20000
    }
    assert {one.id for one in ranging.sensors} == wanted


def test_timestamping_is_the_roles_else_the_stages_else_the_specs() -> None:
    text = HEAD + STAGE.replace("    attitude:", "    timestamping: gpio\n    attitude:")
    spec = loaded(text)
    methods = {role.role: [one.id for one in role.methods] for role in spec.stages[0].roles}
    assert methods["ranging"] == ["hardware"]
    assert methods["attitude"] == ["gpio"]
    assert all(role.inline is None for role in spec.stages[0].roles)


def test_a_role_may_give_its_error_in_place() -> None:
    text = HEAD + STAGE.replace(
        "timestamping: hardware}",
        "timestamping: {error: {distribution: constant, value: -3 ms}, timeline: utc}}",
    )
    role = loaded(text).stages[0].role("ranging")
    assert role is not None
    assert role.methods == ()
    assert isinstance(role.inline, InlineTimestamping)
    assert role.inline.timeline == "utc"
    assert role.inline.error.value == -0.003  # type: ignore[union-attr]


def test_a_sensor_may_be_given_in_place_and_named() -> None:
    inline = "{modality: ranging, sigma_range: 1 cm, sigma_bearing: 0.1 deg, primitives: [pps]%s}"
    for name, shown in (("", "uav.ranging"), (", name: My lidar", "My lidar")):
        text = STAGE.replace("sensor: riegl_vux1uav", f"sensor: {inline % name}")
        role_error = complaint(HEAD + text)  # the objective is cost, and something is open
        assert f"sensor {shown} has no cost" in role_error
        ranging = loaded(HEAD + text + "objective: error\n").stages[0].role("ranging")
        assert ranging is not None
        (sensor,) = ranging.sensors
        assert (sensor.id, sensor.origin) == (shown, IN_PLACE)


def test_figures_are_due_only_where_something_needs_them() -> None:
    own = "{modality: attitude, sigma_attitude: 1 deg, primitives: [pps]}"
    pinned = STAGE.replace("candidates: {modality: attitude}", f"sensor: {own}")
    pinned = pinned.replace("candidates: [ublox_f9p_pvt, ublox_f9p_rtk]", "sensor: ublox_f9p_rtk")
    pinned = pinned.replace("[hardware, gpio]", "[gpio]").replace("rtk,", "rtk, primitive: pps,")
    loaded(HEAD + pinned)  # nothing to choose: what it costs does not matter
    for kind, limit in (("cost", "90000 EUR"), ("mass", "30 kg"), ("power", "300 W")):
        needs = HEAD + f"  - {{id: B-1, kind: {kind}, limit: {limit}}}\n" + pinned
        text = complaint(needs)
        assert f"sensor uav.attitude has no {kind}" in text
        assert "B-1" in text
    opened = pinned.replace("[gpio]", "[hardware, gpio]")
    assert "objective: cost" in complaint(HEAD + opened)
    loaded(HEAD + opened + "objective: error\n")


def test_money_is_converted_exactly() -> None:
    text = HEAD + "  - {id: C, kind: cost, limit: 100000 USD}\nexchange_rates: {USD: 0.92 EUR}\n"
    spec = loaded(text + STAGE).spec
    limit = spec.requirements[1].limit
    assert isinstance(limit, Quantity)
    assert spec.in_currency(limit) == Fraction(92000)
    assert "exchange_rates" in complaint(
        text.replace("exchange_rates: {USD: 0.92 EUR}\n", "") + STAGE
    )


def test_a_rate_of_the_specs_own_currency_is_one() -> None:
    """1 EUR is worth 1 EUR: another rate was taken in and left aside without a word."""
    text = HEAD + "  - {id: C, kind: cost, limit: 100000 EUR}\n"
    assert loaded(text + "exchange_rates: {EUR: 1 EUR}\n" + STAGE)
    said = complaint(text + "exchange_rates: {EUR: 2 EUR}\n" + STAGE)
    assert "exchange_rates.EUR" in said
    assert "found 2 EUR" in said


def test_stages_of_one_vehicle_have_one_clock() -> None:
    second = """  - name: arm
    vehicle: uav
    platform: uav_multi_rotor
    clock: %s
    attitude: {sensor: sbg_apogee, primitive: pps, timestamping: gpio}
    ranging: {sensor: riegl_vux1uav, primitive: pps, timestamping: gpio}
timestamping"""
    text = (HEAD + STAGE).replace("    position", "    clock: pps_gpio\n    position", 1)
    loaded(text.replace("timestamping: {c", second % "pps_gpio" + ": {c"))
    other = text.replace("timestamping: {c", second % "ptp" + ": {c")
    assert "another clock" in complaint(other)


def test_effect_parameters_are_si_whatever_their_unit() -> None:
    entry = EffectChoice(
        effect="latency",
        sensor="position",
        parameters={"latency_ms": 87, "bias_deg": 180.0, "rate": "20 ppm", "convention": "enu"},
        standard_uncertainty={"latency_s": "2 ms"},  # type: ignore[dict-item]
    )
    assert entry.parameters["latency_s"] == pytest.approx(0.087, rel=1e-15)
    assert entry.parameters["bias_rad"] == pytest.approx(math.pi, rel=1e-15)
    assert entry.parameters["rate"] == 2e-5
    assert entry.parameters["convention"] == "enu"
    assert entry.standard_uncertainty == {"latency_s": 0.002}
    with pytest.raises(ValidationError, match="given twice"):
        EffectChoice(effect="e", sensor="target", parameters={"latency_ms": 1, "latency_s": 0.001})
    with pytest.raises(ValidationError, match="in quotes"):
        EffectChoice(effect="e", sensor="target", parameters={"gain": "0.5"})


def test_a_waiver_holds_until_its_last_day() -> None:
    waiver = Waiver(reason="sea trial", expires="2027-01-31")
    assert waiver.holds_on(datetime.date(2027, 1, 31))
    assert not waiver.holds_on(datetime.date(2027, 2, 1))


def test_columns_of_logs_are_split_into_name_and_unit() -> None:
    assert split_column("att.phi [rad]") == ("att.phi", "rad")
    assert split_column("roll") == ("roll", "")
    text = HEAD + STAGE + 'log: {columns: {roll_deg: "att.phi [rad]", range_m: "r [cm]"}}\n'
    log = loaded(text).spec.log
    assert log is not None
    assert log.columns["range_m"] == "r [cm]"
    assert "wrong dimension" in complaint(text.replace("[rad]", "[m]"))
    assert "unknown unit" in complaint(text.replace("[rad]", "[raad]"))


def test_empirical_values_come_from_a_file_beside_the_spec(tmp_path: Path) -> None:
    (tmp_path / "times.txt").write_text("# one night\n12 us\n-3 us\n\n7 us\n", encoding="utf-8")
    text = HEAD + STAGE.replace(
        "timestamping: hardware}",
        "timestamping: {error: {distribution: empirical, file: times.txt}}}",
    )
    spec = loaded(text, tmp_path)
    role = spec.spec.stages[0].ranging
    assert role is not None
    assert isinstance(role.timestamping, InlineTimestamping)
    assert role.timestamping.error.values == (12e-6, -3e-6, 7e-6)  # type: ignore[union-attr]
    before = spec.catalogs_sha256
    (tmp_path / "times.txt").write_text("[ms]\n1\n", encoding="utf-8")
    again = loaded(text, tmp_path)
    assert again.catalogs_sha256 != before
    for content, words in (
        ("", "no values"),
        ("[us]\n", "no values"),
        ("[mm]\n1\n", "length"),
        ("1 us\n2 mm\n", "line 2"),
        ("1\n", "without a unit"),
        ("nan us\n", "finite"),
    ):
        (tmp_path / "times.txt").write_text(content, encoding="utf-8")
        with pytest.raises(BadInput, match=words):
            loaded(text, tmp_path)


def test_files_that_a_spec_names_have_to_be_there(tmp_path: Path) -> None:
    text = HEAD + STAGE + "monte_carlo: {envelope: trajectory, trajectory: {file: track.csv}}\n"
    with pytest.raises(BadInput, match="no such file"):
        loaded(text, tmp_path)
    (tmp_path / "track.csv").write_text("time_s\n", encoding="utf-8")
    loaded(text, tmp_path)
    with pytest.raises(BadInput, match="leaves the spec's folder"):
        loaded(text.replace("track.csv", "../track.csv"), tmp_path)


def test_own_catalogs_add_to_the_builtin_ones(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    sensor = "{modality: attitude, sigma_attitude: 1 deg, primitives: [], cost: 1 EUR}"
    (tmp_path / "own.yaml").write_text(
        f"catalogs: [sub/more.yaml]\nsensors:\n  a: {sensor}\n", encoding="utf-8"
    )
    (tmp_path / "sub" / "more.yaml").write_text(
        f"catalogs: [deeper.yaml]\nsensors:\n  b: {sensor}\n", encoding="utf-8"
    )
    (tmp_path / "sub" / "deeper.yaml").write_text(f"sensors:\n  c: {sensor}\n", encoding="utf-8")
    spec = loaded("catalogs: [own.yaml, sub/deeper.yaml]\n" + HEAD + STAGE, tmp_path)
    assert {"a", "b", "c", "sbg_ellipse"} <= set(spec.catalog.sensors)
    assert spec.origins["sensors", "b"].endswith("more.yaml:3:3")
    without = loaded(HEAD + STAGE, tmp_path)
    assert without.catalogs_sha256 != spec.catalogs_sha256
    assert without.spec_sha256 != spec.spec_sha256


def test_order_of_keys_and_entries_does_not_change_the_spec() -> None:
    one = loaded(HEAD + STAGE).spec
    parts = STAGE.split("timestamping: {candidates", 1)
    two = loaded("timestamping: {candidates" + parts[1] + parts[0] + HEAD).spec
    assert one == two


def test_errors_are_sorted_by_place_and_complete() -> None:
    text = complaint("sync_line: 1\n" + HEAD.replace("accuracy", "acuracy") + "stages: []\n")
    places = [tuple(map(int, line.split(":")[1:3])) for line in text.split("\n")]
    assert places == sorted(places)
    assert len(places) == 3


def test_very_many_errors_are_cut_with_a_count() -> None:
    many = "".join(f"key{i}: 1\n" for i in range(200))
    text = complaint(HEAD + STAGE + many)
    assert text.endswith("... and 150 more")
    assert len(text.split("\n")) == 51


def test_specs_are_frozen() -> None:
    spec = loaded(HEAD + STAGE).spec
    with pytest.raises(ValidationError):
        spec.name = "other"
    with pytest.raises(ValidationError, match="unknown_key"):
        RoleChoice.model_validate({"senser": "x"})


def test_the_example_of_the_manual_loads(tmp_path: Path) -> None:
    manual = (SPECS.parent / "docs" / "specs.md").read_text(encoding="utf-8")
    spec, catalog = re.findall(r"```yaml\n(.*?)```", manual, re.DOTALL)
    (tmp_path / "my_sensors.yaml").write_text(catalog, encoding="utf-8")
    example = load_text(spec, tmp_path / "bridge.yaml")
    assert "my_ins" in example.catalog.sensors
    assert example.spec.effects[0].parameters == {"latency_s": 0.003}


def test_the_manual_lists_every_unit() -> None:
    manual = (SPECS.parent / "docs" / "specs.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"[^\s|,]+", manual.split("|---|---|")[1].split("\n\n")[0]))
    units = {u for u in UNITS if u.isascii()}
    assert units <= listed
