"""Payloads that cannot exist are not chosen, and pinned ones fail: random specs against plain
enumeration, and the ways in which a spec says what is there."""

from __future__ import annotations

import json
import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from existence_oracle import disagreements
from existence_specs import drawn
from syncline_design.spec.load import BadInput, load_text
from syncline_design.verdict.verify import CheckSettings, check_loaded

QUICK = CheckSettings(monte_carlo=False)
Raw = dict[str, Any]
LIDAR: Raw = {
    "modality": "ranging", "type": "lidar", "sigma_range": "2 cm", "sigma_bearing": "0.1 deg",
    "primitives": ["pps"], "medium": "air", "reach": {"min": "1 m", "max": "70 m"},
    "cost": "900 EUR",
}  # fmt: skip
SONAR: Raw = {
    **LIDAR,
    "type": "mbes",
    "medium": "water",
    "reach": {"max": "600 m"},
    "cost": "9000 EUR",
}


def spec_of(ranging: Raw | list[str] | str, stage: Raw | None = None, **keys: Any) -> Raw:
    """One vessel over the sea floor, its ranging sensor pinned or open."""
    named = {"sensor": ranging} if isinstance(ranging, dict | str) else {"candidates": ranging}
    platform = {"v_max": "2 m/s", "omega_max": "4 deg/s", "distance": "500 m", "baseline": "1 m"}
    one = {
        "name": "vessel", "platform": platform, "timestamping": {"candidates": ["hardware"]},
        "position": {"sensor": "ublox_f9p_rtk"}, "attitude": {"sensor": "sbg_ellipse"},
        "ranging": named,
    }  # fmt: skip
    return {
        "syncline": 1, "name": "what can exist", "catalogs": ["parts.yaml"],
        "requirements": [{"id": "ACC-1", "kind": "accuracy", "limit": "50 m"}],
        "stages": [one | (stage or {})], **keys,
    }  # fmt: skip


def said(folder: Path, spec: Raw, explain: str = "", **parts: Raw) -> Raw:
    sensors = {"short_lidar": LIDAR, "sonar": SONAR, **parts}
    (folder / "parts.yaml").write_text(json.dumps({"sensors": sensors}))
    case = load_text(json.dumps(spec, indent=1), folder / "spec.yaml")
    return check_loaded(case, replace(QUICK, explain=(explain,))).to_json()


def at(distance: str, **keys: str) -> Raw:
    figures = {"v_max": "2 m/s", "omega_max": "4 deg/s", "distance": distance, "baseline": "1 m"}
    return {"platform": figures | keys}


def texts(verdict: Raw) -> list[str]:
    return [fix["text"] for fix in verdict["infeasibility"]["fixes"]]


@pytest.mark.parametrize("seed", [1002, 1003, 1006, 1009, 1010])
def test_random_specs_choose_what_plain_enumeration_does(seed: int, tmp_path: Path) -> None:
    spec, parts = drawn(seed)
    assert disagreements(spec, parts, tmp_path, random.Random(seed)) == []


# ------------------------------------------------------------------ the cases it is for


def test_a_70_m_lidar_is_not_chosen_500_m_above_the_floor(tmp_path: Path) -> None:
    verdict = said(tmp_path, spec_of(["short_lidar", "sonar"]))
    assert verdict["verdict"] == "meets"
    assert verdict["design"]["stages"][0]["roles"]["ranging"]["sensor"] == "sonar"
    (gone,) = [row for row in verdict["choice"]["excluded"] if row["sensor"] == "short_lidar"]
    assert (gone["code"], gone["figure"], gone["limit"]) == (
        "reach", "reach: 70 m", "distance: 500 m",
    )  # fmt: skip
    assert gone["reason"] == "short_lidar: reaches 70 m, vessel.distance is 500 m"
    assert (gone["primitive"], gone["method"]) == (None, None)


def test_pinned_it_fails_by_what_is_implied(tmp_path: Path) -> None:
    pinned = spec_of("short_lidar", {"timestamping": "hardware"})
    for role in ("position", "attitude", "ranging"):
        pinned["stages"][0][role] |= {"primitive": "pps", "timestamping": "hardware"}
    verdict = said(tmp_path, pinned)
    assert verdict["verdict"] == "fails"
    row = next(one for one in verdict["requirements"] if one["id"] == "FACTS")
    assert (row["kind"], row["status"], row["value"], row["implied"]) == (
        "feasible",
        "fail",
        1,
        True,
    )
    assert "short_lidar ends at 70 m, vessel is 500 m away" in row["note"]
    (worked,) = said(tmp_path, pinned, explain="FACTS")["explained"]
    (step,) = worked["steps"]
    assert (step["value"], step["numbers"]) == (1, "1")
    assert "short_lidar ends at 70 m" in step["formula"]
    near = said(tmp_path, pinned | {"stages": [pinned["stages"][0] | at("70 m")]})
    assert near["verdict"] == "meets"
    assert not [one for one in near["requirements"] if one["id"] == "FACTS"]


