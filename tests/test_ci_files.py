"""The CI integrations run as they stand: action, snippets of the guide, hook."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent
SCRIPTS = Path(sys.executable).parent
GUIDE = (ROOT / "docs" / "ci.md").read_text(encoding="utf-8")

pytestmark = pytest.mark.skipif(
    not (SCRIPTS / "syncline-design").exists(), reason="the package is not installed here"
)


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", GUIDE, re.DOTALL)


def snippet(language: str, holding: str) -> Any:
    return next(text for text in blocks(language) if holding in text)


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A user's repository: one spec that meets, one that cannot."""
    (tmp_path / "specs").mkdir()
    for name in ("position_track", "infeasible_example"):
        shutil.copy(ROOT / "specs" / f"{name}.yaml", tmp_path / "specs")
    return tmp_path


def run(command: list[str], folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    settings = {**os.environ, "PATH": f"{SCRIPTS}:{os.environ['PATH']}", **environment}
    return subprocess.run(
        command, cwd=folder, env=settings, capture_output=True, text=True, timeout=120, check=False
    )


def run_action(repository: Path, **inputs: str) -> tuple[int, str, Path]:
    """The action's own script, with the environment that GitHub gives it."""
    action = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    defaults = {k: str(v.get("default", "")) for k, v in action["inputs"].items()}
    step = next(s for s in action["runs"]["steps"] if s.get("id") == "check")
    given = {**defaults, **inputs}
    environment = {
        name: re.sub(r"\$\{\{ inputs\.([\w-]+) \}\}", lambda m: given[m[1]], text)
        for name, text in step["env"].items()
    }
    summary, output = repository / "summary.md", repository / "output.txt"
    done = run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]],
        repository, GITHUB_STEP_SUMMARY=str(summary), GITHUB_OUTPUT=str(output), **environment,
    )  # fmt: skip
    assert f"exit-code={done.returncode}" in output.read_text()
    return done.returncode, done.stdout, summary


def test_the_action_shows_the_failing_requirement_at_its_line(repository: Path) -> None:
    code, stdout, summary = run_action(repository, specs="specs")
    assert code == 1
    lines = (repository / "specs" / "infeasible_example.yaml").read_text().splitlines()
    at = next(i for i, line in enumerate(lines, 1) if "id: ACC-1" in line)
    errors = [line for line in stdout.splitlines() if line.startswith("::error ")]
    assert any(
        line.startswith(f"::error file=specs/infeasible_example.yaml,line={at},") for line in errors
    ), stdout
    assert all("file=specs/infeasible_example.yaml" in line for line in errors)
    reports = repository / "syncline-reports"
    log = json.loads((reports / "result.sarif").read_text())
    places = [r["locations"][0]["physicalLocation"] for r in log["runs"][0]["results"]]
    assert at in {place["region"]["startLine"] for place in places}
    assert ElementTree.parse(reports / "junit.xml").getroot().get("failures") != "0"
    assert (reports / "report.html").stat().st_size > 10_000
    assert summary.read_text() == (reports / "summary.md").read_text()


def test_the_action_passes_what_meets(repository: Path) -> None:
    code, stdout, _ = run_action(repository, specs="specs/position_track.yaml", args="--seed 3")
    assert code == 0
    assert "::error" not in stdout


GOOD, MISSED = "specs/position_track.yaml", "specs/infeasible_example.yaml"


@pytest.mark.parametrize(
    ("specs", "wanted"),
    [
        (f"{GOOD}\n{MISSED}\n", 1),
        (f"{MISSED}\n{GOOD}", 1),
        (f"\n  {GOOD}\t{GOOD}\r\n\r\n{GOOD}  {MISSED}\r\n", 1),
        (f"{GOOD}\nspecs/absent.yaml\n{MISSED}\n", 2),
        (f"{GOOD}\nspecs/*.yaml\n", 2),  # a name with a star in it, which is not there
        (f"{GOOD}\n\n{GOOD}\n", 0),
        (" \n\t\n", 2),
    ],
    ids=["two lines", "worst first", "blanks", "one absent", "no globbing", "good", "nothing"],
)
def test_the_action_checks_every_line_and_ends_with_the_worst_code(
    repository: Path, specs: str, wanted: int
) -> None:
    (repository / "syncline-reports").mkdir()
    (repository / "syncline-reports" / "summary.md").write_text("all is well")
    code, stdout, summary = run_action(repository, specs=specs, args="--seed\n2")
    assert code == wanted, stdout
    missed = f"::error file={MISSED},line=" in stdout
    assert missed == (MISSED in specs)
    assert not summary.exists() or "all is well" not in summary.read_text()


@pytest.mark.parametrize("args", ["--help", "--seed 2 --help"])
def test_arguments_that_give_no_verdict_do_not_pass(repository: Path, args: str) -> None:
    """`--help` ended with 0, and so did the step: nothing had been checked."""
    code, stdout, _ = run_action(repository, specs=MISSED, args=args)
    assert code == 2
    assert "::error::syncline-design: these arguments give no verdict" in stdout


