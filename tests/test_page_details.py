"""Small things of a page that a reader stumbles over: broken names, labels on lines, blanks."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from browsing import Opened
from html_page import Page
from study_specs import write
from syncline_design.comparison.acceptance import AssumptionResult
from syncline_design.report import on_plan
from syncline_design.report.charts_plan import beside
from syncline_design.report.document import Document, Outcome, Text, pins, section, show
from syncline_design.report.numbers import typeset
from syncline_design.report.on_acceptance import assumptions_table
from syncline_design.report.on_diff import _standing
from syncline_design.report.render_html import html
from syncline_design.report.studies import render_study
from syncline_design.report.table import Cell, table
from syncline_design.studies import StudySettings, run_study

WIDE, PHONE = {"width": 1300, "height": 900}, {"width": 420, "height": 900}


def page(*nodes: Any, sections: int = 1) -> str:
    parts = [one for k in range(sections) for one in section(f"part-{k}", f"Part no {k}", nodes)]
    return html(Document("x", Outcome("good", "+", "x"), "x", (), (), tuple(parts)))


@pytest.mark.parametrize("name", ["ACC-1", "HDL-32E", "2026-11-22"])
def test_no_line_ends_at_the_hyphen_of_a_name(name: str) -> None:
    shown = page(Text(f"Of requirements[{name}].limit, {name} and a well-known 12."))
    assert shown.count(f'<span class="whole">{name}</span>') == 2
    assert f"Of requirements[{name}].limit, {name} and a well-known 12." in Page(shown).text


@pytest.mark.parametrize(
    ("typed", "printed"),
    [("from -40.3 cm on", "from \u221240.3\u00a0cm on"), ("p = 3e-55", "p = 3e\u221255"),
     ("(-1 to -0.5)", "(\u22121 to \u22120.5)"), ("on 2026-11-22", "on 2026-11-22"),
     ("MRU-5 and 12-14", "MRU-5 and 12-14"), ("`--tilt -3 deg`", "--tilt -3 deg")],
)  # fmt: skip
def test_a_minus_is_printed_for_what_was_typed(typed: str, printed: str) -> None:
    assert printed in Page(page(Text(typed))).text


def test_an_interval_may_end_a_line_between_its_ends_and_nowhere_else() -> None:
    gap = "\N{NO-BREAK SPACE}"
    assert typeset("-87.3 ms to -86.4 ms") == f"\u221287.3{gap}ms{gap}to \u221286.4{gap}ms"


@pytest.mark.parametrize(
    ("key", "steps"),
    [("uav.position.timestamping", ["uav", ".position", ".timestamping"]),
     ("hidden_latency_repaired.csv", ["hidden_", "latency_", "repaired", ".csv"]),
     ("(hidden_latency_repaired.csv).", ["(hidden_", "latency_", "repaired", ".csv)."]),
     ("uav.distance", ["uav.distance"]), ("0.0001234567890123", ["0.0001234567890123"])],
)  # fmt: skip
def test_a_long_key_goes_on_at_its_dots(key: str, steps: list[str]) -> None:
    assert f"see {'<wbr>'.join(steps)}" in re.sub(
        r"</?(span|bdi)[^>]*>", "", page(Text(f"see {key}"))
    )


def test_every_assumption_is_headed_by_its_sensor() -> None:
    """On a phone each row is a card, and its head says whose latency it is about."""
    rows = [
        AssumptionResult(stage, role, kind, 0.0, None, "s", "holds", "", 1, 1)
        for stage in ("front", "rear")
        for role in ("position", "attitude")
        for kind in ("latency", "timing")
    ]
    shown = assumptions_table(rows)
    named = [row[shown.named_by].text for row in shown.rows]
    assert len(set(named)) == len(rows)
    assert "rear \u00b7 attitude: latency" in named


def test_the_label_of_a_leg_lies_beside_its_path() -> None:
    """On a line and at a corner: about as far from all that is drawn as can be."""
    line = np.c_[np.zeros(200), np.linspace(-10.0, 10.0, 200)]
    corner = np.r_[line, np.c_[np.linspace(0.0, 10.0, 100), np.full(100, 10.0)]]
    for drawn, at, least in ((line, (0.0, 0.0), 0.99), (corner, (0.0, 10.0), 0.9)):
        x, y = beside(at, drawn, 1.0)
        assert np.hypot(x - at[0], y - at[1]) == pytest.approx(1.0)
        assert np.min(np.hypot(drawn[:, 0] - x, drawn[:, 1] - y)) > least


def test_no_seed_where_nothing_is_drawn() -> None:
    assert [label for label, _ in pins("1", "a", "b", None)] == [
        "syncline-design", "Spec, SHA-256", "Catalogs, SHA-256",
    ]  # fmt: skip
    assert pins("1", "a", "b", 7)[-1] == ("Seed", "7")


SAMPLE = """\
study: 1
name: Sample
base: [spec.yaml]
sample:
  count: 20
  seed: 3
  over:
    "stages[uav].distance": 30 m .. 140 m
    "stages[uav].v_max": {low: 1 m/s, high: 60 m/s, scale: log}
    "stages[uav].ranging.sensor": [velodyne_hdl32e, riegl_vux1uav]
