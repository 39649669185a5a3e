"""Repairs after a diagnosis: prices, errors and verdicts against plain enumeration and by hand."""

from __future__ import annotations

import copy
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from plain_enumeration import Enumeration, Outcome, failed, number, read_catalog
from syncline_design.comparison import repair_options
from syncline_design.comparison.repairs import Repair, repairs
from syncline_design.diagnosis.result import Estimate, Finding
from syncline_design.report.on_repairs import _row, _sentence
from syncline_design.spec.load import load_text
from syncline_design.verdict.verify import CheckSettings, check_loaded

SPECS = Path(__file__).parent.parent / "specs"


def spec_of(**attitude: str) -> dict[str, Any]:
    """The harbour vessel, pinned; attitude: how its INS is meant to be stamped."""
    spec: dict[str, Any] = yaml.safe_load((SPECS / "usv_wire_missing.yaml").read_text("utf-8"))
    spec["stages"][0]["attitude"] = {"sensor": "sbg_ellipse", **attitude}
    return spec


def finding(effect: str, sensor: str, unit: str, **values: tuple[float, float]) -> Finding:
    """value and half width of its 95 % interval, by parameter."""
    parameters = {
        name: Estimate(value, half / 1.96, unit, True, str(value), (value - half, value + half))
        for name, (value, half) in values.items()
    }
    return Finding(
        effect, sensor, "usv", parameters, (), (), (), "", "", 99.0, -30.0, "", "", "",
    )  # fmt: skip


def by_kind(spec: dict[str, Any], *found: Finding) -> dict[str, Repair]:
    case = load_text(yaml.safe_dump(spec), "specs/usv.yaml")
    return {"+".join(s.kind for s in one.steps): one for one in repairs(case, found, seed=0)}


def total(spec: dict[str, Any], *effects: dict[str, Any]) -> tuple[float, str]:
    text = yaml.safe_dump({**spec, "effects": list(effects)})
    verdict = check_loaded(load_text(text, "specs/usv.yaml"), CheckSettings(monte_carlo=False))
    assert verdict.syncline is not None
    return verdict.syncline.total_m, verdict.verdict


def price(plain: Enumeration, one: Outcome, at: int) -> float:
    """The new sensor and method of a role, and boards that were not there."""
    catalog, option = plain.catalog, one.options[at]
    there = {"ublox_f9p_rtk", "sbg_ellipse", "velodyne_hdl32e"}
    cost = 0.0 if option.sensor in there else number(catalog["sensors"][option.sensor]["cost"])
    if option.method != "gpio":
        cost += number(catalog["timestamping"][option.method]["cost"])
    channels: dict[str, int] = {}
    for each in one.options:
        for item, count in catalog["timestamping"][each.method].get("requires", {}).items():
            channels[item] = channels.get(item, 0) + count
    for item, count in channels.items():
        entry = catalog["infrastructure"][item]
        cost += number(entry["cost"]) * math.ceil(count / entry["channels"])
    return cost


def test_a_lost_wire_costs_nothing_another_sensor_what_the_catalog_says() -> None:
    """Latency of an INS that is meant to be stamped by PPS; every other sensor and way tried."""
    spec = spec_of(primitive="pps", timestamping="gpio")
    found = by_kind(spec, finding("latency", "attitude", "s", latency_s=(0.016, 1e-4)))
    assert set(found) == {"nothing", "calibrate", "rewire", "timestamping", "sensor"}
    as_promised = total(spec)
    assert (found["rewire"].price, found["rewire"].error_m, found["rewire"].verdict) == (
        0.0, pytest.approx(as_promised[0], rel=1e-12), "meets",
    )  # fmt: skip
    catalog = copy.deepcopy(read_catalog(families=True))
    for one in catalog["timestamping"].values():  # a constant is an interval of no width
        if (error := one["error"])["distribution"] == "constant":
            one["error"] = {"distribution": "uniform"} | dict.fromkeys(
                ("low", "high"), error["value"]
            )
    methods = {"candidates": list(catalog["timestamping"])}
    for kind in ("sensor", "timestamping"):
        sensors = [n for n, one in catalog["sensors"].items() if one["modality"] == "attitude"]
        wanted = [n for n in sensors if (n == "sbg_ellipse") == (kind == "timestamping")]
        opened = json.loads(json.dumps(spec))
        opened["stages"][0]["attitude"] = {"candidates": wanted, "timestamping": methods}
        plain = Enumeration(opened, catalog=catalog)
        kept = [
            (round(price(plain, o, 1), 2), o.total_m)
            for o in plain
            if not failed(opened, o)
            and (kind == "sensor" or o.options[1].primitive == "pps")
            and (kind == "sensor" or o.options[1].method != "gpio")
            and all("cost" in catalog["sensors"][p.sensor] for p in o.options)
        ]
        expected = min(kept)
        assert found[kind].price == pytest.approx(expected[0], abs=1e-9)
        assert found[kind].error_m == pytest.approx(expected[1], rel=1e-9)
        assert found[kind].verdict == "meets"
    assert [one.cheapest for one in found.values()].count(True) == 1
    assert "at no cost for parts" in _sentence(tuple(found.values()))
    assert len(_row(found["sensor"], None)) == 5


