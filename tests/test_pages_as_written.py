"""Pages write moments, amounts and names as people do, and say where a table is only a part."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import report_samples as samples
from browsing import Opened
from study_specs import SPEC
from syncline_design.cli.app import app
from syncline_design.report import numbers
from syncline_design.report.charts_front import FrontMark, pareto_front
from syncline_design.report.charts_study import ACROSS, cost_map
from syncline_design.report.choice_tables import sensors
from syncline_design.report.document import (
    Chart,
    Document,
    Facts,
    Group,
    Outcome,
    Text,
    section,
    show,
)
from syncline_design.report.layout import laid_out
from syncline_design.report.render_html import MOST_VALUES, html
from syncline_design.report.simulated import quantiles
from syncline_design.report.table import table
from syncline_design.report.text import dated, grouped
from syncline_design.report.verdict_tables import assumptions
from syncline_design.spec.load import load_text
from syncline_design.studies.summary import HeatMap
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.verify import check_loaded

PHONE = {"width": 420, "height": 900}


def page(*nodes: Any) -> str:
    found = tuple(section("part", "Part", nodes))
    return html(Document("x", Outcome("good", "+", "x"), "x", (), (), found))


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("since 2026-09-27T14:13:20Z", "since 2026-09-27 14:13:20 UTC"),
        ("(a.csv, 2026-09-27T14:13:20.125Z).", "(a.csv, 2026-09-27 14:13:20.125 UTC)."),
        ("day_2026-09-27T14:13:20Z", "day_2026-09-27T14:13:20Z"),
        ("log/2026-09-27T14:13:20Z.csv", "log/2026-09-27T14:13:20Z.csv"),
        ("2026-09-27T14:13:20Z.csv", "2026-09-27T14:13:20Z.csv"),
        ("2026-09-27", "2026-09-27"),
    ],
)
def test_a_moment_reads_as_people_write_it_and_a_file_as_it_is_called(
    text: str, shown: str
) -> None:
    assert dated(text) == shown


@pytest.mark.browser
def test_a_moment_ends_no_line_but_between_day_and_time(browser: Any, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    facts = Facts((("Since", "run 7, day07.csv, 2026-09-27T14:13:20Z"), ("Other", "x")), "facts")
    path.write_text(page(facts, Text("x")), "utf-8")
    lines = """() => { const found = [], range = document.createRange();
      const walk = document.createTreeWalker(document.querySelector('section dd'), 4);
      for (let node; (node = walk.nextNode());) for (const word of node.data.matchAll(/\\S+/g)) {
        range.setStart(node, word.index); range.setEnd(node, word.index + word[0].length);
        found.push([word[0], range.getClientRects().length]); }
      return found; }"""
    with Opened(browser, path, viewport=PHONE) as opened:
        found = opened.page.evaluate(lines)
    assert [word for word, _ in found][-3:] == ["2026-09-27", "14:13:20", "UTC"]
    assert {count for _, count in found} == {1}


@pytest.mark.parametrize("amount", ["950", "5500", "32000", "260000", "1234567.50"])
def test_amounts_as_catalogs_write_them_get_their_thousands(amount: str) -> None:
    """Against the formatter of all other prices."""
    found = grouped(f"cost {amount} EUR +/- 20 %").removeprefix("cost ").removesuffix(" +/- 20 %")
    assert found.replace("\u00a0", " ") == numbers.money(float(amount), "EUR").replace(
        "\u00a0", " "
    )


@pytest.mark.parametrize("text", ["sigma 32000 m", "32000 EURO", "a32000 EUR", "12.34567 EUR"])
def test_what_is_no_amount_stays(text: str) -> None:
    assert grouped(text) == text


def test_every_assumed_price_of_a_verdict_has_its_thousands_apart() -> None:
    shown = assumptions(samples.fixed_wing())
    assert shown is not None
    words = "; ".join(row[1].text for row in shown.rows)
    assert re.search(r"\d\u00a0\d{3} EUR", words)
    assert not re.search(r"\d{4} EUR", words)


def test_designs_around_a_front_are_called_as_those_on_it() -> None:
    """Every design of the front is among them, in the same words."""
    verdict = check_loaded(
        load_text(samples.OPEN, samples.FILE), CheckSettings(1, monte_carlo=False, cloud=True)
    )
    assert verdict.choice is not None
    around = {(one.payload, one.cost) for one in verdict.choice.cloud or ()}
    front = verdict.choice.front or ()
    assert front
    for point in front:
        assert (sensors(point.design), point.cost) in around


def drawn(costs: list[float], across: int) -> str:
    rows = tuple(tuple(costs[k : k + across]) for k in range(0, len(costs), across))
    names = tuple(f"{k} m" for k in range(across)), tuple(f"{k} s" for k in range(len(rows)))
    empty = tuple(("",) * across for _ in rows)
    return cost_map(HeatMap("a.x", "b.y", "EUR", *names, rows, empty)).svg


@pytest.mark.parametrize(
    ("across", "largest", "whole"),
    [(5, 60_000, True), (7, 60_000, True), (8, 60_000, False), (6, 160_000, True),
     (7, 160_000, False), (5, 1_600_000, True), (6, 1_600_000, False), (8, 9_900, True)],
)  # fmt: skip
def test_a_map_writes_prices_out_where_they_fit_and_else_says_thousand(
    across: int, largest: float, whole: bool
) -> None:
    """Oracle: the costs themselves, and the room that a cell has."""
    costs = [largest * (1.0 - 0.07 * k) for k in range(across)]
    picture = drawn(costs, across)
    texts = [t.strip().replace("\u00a0", " ") for t in re.findall(r"<text[^>]*>([^<]*)", picture)]
    out = [f"{cost:,.0f}".replace(",", " ") for cost in costs]
    short = [f"{Fraction(round(cost), 1000).__float__():.4g}" for cost in costs]
    assert set(out if whole else short) <= set(texts)
    assert any("thousand EUR" in text for text in texts) != whole
    assert not any(re.search(r"\dk\b", text) for text in texts)
    assert (max(map(len, out)) * 5.8 <= ACROSS / across) == whole


def test_values_of_very_many_points_are_both_ends_of_them_and_say_so() -> None:
    many = [FrontMark(1e3 + k, 1.0 / (1 + k), False, f"design {k}") for k in range(1234)]
    made = page(Chart("front", lambda: pareto_front(many, "EUR", None, None), ""))
    shown = made.partition('class="values"')[2].partition("</details>")[0]
    assert len(re.findall(r"<tr>", shown)) == 1 + MOST_VALUES
    plain = shown.replace("\u00a0", " ")
    end = MOST_VALUES // 2
    assert f"The first and the last {end} of 1 234" in plain
    for design, there in (
        (end - 1, True),
        (end, False),
        (1234 - end - 1, False),
        (1234 - end, True),
    ):
        assert (f"design {design}<" in plain) is there


def test_a_second_output_needs_no_option_of_its_own_but_must_follow_one(tmp_path: Path) -> None:
    spec = tmp_path / "spec.yaml"
    spec.write_text(SPEC, encoding="utf-8")
    first, second = f"json:{tmp_path / 'a.json'}", f"html:{tmp_path / 'b.html'}"
    apart = CliRunner().invoke(app, ["check", "-o", first, str(spec), second])
    assert apart.exit_code == 2
    assert f"an output takes its own option: --output {second}" in apart.output
    assert sorted(p.name for p in tmp_path.iterdir()) == ["spec.yaml"]
    beside = CliRunner().invoke(app, ["check", str(spec), "-q", "-o", first, second])
    assert beside.exit_code == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.json", "b.html", "spec.yaml"]


def test_a_spec_that_is_called_like_an_output_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("html:x.yaml").write_text("syncline: 1\n", encoding="utf-8")
    found = CliRunner().invoke(app, ["check", "html:x.yaml"])
    assert "its own option" not in found.output


def test_both_ends_of_every_interval_of_a_quantile_have_the_same_digits() -> None:
    """Four figures each, also where the last is a zero."""
    _, found = samples.simulation()
    shown = quantiles(found.monte_carlo)
    ends = [end for row in shown.rows for end in row[2].text.split(" to ")]
    digits = {len(re.sub(r"[^0-9]|^0+\.?0*", "", end.partition("\u00a0")[0])) for end in ends}
    assert any(end.partition("\u00a0")[0].endswith("0") for end in ends)
    assert digits == {4}


def rows_of(count: int, words: str = "x", heads: int = 3) -> Any:
    (node,) = show(table("T", ("A", "B", "C", "D", "E")[:heads], [[words] * heads] * count))
    return node


FIGURE = Chart("front", lambda: pareto_front([FrontMark(1.0, 1.0, True)], "EUR", None, None), "x")


@pytest.mark.parametrize(
    ("after", "beside"),
    [
        ([rows_of(2), rows_of(2), rows_of(3, heads=5)], 2),  # the last is too wide
        ([rows_of(2), rows_of(2), rows_of(2)], 3),
        ([rows_of(12), rows_of(2)], 1),  # as long as the figure is high already
        ([rows_of(4, "word " * 24), rows_of(2)], 1),  # three lines each
        ([rows_of(2), Text("x"), rows_of(2)], 1),
    ],
)
def test_small_tables_fill_what_is_blank_beside_a_figure(after: list[Any], beside: int) -> None:
    """A front of two designs left half a row blank above the table of its price steps."""
    pair, *rest = laid_out([FIGURE, *after])
    assert isinstance(pair, Group)
    assert pair.form == "pair"
    right = pair.nodes[1]
    found = list(right.nodes) if isinstance(right, Group) else [right]
    assert [*found, *rest] == after
    assert len(found) == beside


@pytest.mark.browser
def test_heads_of_a_maps_values_take_two_lines_at_most(browser: Any, tmp_path: Path) -> None:
    """Beside the map, where half of the card is theirs: `requirements[ACC-1]`, then `.limit`."""
    names = ("30 m", "140 m"), ("0.05 m", "0.5 m")
    costs, payload = ((1e4, 2e4), (3e4, None)), (("a long payload " * 4,) * 2,) * 2
    keys = "stages[uav].distance", "requirements[ACC-1].limit"
    heat = HeatMap(*keys, "EUR", *names, costs, payload)
    path = tmp_path / "page.html"
    path.write_text(page(Chart("heat", lambda: cost_map(heat), "x")), "utf-8")
    lines = """() => [...document.querySelectorAll('.values th[scope=col]')].map(head => {
      const range = document.createRange(); range.selectNodeContents(head);
      return new Set([...range.getClientRects()].map(box => Math.round(box.top / 8))).size; })"""
    with Opened(browser, path, viewport={"width": 1300, "height": 900}) as opened:
        found = opened.page.evaluate(lines)
        wide = opened.page.eval_on_selector(".values .inner", "e => e.scrollWidth - e.clientWidth")
    assert len(found) == 4
    assert max(found) <= 2
    assert wide <= 0
