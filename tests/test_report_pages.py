"""The pages of reproduce, simulate and diagnose: complete, escaped, and fit for missing parts."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import mpmath
import pytest

import report_samples as samples
from diagnosis_samples import DESIGN, LATENCY, diagnosis
from drawn_once import Kept
from html_page import Page
from syncline_design.comparison.meaning import DiagnosisAndDesign, ErrorFigure
from syncline_design.comparison.repairs import Repair, RepairStep
from syncline_design.diagnosis.finding import estimate, finding
from syncline_design.diagnosis.gap_result import WholeGap
from syncline_design.diagnosis.result import (
    Estimate,
    Joint,
    MotionQuantiles,
    NextDrive,
    PerLog,
    Rival,
)
from syncline_design.effects import registry
from syncline_design.machine.records import with_texts
from syncline_design.model.known import EffectEntry
from syncline_design.paper.plots import SimulatedPoint
from syncline_design.paper.reproduce import reproduce
from syncline_design.report import numbers
from syncline_design.report.document import Chart, TableNode
from syncline_design.report.on_diagnosis import on_diagnosis
from syncline_design.report.on_joint import scope_nodes
from syncline_design.report.on_paper import on_paper
from syncline_design.report.on_simulation import on_simulation
from syncline_design.report.render_console import console
from syncline_design.report.render_html import html
from syncline_design.report.render_markdown import markdown
from syncline_design.report.text import unbroken, visible
from syncline_design.report.words import effect_words
from syncline_design.simulation import SimulationSettings, simulate
from syncline_design.simulation.comparison import CAUSES
from syncline_design.verdict.tree import decided
from tests.simulation_systems import fixed_wing

pytestmark = pytest.mark.usefixtures("figures_drawn_once")


def hostile(text: str) -> DiagnosisAndDesign:
    """A diagnosis whose every text that is not one of ours is hostile; keys of mappings too."""
    ours = {"explained", "m/s", "s", "meets", "fails"}
    return with_texts(diagnosis(), lambda own: own if own in ours else text)


def test_page_is_well_formed_and_fetches_nothing() -> None:
    page = Page(html(on_diagnosis(diagnosis())))
    assert page.unbalanced == []
    assert len(page.scripts) == 1
    ids = [found["id"] for _, found in page.tags if "id" in found]
    assert len(ids) == len(set(ids))
    assert all(target.startswith("#") for target in page.attribute("a", "href"))
    assert page.attribute("img", "src") == []


def test_same_input_same_bytes(figures_drawn_once: Kept) -> None:
    first = html(on_diagnosis(diagnosis()))
    figures_drawn_once.clear()
    assert html(on_diagnosis(diagnosis())) == first


def test_errors_beside_a_limit_stand_in_its_unit() -> None:
    """An accuracy of `0.30 m` in the spec: no millimetres among what the design comes to."""
    limit = decided(id="ACC-1", kind="accuracy", status="pass", value=0.117, limit=0.3, unit="m",
                    limit_written="0.30 m")  # fmt: skip
    step = RepairStep("nothing", "latency", "position", "car", "leave it", "")
    left = Repair(0.0, "EUR", 0.0934, "meets", (), (step,), cheapest=True, beaten=False)
    design = replace(DESIGN, before=replace(DESIGN.before, requirements=(limit,)))
    told = console(on_diagnosis(diagnosis(design=design, repairs=(left,)))).replace("\u00a0", " ")
    meant = told[told.index("The error without and with") :]
    for text in ("0.117 m", "3.94 m", "0.100 m", "0.68 m", "0.6 m to 0.7 m", "0.0934 m"):
        assert text in meant
    assert " mm" not in meant
    plain = console(on_diagnosis(diagnosis())).replace("\u00a0", " ")
    assert "117 mm" in plain  # without a limit by the ladder


def test_hostile_text_stays_text() -> None:
    text = "".join(samples.HOSTILE)
    page = Page(html(on_diagnosis(hostile(text))))
    assert len(page.scripts) == 1
    assert page.attribute("img", "src") == []
    assert page.unbalanced == []
    assert visible(text) in " ".join(page.texts)
    assert "<img" not in markdown(on_diagnosis(hostile(text)))


BARE: tuple[dict[str, Any], ...] = (
    {"design": None, "spec": None},
    {"findings": (), "steps": (), "gap": WholeGap(), "where": (), "unseen": ()},
    {"first_disagreement_s": None, "log_files": (), "checks": (), "verdict": "agrees"},
    {"plots": replace(diagnosis().plots, where_map=(), coverage=())},
    {"design": replace(DESIGN, figures=(ErrorFigure("x", "Syncline", None, None),))},
)


@pytest.mark.parametrize("bare", BARE)
def test_any_part_may_be_empty(bare: dict[str, Any]) -> None:
    found = diagnosis(**bare)
    assert Page(html(on_diagnosis(found))).unbalanced == []
    for text in (
        html(on_diagnosis(found)),
        markdown(on_diagnosis(found)),
        console(on_diagnosis(found)),
    ):
        assert "None" not in re.sub(r"<dd><code>None</code>", "", text)


def test_reproduction_shows_printed_beside_computed() -> None:
    result = samples.reproduction()
    page = Page(html(on_paper(result)))
    assert (page.unbalanced, len(page.scripts)) == ([], 1)
    for cell in (*result.cells, *result.inputs):
        assert f"printed {numbers.typeset(cell.printed_text)}" in page.text
    for words in (
        "519.62\u00a0ms", "44 of 46 agree, 2 documented errata", "Printed 1.67 m.", "10 per metre",
        "B \u00b7 ",
    ):  # fmt: skip
        assert unbroken(words) in page.text
    assert page.attribute("article", "id") == [f"figure-{number}" for number in range(1, 8)]
    assert html(on_paper(result)) == html(on_paper(reproduce(simulate=False, seed=0)))


def test_reproduction_says_how_near_the_simulation_comes() -> None:
    result = samples.reproduction()
    points = (SimulatedPoint(1e-3, 0.14, 0.965), SimulatedPoint(1e-2, 0.5, 1.0))
    figures = list(result.figures)
    figures[2] = replace(figures[2], simulated=points)
    told = replace(result, figures=tuple(figures))
    for text in (Page(html(on_paper(told))).text, console(on_paper(told)).replace(" %", "\u00a0%")):
        assert "96.5\u00a0% to 100\u00a0% of the Syncline" in text


def test_a_failed_reproduction_says_so() -> None:
    result = samples.reproduction()
    wrong = replace(result.cells[0], status="differs", note="by much")
    told = on_paper(replace(result, cells=(wrong, *result.cells[1:]), ok=False))
    assert "Some printed figures differ" in Page(html(told)).text
    assert "\u2717 differs, by much" in console(told)


def test_simulation_tells_ratio_reason_and_certificate() -> None:
    document, result = samples.simulation()
    page = Page(html(document))
    assert (page.unbalanced, len(page.scripts)) == ([], 1)
    ratios = [row.ratio for row in result.grid]
    assert f"{100 * min(ratios):.4g}\u00a0%" in page.text
    said = [cause for row in result.grid for cause in row.causes]
    assert said
    for row in result.grid:  # the share of each cause beside its name, `tilt (up to 1.2 %)`
        for cause, share in zip(row.causes, re.findall(r"\(([^()]*%)\)", row.reason), strict=True):
            assert f"{cause.replace('_', ' ')} ({unbroken(share)})" in page.text
    fold = page.text[page.text.index("Worst case and Syncline at every") :]
    for cause in set(said):
        assert fold.count(CAUSES[cause]) == 1
    found = result.monte_carlo
    for words in (
        "a turn moves the object along a chord", "nothing exceeds the bound", "specs/uav.yaml",
        numbers.length(found.quantile(0.95).value_m), numbers.length(found.worst_case.bound_m),
        numbers.length(found.worst_case.syncline_m),
    ):  # fmt: skip
        assert words in page.text
    assert html(document) == html(samples.simulation()[0])


@pytest.fixture(scope="module")
def diagnosed() -> Page:
    return Page(html(on_diagnosis(diagnosis())))


@pytest.mark.parametrize(
    "words",
    [
        "GNSS positions are 87.1 ms older than their stamps.",
        "87.1 \u00b1 0.3 ms".replace(" ", "\u00a0"),
        "This log cannot tell it apart from lever arm (position)",
        "vary the speed",
        "98.1\u00a0%",
        "2\u00a0987 of 3\u00a0000",
        "missing values",
        "28.3\u00a0cm",
        "along, speed 6.2\u00a0m/s to 9\u00a0m/s: mean \u221265.2\u00a0cm, 508 standard errors",
        "Told apart on this log from filter lag (position), 141\u00a0nat worse",
        "boresight: the vehicle never tilted",
        "after, plus a placebo: boresight (ranging)",
        "held-out regime (speed above 7 m/s), after",
        "ACC-1 now fails",
    ],
)
def test_diagnosis_says(diagnosed: Page, words: str) -> None:
    assert unbroken(words) in diagnosed.text


@pytest.mark.parametrize(
    ("verdict", "words"),
    [
        ("agrees", "nothing is missing"),
        ("explained", "what remains is noise"),
        ("unexplained", "no effect of the dictionary explains"),
    ],
)
def test_diagnosis_verdicts(verdict: str, words: str) -> None:
    assert words in Page(html(on_diagnosis(diagnosis(verdict=verdict)))).text


@pytest.mark.parametrize(
    ("value", "uncertainty", "unit", "text"),
    [
        (0.0871, 0.0003, "s", "87.1 \u00b1 0.3 ms"),
        (-0.37, 0.0123, "m", "\u221237.0 \u00b1 1.2 cm"),
        (0.35312, 0.0021, "m", "35.31 \u00b1 0.21 cm"),
        (math.radians(0.25), math.radians(0.011), "rad", "0.250 \u00b1 0.011 deg"),
        (1e-5, 2e-4, "s", "10 \u00b1 200 \u00b5s"),
        (3.0, None, "", "3"),
        (18.0, 0.0, "s", "18 s"),
        (4.7e-5, 2.0e-6, "", "47.0 \u00b1 2.0 ppm"),
    ],
)
def test_estimates_end_where_their_uncertainty_does(
    value: float, uncertainty: float | None, unit: str, text: str
) -> None:
    assert numbers.with_uncertainty(value, uncertainty, unit) == text.replace(" ", "\u00a0")


@pytest.mark.parametrize(
    ("value", "uncertainty", "unit"),
    [
        (0.123, 0.004, "m"),
        (-0.0871, 0.0003, "s"),
        (1e-4, 2e-6, "rad/s"),
        (5.9e-5, 1e-6, ""),
        (-0.0032, 0.0001, "m/(m/s2)"),
        (0.02, None, "rad"),
    ],
)
def test_a_finding_reads_the_same_on_console_page_markdown_and_json(
    value: float, uncertainty: float | None, unit: str
) -> None:
    """One estimate through all four outputs; mpmath undoes the unit and finds the value again."""
    effect = replace(registry()["latency"], sentence="it is {latency_s}", reverse="")
    figures = {"latency_s": estimate(value, uncertainty, unit)}
    found = finding(effect, "position", "uav", figures, "clear", 1.0, -5.0)
    printed = found.sentence.removeprefix("It is ")
    assert found.to_json()["parameters"]["latency_s"]["text"] == printed
    data = diagnosis(findings=(found,))
    typeset = printed.replace("-", "\u2212").replace(" ", "\u00a0")
    assert typeset in Page(html(on_diagnosis(data))).text
    assert typeset in markdown(on_diagnosis(data)).replace("\\", "")
    body, _, shown = printed.rpartition(" ")
    size = {
        "cm": "1e-2", "ms": "1e-3", "ppm": "1e-6", "mm/(m/s2)": "1e-3",
        "deg": mpmath.pi / 180, "deg/h": mpmath.pi / 648000,
    }[shown]  # fmt: skip
    middle, _, spread = body.partition(" \u00b1 ")
    tolerance = abs(mpmath.mpf(uncertainty or value)) / 10
    assert abs(mpmath.mpf(middle) * mpmath.mpf(size) - mpmath.mpf(value)) < tolerance
    if uncertainty is not None:
        assert abs(mpmath.mpf(spread) * mpmath.mpf(size) - mpmath.mpf(uncertainty)) < tolerance


@pytest.mark.parametrize("exponent", range(-9, 4))
def test_shown_length_is_the_value_to_four_figures(exponent: int) -> None:
    value = 1.23456 * 10.0**exponent
    text = numbers.length(value)
    figure, unit = text.split("\u00a0")
    factor = {"nm": "1e-9", "\u00b5m": "1e-6", "mm": "1e-3", "m": "1", "km": "1e3"}[unit]
    shown = mpmath.mpf(figure) * mpmath.mpf(factor)
    assert abs(shown - mpmath.mpf(value)) <= mpmath.mpf(value) * mpmath.mpf("5e-4")
    assert 1 <= float(figure) < 1000 or unit in ("nm", "km")


def test_missing_figures_read_as_missing() -> None:
    for show in (numbers.length, numbers.time, numbers.percent, numbers.number, numbers.count):
        for value in (None, math.nan, math.inf, "text", True):
            assert show(value) == numbers.MISSING
    assert numbers.time_limit(None) == "unlimited"
    assert numbers.money(38_400.0, "EUR") == "38\u00a0400\u00a0EUR"


def test_a_page_says_fits_worse_only_of_what_does() -> None:
    """Each effect in the named one's place carries its own comparison, not a common heading."""
    alike = (
        Rival("packetised_timestamps", "attitude", "car", 0.99, -157.4, possible=False),
        Rival("filter_lag", "position", "car", 0.999, 31.6, possible=True),
    )
    data = diagnosis(findings=(replace(LATENCY, lookalikes=alike),))
    page = " ".join(Page(html(on_diagnosis(data))).text.split())
    plain = re.sub(r"\\(.)", r"\1", markdown(on_diagnosis(data))).replace("\u00a0", " ")
    for text in (page, plain):
        assert "fits worse" not in text
        assert "157 nat better, but this log does not scatter as it would have to" in text
        assert "filter lag (position), 31.6 nat worse" in text
        assert re.search("told apart on this log from filter lag .*141 nat worse", text, re.I)


