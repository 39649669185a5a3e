"""What every command promises of `--output`, `--seed` and `--help`."""

from __future__ import annotations

import json
import re
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import cast

import pytest
from typer import Typer
from typer.testing import CliRunner

import command as commands
from syncline_design.cli.app import app, called, each_output

ROOT = Path(__file__).resolve().parent.parent
TRACK, USV = "specs/position_track.yaml", "specs/usv_mapping.yaml"
# command -> arguments that make it run, and the formats that its page in docs/ promises
COMMANDS = {
    "check": (
        [TRACK], {"json", "html", "junit", "sarif", "github", "markdown", "csv", "bill"},
    ),
    "optimize": ([TRACK], {"json", "html", "csv"}),
    "simulate": ([TRACK, "--samples", "500"], {"json", "html", "csv"}),
    "diagnose": ([TRACK, "x.csv"], {"json", "html", "markdown"}),
    "study": (["specs/studies/usv_speed.yaml"], {"csv", "parquet", "json", "html", "junit",
                                                 "sarif", "github", "markdown"}),
    "diff": ([TRACK, TRACK], {"json", "html", "markdown", "github"}),
    "reproduce": ([], {"json", "html"}),
    "audit": (["x.csv"], {"json", "html", "markdown"}),
    "timing": (["x.csv"], {"json", "html", "markdown"}),
    "watch": (["x.jsonl", TRACK, "x.csv"], {"json", "html", "markdown"}),
    "plan": ([USV], {"json", "html", "markdown", "csv", "kml", "qgc"}),
}  # fmt: skip