def test_the_shipped_auv_stays_free_of_gnss_pps(tmp_path: Path) -> None:
    """`pps_gnss` among the candidates of the small survey vessel's chain stamps nothing below."""
    text = Path("specs/subsea_survey_small_sv.yaml").read_text("utf-8")
    text = text.replace("[gpio, arrival]", "[gpio, arrival, pps_gnss]")
    verdict = check_loaded(load_text(text, tmp_path / "spec.yaml"), QUICK).to_json()
    assert verdict["verdict"] == "meets"
    auv = verdict["design"]["stages"][1]["roles"].values()
    assert {role["timestamping"] for role in auv} == {"gpio"}
    rows = [row for row in verdict["choice"]["excluded"] if row["method"] == "pps_gnss"]
    assert {(row["stage"], row["code"]) for row in rows} == {("auv", "gnss")}


# ------------------------------------------------------------------ what is said, and what is not


def test_who_is_under_water_looks_into_water(tmp_path: Path) -> None:
    fish = {**at("30 m"), "depth": "40 m", "gnss": "yes"}
    verdict = said(tmp_path, spec_of(["short_lidar", "sonar"], fish))
    assert [row["code"] for row in verdict["choice"]["excluded"]] == ["medium"]
    said_air = said(tmp_path, spec_of(["short_lidar", "sonar"], {**fish, "medium": "air"}))
    assert [row["sensor"] for row in said_air["choice"]["excluded"]] == ["sonar"]


def test_an_unknown_fact_is_a_caution_with_entry_and_key_the_weightiest_first(
    tmp_path: Path,
) -> None:
    silent = {key: LIDAR[key] for key in LIDAR if key not in ("reach", "medium")}
    spec = spec_of(["silent"], {"medium": "air", "temperature": "-5 degC .. 20 degC"})
    verdict = said(tmp_path, spec, silent=silent)
    assert verdict["verdict"] == "meets"
    told = [one for one in verdict["warnings"] if one["code"] == "unknown-fact"]
    assert [(one["entry"], one["key"]) for one in told[:2]] == [
        ("silent", "reach"), ("silent", "medium"),
    ]  # fmt: skip
    assert {one["key"] for one in told[2:]} == {"temperature"}
    assert "look this up first" in told[0]["message"]
    strict = said(tmp_path, spec | {"strict_facts": True}, silent=silent)
    assert strict["verdict"] == "infeasible"
    assert {row["code"] for row in strict["choice"]["excluded"]} == {"unknown-fact"}
    assert any(text.startswith("strict_facts: no") for text in texts(strict))


def test_strict_facts_leave_what_tells_all_that_is_asked(tmp_path: Path) -> None:
    silent = {key: LIDAR[key] for key in LIDAR if key != "reach"}
    spec = spec_of(["silent", "sonar"], {"medium": "water"}, strict_facts=True)
    verdict = said(tmp_path, spec, silent=silent | {"medium": "water"})
    assert verdict["design"]["stages"][0]["roles"]["ranging"]["sensor"] == "sonar"
    assert not [one for one in verdict["warnings"] if one["code"] == "unknown-fact"]


def test_nobody_says_what_the_path_goes_through(tmp_path: Path) -> None:
    verdict = said(tmp_path, spec_of(["short_lidar"], at("50 m")))
    assert verdict["verdict"] == "meets"
    (told,) = [one for one in verdict["warnings"] if one["code"] == "unknown-fact"]
    assert (told["entry"], told["key"]) == ("vessel", "medium")


def test_a_bright_object_is_said_to_be_what_the_verdict_stands_on(tmp_path: Path) -> None:
    table = LIDAR | {"reach": {"max": {"10 %": "40 m", "80 %": "70 m"}}}
    plain = said(tmp_path, spec_of(["table"], at("60 m")), table=table)
    assert plain["verdict"] == "infeasible"
    bright = spec_of(["table"], {**at("60 m"), "reflectivity": "80 %"})
    verdict = said(tmp_path, bright, table=table)
    assert verdict["verdict"] == "meets"
    assert "favourable-reach" in {one["code"] for one in verdict["warnings"]}