def test_markdown_of_a_diagnosis_says_what_the_page_says_of_gap_and_log() -> None:
    """They stood on the page and the console only."""
    own = diagnosis().log
    log = replace(own, fitted=2900, thinned=5000, notes=("heading_deg was read as yaw",))
    data = diagnosis(log=log)
    text = re.sub(r"\\(.)", r"\1", markdown(on_diagnosis(data))).replace("\u00a0", " ")
    for words in (
        "The spec's noise expects** 2.17 cm", "Gap closed on held-out data** 98.1 %",
        "Log: 2 987 of 3 000 rows used, 2 900 fitted", "5 000 rows are between windows",
        "Left out: 13 (missing values)", "heading_deg was read as yaw",
    ):  # fmt: skip
        assert words in text


def test_a_page_and_the_console_say_alike_what_a_log_varied() -> None:
    """The page showed the record: `speed low 0.8178, high 7.826, unit m/s`."""
    motion = {
        "speed": MotionQuantiles(0.81784, 7.8261, "m/s"),
        "turn_rate": MotionQuantiles(-23.604, 23.37, "deg/s"),
    }
    plain = diagnosis()
    document = on_diagnosis(replace(plain, log=replace(plain.log, motion=motion)))
    wanted = "speed 0.818 to 7.83 m/s, turn rate \u221223.6 to 23.4 deg/s"
    for text in (Page(html(document)).text, console(document), markdown(document)):
        assert wanted in " ".join(text.replace("\u00a0", " ").split())