def run(*arguments: str, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    return commands.run(*arguments, cwd=cwd, environment={"NO_COLOR": "1", "COLUMNS": "200"})


@pytest.mark.parametrize("command", COMMANDS)
def test_help_names_the_formats_and_the_options_of_every_command(command: str) -> None:
    help_text = run(command, "--help").stdout
    for option in ("--output", "--seed", "--quiet"):
        assert option in help_text
    listed = re.search(r"formats: ([a-z, ]+);", help_text)
    assert listed is not None, help_text
    figures = set() if command == "diff" else {"svg", "png"}  # nothing is drawn of a difference
    assert set(listed[1].split(", ")) == COMMANDS[command][1] | figures


@pytest.mark.parametrize("command", COMMANDS)
def test_a_page_without_a_path_never_takes_the_place_of_another_file(
    tmp_path: Path, command: str
) -> None:
    """Its name is that of what is read first, and the command's; before anything is computed."""
    given = [str(ROOT / word) if "." in word else word for word in COMMANDS[command][0]]
    page = tmp_path / "-".join([*(Path(word).stem for word in given[:1]), f"{command}.html"])
    page.write_text("mine", encoding="utf-8")
    done = run(command, *given, "-o", "html", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"{page.name} exists" in done.stderr
    assert page.read_text(encoding="utf-8") == "mine"


def test_a_page_without_a_path_says_where_it_went(tmp_path: Path) -> None:
    for _ in range(2):  # the second takes the place of the first
        done = run("check", str(ROOT / TRACK), "-o", "html", cwd=tmp_path)
        assert done.returncode == 0
        assert "written to position_track-check.html" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["position_track-check.html"]


def test_text_formats_without_a_path_still_go_to_standard_output(tmp_path: Path) -> None:
    done = run("check", TRACK, "-o", "json")
    assert done.returncode == 0
    assert json.loads(done.stdout)["verdict"] == "meets"
    (tmp_path / "usv_speed-study.parquet").write_bytes(b"mine")
    table = run("study", str(ROOT / "specs/studies/usv_speed.yaml"), "-o", "parquet", cwd=tmp_path)
    assert table.returncode == 2
    assert "usv_speed-study.parquet exists" in table.stderr


class Rows(HTMLParser):
    """The cells of every table row of a page, as text."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.open = False

    def handle_starttag(self, tag: str, _: object) -> None:
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th") and self.rows:
            self.rows[-1].append("")
            self.open = True

    def handle_endtag(self, tag: str) -> None:
        if tag in ("td", "th"):
            self.open = False

    def handle_data(self, data: str) -> None:
        if self.open and self.rows and self.rows[-1]:
            self.rows[-1][-1] += data


def test_the_page_of_a_difference_says_what_its_data_say(tmp_path: Path) -> None:
    page, data = tmp_path / "d.html", tmp_path / "d.json"
    done = run("diff", USV, TRACK, "-o", f"html:{page}", "-o", f"json:{data}")
    told = json.loads(data.read_text("utf-8"))
    assert done.returncode == told["exit_code"] == 0
    text = page.read_text("utf-8")
    rows = Rows()
    rows.feed(text)
    cells = {row[0].strip(): [" ".join(cell.split()) for cell in row] for row in rows.rows if row}
    assert "default-src 'none'" in text.replace("&#39;", "'")
    cost = next(entry for entry in told["sums"] if entry["name"] == "cost")
    figures = [float(re.sub(r"[^\d.]", "", c.replace("EUR", ""))) for c in cells["cost"][1:]]
    assert figures == pytest.approx([cost["old"], cost["new"], abs(cost["change"])], abs=0.006)
    assert cells["cost"][3].startswith("\u2212")
    for entry in told["payload"]:
        assert entry["role"] in cells
    assert {entry["id"] for entry in told["requirements"]} <= set(cells)


def test_reproduce_takes_a_seed_and_says_it() -> None:
    runs = [json.loads(run("reproduce", "--seed", seed, "-o", "json:-").stdout) for seed in "07"]
    assert [one["seed"] for one in runs] == [0, 7]
    assert runs[0]["cells"] == runs[1]["cells"]  # printed figures know no chance
    worst = [
        [point["worst_case_m"] for figure in one["figures"] for point in figure["simulated"]]
        for one in runs
    ]
    assert worst[0] == pytest.approx(worst[1], rel=1e-3)


def test_no_page_installs_from_an_index_that_does_not_have_it() -> None:
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
        for line in page.read_text("utf-8").splitlines():
            if "pip install" in line:
                assert re.search(r"install (--\S+ |-\S+ )*['\"]?(\.|git\+)", line), (page, line)


def test_a_command_alone_is_the_command_among_all() -> None:
    runner = CliRunner()
    commands = [[str(one.name)] for one in app.registered_commands]
    commands += [
        [str(group.name), str(one.name)]
        for group in app.registered_groups
        for one in cast(Typer, group.typer_instance).registered_commands
    ]
    assert len(commands) > 15
    for arguments in [*commands, ["catalog"], ["log"]]:
        alone, among = (
            runner.invoke(one, [*arguments, "--help"]) for one in (called(arguments), app)
        )
        assert alone.output == among.output
    for arguments in ([], ["--version"], ["chek"], ["--", "check"]):
        assert called(arguments) is app


@pytest.mark.parametrize(
    ("given", "meant"),
    [("a.yaml -o svg:a png:b -q", "a.yaml -o svg:a -o png:b -q"),
     ("--output=svg:a png:b a.yaml", "--output=svg:a -o png:b a.yaml"),
     ("-ojson html:b sarif:c", "-ojson -o html:b -o sarif:c"),
     ("-o json a.yaml html:b", "-o json a.yaml html:b"),
     ("json:a -o html", "json:a -o html"), ("-o html:a b:c", "-o html:a b:c"), ("", "")],
)  # fmt: skip
def test_one_option_takes_several_outputs(given: str, meant: str) -> None:
    assert each_output(given.split()) == meant.split()


def test_a_file_that_is_there_is_no_output(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("png:b").write_text("a log with a strange name")
    assert each_output(["-o", "svg:a", "png:b"]) == ["-o", "svg:a", "png:b"]
