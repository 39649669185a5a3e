"""Why an entry is not in the design, against plain enumeration of every design that holds it."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from plain_enumeration import Enumeration
from questions_oracle import answers_of, best, case_of, compare_why_not, drawn
from syncline_design.cli.app import app
from syncline_design.report.on_choice import on_choice
from syncline_design.report.render_console import console
from syncline_design.verdict.optimize import OptimizeSettings, optimize
from syncline_design.verdict.why_not import HeldBack, NotTaken

SPECS = Path(__file__).parent.parent / "specs"


def test_the_best_design_with_an_entry_is_that_of_plain_enumeration() -> None:
    seen = sum((compare_why_not(spec) for spec in drawn(7, 4)), Counter[str]())
    assert seen["best with"] >= 15
    assert seen["kept out"] >= 2
    assert seen["ruled out"] >= 2


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


def test_choosing_for_all_figures_answers_as_one_mission_where_none_is_an_interval() -> None:
    spec = yaml.safe_load((SPECS / "position_track.yaml").read_text("utf-8"))
    asked = OptimizeSettings(why_not=("trimble_r12_rtk", "arrival_gnss_serial"))
    plain = optimize(case_of(spec), asked).result.why_not
    found = optimize(case_of(spec | {"choose_for": "always"}), asked).result.why_not
    assert plain is not None
    assert found is not None
    assert [type(one) for one in found] == [type(one) for one in plain]
    for one, other in zip(found, plain, strict=True):
        if isinstance(one, HeldBack) and isinstance(other, HeldBack):
            assert one.dearer_by == other.dearer_by
            assert one.worse_by == pytest.approx(other.worse_by, rel=1e-9)
        elif isinstance(one, NotTaken) and isinstance(other, NotTaken):
            assert (one.code, one.limit) == (other.code, other.limit)
            assert one.figure == pytest.approx(other.figure, rel=1e-9)