meets_when: decided
"""


QUICK = "check: {monte_carlo: false, method: enumerate}\n"


@pytest.mark.browser
def test_the_cases_of_a_sample_fill_the_card_beside_their_figure(
    browser: Any, tmp_path: Path
) -> None:
    """As cards, each headed by its number; from its top to near the figure's foot."""
    path = tmp_path / "page.html"
    found = run_study(write(tmp_path, SAMPLE), StudySettings(workers=1))
    path.write_text(str(render_study("html", found)), "utf-8")
    box = "e => { const b = e.getBoundingClientRect(); return [b.left, b.top, b.right, b.bottom]; }"
    with Opened(browser, path, viewport=WIDE) as opened:
        figure, values = (
            opened.page.eval_on_selector(f"#sampled {part}", box)
            for part in (".drawing", ".values .inner")
        )
        head = "e => getComputedStyle(e, '::before').content + e.innerText.trim()"
        assert opened.page.eval_on_selector("#sampled tbody th", head) == '"Case\u00a0"1'
    assert values[0] > figure[2]
    assert values[3] - figure[1] > 0.7 * (figure[3] - figure[1])


@pytest.mark.browser
def test_a_list_of_sections_says_that_it_goes_on(browser: Any, tmp_path: Path) -> None:
    """Until its end is in sight; not where all of it is."""
    path = tmp_path / "page.html"
    path.write_text(page(Text("x"), sections=9), "utf-8")
    hint = "() => getComputedStyle(document.querySelector('nav'), '::after').content"
    with Opened(browser, path, viewport=PHONE) as opened:
        assert opened.page.evaluate(hint) == '"\u203a"'
        opened.page.evaluate("() => { document.querySelector('nav ul').scrollLeft = 9999; }")
        opened.page.wait_for_function(f"({hint})() === 'none'")
        opened.page.set_viewport_size(WIDE)
        opened.page.wait_for_function(f"({hint})() === 'none'")


@pytest.mark.browser
def test_short_names_and_states_stand_on_one_line(browser: Any, tmp_path: Path) -> None:
    """Beside a column of sentences, which takes what it can get."""
    path = tmp_path / "page.html"
    rows = [["uav \u00b7 attitude", "x", "y", "z", "a long reason " * 12] for _ in range(26)]
    path.write_text(page(*show(table("x", ("Role", "A", "B", "C", "Why"), rows))), "utf-8")
    high = "e => e.getClientRects().length && e.querySelector('bdi').getClientRects().length"
    with Opened(browser, path, viewport=WIDE) as opened:
        assert opened.page.eval_on_selector("tbody th", high) == 1


@pytest.mark.browser
@pytest.mark.parametrize(("last", "least"), [("line 14", "0px"), ("lines 14, 15", "112px")])
def test_room_is_kept_for_words_alone(browser: Any, tmp_path: Path, last: str, least: str) -> None:
    """On a tablet seven columns that end in a few letters fit; 7 rem for them would cut them."""
    path = tmp_path / "page.html"
    heads = ("Requirement", "Status", "Limits", "Value", "Limit", "Margin", "In the spec")
    rows = [["ACC-1", "pass", "error", "1.661 m", "3 m", "44.6 %", last]]
    path.write_text(page(*show(table("x", heads, rows))), "utf-8")
    with Opened(browser, path, viewport={"width": 768, "height": 900}) as opened:
        width = "e => { const w = getComputedStyle(e).minWidth; return w === 'auto' ? '0px' : w; }"
        assert opened.page.eval_on_selector("tbody td:last-child", width) == least


