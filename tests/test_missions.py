"""Several missions with one payload: read, judged, bought once, written back."""

from __future__ import annotations

import copy
import csv
import io
import itertools
import json
import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import jsonschema
import pytest
import yaml

from checked import check_file
from command import run
from plain_enumeration import Enumeration, Outcome, number, read_catalog
from syncline_design.machine.records import read_as
from syncline_design.report import numbers
from syncline_design.report.checks import render_checks
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.result_schemas import result_schema
from syncline_design.spec.load import BadInput, load, load_text
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import CheckSettings, check_loaded

ROOT = Path(__file__).parents[1]
SHIPPED = ROOT / "examples" / "uav_three_heights.yaml"
QUICK = CheckSettings(monte_carlo=False)
BOARDED = """
syncline: 1
name: two missions
requirements:
  - {id: ACC-1, kind: accuracy, limit: 2 m}
  - {id: COST-1, kind: cost, limit: 60000 EUR}
stages:
  - name: uav
    platform: uav_fixed_wing
    position: {candidates: [ublox_f9p_pvt, ublox_f9p_rtk]}
    attitude: {candidates: [sbg_ellipse_d, vectornav_vn200]}
    ranging: {per_mission: yes, candidates: [livox_mid360, livox_tele15]}
timestamping: {candidates: [hardware, gpio]}
missions:
  - {name: near, stages: {uav: {distance: 30 m}}, requirements: {ACC-1: 0.25 m}}
  - {name: far, stages: {uav: {distance: 120 m}}}
"""


