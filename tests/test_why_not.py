"""Why an entry is not in the design, against plain enumeration of every design that holds it."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from plain_enumeration import Enumeration, Outcome, failed
from syncline_design.choice.holding import best_design
from syncline_design.choice.problem import build_problem
from syncline_design.cli.app import app
from syncline_design.report.on_choice import on_choice
from syncline_design.report.render_console import console
from syncline_design.spec.load import BadInput, Case, load_text
from syncline_design.verdict.admitted import kinds_of, with_whole_catalog
from syncline_design.verdict.optimise import OptimizeSettings, optimize
from syncline_design.verdict.why_not import Answer, Asked, HeldBack, NotTaken, why_not
from test_random_specs import draw_spec

SPECS = Path(__file__).parent.parent / "specs"
Key = tuple[int, float]  # cents, error [m]


def case_of(spec: dict[str, Any]) -> Case:
    return load_text(yaml.safe_dump(spec, sort_keys=False), "specs/drawn.yaml")


def answers_of(spec: dict[str, Any], *entries: str) -> list[Answer]:
    case = case_of(spec)
    problem, whole = build_problem(case), with_whole_catalog(case)
    asked = Asked(case, problem, best_design(problem), build_problem, whole)
    return list(why_not(asked, kinds_of(whole, entries)))


def held(plain: Enumeration, one: Outcome, kind: str) -> set[str]:
    """Entries of a kind that a design holds."""
    methods = [plain.catalog["timestamping"][option.method] for option in one.options]
    clocks = [plain.catalog["clocks"][name] for name in one.clocks if name is not None]
    return {
        "sensor": {option.sensor for option in one.options},
        "timestamping": {option.method for option in one.options},
        "clock": {name for name in one.clocks if name is not None},
        "hardware": {item for entry in (*methods, *clocks) for item in entry.get("requires", {})},
    }[kind]


def best(spec: dict[str, Any], outcomes: list[Outcome]) -> Key | None:
    kept = [(round(100 * o.cost), o.total_m) for o in outcomes if not failed(spec, o)]
    return min(kept, default=None)


def drawn(seed: int, count: int) -> list[dict[str, Any]]:
    """Random specs with a limit on the error that some designs miss."""
    rng, found = random.Random(seed), []
    while len(found) < count:
        spec = draw_spec(rng)
        plain = Enumeration(spec)
        if not 4 <= plain.count <= 600:
            continue
        errors = sorted(o.total_m for o in plain if not failed(spec, o))
        if len(errors) < 2:
            continue
        limit = {
            "id": "A",
            "kind": "accuracy",
            "limit": f"{1.001 * errors[len(errors) // 3]:.6f} m",
        }
        spec["requirements"].append(limit)
        found.append(spec)
    return found


def test_the_best_design_with_an_entry_is_that_of_plain_enumeration() -> None:
    answers = kept_out = ruled_out = 0
    for spec in drawn(7, 4):
        plain = Enumeration(spec)
        outcomes = list(plain)
        first = best(spec, outcomes)
        assert first is not None
        named = {s for stage in spec["stages"] for r in ("position", "attitude", "ranging")
                 for s in stage.get(r, {}).get("candidates", [])}  # fmt: skip
        named |= {c for one in spec["stages"] for c in one.get("clock", {}).get("candidates", [])}
        named |= set(spec["timestamping"]["candidates"]) | {"timing_board"}
        for row in answers_of(spec, *sorted(named)):
            mine = [o for o in outcomes if row.entry in held(plain, o, row.kind)]
            expected = best(spec, mine)
            if isinstance(row, NotTaken):
                if row.code == "not-a-candidate" or not mine:
                    ruled_out += not mine
                    assert not mine
                else:
                    kept_out += 1
                    assert expected is None
                continue
            if not row.candidate:
                assert not mine
                continue
            assert expected is not None
            answers += 1
            assert row.best_with.cost == pytest.approx(expected[0] / 100, abs=1e-9)
            assert row.best_with.error_m == pytest.approx(expected[1], rel=1e-9)
            assert row.dearer_by == pytest.approx((expected[0] - first[0]) / 100, abs=1e-6)
            assert row.worse_by == pytest.approx(expected[1] - first[1], rel=1e-6, abs=1e-9)
            assert not row.in_design or (row.dearer_by, row.worse_by) == (0.0, 0.0)
    assert answers >= 15
    assert kept_out >= 3
    assert ruled_out >= 2


def test_what_would_be_if_it_were_a_candidate_is_that_of_the_spec_so_changed() -> None:
    compared = 0
    for spec in drawn(8, 2):
        for entry, role in (("trimble_r12_rtk", "position"), ("sbg_apogee", "attitude")):
            rows = [r for r in answers_of(spec, entry) if isinstance(r, HeldBack)]
            keys = []
            for stage in spec["stages"]:
                if role in stage and entry not in stage[role]["candidates"]:
                    changed = json.loads(json.dumps(spec))
                    at = spec["stages"].index(stage)
                    changed["stages"][at][role] = {"candidates": [entry]}
                    keys.append(best(changed, list(Enumeration(changed))))
            expected = min((key for key in keys if key is not None), default=None)
            if expected is None or any(row.candidate for row in rows):
                continue
            (row,) = rows
            compared += 1
            assert row.best_with.cost == pytest.approx(expected[0] / 100, abs=1e-9)
            assert row.best_with.error_m == pytest.approx(expected[1], rel=1e-9)
    assert compared >= 2


def test_the_requirement_in_the_way_is_named_with_both_figures() -> None:
    """ACC-1 of 40 cm: the least error with the poorer receiver, by enumeration, is above it."""
    spec = yaml.safe_load((SPECS / "position_track.yaml").read_text("utf-8"))
    role = spec["stages"][0]["position"]
    role["candidates"], role["timestamping"] = ["ublox_f9p_pvt", "ublox_f9p_rtk"], "hardware"
    role.pop("sensor", None)
    role.pop("primitive", None)
    spec["requirements"] = [{"id": "ACC-1", "kind": "accuracy", "limit": "5 cm"}]
    plain = [o for o in Enumeration(spec) if o.options[0].sensor == "ublox_f9p_pvt"]
    least = min(o.total_m for o in plain)
    assert least > 0.05
    found = optimize(case_of(spec), OptimizeSettings(why_not=("ublox_f9p_pvt",)))
    (row,) = found.result.why_not or ()
    assert isinstance(row, NotTaken)
    assert (row.code, row.limit) == ("accuracy", 0.05)
    assert row.figure == pytest.approx(least, rel=1e-12)
    assert "ACC-1: at best" in row.reason
    assert "Why not" in console(on_choice(found))


def said(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["optimize", str(SPECS / "position_track.yaml"), *words])
    return done.exit_code, done.output


def test_the_command_says_what_the_entry_says_and_what_is_asked(tmp_path: Path) -> None:
    out = tmp_path / "out.json"
    words = ("--why-not", "arrival_gnss_serial", "--why-not", "trimble_r12_rtk")
    assert said(*words, "-o", f"json:{out}", "-q")[0] == 0
    excluded, held_back = json.loads(out.read_text("utf-8"))["why_not"]
    assert set(excluded) >= {"entry", "code", "figure", "limit", "reason"}
    assert (excluded["code"], excluded["figure"] > excluded["limit"]) == ("accuracy", True)
    assert set(held_back) >= {"entry", "best_with", "dearer_by", "worse_by"}
    assert held_back["dearer_by"] > 0.0
    code, text = said("--why-not", "livox_mid36")
    assert code == 2
    assert "--why-not livox_mid36: no such entry in the catalogs; did you mean" in text


def test_a_spec_of_several_scenarios_is_not_answered_in_silence() -> None:
    spec = yaml.safe_load((SPECS / "position_track.yaml").read_text("utf-8"))
    spec["choose_for"] = "always"
    with pytest.raises(BadInput, match="answered for one mission at nominal figures"):
        optimize(case_of(spec), OptimizeSettings(why_not=("trimble_r12_rtk",)))
