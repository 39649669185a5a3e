"""Habits of a shell: completion, as a bash asks for it, and an example below every help."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from syncline_design.cli import completions
from syncline_design.cli.app import EXAMPLES, app
from syncline_design.effects import registry
from syncline_design.spec.catalog import SECTIONS
from syncline_design.spec.load import builtin_collection

SCRIPT = """\
eval "$(_SYNCLINE_DESIGN_COMPLETE=source_bash syncline-design)"
COMP_WORDS=({words}) COMP_CWORD={last}
_syncline_design_completion syncline-design
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash on this machine")
@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ("ch", {"check"}),
        ("schema aud", {"audit"}),
        ("catalog show velodyne_h", {"velodyne_hdl32e"}),
        ("catalog list se", {"sensors"}),
        ("catalog list --modality r", {"ranging"}),
        ("catalog list --medium w", {"water"}),
        ("catalog add --from-template lid", {"lidar", "lidar_2d"}),
        ("optimize specs/x.yaml --road mi", {"milp"}),
        ("check specs/x.yaml -o ju", {"junit:"}),
        ("optimize specs/x.yaml --why-not velodyne_h", {"velodyne_hdl32e"}),
        ("plan specs/x.yaml --reach laten", {"latency("}),
    ],
)
def test_bash_completes(tmp_path: Path, words: str, wanted: set[str]) -> None:
    command = tmp_path / "syncline-design"
    command.write_text(f'#!/bin/sh\nexec {sys.executable} -P -m syncline_design "$@"\n', "utf-8")
    command.chmod(0o755)
    given = ["syncline-design", *words.split()]
    script = SCRIPT.format(words=" ".join(given), last=len(given) - 1)
    path = {**os.environ, "PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(["bash", "-c", script], env=path, capture_output=True, text=True,
                          timeout=120, check=True)  # fmt: skip
    assert set(done.stdout.split()) == wanted
    assert done.stderr == ""


def test_names_are_those_of_catalogs_and_effects() -> None:
    """What is quick to list is what there is."""
    catalog = builtin_collection().catalog()
    every = {name for section in SECTIONS for name in getattr(catalog, section)}
    assert set(completions.catalog_ids()) == every
    assert set(completions.catalog_sections()) == set(SECTIONS)
    assert completions.effect_names() == sorted(registry())


def test_the_effects_of_a_plan_go_on_term_by_term() -> None:
    typed = "latency(position)=1 ms, lever_arm(att"
    assert completions.effect_terms(typed) == ["latency(position)=1 ms, lever_arm(attitude)="]
    assert "latency(position)=1 ms, lever_arm(" in completions.effect_terms(typed[:-5])


def test_names_are_offered_without_loading_what_computes() -> None:
    """An answer to Tab: numpy, catalogs and effects took three times as long as all the rest."""
    asked = "import sys; from syncline_design.cli.completions import catalog_ids, effect_terms; "
    asked += "catalog_ids(); effect_terms(''); print('numpy' in sys.modules, 'yaml' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_one_line_on_any_terminal(name: str) -> None:
    """So what is copied from a help is the whole call; a terminal alone shows it in several."""
    shown = CliRunner().invoke(app, [*name.split(), "--help"], env={"COLUMNS": "80"}).output
    assert f" Example: syncline-design {name} {EXAMPLES[name]}\n" in shown


def test_a_command_without_pages_does_not_speak_of_them() -> None:
    for name, has_pages in {"catalog show": False, "catalog list": False, "check": True}.items():
        shown = CliRunner().invoke(app, [*name.split(), "--help"], env={"COLUMNS": "200"}).output
        assert ("html" in shown) is has_pages


ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_example_of_a_help_is_a_call_of_its_command(name: str) -> None:
    """It is printed, its words are taken as they stand, and the repository's files are there."""
    shown = CliRunner().invoke(app, [*name.split(), "--help"], env={"COLUMNS": "200"}).output
    assert f"syncline-design {name} {EXAMPLES[name]}" in " ".join(shown.split())
    words = shlex.split(EXAMPLES[name])
    command: Any = typer.main.get_command(app)
    for part in name.split():
        command = command.commands[part]
    command.make_context(name, words)  # refuses what it does not know
    for word in words:
        if re.match(r"(specs|examples)/", word):
            assert (ROOT / word).is_file()


@pytest.mark.parametrize("group", ["", "catalog", "log"])
def test_the_help_of_a_group_ends_with_an_example_of_one_of_its_commands(group: str) -> None:
    shown = CliRunner().invoke(app, [*group.split(), "--help"], env={"COLUMNS": "80"}).output
    told = (
        shown.rstrip().splitlines()[-1].removeprefix(f" Example: syncline-design {group}".rstrip())
    )
    name, _, words = told.strip().partition(" ")
    assert EXAMPLES[f"{group} {name}".strip()] == words