def test_what_is_calibrated_out_leaves_its_interval() -> None:
    """The error is that of the spec with the half width of the interval as the effect's value."""
    spec = spec_of(primitive="pps", timestamping="gpio")
    found = by_kind(spec, finding("latency", "attitude", "s", latency_s=(-0.016, 2e-4)))
    entry = {"effect": "latency", "sensor": "attitude", "parameters": {"latency_s": 2e-4}}
    left = total(spec, entry)
    assert (found["calibrate"].error_m, found["calibrate"].verdict) == (
        pytest.approx(left[0], rel=1e-12), left[1],
    )  # fmt: skip
    whole = total(spec, entry | {"parameters": {"latency_s": -0.016}})
    assert found["nothing"].error_m == pytest.approx(whole[0], rel=1e-12)
    assert found["nothing"].verdict == "fails"
    assert set(found["nothing"].misses) == {"ACC-1", "SYNC-1"}


def test_what_hangs_on_the_mounting_is_calibrated_and_nothing_is_bought() -> None:
    spec = spec_of(primitive="pps", timestamping="gpio")
    arm = dict.fromkeys(("x_m", "y_m", "z_m"), (0.2, 0.01))
    found = by_kind(spec, finding("lever_arm", "ranging", "m", **arm))
    assert set(found) == {"nothing", "calibrate"}
    assert found["calibrate"].error_m < found["nothing"].error_m


def test_noise_cannot_be_calibrated_out() -> None:
    spec = spec_of(primitive="pps", timestamping="gpio")
    found = by_kind(spec, finding("noise_understated", "attitude", "", factor=(3.0, 0.2)))
    assert set(found) == {"nothing", "sensor"}
    assert found["sensor"].price > 0.0


def test_two_findings_are_put_right_together() -> None:
    spec = spec_of(primitive="pps", timestamping="gpio")
    wire = finding("latency", "attitude", "s", latency_s=(0.016, 1e-4))
    arm = finding("lever_arm", "ranging", "m", **dict.fromkeys(("x_m", "y_m", "z_m"), (0.3, 0.001)))
    found = by_kind(spec, wire, arm)
    best = next(one for one in found.values() if one.cheapest)
    assert [s.kind for s in best.steps] == ["rewire", "calibrate"]
    entry = {"effect": "lever_arm", "sensor": "ranging",
             "parameters": dict.fromkeys(("x_m", "y_m", "z_m"), 0.001)}  # fmt: skip
    assert best.error_m == pytest.approx(total(spec, entry)[0], rel=1e-12)
    alone = [one for name, one in found.items() if name == "nothing+nothing"]
    assert all(one.verdict == "fails" for one in alone)


def test_a_stand_in_and_what_does_not_matter_call_for_nothing() -> None:
    case = load_text(yaml.safe_dump(spec_of(primitive="pps", timestamping="gpio")), "specs/u.yaml")
    wire = finding("latency", "attitude", "s", latency_s=(0.016, 1e-4))
    assert (
        repairs(case, [replace(wire, kind="stand_in"), replace(wire, material=False)], seed=0) == ()
    )


def test_one_role_is_not_put_right_in_two_ways_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who buys another sensor does not stamp the present one, given in place, otherwise as well."""
    monkeypatch.setattr(repair_options, "MOST_KEPT", 1)  # of each kind, for time's sake
    spec = spec_of(primitive="pps", timestamping="gpio")
    entry = read_catalog(families=False)["sensors"]["sbg_ellipse"]
    kept = ("modality", "type", "sigma_attitude", "primitives", "cost")
    spec["stages"][0]["attitude"]["sensor"] = {key: entry[key] for key in kept}
    late = finding("latency", "attitude", "s", latency_s=(0.016, 1e-4))
    noisy = finding("timestamp_jitter", "attitude", "s", std_s=(0.01, 1e-4))
    found = by_kind(spec, late, noisy)
    assert "timestamping+timestamping" in found
    for repair in found.values():
        ways = {s.text.replace(" for usv attitude", "").removeprefix("stamp usv attitude ")
                for s in repair.steps if s.kind in ("timestamping", "sensor")}  # fmt: skip
        assert len(ways) <= 1, [s.text for s in repair.steps]