def written_out(spec: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Each mission of a spec as a spec of its own, put together by hand."""
    out = {}
    for mission in spec["missions"]:
        own = copy.deepcopy({k: v for k, v in spec.items() if k != "missions"})
        for name, keys in mission.get("stages", {}).items():
            stage = next(one for one in own["stages"] if one["name"] == name)
            figures = {key: value for key, value in keys.items() if key != "ranging"}
            stage["platform"] = {"use": stage["platform"], **figures}
            stage["ranging"] = {**stage["ranging"], **keys.get("ranging", {})}
        for identity, limit in mission.get("requirements", {}).items():
            next(one for one in own["requirements"] if one["id"] == identity)["limit"] = limit
        out[mission["name"]] = own
    return out


def outcomes(spec: dict[str, Any]) -> dict[str, list[Outcome]]:
    """Of each mission every payload that meets its requirements but cost, by plain enumeration."""
    found = {}
    for name, own in written_out(spec).items():
        limit = next(number(r["limit"]) for r in own["requirements"] if r["kind"] == "accuracy")
        every = Enumeration(own)
        found[name] = [one for one in every if one.total_m <= limit and one.sync < 1.0]
    return found


def key_of(one: Outcome) -> tuple[tuple[str, str, str], ...]:
    return tuple((o.sensor, o.primitive, o.method) for o in one.options)


@pytest.fixture(scope="module")
def shipped() -> Verdict:
    return check_file(SHIPPED)


def test_the_shipped_family_is_the_cheapest_of_all_payloads(shipped: Verdict) -> None:
    spec = yaml.safe_load(SHIPPED.read_text("utf-8"))
    found = outcomes(spec)
    by_key = {name: {key_of(one): one for one in own} for name, own in found.items()}
    shared = set.intersection(*(set(own) for own in by_key.values()))
    first = by_key["powerline"]
    cheapest = min(first[key].cost for key in shared)
    assert shipped.verdict == "meets"
    assert shipped.design is not None
    assert shipped.design.cost == pytest.approx(cheapest, abs=0.005)
    for mission in shipped.missions or ():
        assert mission.design is not None
        assert mission.syncline is not None
        assert mission.alone is not None
        roles = mission.design.roles
        names = tuple((r.sensor, r.primitive, r.timestamping) for _, _, r in roles)
        assert mission.syncline.total_m == pytest.approx(by_key[mission.name][names].total_m)
        alone = min(one.cost for one in found[mission.name])
        assert mission.alone.cost == pytest.approx(alone, abs=0.005)
        assert alone <= cheapest
    assert len({one.alone.cost for one in shipped.missions or () if one.alone}) == 3


def test_each_mission_is_judged_at_its_own_limit_and_line(shipped: Verdict) -> None:
    lines = SHIPPED.read_text("utf-8").splitlines()
    for mission in shipped.missions or ():
        row = next(row for row in mission.requirements if row.id == "ACC-1")
        assert row.line is not None
        assert f"{row.limit:.2f} m" in lines[row.line - 1]
        assert mission.figures is not None
        assert mission.monte_carlo is not None
        costs = [row.value for row in mission.requirements if row.kind == "cost"]
        assert shipped.design is not None
        assert costs == [shipped.design.cost]
    worst = next(row for row in shipped.requirements if row.id == "ACC-1")
    shares = {
        one.name: row.value / row.limit
        for one in shipped.missions or ()
        for row in one.requirements
        if row.id == "ACC-1" and row.value is not None
    }
    assert f"in mission {max(shares, key=lambda name: shares[name])}" in worst.note


def test_the_verdict_is_as_its_schema_says(shipped: Verdict) -> None:
    text = render_checks("json", [shipped])
    jsonschema.validate(json.loads(text), result_schema("verdict"))
    assert read_as(Verdict, text) == shipped


def test_the_bill_adds_up_to_what_the_family_costs(shipped: Verdict) -> None:
    lines = shipped.bill_of_materials or ()
    cents = sum(round(100 * line.cost) for line in lines if line.cost is not None)
    assert shipped.design is not None
    assert shipped.design.cost is not None
    assert cents == round(100 * shipped.design.cost)


def test_every_output_says_each_mission(shipped: Verdict) -> None:
    names = [one.name for one in shipped.missions or ()]
    assert names == ["powerline", "corridor", "overview"]
    suite = ElementTree.fromstring(render_checks("junit", [shipped]))
    tests = [case.get("name", "") for case in suite.iter("testcase")]
    assert {f"{name} ACC-1 accuracy" for name in names} <= set(tests)
    data = json.loads(render_checks("json", [shipped]))
    assert [one["name"] for one in data["missions"]] == names
    assert all(one["verdict"] == "meets" for one in data["missions"])
    for output in ("html", "markdown"):
        text = render_checks(output, [shipped])
        assert "Missions" in text
        assert all(name in text for name in names)
        assert "A payload for each mission" in text


def test_the_error_that_leads_is_of_the_mission_nearest_its_limit(shipped: Verdict) -> None:
    """A headline of the mission whose timing is tightest would show less than what was required."""
    rows = [(one.name, row) for one in shipped.missions or () for row in one.requirements]
    near = [(row.value / row.limit, name, row) for name, row in rows
            if row.kind == "accuracy" and row.value is not None]  # fmt: skip
    _, name, row = max(near, key=lambda one: one[0])
    facts = dict(on_verdict(shipped).facts)
    assert facts[f"Syncline error, {name}"].startswith(numbers.error(row.value, row))
    assert not any(label == "Syncline error" for label in facts)


@pytest.mark.parametrize("far", ["", ", ranging: {candidates: [hesai_xt32m]}"])
def test_a_role_of_its_own_in_each_mission_is_bought_once_where_it_is_the_same(
    tmp_path: Path, far: str
) -> None:
    path = tmp_path / "two.yaml"
    text = BOARDED.replace("[hardware, gpio]", "[hardware, gpio, ptp]")
    text = text.replace("distance: 120 m", f"distance: 60 m{far}")
    path.write_text(text, "utf-8")
    verdict = check_file(path, QUICK)
    spec = yaml.safe_load(text)
    found = outcomes(spec)
    catalog = Enumeration(written_out(spec)["near"]).catalog
    cheapest = math.inf
    for one, other in itertools.product(found["near"], found["far"]):
        if key_of(one)[:2] == key_of(other)[:2]:
            cheapest = min(cheapest, bought_once(catalog, [one, other]))
    assert verdict.design is not None
    assert verdict.design.cost == pytest.approx(cheapest, abs=0.005)
    lines = verdict.bill_of_materials or ()
    assert sum(line.cost or 0.0 for line in lines) == pytest.approx(cheapest, abs=0.005)
    used = {line.entry for line in lines if line.use == "ranging sensor"}
    assert len(used) == (2 if far else 1)
    assert any(one.code == "differs-by-mission" for one in verdict.warnings) == bool(far)


def bought_once(catalog: dict[str, Any], designs: list[Outcome]) -> float:
    """The cost of all pieces that two designs name; boards for the one that needs most."""
    pieces: dict[tuple[str, ...], float] = {}
    boards: dict[str, int] = {}
    for design in designs:
        used: dict[str, int] = {}
        for place, option in enumerate(design.options):
            sensor = catalog["sensors"][option.sensor]
            method = catalog["timestamping"][option.method]
            pieces[str(place), option.sensor] = number(sensor["cost"])
            pieces[str(place), option.sensor, option.method] = number(method["cost"])
            for item, count in method.get("requires", {}).items():
                used[item] = used.get(item, 0) + count
        for item, count in used.items():
            channels = catalog["infrastructure"][item]["channels"]
            boards[item] = max(boards.get(item, 0), math.ceil(count / channels))
    shared = (n * number(catalog["infrastructure"][item]["cost"]) for item, n in boards.items())
    return sum(pieces.values()) + sum(shared)


def test_a_written_design_is_pinned_and_judged_the_same(tmp_path: Path) -> None:
    path, pinned = tmp_path / "two.yaml", tmp_path / "pinned.yaml"
    path.write_text(BOARDED, "utf-8")
    done = run("optimize", str(path), "--best", "2", "--pareto", "--write-design", str(pinned))
    assert done.returncode == 0, done.stderr
    before, after = check_file(path, QUICK), check_file(pinned, QUICK)
    assert after.verdict == "meets"
    assert before.design is not None
    assert after.design is not None
    assert after.design.cost == before.design.cost
    case = load(pinned)
    assert all(
        role.choice.sensor for one in case.missions for s in one.case.stages for role in s.roles
    )


SPLIT = """
missions:
  - name: near
    stages: {uav: {distance: 30 m, ranging: {candidates: [livox_tele15, riegl_vux1uav]}}}
  - {name: mid, stages: {uav: {distance: 60 m}}}
  - name: far
    stages: {uav: {distance: 80 m, ranging: {candidates: [hesai_xt32m, riegl_vux1uav]}}}
"""


@pytest.mark.parametrize(("limit", "verdict"), [("30000 EUR", "infeasible"), ("200 EUR", "")])
def test_missions_that_cannot_share_a_payload_are_named(
    tmp_path: Path, limit: str, verdict: str
) -> None:
    text = BOARDED[: BOARDED.index("missions:\n")].replace("60000 EUR", limit) + SPLIT
    text = text.replace("per_mission: yes, candidates: [livox_mid360, livox_tele15]",
                        "candidates: [livox_tele15, hesai_xt32m, riegl_vux1uav]")  # fmt: skip
    text = text.replace("[hardware, gpio]", "[hardware, gpio, ptp]")
    path = tmp_path / "three.yaml"
    path.write_text(text, "utf-8")
    found = check_file(path, QUICK)
    assert found.verdict == "infeasible"
    why = found.infeasibility
    assert why is not None
    if verdict:  # each alone can be met, near and far not with one ranging sensor below the limit
        assert why.missions == ("near", "far")
        assert "near" in render_checks("github", [found])
        assert {one.verdict for one in found.missions or ()} == {"indeterminate"}
    else:
        assert why.missions == ("near",)
        assert why.text[0] == "Mission near alone:"
        assert found.exit_code == 1


def test_what_helps_a_mission_is_told_by_every_command(tmp_path: Path) -> None:
    """A mission that misses two limits: the changes that do so together are lost in no output."""
    example = Path(__file__).parent.parent / "examples/uav_three_heights.yaml"
    text = example.read_text("utf-8").replace("60000 EUR", "1000 EUR")
    path = tmp_path / "three.yaml"
    path.write_text(text.replace("{ACC-1: 0.20 m}", "{ACC-1: 1 mm}"), "utf-8")
    found = check_file(path, QUICK)
    why = found.infeasibility
    assert why is not None
    assert len(why.joint_fixes) > 1
    outputs = (
        "\n".join(why.text),
        render_checks("markdown", [found]),
        run("optimize", str(path), cwd=tmp_path, environment={"COLUMNS": "500"}).stdout,
    )
    for told in (" ".join(one.replace("\\", "").split()) for one in outputs):
        assert "Mission powerline alone" in told
        for fix in (fix for together in why.joint_fixes for fix in together):
            assert fix.text in told


# What is written instead of what, the word that the message leads to, and what it says.
REFUSED = [
    ("name: far", "name: near", "near, stages: {uav: {distance: 120", "used twice: near"),
    ("distance: 120 m", "distnce: 120 m", "distnce", "unknown key"),
    ("distance: 120 m", "distance: 120 kg", "120 kg", "wrong dimension"),
    ("distance: 120 m", "name: other", "name: other", "name is the same in every mission"),
    ("distance: 120 m", "vehicle: other", "vehicle", "vehicle is the same in every mission"),
    ("uav: {distance: 120 m}", "uaw: {distance: 120 m}", "uaw", "no stage of that name"),
    ("ACC-1: 0.25 m", "ACC-2: 0.25 m", "ACC-2", "no requirement of that id"),
    ("ACC-1: 0.25 m", "ACC-1: {kind: cost}", "kind: cost}", "kind is the same in every mission"),
    ("distance: 120 m", "ranging: {sensor: nothing}", "nothing", "unknown sensor"),
    ("distance: 120 m", "ranging: {per_mission: no}", "per_mission: no", "is said once"),
    ("distance: 120 m", "position: {sensor: trimble_r12_rtk}", "trimble_r12_rtk", "no sensor that"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "word", "message"), REFUSED)
def test_bad_missions_are_refused_at_their_place(
    old: str, new: str, word: str, message: str
) -> None:
    text = BOARDED.replace(old, new)
    before = text[: text.index(word)]
    place = f"{before.count(chr(10)) + 1}:{len(before) - before.rfind(chr(10))}"
    with pytest.raises(BadInput) as refused:
        load_text(text, "spec.yaml")
    said = str(refused.value)
    assert f"spec.yaml:{place}:" in said, said
    assert message in said


def test_what_works_on_one_system_refuses_missions() -> None:
    for command in ("simulate", "plan"):
        done = run(command, str(SHIPPED))
        assert done.returncode == 2
        assert "several missions" in done.stderr


def test_the_bill_as_a_table_adds_up_with_shared_and_owned_hardware() -> None:
    """Two lidars, one of them owned, one board: the union once, and who takes what."""
    spec = yaml.safe_load(BOARDED)
    spec["owned"] = ["livox_mid360"]
    spec["timestamping"]["candidates"] = ["hardware"]
    spec["missions"][0]["stages"]["uav"]["ranging"] = {"candidates": ["livox_mid360"]}
    verdict = check_loaded(load_text(yaml.safe_dump(spec), "boarded.yaml"), QUICK)
    rows = list(csv.DictReader(io.StringIO(render_checks("bill", [verdict]), newline="")))
    shared = read_catalog()
    board = shared["infrastructure"]["timing_board"]
    lidars = {row["entry"]: row for row in rows if row["use"] == "ranging sensor"}
    assert lidars["livox_mid360"]["cost"] == "0.0"
    assert lidars["livox_mid360"]["basis"].startswith("owned")
    assert {name: row["missions"] for name, row in lidars.items()} == {
        "livox_mid360": "near", "livox_tele15": "far",
    }  # fmt: skip
    (shelf,) = [row for row in rows if row["entry"] == "timing_board"]
    assert (shelf["quantity"], shelf["missions"]) == ("1", "")
    assert float(shelf["cost"]) == number(board["cost"])
    # One way of stamping for each of the four sensors, though each mission uses three.
    assert sum(row["entry"] == "hardware" for row in rows) == 4
    cents = sum(round(100 * float(row["cost"])) for row in rows)
    assert verdict.design is not None
    assert verdict.design.cost is not None
    assert cents == round(100 * verdict.design.cost)


def test_what_is_no_sum_is_asked_in_every_mission(tmp_path: Path) -> None:
    """Against every payload pinned and checked as a spec of each mission alone."""
    text = BOARDED.replace("kind: accuracy, limit: 2 m", "kind: thu, limit: {a: 0.02 m, b: 0.003}")
    text = text.replace("ACC-1: 0.25 m", "ACC-1: {a: 0.02 m, b: 0.0035}")
    text = text.replace("candidates: [livox_mid360, livox_tele15]", "candidates: [livox_tele15]")
    text = text.replace("[hardware, gpio]", "[gpio]").replace("per_mission: yes, ", "")
    text = text.replace("[sbg_ellipse_d, vectornav_vn200]", "[sbg_ellipse_d, novatel_cpt7]")
    path = tmp_path / "two.yaml"
    path.write_text(text, "utf-8")
    costs = []
    for position, attitude in itertools.product(
        ("ublox_f9p_pvt", "ublox_f9p_rtk"), ("sbg_ellipse_d", "novatel_cpt7")
    ):
        words, cost = set(), 0.0
        for name, own in written_out(yaml.safe_load(text)).items():
            picked = {"position": position, "attitude": attitude, "ranging": "livox_tele15"}
            for role, sensor in picked.items():
                own["stages"][0][role] = {"sensor": sensor, "primitive": "pps"}
            own["timestamping"] = "gpio"
            alone = tmp_path / f"{name}.yaml"
            alone.write_text(yaml.safe_dump(own), "utf-8")
            found = check_file(alone, QUICK)
            assert found.design is not None
            assert found.design.cost is not None
            words.add(found.verdict)
            cost = found.design.cost
        if words == {"meets"}:
            costs.append(cost)
    assert 0 < len(costs) < 4
    family = check_file(path, QUICK)
    assert family.verdict == "meets"
    assert family.design is not None
    assert family.design.cost == min(costs)