def test_no_line_of_the_banner_ends_in_a_name_or_before_a_unit() -> None:
    told = Outcome("bad", "x", "Does not meet, waiver of SYNC-1 expired")
    shown = html(Document("x", told, "Five centimetres from 100 m", (), (), ()))
    assert '<span class="whole">SYNC-1</span>' in shown
    assert "Five centimetres from 100\u00a0m" in Page(shown).text


@pytest.mark.browser
@pytest.mark.parametrize("viewport", [PHONE, {"width": 768, "height": 900}, WIDE])
def test_long_words_break_before_a_table_goes_on_sideways(
    browser: Any, tmp_path: Path, viewport: dict[str, int]
) -> None:
    """A file's hash, the address of a source: a column of a few letters each would be cut."""
    path = tmp_path / "page.html"
    hashes = [[Cell("recordings/of_the_third_day.mcap", code=True), Cell("0f" * 32, code=True)]]
    sources = [["gpio", "see https://example.org/" + "documentation" * 7 + " (mean 6.92 us)"]]
    shown = page(*show(table("a", ("File", "SHA-256"), hashes)),
                 *show(table("b", ("Entry", "Source"), sources)))  # fmt: skip
    path.write_text(shown, "utf-8")
    beyond = "all => all.map(e => e.scrollWidth - e.clientWidth)"
    with Opened(browser, path, viewport=viewport) as opened:
        assert opened.page.eval_on_selector_all(".scroll", beyond) == [0, 0]
        assert opened.page.query_selector(".more") is None


@pytest.mark.browser
def test_on_a_tablet_rows_stand_as_cards_before_a_table_goes_on_sideways(
    browser: Any, tmp_path: Path
) -> None:
    """However many they are; and as rows again where there is room."""
    path = tmp_path / "page.html"
    heads = tuple(f"Heading{k}" for k in range(9))
    path.write_text(page(*show(table("x", heads, [["1234.5678_m"] * 9] * 400))), "utf-8")
    cut = "e => e.scrollWidth - e.clientWidth"
    row = "e => getComputedStyle(e).display"
    with Opened(browser, path, viewport={"width": 1500, "height": 900}) as opened:
        for width, shape in ((768, "grid"), (420, "flex"), (1500, "table-row")):
            opened.page.set_viewport_size({"width": width, "height": 900})
            opened.page.wait_for_timeout(100)
            assert opened.page.eval_on_selector(".scroll", cut) <= 1
            assert opened.page.eval_on_selector("tbody tr", row) == shape


@pytest.mark.browser
def test_the_file_of_a_figure_holds_all_its_values(browser: Any, tmp_path: Path) -> None:
    """Of 300 cases the table shows 200; and figures stand without gaps."""
    path, file = tmp_path / "page.html", tmp_path / "values.csv"
    text = SAMPLE.replace("count: 20", "count: 220").replace("meets_when", QUICK + "meets_when")
    found = run_study(write(tmp_path, text), StudySettings(workers=1))
    path.write_text(str(render_study("html", found)), "utf-8")
    with Opened(browser, path, viewport=WIDE) as opened:
        assert opened.page.locator("#sampled tbody tr").count() == 200
        with opened.page.expect_download() as waiting:
            opened.page.locator("#sampled").get_by_role("button", name="as CSV").first.click()
        waiting.value.save_as(file)
    rows = list(csv.DictReader(file.read_text("utf-8").splitlines()))
    assert [int(row["Case"]) for row in rows] == list(range(1, 221))
    prices = [case.record.cost for case in found.cases() if case.verdict == "meets"]
    told = [float(row["Price"].split(" ")[0]) for row in rows if row["Price"]]
    assert told == pytest.approx(prices)


