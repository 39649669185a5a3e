"""`check --explain ID`: every line is arithmetic that gives its value, the last the verdict's."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from typer.testing import CliRunner

from syncline_design.cli.app import app
from syncline_design.spec.load import load
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import CheckSettings, check_loaded

SPECS = Path(__file__).parent.parent / "specs"
MEETING = [
    "uav_corridor", "usv_mapping", "subsea_survey_large_sv", "position_track", "rov_relay",
    "car_mapping", "multirotor_inspection", "usv_wire_missing",
]  # fmt: skip
ARITHMETIC = {"sqrt": math.sqrt, "max": max, "abs": abs, "__builtins__": {}}


def worked_out(name: str) -> Verdict:
    case = load(SPECS / f"{name}.yaml")
    ids = (*(one.id for one in case.spec.requirements), "SYNC")
    return check_loaded(case, CheckSettings(monte_carlo=False, explain=ids))


@pytest.mark.parametrize("name", MEETING)
def test_every_line_of_a_shipped_spec_gives_its_value(name: str) -> None:
    """Python as the calculator: names are earlier lines, the last one is what is required."""
    verdict = worked_out(name)
    assert verdict.explained is not None
    values = {row.id: row.value for row in verdict.requirements}
    assert {"accuracy", "sync"} <= {one.kind for one in verdict.explained}
    for one in verdict.explained:
        known: dict[str, float] = {}
        for step in one.steps:
            value = eval(step.numbers, dict(ARITHMETIC), dict(known))
            assert value == pytest.approx(step.value, rel=1e-12, abs=1e-300), step
            known[step.name] = value
        if values[one.id] is not None:
            assert known[one.steps[-1].name] == pytest.approx(values[one.id], rel=1e-12)


def test_lines_lead_down_to_a_source() -> None:
    verdict = worked_out("uav_corridor")
    steps = [step for one in verdict.explained or () for step in one.steps]
    sources = {one.source for one in verdict.sources or ()}
    for name in ("sigma_p_uav", "sigma_Theta_d_uav", "sigma_r_uav", "tau_position_uav"):
        step = next(one for one in steps if one.name == name)
        assert any(source in step.source for source in sources)


def test_text_and_json_of_the_command(tmp_path: Path) -> None:
    path = tmp_path / "v.json"
    spec = str(SPECS / "position_track.yaml")
    done = CliRunner().invoke(app, ["check", spec, "--explain", "ACC-1", "-o", f"json:{path}"])
    assert "Worked out" in done.stdout
    (one,) = json.loads(path.read_text())["explained"]
    assert one["id"] == "ACC-1"
    for step in one["steps"]:
        assert step["name"] in done.stdout


def test_an_unknown_requirement_is_refused() -> None:
    spec = str(SPECS / "position_track.yaml")
    done = CliRunner().invoke(app, ["check", spec, "--explain", "ACC-9"])
    assert done.exit_code == 2
    assert "ACC-9" in done.stderr
    assert "ACC-1" in done.stderr
