"""The page that follows a fault from a log to its repair prints what its commands print."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from syncline_design.cli.app import app

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "loop.md"
BLOCK = re.compile(r"(?:<!-- exit code: (?P<code>\d) -->\n\n)?```(?P<kind>sh|text)\n(?P<body>.*?)```", re.S)  # fmt: skip  # noqa: E501
LATENCY_S = 0.087  # what tests/world hid in the first log


def _printed(line: str) -> tuple[str, int]:
    """What one line of the page prints, and what it ends with."""
    if not line.startswith("syncline-design "):
        done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=False)
        return done.stdout, done.returncode
    wanted = shlex.split(line)[1:]
    if wanted[0] == "diagnose":  # its figures as data too, for the test below
        wanted += ["--output", "json:found.json"]
    done = CliRunner().invoke(app, wanted)
    return done.stderr + done.stdout, done.exit_code


def _in_order(lines: list[str], printed: str) -> str | None:
    """The first of these lines that does not follow those before it in what was printed."""
    rest = iter([line.rstrip().replace("\u00a0", " ") for line in printed.splitlines()])
    return next((line for line in lines if line.rstrip() not in rest), None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the page was followed, every line of it compared."""
    place = tmp_path_factory.mktemp("loop")
    (place / "examples").symlink_to(ROOT / "examples")
    printed = ""
    with pytest.MonkeyPatch.context() as patched:
        patched.chdir(place)
        patched.setitem(os.environ, "COLUMNS", "80")
        for block in BLOCK.finditer(PAGE.read_text("utf-8")):
            lines = block["body"].splitlines()
            if block["kind"] == "sh":
                ran = [_printed(line) for line in lines]
                printed = "\n".join(text for text, _ in ran)
                assert [code for _, code in ran] == [int(block["code"] or 0)] * len(lines), printed
            else:
                assert _in_order(lines, printed) is None, printed
    return place


def test_the_first_log_tells_what_was_hidden_in_it(folder: Path) -> None:
    document = json.loads((folder / "found.json").read_text("utf-8"))
    assert document["verdict"] == "explained"
    (finding,) = document["findings"]
    assert (finding["effect"], finding["sensor"]) == ("latency", "position")
    found = finding["parameters"]["latency_s"]
    assert abs(found["value"] - LATENCY_S) < 5.0 * found["standard_uncertainty"]
    assert found["standard_uncertainty"] < 0.5e-3
    assert document["gap"]["closed_fraction"] > 0.95


def test_every_step_of_the_loop_is_on_the_page() -> None:
    page = PAGE.read_text("utf-8")
    commands = re.findall(r"^syncline-design (\w+)", page, re.M)
    assert commands == ["check", "audit", "diagnose", "check", "audit", "accept"]


def test_lines_out_of_order_or_altered_are_seen() -> None:
    printed = "one\ntwo \nthree\n"
    assert _in_order(["one", "three"], printed) is None
    assert _in_order(["three", "one"], printed) == "one"
    assert _in_order(["two", "thre"], printed) == "thre"
