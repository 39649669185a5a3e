"""Figures of the pages: parts sum to the price, datasheet figures read as they were written."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from matplotlib.figure import Figure

from diagnosis_samples import CLOSED, diagnosis
from html_page import Page
from syncline_design.model.written import beside
from syncline_design.report import numbers
from syncline_design.report.axes import in_view, log_ticks, set_ticks, short_length
from syncline_design.report.charts import WIDTH, LedgerBar, SynclineCurve, ledger, syncline
from syncline_design.report.charts_clocks import ClockedVehicle, Stamped, clocks
from syncline_design.report.charts_distribution import DensityBars, error_histogram
from syncline_design.report.charts_front import FrontMark, pareto_front
from syncline_design.report.charts_ways import from_above
from syncline_design.report.on_choice import on_choice
from syncline_design.report.on_diagnosis import on_diagnosis
from syncline_design.report.on_findings import NAT
from syncline_design.report.on_study import shown_value
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.optimizations import render_optimize
from syncline_design.report.render_console import console
from syncline_design.report.render_html import html
from syncline_design.report.svg import add_axes, draw
from syncline_design.report.text import unbroken
from syncline_design.report.verdict_words import failing_text, margin_text
from syncline_design.spec.load import load_text
from syncline_design.studies.definition import Factor
from syncline_design.verdict.optimize import (
    OptimizeSettings,
    optimize,
)
from syncline_design.verdict.tree import RequirementResult
from syncline_design.verdict.verify import CheckSettings
from tests.checked import check_file

pytestmark = pytest.mark.usefixtures("figures_drawn_once")

ROOT = Path(__file__).parent.parent
PLAIN = CheckSettings(monte_carlo=False)
MULTIROTOR = ROOT / "specs" / "multirotor_inspection.yaml"
# What a unit is worth in SI, from the SI brochure, and not by the product's own table.
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "deg": math.pi / 180.0, "mdeg": math.pi / 180e3}


@pytest.mark.parametrize("name", ["car_mapping", "rov_relay", "subsea_survey_small_sv"])
def test_the_costs_on_the_page_sum_to_the_price(name: str) -> None:
    """Every role, every shared piece and every clock: to the cent."""
    verdict = check_file(ROOT / "specs" / f"{name}.yaml", PLAIN)
    assert verdict.design is not None
    assert any(clock.cost for clock in verdict.design.clocks)
    cells: list[str] = []
    text = html(on_verdict(verdict))
    for caption in ("Payload and timestamping", "Shared hardware and clocks"):
        tables = re.findall(r"<table.*?</table>", text, re.DOTALL)
        [found] = [one for one in tables if caption in one.partition("</caption>")[0]]
        body = found.partition("<tbody>")[2]
        amounts = re.findall(r"<bdi>([\d\u00a0.]+)\u00a0EUR</bdi>", body)
        assert body.count("<tr>") == len(amounts), "a row without a cost"
        cells += amounts
    total = sum(float(cell.replace("\u00a0", "")) for cell in cells)
    assert total == pytest.approx(verdict.design.cost, abs=0.005)


@pytest.mark.parametrize("method", ["front", "milp", "enumerate"])
def test_the_page_says_in_words_how_the_choice_was_proven(method: Any) -> None:
    words = {"front": "Pareto front", "milp": "integer program", "enumerate": "enumeration of all"}
    verdict = check_file(MULTIROTOR, CheckSettings(road=method, monte_carlo=False))
    assert verdict.choice is not None
    assert verdict.choice.proof is not None
    assert verdict.choice.proof.method == method
    sentence = re.search(r"Found by [^<]*", Page(html(on_verdict(verdict))).text)
    assert sentence is not None
    assert words[method] in sentence[0]
    assert "enumerate" not in sentence[0]
    assert "milp" not in sentence[0]


def test_a_datasheet_figure_reads_as_it_was_written() -> None:
    loaded = load_text(MULTIROTOR.read_text("utf-8"), MULTIROTOR)
    found = optimize(loaded, OptimizeSettings(report=True))
    entries = found.result.measure_next
    assert entries is not None
    assert {entry.value_text for entry in entries} >= {"2 cm", "0.2 deg"}
    said, page = console(on_choice(found)), Page(render_optimize("html", found)).text
    for entry in entries:
        for value, text in ((entry.value, entry.value_text), (entry.at, entry.at_text)):
            number, unit = text.split(" ")
            assert float(number) * UNITS[unit] == pytest.approx(value, rel=5e-4)
            assert unit == entry.value_text.split(" ")[1]
            assert unbroken(text) in page
            assert text in said
    assert "Figure (SI)" not in page
    tolerances = found.result.tolerances
    assert tolerances is not None
    for told in (" ".join(said.split()), " ".join(page.replace("\u00a0", " ").split())):
        assert " ".join(tolerances.text.split()) in told
        for row in found.result.slack or ():
            text = numbers.si_quantity(row.value, row.unit).replace("\u00a0", " ")
            if row.term.endswith("sensor error"):  # beside a limit of 8 cm
                text = f"{100.0 * row.value:.4g} cm"
            assert text.split(" ")[0].rstrip("0").rstrip(".") in told
            assert text.split(" ")[1] in told


@pytest.mark.parametrize(
    ("written", "value_si", "shown"),
    [
        ("0.05 deg", 0.05 * math.pi / 180.0, "0.05 deg"),
        ("50 mdeg +/- 20 %", 0.04 * math.pi / 180.0, "40 mdeg"),
        ("0.8 cm .. 1.2 cm", 0.008, "0.8 cm"),
        ("1 cm +/- 2 mm", 0.012, "1.2 cm"),
        ("0.0008727 rad", 0.00069816, "0.0006982 rad"),
        ("3", 2.4, "2.4"),
    ],
)
def test_a_figure_in_the_unit_of_another(written: str, value_si: float, shown: str) -> None:
    from syncline_design.model.figure_text import format_like

    assert format_like(written, value_si) == shown


@pytest.fixture(scope="module")
def simulated_page() -> str:
    page = html(on_verdict(check_file(ROOT / "specs" / "usv_mapping.yaml", CheckSettings())))
    return re.sub(r"[\u00a0\u202f\u2009]", " ", page)


def test_intervals_of_one_quantile_that_differ_differ_in_name(simulated_page: str) -> None:
    """The sequential decision's interval is wider (several looks) than the final sample's."""
    cells = [re.sub(r"<[^>]+>", "", c) for c in re.findall(r"<td.*?</td>", simulated_page, re.S)]
    [decided] = [cell for cell in cells if cell.startswith("95 % interval")]
    [row] = re.findall(r"<tr>(?:(?!</tr>).)*?>95 %<.*?</tr>", simulated_page, re.S)
    ends = [
        [float(figure) * (1e-3 if unit == "mm" else 1.0) for figure, unit in found]
        for found in (
            re.findall(r"([\d.]+)\s(mm|m)\b", text)
            for text in (decided, re.sub(r"<[^>]+>", " ", row))
        )
    ]
    (low, high), (_, final_low, final_high) = ends
    assert low <= final_low < final_high <= high
    assert (low, high) != (final_low, final_high)
    assert "over all looks" in decided


def test_facts_are_short_and_sentences_stand_below(simulated_page: str) -> None:
    facts = re.findall(r"<dd>(.*?)</dd>", simulated_page, re.S)
    assert max(len(re.sub(r"<[^>]+>", "", fact)) for fact in facts) <= 64  # a SHA-256
    notes = " ".join(re.findall(r'<p class="note">(.*?)</p>', simulated_page, re.S))
    assert "nothing exceeds the bound" in notes
    assert "quantiles run over missions" in notes


def test_pages_say_how_often_errors_exceed_the_sum(simulated_page: str) -> None:
    """39 %: three standard normal components beyond the root of three, by their distribution."""
    beyond = 1.0 - math.erf(math.sqrt(1.5)) + math.sqrt(6.0 / math.pi) * math.exp(-1.5)
    assert f"{100 * beyond:.0f} % of them where position noise is all there is" in simulated_page
    templates = ROOT / "reports" / "templates"
    assert not [p.name for p in templates.glob("*.j2") if "now and then" in p.read_text("utf-8")]


@pytest.mark.parametrize("span", [1.05, 1.3, 2.3, 2.6, 5.2, 40.0, 1e4])
def test_an_axis_has_two_marks_or_more_wherever_it_begins(span: float) -> None:
    for step in range(40):
        low = 0.0123 * 10.0 ** (step / 20.0)
        ticks = log_ticks(low, span * low)
        assert len(ticks) >= 2
        assert all(low <= tick <= span * low for tick in ticks)


def test_an_assumed_figure_reads_as_its_catalog_writes_it() -> None:
    """Keys that an entry leaves empty stood before the figure: `evidence [] events [] uniform`."""
    verdict = check_file(ROOT / "specs" / "rov_relay.yaml", PLAIN)
    values = {(one.entry, one.figure): one.value for one in verdict.assumptions or ()}
    assert values["ocxo", "offset"] == "uniform low -1 us high 1 us"
    assert not [value for value in values.values() if "[]" in value]


def test_words_of_the_trade_are_explained_where_they_are_first_used() -> None:
    """Nat, placebo and floor of a diagnosis, on the console and on the page."""
    placebo = replace(CLOSED, added="azimuth bias (ranging)")
    found = diagnosis()
    found = replace(found, gap=replace(found.gap, placebo=placebo))
    for text in (console(on_diagnosis(found), colour=False), Page(html(on_diagnosis(found))).text):
        said = " ".join(text.split())
        first = said.index(" nat")
        assert 0 < said.index("1 nat, the unit of evidence: the log is 2.7 times") - first < 120
        assert said.index("lacebo") == said.index("A placebo is an effect") + 3
    page = Page(html(on_diagnosis(found))).text
    assert "Floor (dashed): the better of what the spec's noise expects" in page


def test_a_nat_is_what_is_said_of_it() -> None:
    assert [round(math.exp(1.0), 1), round(math.exp(5.0))] == [2.7, 148]
    assert "2.7 times" in NAT
    assert "148 times" in NAT
    assert round(math.exp(0.1), 1) == 1.1  # of a sample, in the words on the gap


def test_a_diagram_of_clocks_has_names_in_full_where_three_lines_hold_them() -> None:
    """The longest of a catalog with the longest of its signals; no text outside the figure."""
    name = "Applanix POS MV OceanMaster with IARTK"
    method = "Precision Time Protocol with a timing board"
    sensor = Stamped("uav \u00b7 position", name, "time-of-validity pulse", method, False,
                     1.208e-5, None, True)  # fmt: skip
    short = replace(sensor, sensor="SBG", method="GPIO")
    clock = "OCXO, set from PPS, four hours without GNSS"
    drawn = clocks([ClockedVehicle("uav", (sensor, short), clock, 7.3e-5)])
    texts = re.findall(r"<text[^>]*>([^<]*)</text>", drawn.svg)
    said = " ".join(texts)
    assert all(word in said for word in (*name.split(), *method.split(), *clock.split(), "pulse"))
    assert "\u2026" not in said


def test_a_diagram_of_clocks_breaks_no_word_and_no_figure() -> None:
    """A name of a key goes on after its dot, a role keeps its word, a unit its figure."""
    sensor = Stamped("multirotor \u00b7 position", "multirotor.position", "1PPS input",
                     "Timer or FPGA capture (100 MHz)", False, 1e-8, None, True)  # fmt: skip
    drawn = clocks([ClockedVehicle("multirotor", (sensor,), "OCXO", 7.3e-5)])
    texts = re.findall(r"<text[^>]*>([^<]*)</text>", drawn.svg)
    assert {"multirotor.", "position", "(100\u00a0MHz)"} <= set(texts)
    (role,) = (text for text in texts if "\u00b7" in text)
    assert role.startswith("multi")
    assert role.endswith("\u2026 \u00b7 position")


@pytest.mark.parametrize(
    ("label", "shown"),
    [("2.92522 m/s", "2.925 m/s"), ("0.0123456 deg", "0.01235 deg"), ("12 m", "12 m"),
     ("0.123456", "0.1235"), ("12.3456 %", "12.3456 %"), ("38412.5 EUR", "38412.5 EUR"),
     ("sbg_apogee", "sbg_apogee")],
)  # fmt: skip
def test_drawn_values_have_four_figures_and_listed_ones_all_of_theirs(
    label: str, shown: str
) -> None:
    drawn = Factor("key", (label,), "sample", (), listed=False)
    assert shown_value(drawn, label).replace("\u00a0", " ") == shown
    assert shown_value(Factor("key", (label,), "grid", ()), label) == label


@pytest.mark.parametrize("limit_m", [6.0, 500.0])
def test_a_lax_limit_makes_no_slivers_of_what_is_drawn(limit_m: float) -> None:
    """Beyond five times all that is drawn it is told at the edge: the bars keep their room."""
    limit = cast(numbers.Limited, SimpleNamespace(limit=limit_m, unit="m", limit_written=None))
    bars = ledger([LedgerBar("range noise", 4.0, "sensor")], limit)
    bins = error_histogram(
        DensityBars((0.0, 1.0, 2.0, 3.0), (0.2, 0.5, 0.3), (("50 %", 1.5),), limit, None)
    )
    for drawn in (bars, bins):
        assert max(told.left + told.wide for told in drawn.told) > 0.3 * WIDTH
        assert ("limit" in drawn.svg, "\u2192" in drawn.svg) == (True, limit_m > 20.0)


@pytest.mark.parametrize(("limit_m", "arrow"), [(1e-9, "\u2191"), (5e-3, ""), (2e6, "\u2193")])
def test_a_limit_far_from_all_errors_leaves_them_the_frame(limit_m: float, arrow: str) -> None:
    """Errors of 0.3 m to some 80 m: a limit of 1 nm at the edge, not nine decades of nothing."""
    limit = cast(numbers.Limited, SimpleNamespace(limit=limit_m, unit="m", limit_written=None))
    curve = SynclineCurve(0.29, 157.0, 1.85e-3, 24e-6, 0.294, limit)
    svg = syncline(curve).svg
    label = re.search(r">limit [^<]*<", svg)
    assert label is not None
    assert "".join(re.findall("[\u2191\u2193]", label[0])) == arrow
    box = syncline(curve).box
    assert box.log_top - box.log_bottom < 6.0


@pytest.mark.parametrize(
    ("value", "limit", "shown"),
    [(0.3, 0.4, "25 % to spare"), (0.9, 0.4, "125 % over"), (4.4, 0.4, "11 times the limit"),
     (17.6, 1e-3, "17 600 times the limit"), (3.0, 1e-9, "3.00e+09 times the limit")],
)  # fmt: skip
def test_a_miss_by_far_is_told_as_a_multiple(value: float, limit: float, shown: str) -> None:
    row = cast(RequirementResult, SimpleNamespace(value=value, limit=limit))
    assert margin_text(row).replace("\u00a0", " ") == shown


@pytest.mark.parametrize(
    ("value_m", "shown"),
    [(5.074e-4, "507.4 um"), (9.9e-5, "99000 nm"), (0.2945, "294.5 mm"), (2e-9, "2 nm")],
)
def test_a_figure_keeps_the_unit_of_its_limit_while_it_can_be_read(
    value_m: float, shown: str
) -> None:
    assert beside("1 nm", value_m, "m") == shown


def test_those_that_fail_are_named_where_the_table_is_long() -> None:
    rows = cast(
        list[RequirementResult],
        [SimpleNamespace(id=f"R{k}", status="fail" if k % 2 else "pass") for k in range(20)],
    )
    assert failing_text(rows) == "10 of 20: R1, R3, R5, R7, R9, R11 and 4 more"
    assert failing_text(rows[:8]) == ""
    assert failing_text(rows[::2]) == ""


def test_the_axis_of_a_map_keeps_its_title_in_the_frame() -> None:
    """Equal scales push the limits out once the box is known, here to a label `-100`."""

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        axes.plot([-35.0, 295.0], [-55.0, 215.0])
        from_above(axes)

    drawn = draw("fig-map", "Map", "a map", (WIDTH, 340.0), build).svg
    (foot,) = re.findall(r'x="(-?[\d.]+)" y="[\d.]+" transform="rotate\(-90', drawn)
    assert float(foot) > 9.0  # letters of 10 px stand on it, to the left


def test_designs_that_no_word_tells_apart_are_told_once_and_counted() -> None:
    front = [FrontMark(100.0, 1.0, True, "A (gpio)"), FrontMark(200.0, 0.5, False, "B (gpio)")]
    same = [FrontMark(150.0, 0.8, False, "C (arrival)")] * 3
    other = FrontMark(150.0, 0.9, False, "C (arrival)")
    drawn = pareto_front(front, "EUR", None, None, cloud=[front[0], *same, other])
    said = [dict(tip.says) for tip in drawn.told]
    assert [(one["Design"], one.get("Alike", "")) for one in said] == [
        ("A (gpio)", ""), ("B (gpio)", ""),
        ("C (arrival)", "3, which differ in signal or clock"), ("C (arrival)", ""),
    ]  # fmt: skip


def test_a_front_stands_before_all_designs_but_those_that_leave_it_no_room() -> None:
    seen = [FrontMark(30.0, 29.0, False), FrontMark(500.0, 0.1, False)]
    unseen = [FrontMark(600.0, 1.0, False), FrontMark(100.0, 31.0, False)]
    assert in_view([*seen, *unseen], [100.0, 200.0], 1.0, None) == seen


def test_the_ticks_of_an_axis_have_one_unit_where_one_serves_them_all() -> None:
    """`0.1 m ... 100 m`, not `100 mm ... 100 m`; but 10 um is not written 0.00001 m."""
    told = {
        (0.1, 1.0, 10.0, 100.0): ["0.1 m", "1 m", "10 m", "100 m"],
        (0.0, 0.0005, 0.001, 0.0015): ["0", "0.5 mm", "1 mm", "1.5 mm"],
        (1e-5, 1e-3, 0.1, 10.0): ["10 \N{MICRO SIGN}m", "1 mm", "100 mm", "10 m"],
        (-0.002, 0.0, 0.001): ["\N{MINUS SIGN}2 mm", "0", "1 mm"],
    }
    for places, labels in told.items():
        assert _labels(places, lambda v: "0" if v == 0 else short_length(v)) == labels
    counts = [1.0, 10.0, 100.0, 1000.0, 10000.0]
    assert _labels(counts, numbers.count) == ["1", "10", "100", "1 000", "10 000"]
    assert _labels([1500.0, 2000.0], numbers.count) == ["1 500", "2 000"]


def _labels(places: Sequence[float], label: Callable[[float], str]) -> list[str]:
    axes = Figure().add_subplot()
    set_ticks(axes, "y", places, label)
    return [text.get_text().replace("\N{NO-BREAK SPACE}", " ") for text in axes.get_yticklabels()]