def test_the_tau_of_stamps_is_not_called_the_systems_where_a_latency_adds_to_it() -> None:
    """`check` tells 10.02 ms as the system's tau where `simulate` named 24.16 us so."""
    plain = fixed_wing()
    late = replace(
        plain, effects=(EffectEntry("latency", "position", "uav", (("latency_s", 0.01),)),)
    )
    for system, words in ((plain, "At the system's own"), (late, "known effects besides")):
        result = simulate(system, SimulationSettings(samples=40, tau_grid_s=(1e-3,)))
        text = " ".join(console(on_simulation(result, system)).split())
        assert words in text
        assert ("system's own" in text) == (system is plain)


def test_a_column_of_many_logs_is_in_one_unit_and_in_words() -> None:
    every = [Estimate(988e-6, 387e-6, "s", True, "988 \u00b1 387 us"),
             Estimate(1.1e-3, 0.6e-3, "s", True, "1.1 \u00b1 0.6 ms"),
             Estimate(0.0, math.inf, "s", False, "(not seen)")]  # fmt: skip
    logs = tuple(PerLog(k, f"{k}.csv", f"#{k}", {"time_constant_s": one})
                 for k, one in enumerate(every, 1))  # fmt: skip
    found = replace(LATENCY, effect="filter_lag", scope="log", per_log=logs, one_value=1e-4)
    (shown,) = (node for node in scope_nodes(found) if isinstance(node, TableNode))
    assert [row[2].text for row in shown.table.rows] == [
        "1.0 \u00b1 0.4 ms", "1.1 \u00b1 0.6 ms", "(not seen)",
    ]  # fmt: skip
    assert shown.table.heads[2].text == "time constant"
    assert shown.table.caption == "filter lag (position) in each log"
    assert shown.reach == "everywhere"  # no figure says the same