@pytest.mark.parametrize("status", ["discontinued", "announced"])
def test_what_cannot_be_had_is_let_in_on_request_and_always_said(
    status: str, tmp_path: Path
) -> None:
    old = SONAR | {"lifecycle": {"status": status, "read": "2026-11-22", "successor": "sonar"}}
    spec = spec_of(["old"])
    verdict = said(tmp_path, spec, old=old)
    assert verdict["verdict"] == "infeasible"
    assert [row["code"] for row in verdict["choice"]["excluded"]] == ["discontinued"]
    assert any(text.startswith("allow_discontinued: yes") for text in texts(verdict))
    allowed = said(tmp_path, spec | {"allow_discontinued": "yes"}, old=old)
    assert allowed["verdict"] == "meets"
    (told,) = [one for one in allowed["warnings"] if one["code"] == "discontinued"]
    assert (told["entry"], told["key"]) == ("old", "lifecycle")
    assert f"old is {status}" in told["message"]
    assert "sonar follows it" in told["message"]


# ------------------------------------------------------------------ what would help


@pytest.mark.parametrize(
    ("reach", "before", "after"),
    [
        ({"max": "70 m"}, "500 m", 70.0),
        ({"max": "70.7 m"}, "500 m", 70.7),
        ({"min": "20 m", "max": "70 m"}, "500 m", 70.0),
        ({"min": "20 m", "max": "70 m"}, "10 m", 20.0),
    ],
)
def test_the_distance_that_helps_is_the_end_of_the_reach(
    reach: Raw, before: str, after: float, tmp_path: Path
) -> None:
    verdict = said(tmp_path, spec_of(["own"], at(before)), own=LIDAR | {"reach": reach})
    assert verdict["verdict"] == "infeasible"
    (fix,) = [one for one in verdict["infeasibility"]["fixes"] if one["figure"] == "distance"]
    assert fix["to"] == pytest.approx(after, rel=1e-12)
    assert (
        said(tmp_path, spec_of(["own"], at(f"{fix['to']!r} m")), own=LIDAR | {"reach": reach})[
            "verdict"
        ]
        == "meets"
    )


def test_gnss_or_a_cable_is_offered_where_it_is_missing(tmp_path: Path) -> None:
    text = Path("specs/subsea_survey_small_sv.yaml").read_text("utf-8")
    text = text.replace("[gpio, arrival]", "[pps_gnss]")
    verdict = check_loaded(load_text(text, tmp_path / "spec.yaml"), QUICK).to_json()
    assert verdict["verdict"] == "infeasible"
    found = {(fix["figure"], fix["stage"]) for fix in verdict["infeasibility"]["fixes"]}
    assert {("gnss", "auv"), ("timing_from", "auv")} <= found


def test_the_ledger_ends_a_distance_where_the_reach_does(tmp_path: Path) -> None:
    (tmp_path / "parts.yaml").write_text(json.dumps({"sensors": {"short_lidar": LIDAR}}))
    from syncline_design.choice.decide import choose
    from syncline_design.choice.outcome import Choice
    from syncline_design.choice.problem import build_problem
    from syncline_design.choice.slack import slack_ledger

    case = load_text(json.dumps(spec_of(["short_lidar"], at("50 m"))), tmp_path / "spec.yaml")
    problem = build_problem(case)
    found = choose(problem, "front")
    assert isinstance(found, Choice)
    (row,) = [
        one for one in slack_ledger(case, problem, found.design) if one.term.startswith("distance")
    ]
    assert row.fails_at == pytest.approx(70.0, rel=1e-5)
    assert row.limited_by == "feasible"


# ------------------------------------------------------------------ bad input


@pytest.mark.parametrize(
    ("keys", "place"),
    [
        ({"medium": "vacuum"}, "stages[0].medium"),
        ({"medium": "both"}, "stages[0].medium"),
        ({"look": {"azimuth": "10 deg"}}, "stages[0].look.azimuth"),
        ({"look": {"azimuth": "0 deg .. 400 deg"}}, "stages[0].look.azimuth"),
        ({"temperature": "20 degC"}, "stages[0].temperature"),
        ({"reflectivity": "120 %"}, "stages[0].reflectivity"),
        ({"reflectivity": "0 %"}, "stages[0].reflectivity"),
    ],
)
def test_what_a_stage_cannot_ask_is_refused_at_its_place(
    keys: Raw, place: str, tmp_path: Path
) -> None:
    with pytest.raises(BadInput) as refused:
        said(tmp_path, spec_of(["sonar"], keys))
    (flaw, *_) = refused.value.problems
    assert flaw.path == place
    assert flaw.line > 1