@pytest.mark.browser
@pytest.mark.parametrize("setting", ["73.66 m", "velodyne_hdl32e_ntp"])
def test_a_hundred_and_fifty_cases_are_printed_on_six_sheets(
    browser: Any, tmp_path: Path, setting: str
) -> None:
    """Of two factors: the payload has half of the width, whatever stands in the other columns."""
    path = tmp_path / "page.html"
    payload = "SBG Apogee, u-blox F9P with RTK corrections, Velodyne HDL-32E"
    why = (
        "MASS-1 and COST-1 cannot be met, each for itself. This would do: distance of uav from 9 m"
    )
    rows = [
        (Cell(str(k), k), setting, "12.68 m/s", Cell("infeasible", mark="x", sub="COST-1, MASS-1"),
         "59 862.35 EUR", "0.2265 m", (payload, why)[k % 2])
        for k in range(1, 151)
    ]  # fmt: skip
    heads = ("Case #", "uav.ranging.sensor", "uav.v_max", "Verdict", "Price #", "Syncline error #",
             "Payload, or why there is none")  # fmt: skip
    path.write_text(page(*show(table("All cases", heads, rows))), "utf-8")
    with Opened(browser, path) as opened:
        sheets = opened.page.pdf(path=str(tmp_path / "page.pdf"), format="A4")
        opened.page.set_viewport_size({"width": 688, "height": 900})  # as wide as such a sheet
        opened.page.emulate_media(media="print")
        width = "e => e.getBoundingClientRect().width"
        whole = opened.page.eval_on_selector(".scroll table", width)
        last = opened.page.eval_on_selector(".scroll tbody td:last-child", width)
    assert 0.4 * whole < last < 0.6 * whole
    assert len(re.findall(rb"/Type\s*/Page\b", sheets)) <= 6


@pytest.mark.browser
def test_a_table_that_would_just_be_cut_stands_closer(browser: Any, tmp_path: Path) -> None:
    """And apart again where there is room."""
    path = tmp_path / "page.html"
    heads = tuple(f"Head{k}" for k in range(9))
    path.write_text(page(*show(table("x", heads, [["-1234.5678 m"] * 9] * 70))), "utf-8")
    closer = "() => document.querySelector('.scroll').classList.contains('tight')"
    cut = "e => e.scrollWidth > e.clientWidth + 1"
    with Opened(browser, path, viewport={"width": 2000, "height": 900}) as opened:
        seen = []
        for width in range(1300, 700, -20):
            opened.page.set_viewport_size({"width": width, "height": 900})
            opened.page.wait_for_timeout(30)
            seen.append(
                (opened.page.evaluate(closer), opened.page.eval_on_selector(".scroll", cut))
            )
        assert (True, False) in seen
        assert (False, True) not in seen
        opened.page.set_viewport_size({"width": 1300, "height": 900})
        opened.page.wait_for_function(f"!({closer})()")


@pytest.mark.browser
def test_what_a_finger_asked_for_stays_until_it_asks_anew(browser: Any, tmp_path: Path) -> None:
    """A finger hides what it points at: the answer is read when it has gone."""
    path = tmp_path / "page.html"
    found = run_study(write(tmp_path, SAMPLE), StudySettings(workers=1))
    path.write_text(str(render_study("html", found)), "utf-8")
    phone = {"viewport": PHONE, "has_touch": True, "is_mobile": True}
    with Opened(browser, path, **phone) as opened:
        drawing = opened.page.locator(".drawing").first
        drawing.scroll_into_view_if_needed()
        opened.page.wait_for_timeout(200)
        box = drawing.bounding_box()
        assert box is not None
        for share in (0.3, 0.4, 0.5, 0.6, 0.7):
            opened.page.touchscreen.tap(box["x"] + 0.5 * box["width"],
                                        box["y"] + share * box["height"])  # fmt: skip
            opened.page.wait_for_timeout(100)
            if opened.page.query_selector(".tip"):
                break
        assert opened.page.query_selector(".tip") is not None
        opened.page.touchscreen.tap(10, box["y"] - 5)
        opened.page.wait_for_function("() => !document.querySelector('.tip')")


def test_a_limit_that_no_spec_writes_is_not_said_to_be_no_longer_required() -> None:
    """A verdict without a design has no row for it, though it is asked for as before."""
    implied, written = (cast(Any, SimpleNamespace(line=line)) for line in (None, 4))
    assert _standing(None, implied).text == "no design to judge"
    assert _standing(None, written).text == "not required"


@pytest.mark.parametrize(("sigma", "said"), [(0.3e-3, "never told apart"), (2e-3, "never")])
def test_a_plan_that_is_sharp_and_never_enough_says_why(
    monkeypatch: pytest.MonkeyPatch, sigma: float, said: str
) -> None:
    key = "latency_s(position)"
    monkeypatch.setattr(on_plan, "_shown", lambda _: [key])
    monkeypatch.setattr(on_plan, "_column_sizes", lambda _: {key: 1e-3})
    found = cast(Any, SimpleNamespace(reached=True))
    row = on_plan._standard_row(
        "straight", found, {key: sigma}, "", Cell("", math.inf), {key: 1e-3}
    )
    assert cast(Cell, row[1]).text == said