def test_a_page_has_the_values_of_logs_once() -> None:
    """Where a figure has them as its values; the console, which draws nothing, has the table."""
    every = [Estimate(0.5, 0.003, "m", True, "50.0 \u00b1 0.3 cm", (0.494, 0.506)),
             Estimate(-0.4, 0.004, "m", True, "-40.0 \u00b1 0.4 cm", (-0.408, -0.392))]  # fmt: skip
    logs = tuple(PerLog(k, f"{k}.csv", f"#{k}", {"bias_m": one})
                 for k, one in enumerate(every, 1))  # fmt: skip
    found = replace(LATENCY, effect="range_bias", scope="log", per_log=logs, one_value=1e-4)
    (shown,) = (node for node in scope_nodes(found) if isinstance(node, TableNode))
    assert shown.reach == "text"
    (drawn,) = (node for node in scope_nodes(found) if isinstance(node, Chart))
    assert [dict(one.says)["95 % interval"] for one in drawn.draw().told] == [
        "49.4\u00a0cm to 50.6\u00a0cm", "\u221240.8\u00a0cm to \u221239.2\u00a0cm",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("lever_arm(position): x_m, z_m", "lever arm (position): x, z"),
        ("timestamp_drift(attitude)", "timestamp drift (attitude)"),
        ("lever_arm (auv.position): z_m", "lever arm (auv.position): z"),
    ],
)
def test_effects_are_called_as_the_field_calls_them(text: str, said: str) -> None:
    assert effect_words(text) == said


def test_logs_taken_together_are_several_where_the_drive_is_told() -> None:
    drive = NextDrive("latency(position)", "lever_arm(position)", 2.0, 2.0, True, ("1 slalom",), 4,
                      "syncline-design plan spec.yaml")  # fmt: skip
    one = markdown(on_diagnosis(diagnosis(plan=drive)))
    assert "This log cannot tell latency" in one
    joint = Joint((), 1, None, None, 0)
    several = markdown(on_diagnosis(diagnosis(plan=drive, joint=joint)))
    assert "These logs cannot tell latency" in several


def test_a_sentence_has_the_micro_sign_as_the_figures_below_it() -> None:
    """In a terminal, on the page and in Markdown; the JSON keeps its ASCII."""
    found = diagnosis(findings=(replace(LATENCY, sentence="Stamps are 854 us late"),))
    for shown in (console, html, markdown):
        words = shown(on_diagnosis(found)).replace("\u00a0", " ")
        assert "854 \u00b5s late" in words
        assert "854 us" not in words