@pytest.mark.parametrize("key", ["strict_facts", "allow_discontinued"])
def test_a_switch_is_yes_or_no(key: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="yes or no"):
        said(tmp_path, spec_of(["sonar"], **{key: "perhaps"}))


# ------------------------------------------------------------------ how close samples are


def gap(limit: str, ranging: Any, stage: Raw | None = None, **keys: Any) -> Raw:
    spec = spec_of(ranging, stage, **keys)
    spec["requirements"].append({"id": "GAP-1", "kind": "sample_spacing", "limit": limit})
    return spec


def row_of(verdict: Raw, name: str = "GAP-1") -> Raw:
    return next(row for row in verdict["requirements"] if row["id"] == name)


@pytest.mark.parametrize(
    ("rate", "limit", "ok"),
    [
        ("10 Hz", "0.2 m", True),  # 2 m/s at 10 Hz
        ("10 Hz", "0.199999 m", False),
        ("9.9999 Hz", "0.2 m", False),
        ("3 Hz", "0.6666666666666667 m", True),  # 2/3 m, rounded once
        ("3 Hz", "0.6666666666666 m", False),
    ],
)
def test_samples_are_v_max_over_rate_apart(rate: str, limit: str, ok: bool, tmp_path: Path) -> None:
    spec = gap(limit, ["own"], at("50 m", medium="air"))
    verdict = said(tmp_path, spec, own=LIDAR | {"rate": rate})
    assert verdict["verdict"] == ("meets" if ok else "infeasible")
    if ok:
        row = row_of(verdict)
        assert (row["kind"], row["status"], row["unit"]) == ("sample_spacing", "pass", "m")
        assert row["value"] == pytest.approx(2.0 / float(rate.split()[0]), rel=1e-12)
        return
    (gone,) = verdict["choice"]["excluded"]
    assert gone["code"] == "rate"
    assert verdict["infeasibility"]["conflict"]["requirements"][0]["id"] == "GAP-1"


@pytest.mark.parametrize(("sound", "apart"), [(None, 4.0 / 3.0), ("1480 m/s", 2000.0 / 1480.0)])
def test_a_sonar_waits_for_its_echo(sound: str | None, apart: float, tmp_path: Path) -> None:
    """2 m/s over 2 * 500 m of sound, whatever rate the maker prints."""
    stage = {"sound_speed": sound} if sound else {}
    spec = gap("1.5 m", ["own"], {**stage, "medium": "water"})
    verdict = said(tmp_path, spec, own=SONAR | {"rate": "50 Hz"})
    assert verdict["verdict"] == "meets"
    assert row_of(verdict)["value"] == pytest.approx(apart, rel=1e-12)


def test_what_helps_where_samples_are_too_far_apart(tmp_path: Path) -> None:
    """A wider limit, a slower vessel, a nearer floor: 2 v d / c <= 1 m at v = 2 m/s, d = 500 m."""
    spec = gap("1 m", ["own"], {"medium": "water"})
    verdict = said(tmp_path, spec, own=SONAR | {"rate": "50 Hz"})
    assert verdict["verdict"] == "infeasible"
    fixes = {fix["figure"] or fix["kind"]: fix for fix in verdict["infeasibility"]["fixes"]}
    assert fixes["sample_spacing"]["requirement"] == "GAP-1"
    assert 4.0 / 3.0 <= fixes["sample_spacing"]["to"] <= 1.34
    assert fixes["v_max"]["to"] == pytest.approx(1.5, rel=1e-9)
    assert fixes["distance"]["to"] == pytest.approx(375.0, rel=1e-9)


def test_a_rate_that_nobody_tells_leaves_the_verdict_open(tmp_path: Path) -> None:
    spec = gap("0.2 m", ["short_lidar"], at("50 m", medium="air"))
    verdict = said(tmp_path, spec)
    assert verdict["verdict"] == "indeterminate"
    row = row_of(verdict)
    assert (row["status"], row["value"]) == ("indeterminate", None)
    assert "short_lidar gives no rate" in row["note"]
    (told,) = [one for one in verdict["warnings"] if one["code"] == "unknown-fact"]
    assert (told["entry"], told["key"]) == ("short_lidar", "rate")
    strict = said(tmp_path, spec | {"strict_facts": True})
    assert [row["code"] for row in strict["choice"]["excluded"]] == ["unknown-fact"]


