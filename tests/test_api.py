"""The functions of the package: lazy, never hidden by a package, the same as the commands."""

from __future__ import annotations

import inspect
import json
import pkgutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from typer.testing import CliRunner

import syncline_design as sd
from syncline_design.cli.app import app
from tests.world import hidden, make_log, scenario

SPECS = Path(__file__).parent.parent / "specs"
SPEC = SPECS / "position_track.yaml"
FUNCTIONS = (
    "accept",
    "audit",
    "check",
    "diagnose",
    "diff",
    "load",
    "optimize",
    "plan",
    "reproduce",
    "simulate",
    "study",
    "timing",
    "watch",
)


def printed(*words: str) -> object:
    """The JSON of a command."""
    return json.loads(CliRunner().invoke(app, [*words, "--output", "json:-"]).stdout)


def test_importing_the_package_imports_nothing_else() -> None:
    code = (
        "import sys; before = set(sys.modules); import syncline_design; "
        "print(sorted(set(sys.modules) - before))"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "['syncline_design']"


def test_no_package_hides_a_function() -> None:
    """A folder `check/` would: importing it sets the attribute of that name."""
    code = (
        "import pkgutil, syncline_design as sd\n"
        "for found in pkgutil.iter_modules(sd.__path__):\n"
        "    if found.name != '__main__': __import__(f'syncline_design.{found.name}')\n"
        f"assert all(callable(getattr(sd, name)) for name in {FUNCTIONS})\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    assert not {found.name for found in pkgutil.iter_modules(sd.__path__)} & set(sd.__all__)
    import_module("syncline_design.choice")
    assert inspect.isfunction(sd.check)


def test_the_names_are_those_of_the_api_and_of_the_commands() -> None:
    from syncline_design import api

    assert set(sd.__all__) - {"__version__"} == set(api.__all__)
    assert set(sd.__all__) <= set(dir(sd))
    commands = {command.name for command in app.registered_commands}
    assert commands - {"schema", "init"} | {"load"} == set(FUNCTIONS)
    with pytest.raises(AttributeError, match="no attribute 'chekc'"):
        sd.chekc  # noqa: B018


@pytest.mark.parametrize("name", [n for n in FUNCTIONS if n != "load"])
def test_every_function_takes_one_seed_and_one_time_limit(name: str) -> None:
    parameters = inspect.signature(getattr(sd, name)).parameters
    assert parameters["seed"].default == 0
    assert parameters["time_limit_s"].default is None


def test_a_path_a_text_and_a_case_give_the_verdict_that_check_prints() -> None:
    wanted = printed("check", str(SPEC), "--seed", "3")
    case = sd.load(SPEC)
    for spec in (SPEC, str(SPEC), case):
        assert json.loads(_json(sd.check(spec, seed=3))) == wanted


def test_the_others_give_what_their_commands_print(tmp_path: Path) -> None:
    spec = str(SPEC)
    pairs = (
        (sd.simulate(spec, samples=2000), ("simulate", spec, "--samples", "2000")),
        (sd.diff(spec, spec), ("diff", spec, spec)),
    )
    for found, words in pairs:
        assert json.loads(_json(found)) == printed(*words)
    best = printed("optimize", spec, "--best", "2")
    assert isinstance(best, dict)
    assert len(sd.optimize(spec, best=2).designs) == len(best["designs"]) > 0


def test_diagnose_and_study_and_reproduce_are_the_engines(tmp_path: Path) -> None:
    late = hidden("latency", "position", latency_s=0.06)
    made = make_log(scenario("multirotor_lines", 31, 60.0, 5.0), (late,))
    (tmp_path / "late.yaml").write_text(made.spec_yaml(), "utf-8")
    logs = [made.to_csv(tmp_path / "late.csv")]
    found = sd.diagnose(tmp_path / "late.yaml", logs, max_effects=1)
    assert [one["effect"] for one in found.to_json()["findings"]] == ["latency"]
    (tmp_path / "base.yaml").write_bytes(SPEC.read_bytes())
    study = tmp_path / "study.yaml"
    study.write_text(
        "study: 1\nname: x\nbase: [base.yaml]\ncheck: {monte_carlo: false}\n"
        'grid: {"requirements[0].limit": [0.2 m, 0.3 m]}\n',
        "utf-8",
    )
    done = sd.study(study, workers=1)
    assert len(list(done.cases())) == 2
    assert json.loads(_json(done)) == printed("study", str(study))
    assert sd.reproduce().ok


def test_out_of_time_and_bad_input_have_names() -> None:
    with pytest.raises(sd.OutOfTime):
        sd.reproduce(time_limit_s=0.0)
    with pytest.raises(sd.BadInput):
        sd.check(SPECS / "there_is_none.yaml")
    assert issubclass(sd.OutOfTime, sd.NoVerdict)


def _json(found: object) -> str:
    from syncline_design.report.json_out import json_text

    return json_text(found.to_json() if hasattr(found, "to_json") else found)