def test_the_reports_may_have_any_name(repository: Path) -> None:
    code, _, summary = run_action(repository, specs=GOOD, reports="-n")
    assert code == 0
    assert summary.read_text() == (repository / "-n" / "summary.md").read_text()
    (repository / "nowhere").symlink_to(repository / "absent" / "deep")
    (repository / "taken").touch()
    for name in ("nowhere", "taken"):
        code, stdout, _ = run_action(repository, specs=GOOD, reports=name)
        assert code == 2
        assert "::error::syncline-design: the input `reports` is no folder" in stdout
    assert not (repository / "absent").exists()


def test_steps_import_nothing_that_the_environment_names(repository: Path) -> None:
    """A PYTHONPATH with an empty entry (`:src`) is the repository under check."""
    (repository / "sitecustomize.py").write_text("open('owned', 'w').close()\n")
    action = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    steps = [step for step in action["runs"]["steps"] if "run" in step]
    assert len(steps) == 2
    for step in steps:
        given = {"SPECS": GOOD, "ARGS": "", "REPORTS": "", "GITHUB_ACTION_PATH": "absent"}
        environment = {"PYTHONPATH": ".:"} | {
            name: given.get(name, text) for name, text in step["env"].items()
        }
        files = {name: str(repository / "log") for name in ("GITHUB_OUTPUT", "GITHUB_STEP_SUMMARY")}
        run(["bash", "-e", "-c", step["run"]], repository, **given | environment | files)
        assert not (repository / "owned").exists()


def test_the_installation_runs_nothing_of_the_repository_under_check(repository: Path) -> None:
    action = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    step = next(s for s in action["runs"]["steps"] if s.get("name") == "Install")
    for module in ("pip", "runpy", "pkgutil", "json", "typing", "sitecustomize"):
        (repository / f"{module}.py").write_text("open('owned', 'w').close()\n")
    absent = str(repository / "absent")  # nothing is installed: how pip is started is what counts
    done = run(["bash", "-e", "-c", step["run"]], repository, GITHUB_ACTION_PATH=absent)
    assert "absent" in done.stderr, done.stderr
    assert not (repository / "owned").exists()


def test_without_a_folder_for_reports_the_action_takes_its_own(repository: Path) -> None:
    code, _, _ = run_action(repository, specs=GOOD, reports="")
    assert code == 0
    assert (repository / "syncline-reports" / "result.sarif").exists()


def test_inputs_of_the_action_are_not_run(repository: Path) -> None:
    code, _, _ = run_action(repository, specs="$(touch owned) ; touch owned", args="`touch owned`")
    assert code == 2
    assert not (repository / "owned").exists()


def test_the_actions_of_the_guide_exist_in_the_action() -> None:
    action = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    workflow = yaml.safe_load(snippet("yaml", "OWNER/syncline-design@"))
    steps = workflow["jobs"]["check"]["steps"]
    used = next(step for step in steps if step["uses"].startswith("OWNER/"))
    assert set(used["with"]) <= set(action["inputs"])
    sarif = next(s["with"]["sarif_file"] for s in steps if "upload-sarif" in s["uses"])
    assert sarif == f"{action['inputs']['reports']['default']}/result.sarif"


def test_the_gitlab_snippet_runs(repository: Path) -> None:
    job = yaml.safe_load(snippet("yaml", ".gitlab-ci.yml"))["specs"]
    install, check = job["script"]
    assert install.startswith("pip install")  # `python -m pip` would run a pip.py of the repository
    done = run(["bash", "-c", check], repository)
    assert done.returncode == 1, done.stderr
    junit = ElementTree.parse(repository / job["artifacts"]["reports"]["junit"]).getroot()
    assert len(junit.findall("testsuite")) == 2
    assert all((repository / path).exists() for path in job["artifacts"]["paths"])


def test_the_hook_runs_on_the_files_it_names(repository: Path) -> None:
    [hook] = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))
    config = yaml.safe_load(snippet("yaml", ".pre-commit-config.yaml"))
    assert config["repos"][0]["hooks"][0]["id"] == hook["id"]
    staged = [
        f"specs/{p.name}" for p in sorted((repository / "specs").iterdir())
        if re.search(hook["files"], f"specs/{p.name}")
    ]  # fmt: skip
    assert len(staged) == 2
    entry = shlex.split(hook["entry"])
    assert run([*entry, *staged], repository).returncode == 1
    assert run([*entry, "specs/position_track.yaml"], repository).returncode == 0


def test_the_single_step_of_the_guide_runs(repository: Path) -> None:
    [command] = [b for b in blocks("sh") if "--output github:-" in b]
    done = run(["bash", "-c", command], repository)
    assert done.returncode == 1
    assert "::error file=specs/infeasible_example.yaml,line=" in done.stdout
    assert (repository / "result.sarif").exists()


def test_the_diff_of_the_guide_runs(repository: Path) -> None:
    shutil.copy(ROOT / "specs" / "uav_corridor.yaml", repository / "specs")
    command = next(b for b in blocks("sh") if "syncline-design diff" in b).splitlines()[1]
    before = repository / "before.yaml"
    shutil.copy(ROOT / "specs" / "uav_corridor.yaml", before)
    spec = repository / "specs" / "uav_corridor.yaml"
    spec.write_text(spec.read_text().replace("limit: 0.30 m", "limit: 0.35 m"), encoding="utf-8")
    done = run(["bash", "-c", command], repository)
    assert done.returncode == 0, done.stderr
    assert "ACC-1" in (repository / "diff.md").read_text()
    assert "0.30 m to 0.35 m" in done.stdout