def test_a_pinned_sensor_that_samples_too_seldom_fails_that_requirement(tmp_path: Path) -> None:
    spec = gap("0.2 m", "own", {**at("50 m", medium="air"), "timestamping": "hardware"})
    for role in ("position", "attitude", "ranging"):
        spec["stages"][0][role] |= {"primitive": "pps", "timestamping": "hardware"}
    verdict = said(tmp_path, spec, own=LIDAR | {"rate": "5 Hz"})
    assert verdict["verdict"] == "fails"
    assert (row_of(verdict)["status"], row_of(verdict)["value"]) == ("fail", 0.4)
    assert not [one for one in verdict["requirements"] if one["id"] == "FACTS"]


def test_samples_are_asked_of_a_ranging_sensor(tmp_path: Path) -> None:
    spec = gap("0.2 m", ["sonar"])
    del spec["stages"][0]["ranging"], spec["stages"][0]["attitude"]
    with pytest.raises(BadInput) as refused:
        said(tmp_path, spec)
    (flaw,) = refused.value.problems
    assert flaw.path == "requirements[1].kind"


@pytest.mark.parametrize("corrects", [None, ["travel_time"]])
def test_what_moves_while_sound_travels_is_said(corrects: list[str] | None, tmp_path: Path) -> None:
    """(2 + 500 * 4 deg) m/s for 2 * 500 / 1500 s: 24.6044 m."""
    own = SONAR | ({} if corrects is None else {"corrects": corrects})
    verdict = said(tmp_path, spec_of(["own"], {"medium": "water"}), own=own)
    (told,) = [one for one in verdict["warnings"] if one["code"] == "travel-time"]
    assert (told["entry"], told["key"]) == ("own", "corrects")
    assert "24.6 m" in told["message"]
    assert ("look up" in told["message"]) == (not corrects)
    assert "would fail" not in told["message"]
    tight = json.loads(json.dumps(spec_of(["own"], {"medium": "water"})).replace("50 m", "26 m"))
    (told,) = [
        one for one in said(tmp_path, tight, own=own)["warnings"] if one["code"] == "travel-time"
    ]
    assert ("without that ACC-1 would fail" in told["message"]) == (not corrects)


def test_a_wider_spacing_is_found_beside_simulated_requirements(tmp_path: Path) -> None:
    """What the limit kept out is judged as the spec would have it."""
    spec = gap("0.2 m", ["own"], at("50 m", medium="air"))
    spec["requirements"].append({"id": "W", "kind": "worst_case", "limit": "20 m"})
    verdict = said(tmp_path, spec, own=LIDAR | {"rate": "5 Hz"})
    assert verdict["verdict"] == "infeasible"
    (fix,) = [one for one in verdict["infeasibility"]["fixes"] if one["requirement"] == "GAP-1"]
    assert fix["to"] == pytest.approx(0.4, rel=1e-9)


def test_the_board_of_what_cannot_exist_is_paid_for_too(tmp_path: Path) -> None:
    """The pinned payload's price, by hand: sensors, one method of hardware and one board."""
    spec = spec_of("short_lidar", {"timestamping": "hardware"})
    stage = spec["stages"][0]
    for role, method in (
        ("position", "arrival"),
        ("attitude", "arrival"),
        ("ranging", "own_board"),
    ):
        stage[role] |= {"primitive": "arrival" if method == "arrival" else "pps"}
        stage[role] |= {"timestamping": method}
    board = {"channels": 4, "cost": "250 EUR"}
    error = {"distribution": "uniform", "low": "-1 us", "high": "1 us"}
    method = {"primitives": ["pps"], "error": error, "cost": "7 EUR", "requires": {"own": 1}}
    catalog = {
        "sensors": {"short_lidar": LIDAR}, "timestamping": {"own_board": method},
        "infrastructure": {"own": board},
    }  # fmt: skip
    (tmp_path / "parts.yaml").write_text(json.dumps(catalog))
    verdicts = []
    for distance in ("50 m", "500 m"):
        text = json.dumps(spec | {"stages": [stage | at(distance)]}, indent=1)
        verdicts.append(check_loaded(load_text(text, tmp_path / "spec.yaml"), QUICK).to_json())
    near, far = verdicts
    assert [one["verdict"] for one in verdicts] == ["fails", "fails"]  # arrival is too late
    assert far["design"]["cost"] == near["design"]["cost"]
    assert [row["id"] for row in far["requirements"] if row["id"] == "FACTS"] == ["FACTS"]
    roles = far["design"]["stages"][0]["roles"]
    assert roles["ranging"]["cost"] == 907.0
    assert far["design"]["cost"] == sum(role["cost"] for role in roles.values()) + 250.0
