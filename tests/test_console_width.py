"""What a command prints fits the terminal, whatever its width, and says the same."""

from __future__ import annotations

import functools
import io
from pathlib import Path

import pytest
from typer.testing import CliRunner

from syncline_design.cli.app import app
from syncline_design.report import render_console
from syncline_design.report.console_table import fitted, folded
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.table import Cell, table
from syncline_design.spec.catalog import SECTIONS
from syncline_design.spec.load import builtin_collection
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import CheckSettings
from tests.checked import check_file

ROOT = Path(__file__).resolve().parent.parent
SPECS = ("usv_wire_missing", "infeasible_example", "position_track")
WIDTHS = (40, 60, 80, 100, 160)


@functools.cache
def verdict_of(name: str) -> Verdict:
    return check_file(ROOT / "specs" / f"{name}.yaml", CheckSettings(monte_carlo=False))


def said(name: str, width: int, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("COLUMNS", str(width))
    return render_console.console(on_verdict(verdict_of(name)), colour=False)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", SPECS)
def test_no_line_is_wider_than_the_terminal(
    name: str, width: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for line in said(name, width, monkeypatch).splitlines():
        words = line.split()
        # only a word that fits in no line, a path for instance, may stand out
        assert len(line) <= width or max(map(len, words)) + len(line) - len(line.lstrip()) > 28


@pytest.mark.parametrize("name", SPECS)
def test_every_word_is_said_at_every_width(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    wide = set(said(name, 400, monkeypatch).split())
    first_heads = {
        "Requirement",
        "Role",
        "Stage",
        "Figure",
        "Model",
        "Term",
        "Sensor",
        "Option",
        "Design",
    }
    for width in WIDTHS:
        narrow = said(name, width, monkeypatch)
        # rows that became records name themselves without the first head
        heads = {word for word in wide if word + ":" in narrow}
        assert wide - set(narrow.split()) <= {"\u2014", *first_heads} | heads


def test_without_a_terminal_there_are_80_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("COLUMNS")
    monkeypatch.setattr("sys.__stdout__", None)
    assert render_console.columns() == 80
    monkeypatch.setenv("COLUMNS", "7")
    assert render_console.columns() == 40


def test_columns_give_way_at_words_and_figures_stay_with_their_units() -> None:
    shown = table(
        "T", ("Name", "Value #", "What it says"),
        [("one two", "12.5\u00a0mm", "a b c d e f"), ("three", "7\u00a0m", "g")],
    )  # fmt: skip
    assert list(fitted(shown, 40)) == [
        "Name       Value  What it says",
        "one two  12.5 mm  a b c d e f",
        "three        7 m  g",
    ]
    assert list(fitted(shown, 25)) == [
        "Name       Value  What it",
        "                  says",
        "one two  12.5 mm  a b c d",
        "                  e f",
        "three        7 m  g",
    ]
    assert list(fitted(shown, 18)) == [
        "one two",
        "  Value: 12.5 mm",
        "  What it says: a",
        "    b c d e f",
        "three",
        "  Value: 7 m",
        "  What it says: g",
    ]


def test_rows_become_records_where_those_take_fewer_lines() -> None:
    """A sentence in a column as wide as its longest word: a dozen lines a row."""
    why = "chosen for least cost of the whole design; 8 options ruled out before"
    shown = table(
        "T", ("Role", "Sensor", "Primitive", "Timestamping", "Timeline", "Cost #", "Why"),
        [("uav position", "u-blox F9P", "1PPS input", "Interrupt on a Linux GPIO", "host clock",
          "32 020.00 EUR".replace(" ", "\u00a0"), why)] * 3,
    )  # fmt: skip
    lines = list(fitted(shown, 78))
    assert len(lines) == 3 * len(shown.heads)
    assert max(map(len, lines)) == len(f"  Why: {why}")
    assert next(fitted(shown, 200)).split()[0] == "Role"
    assert len(list(fitted(shown, 200))) == 4


def test_a_record_that_a_bare_number_heads_says_of_what() -> None:
    shown = table("T", ("Case #", "Unbreakable-heading"), [("12", "yes"), ("x1", "no")])
    lines = list(fitted(shown, 20))
    assert [line for line in lines if not line.startswith(" ")] == ["Case 12", "x1"]


def test_a_word_longer_than_the_line_is_not_broken() -> None:
    assert folded("see /a/very/long/path.yaml now", 10) == ["see", "/a/very/long/path.yaml", "now"]


def test_a_name_that_no_column_holds_goes_on_after_one_of_its_joints() -> None:
    long = "Survey_aircraft_with_quite_a_long_name_for_any_table"
    shown = table("T", ("Term", "Stage", "Value #"), [("noise of positions", long, "12.5 mm")] * 9)
    lines = list(fitted(shown, 60))
    assert max(map(len, lines)) <= 60
    parts = [word for line in lines[1:3] for word in line.split() if "_" in word]
    assert "".join(parts) == long
    assert parts[0].endswith("_")
    assert max(map(len, fitted(table("T", ("A", "B"), [("x" * 90, "y")]), 40))) <= 40


@functools.cache
def catalog_words(*arguments: str) -> str:
    """What a command on the catalogs prints where nothing has to give way."""
    return said_of_catalogs(4000, *arguments)


def said_of_catalogs(width: int, *arguments: str) -> str:
    done = CliRunner().invoke(app, ["catalog", *arguments], env={"COLUMNS": str(width)})
    assert done.exit_code == 0
    return done.stdout


@pytest.mark.parametrize("width", WIDTHS)
def test_catalogs_fit_the_terminal_and_say_the_same(width: int) -> None:
    """But for an address or a path that no line holds, which stands alone to be copied."""
    catalog = builtin_collection().catalog()
    shown = [one for section in SECTIONS for one in getattr(catalog, section)]
    asked = [("list",), ("list", "--reach", "200 m"), *(("show", one) for one in shown[::7])]
    for arguments in [*asked, ("show", "sbg_apogee"), ("show", "riegl_vux1uav")]:
        narrow = said_of_catalogs(width, *arguments)
        assert set(catalog_words(*arguments).split()) <= {
            *narrow.replace(":", "").split(), *narrow.split(), "Figure", "Value", "Basis"
        }  # fmt: skip
        for line in narrow.splitlines():
            assert len(line) <= width or len(line.split()) == 1, line
            assert len(line) <= width or "/" in line, line


def test_a_search_through_the_catalogs_finds_ids_with_their_names() -> None:
    catalog = builtin_collection().catalog()
    lines = said_of_catalogs(80, "list").splitlines()
    for section in SECTIONS:
        for identity, entry in getattr(catalog, section).items():
            found = [one for one in lines if one.startswith(f"  {identity}  ")]
            assert any(entry.name.split()[0] in line for line in found)


@pytest.mark.parametrize(
    ("environment", "terminal", "coloured"),
    [
        ({}, True, True),
        ({}, False, False),
        ({"NO_COLOR": "1"}, True, False),
        ({"NO_COLOR": ""}, True, True),
        ({"FORCE_COLOR": "1"}, False, True),
        ({"FORCE_COLOR": ""}, False, False),
        ({"FORCE_COLOR": "1", "NO_COLOR": "1"}, False, False),
        ({"TERM": "dumb"}, True, False),
        ({"TERM": "dumb", "FORCE_COLOR": "1"}, True, True),
    ],
)
def test_colours_are_where_they_can_be_shown_or_are_asked_for(
    monkeypatch: pytest.MonkeyPatch, environment: dict[str, str], terminal: bool, coloured: bool
) -> None:
    """Rules of no-color.org and force-color.org: what is empty says nothing."""
    for name in ("NO_COLOR", "FORCE_COLOR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    stream = io.StringIO()
    monkeypatch.setattr(stream, "isatty", lambda: terminal)
    monkeypatch.setattr("sys.stdout", stream)
    text = render_console.console(on_verdict(verdict_of("infeasible_example")))
    assert ("\x1b[31m" in text, "\x1b[" in text) == (coloured, coloured)


def test_a_symbol_stays_with_its_first_word() -> None:
    rows = [[Cell("10", 10, mark="+"), "a file of a name that needs all the room there is"]]
    lines = [line.rstrip() for line in fitted(table("", ("Run", "File"), rows), 30)]
    assert any(line.startswith("+ 10") for line in lines), lines
