"""One document through every renderer: what stands where, and no text that does more than stand."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING
from unittest.mock import ANY

import pytest

from html_page import Page
from report_samples import HOSTILE
from syncline_design.report import document as d
from syncline_design.report import svg
from syncline_design.report.render_console import WIDTH, console
from syncline_design.report.render_html import html
from syncline_design.report.render_markdown import markdown
from syncline_design.report.svg import InlineChart, LogBox, add_axes, draw
from syncline_design.report.table import Cell, table
from syncline_design.report.text import visible

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def drawing() -> InlineChart:
    box = LogBox(0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0)
    return InlineChart('<svg xmlns="http://www.w3.org/2000/svg"><title>drawn</title></svg>', box)


def not_drawn() -> InlineChart:
    raise AssertionError("only a page draws")


def every_node(text: str, draw: Callable[[], InlineChart] = drawing) -> d.Document:
    """A document with the text wherever a document takes one."""
    words = (text, d.code(text), d.strong(text), d.muted(text), d.given(text))
    rows = [[Cell(text, 1.0, "good", "*", code=True, sub=text), Cell("2", 2.0)], [text, text]]
    shown = table(text, (text, f"{text} #"), rows, text)
    explorer = d.Explorer("chart", 1.0, 2.0, 3.0, None, None, 1.0, True, (0.1, 10.0), (0.1, 10.0))
    nodes: tuple[d.Node, ...] = (
        d.Heading(words, words),
        d.Text(words, mark="!", tone="warn"),
        d.Text(text, quiet=True),
        *(d.Facts(((text, words), (text, text)), look) for look in ("facts", "record", "terms")),
        d.Items((words, text), "!", "bad"),
        d.Items((text,)),
        *d.show(shown),
        *d.show(shown, silent=True),
    )
    inner = tuple(
        d.Group(nodes, look, key="", summary=text)
        for look in ("article", "column", "split", "pair", "fold")
    )
    drawn = (d.Chart("chart", draw, text), explorer)
    return d.Document(
        text, d.Outcome("good", "*", text), text, (text, words), ((text, words), (text, text)),
        (d.Section("one", text, text, (*nodes, *inner, *drawn)),), text,
    )  # fmt: skip


ALL = "".join(HOSTILE)


def tags(page: Page) -> list[tuple[str, list[str]]]:
    """Every tag with its attributes' names; where a heading may break, and what is set as code
    because it stands in backticks, is no matter.
    """
    free: dict[str, set[str]] = {"wbr": set(), "bdi": set(), "code": {"class"}}
    return [(t, sorted(had)) for t, had in page.tags if t not in free or not set(had) <= free[t]]


@pytest.mark.parametrize("text", [*HOSTILE, ALL])
def test_hostile_text_stays_text_on_a_page_in_every_node(text: str) -> None:
    page = html(every_node(text))
    read = Page(page)
    plain = Page(html(every_node("plain")))
    assert tags(read) == tags(plain), "no tag and no attribute but ours"
    assert (len(read.scripts), read.scripts) == (1, plain.scripts)
    assert read.unbalanced == []
    said = visible(text if text.count("`") % 2 else text.replace("`", ""))
    assert "".join(read.texts).replace("`", "").count(said.replace("`", "")) >= 60
    assert not re.search(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e]", page)
    page.encode("utf-8")


@pytest.mark.parametrize("text", [*HOSTILE, ALL])
def test_hostile_text_reaches_no_terminal(text: str) -> None:
    told = console(every_node(text, not_drawn), colour=False)
    for line in told.splitlines():
        assert not re.search(r"[\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ufeff]", line)
    told.encode("utf-8")
    assert "".join(visible(text).split()) in "".join(told.split())


@pytest.mark.parametrize("text", [*HOSTILE, ALL])
def test_hostile_text_is_literal_in_markdown(text: str) -> None:
    told = markdown(every_node(text, not_drawn))
    assert "<" not in told
    assert ">" not in told.replace("&gt;", "")
    assert not re.search(r"(?<!\\)[`\[\]]", told), "markup of a user's own"
    assert "://" not in told
    assert not re.search(r"(?<!&)@|&(?!amp;|lt;|gt;|#64;|#8203;)", told)
    plain = markdown(every_node("plain", not_drawn))
    assert len(told.splitlines()) == len(plain.splitlines()), "no line of a user's own"
    for line, like in zip(told.splitlines(), plain.splitlines(), strict=True):
        assert len(re.findall(r"(?<!\\)\|", line)) == len(re.findall(r"(?<!\\)\|", like))


def test_only_a_page_draws_and_each_output_takes_what_reaches_it() -> None:
    nodes = [d.Text(f"for the {reach}", reach=reach) for reach in ("everywhere", "page", "text")]
    empty = d.Group((d.Text("gone", reach="page"),))
    document = d.Document(
        "Family", d.Outcome("bad", "x", "fails"), "name", (), (),
        (*d.section("a", "A", [*nodes, empty, d.Chart("c", not_drawn, "caption")]),
         *d.section("b", "B", nodes[1:2]), *d.section("c", "C", nodes, reach="page"),
         *d.section("none", "None", [])),
    )  # fmt: skip
    for told in (console(document, colour=False), markdown(document)):
        assert "for the everywhere" in told
        assert "for the text" in told
        assert "for the page" not in told
        assert "gone" not in told
        assert "B" not in told.split()
        assert "C" not in told.split()
    with pytest.raises(AssertionError, match="only a page"):
        html(document)


def test_console_says_the_answer_first_and_lines_columns_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("COLUMNS", str(WIDTH))
    rows = [["a", Cell("1", 1.0), "short"], ["longer", Cell("22\u00a0m", 22.0), "word " * 60]]
    document = d.Document(
        "Family", d.Outcome("good", "\u2713", "Meets"), "My system", ("One sentence.",),
        (("Price", "1\u00a0EUR"), ("Long label", "2")),
        (*d.section("t", "Rows", d.show(table("Rows", ("Name", "Size #", "Note"), rows),
                                        silent=True)),),
        "my.yaml",
    )  # fmt: skip
    lines = console(document, colour=False).splitlines()
    assert lines[:6] == [
        "My system (my.yaml): \u2713 Meets",
        "  One sentence.",
        "  Price       1 EUR",
        "  Long label  2",
        "",
        "Rows",
    ]
    assert lines[6:9] == [
        "  Name    Size  Note",
        "  a          1  short",
        "  longer  22 m  " + " ".join(["word"] * 19),
    ]
    assert all(line.startswith(" " * 16 + "word") for line in lines[9:])
    assert max(map(len, lines)) <= WIDTH
    assert "\x1b[32m" in console(document, colour=True)
    assert "\x1b" not in console(document, colour=False)


def test_markdown_has_headings_tables_and_lists() -> None:
    document = d.Document(
        "Family", d.Outcome("warn", "?", "No verdict"), "a_b", ("Why.",), (("Price", "1 EUR"),),
        (*d.section("s", "Part", [d.Items(("one", "two")), *d.show(table("T", ("x", "y #"),
                                                                         [("1", "2")]))]),),
    )  # fmt: skip
    assert markdown(document).splitlines() == [
        "## ? a\\_b: No verdict", "", "Why.", "", "**Price** 1 EUR", "", "### Part", "",
        "- one", "- two", "", "**T**", "", "| x | y |", "| --- | ---: |", "| 1 | 2 |",
    ]  # fmt: skip


def test_what_our_words_have_in_backticks_is_code_on_a_page_and_an_odd_one_stays() -> None:
    words = "`motion:` says more, `log: {files}` too"
    assert [(s.text, s.style) for s in d.spans(words)] == [
        ("motion:", "code"), (" says more, ", ""), ("log: {files}", "code"), (" too", ""),
    ]  # fmt: skip
    assert d.spans(d.given("a file `x")) == (d.Span("a file `x", "given"),)
    assert d.plain(words) == "motion: says more, log: {files} too"


def _told_everywhere(words: str) -> d.Document:
    """A document that says it in every place that takes words."""
    shown = table(words, ("x", "y"), [(Cell(words, sub=words), Cell("`kept`", code=True))], words)
    nodes = [
        d.Heading(words, words), d.Text(words), d.Facts(((words, words),)),
        d.Facts(((words, words),), "terms"), d.Items((words, d.given(words))), *d.show(shown),
    ]  # fmt: skip
    return d.Document(
        "Family", d.Outcome("good", "", "Word"), "Name", (words,), ((words, words),),
        tuple(d.section("part", "Part", nodes)),
    )  # fmt: skip


TICKED = "write `limit: 5 us`, not 12 us"
PLACES = 16  # of the words in that document


def test_every_output_takes_names_out_of_backticks_and_gives_figures_their_sign() -> None:
    document = _told_everywhere(TICKED)
    page = re.sub(r"</?bdi>", "", html(document))
    assert page.count('<code class="whole">limit: 5 us</code>, not 12\u00a0\u00b5s') == PLACES
    assert page.count("`") == page.count("<code>`kept`</code>") * 2 == 2
    for text in (console(document), markdown(document).replace("\u00a0", " ")):
        assert text.count("write limit: 5 us, not 12 \u00b5s") == PLACES
        assert text.replace("\\`kept\\`", "").replace("`kept`", "").count("`") == 0


def test_a_figure_is_laid_out_and_then_drawn_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """As matplotlib lays it out by itself, which draws it twice: the marks at the same places."""
    from matplotlib.axis import XAxis

    drawn: list[XAxis] = []
    plain = XAxis.draw
    monkeypatch.setattr(XAxis, "draw", lambda axis, pen: (drawn.append(axis), plain(axis, pen))[1])

    def build(figure: Figure) -> Axes:
        axes = add_axes(figure, 1, 1, 1)
        axes.loglog([1e-4, 2.0], [3.0, 4e5])
        axes.set(xlabel="time difference (s)", ylabel="error (m)", title="Two lines\nof a title")
        return axes

    quick = draw("f", "a title", "what it shows", (420.0, 260.0), build)
    assert len(drawn) == 1
    monkeypatch.setattr(svg, "_lay_out", lambda figure: None)
    assert draw("f", "a title", "what it shows", (420.0, 260.0), build) == replace(
        quick, exported=ANY
    )
    assert len(drawn) == 3
