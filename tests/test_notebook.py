"""The notebook of the docs says what it said when it was run, and every result can be drawn."""

from __future__ import annotations

import importlib.util
import json
import re
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

import page_looks
import syncline_design as sd
from browsing import Opened
from syncline_design.report import notebook
from syncline_design.report.palette import VARIABLES

ROOT = Path(__file__).resolve().parent.parent
VOID = {"path", "use", "rect", "circle", "line", "br", "wbr", "meta", "link", "image", "polygon"}


class Words(HTMLParser):
    """The text of a fragment without styles and figures; tags have to close in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.words: list[str] = []
        self.tags: set[str] = set()
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        assert not any(name.startswith("on") or name == "src" for name, _ in attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not {"style", "svg"} & set(self.open):
            self.words.append(data)

    @property
    def text(self) -> str:
        said = " ".join(" ".join(self.words).split())
        return re.sub(r" Provenance .*", "", said)  # versions and hashes change with any entry


def _said(output: dict[str, Any]) -> tuple[str, str]:
    data = output.get("data", {"text/plain": output.get("text", [])})
    return "".join(data["text/plain"]), Words("".join(data.get("text/html", ""))).text


def test_the_notebook_says_what_it_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    place = importlib.util.spec_from_file_location("make", ROOT / "docs" / "make_notebook.py")
    assert place is not None
    assert place.loader is not None
    make = importlib.util.module_from_spec(place)
    place.loader.exec_module(make)
    book = json.loads(make.NOTEBOOK.read_text(encoding="utf-8"))
    codes = [cell for cell in book["cells"] if cell["cell_type"] == "code"]
    for cell, outputs in zip(codes, make.ran(codes), strict=True):
        assert [_said(one) for one in cell["outputs"]] == [_said(one) for one in outputs]
    assert sum("text/html" in out.get("data", {}) for c in codes for out in c["outputs"]) == 5


def test_a_verdict_is_drawn_without_a_script_and_with_every_figure() -> None:
    verdict = sd.check(ROOT / "specs" / "usv_wire_missing.yaml", monte_carlo=False)
    drawn = Words(verdict._repr_html_() or "")
    assert "Does not meet its requirements" in drawn.text
    assert "0.4474 m" in drawn.text
    assert drawn.tags >= {"table", "details", "svg"}
    assert not drawn.tags & {"script", "iframe", "link", "html", "body", "form"}


def test_every_colour_of_a_figure_is_known_in_a_notebook() -> None:
    """Figures are drawn in the page's variables: without them bars are black and lines are gone."""
    style = files("syncline_design.templates").joinpath("fragment.css").read_text("utf-8")
    known = dict(re.findall(r"(--[\w-]+): (#[0-9a-f]{6});", style))
    assert {name: colour for colour, name in VARIABLES.items()} == known
    verdict = sd.check(ROOT / "specs" / "usv_wire_missing.yaml", monte_carlo=False)
    used = set(re.findall(r"var\((--[\w-]+)\)", verdict._repr_html_() or ""))
    assert used
    assert used <= set(known)


@pytest.mark.browser
@pytest.mark.parametrize(("ground", "ink"), [("#111111", "#ffffff"), ("#ffffff", "#111111")])
def test_a_cell_is_read_in_the_notebooks_own_theme(
    browser: Any, tmp_path: Path, ground: str, ink: str
) -> None:
    """As JupyterLab has it: its tables in its own ink, which only it knows; axe on contrasts."""
    verdict = sd.check(ROOT / "specs" / "usv_wire_missing.yaml", monte_carlo=False)
    path = tmp_path / "cell.html"
    css = (
        f"body {{ background: {ground}; color: {ink} }} .jp table {{ color: {ink} }}"
        ".jp { font: 13px sans-serif }"
    )
    drawn = f"<style>{css}</style><div class='jp'>{verdict._repr_html_()}</div>"
    path.write_text(f"<!DOCTYPE html><html lang='en'><title>x</title>{drawn}</html>", "utf-8")
    with Opened(browser, path) as opened:
        unfold = "() => document.querySelectorAll('details').forEach(d => { d.open = true; })"
        opened.page.evaluate(unfold)
        opened.page.evaluate(page_looks.AXE.read_text("utf-8") + "; undefined")
        found = opened.page.evaluate(page_looks.BARRIERS, page_looks.COLOURS)
        assert found["passes"] > 0
        assert found["violations"] == []


def test_a_front_that_was_asked_for_is_drawn_and_comes_first() -> None:
    drawn = sd.optimize(ROOT / "specs" / "uav_corridor.yaml", pareto=True)._repr_html_() or ""
    assert drawn.count("<svg") == 1
    assert drawn.index("<svg") < drawn.index("Best designs")
    plain = sd.optimize(ROOT / "specs" / "uav_corridor.yaml")._repr_html_() or ""
    assert "<svg" not in plain
    assert "Best designs" in plain


def test_a_design_of_a_front_is_drawn_with_its_price_its_error_and_its_payload() -> None:
    found = sd.optimize(ROOT / "specs" / "uav_corridor.yaml", pareto=True)
    for one in (found.front[0], found.designs[0]):
        said = Words(one._repr_html_() or "").text
        assert f"{one.cost:,.0f}".replace(",", "\N{NO-BREAK SPACE}") in said.replace(" ", "\xa0")
        assert f"{1000 * one.error_m:.4g}" in said
        for stage in one.design.stages:
            for entry in stage.roles.values():
                assert entry.name in said


def test_what_a_user_wrote_stays_text(tmp_path: Path) -> None:
    text = (ROOT / "specs" / "position_track.yaml").read_text(encoding="utf-8")
    spec = tmp_path / "own.yaml"
    spec.write_text(re.sub(r"(?m)^name: .*", "name: <img src=x onerror=a()>", text))
    drawn = sd.check(spec, monte_carlo=False)._repr_html_() or ""
    assert "&lt;img" in drawn
    assert "<img" not in drawn
    Words(drawn)


def test_a_simulation_is_drawn_with_its_figures() -> None:
    found = sd.simulate(ROOT / "specs" / "position_track.yaml", samples=2000)
    drawn = Words(found._repr_html_() or "")
    # the ratio by hand from the figures themselves
    worst = found.monte_carlo.worst_case
    assert f"{100 * worst.value_m / worst.syncline_m:.4g} % of the Syncline" in drawn.text
    assert "known effects of the spec, if any" in drawn.text
    assert drawn.tags >= {"table", "svg"}
    assert "script" not in drawn.tags


def test_whatever_a_function_of_the_package_returns_can_be_drawn() -> None:
    """By what the functions say they return, except for a spec that was only read."""
    functions = [getattr(sd, name) for name in sd.__all__ if name[0].islower()]
    returned = {f.__annotations__["return"] for f in functions if f.__name__ != "load"}
    assert len(returned) >= 12
    assert returned <= set(notebook._MAKERS)


def test_results_without_a_picture_fall_back_to_their_repr() -> None:
    case = sd.load(ROOT / "specs" / "position_track.yaml")
    assert notebook.shown(case) is None
    assert notebook.shown(3) is None
