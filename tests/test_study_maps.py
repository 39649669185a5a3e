"""Pictures and tables of a study: only what was computed, costs by strength, nothing too wide."""

from __future__ import annotations

import json
import random
import re
import time
from dataclasses import dataclass, replace
from decimal import ROUND_HALF_DOWN, ROUND_HALF_UP, Context, Decimal
from pathlib import Path
from typing import Any

import pytest

from browsing import Opened
from study_specs import SPEC, write
from syncline_design.report.charts_along import over_key
from syncline_design.report.charts_cells import _outline
from syncline_design.report.charts_study import cost_map, sampled_cases
from syncline_design.report.on_study import _common, on_study
from syncline_design.report.render_console import console
from syncline_design.report.render_html import html
from syncline_design.report.render_markdown import markdown_table
from syncline_design.report.studies import render_study
from syncline_design.report.study_words import (
    MOST_ACROSS,
    heat_table,
    short_key,
    winners_table,
)
from syncline_design.spec.keys import label
from syncline_design.studies import StudyResult, StudySettings, run_study
from syncline_design.studies.loading import Study, load_study
from syncline_design.studies.scatter import along, scatter
from syncline_design.studies.summary import Brief, HeatMap, StudySummary, heat_map, summarise

SAMPLE = """\
study: 1
name: Sample
base: [spec.yaml]
sample:
  count: {count}
  seed: 3
  over:
    "stages[uav].distance": 30 m .. 140 m
    "stages[uav].v_max": {{low: 1 m/s, high: 60 m/s, scale: log}}
{more}meets_when: decided
"""
WORDS = '    "stages[uav].ranging.sensor": [velodyne_hdl32e, riegl_vux1uav]\n'
GRID = """\
study: 1
name: Grid
base: [spec.yaml]
grid:
  "stages[uav].distance": {{low: 30 m, high: 140 m, count: {across}}}
  "requirements[ACC-1].limit": {{low: 0.05 m, high: 0.5 m, count: {up}}}
meets_when: decided
"""


# One sensor a role: the cases differ all the same, and take a fraction of the time.
NARROW = (
    SPEC.replace("[ublox_f9p_rtk, ublox_f9p_pvt]", "[ublox_f9p_rtk]")
    .replace("[velodyne_hdl32e, riegl_vux1uav]", "[velodyne_hdl32e]")
    .replace("[hardware, gpio]", "[gpio]")
)


def done(folder: Path, study: str, spec: str = NARROW) -> StudyResult:
    return run_study(write(folder, study, spec), StudySettings(workers=1))


@pytest.mark.parametrize("count", [2, 7, 40])
def test_a_sample_is_points_and_never_a_grid_with_empty_cells(tmp_path: Path, count: int) -> None:
    result = done(tmp_path, SAMPLE.format(count=count, more=""))
    summary = summarise(result)
    assert heat_map(summary) is None
    found = scatter(summary)
    assert found is not None
    rows = [(case.labels, case.verdict) for case in result.cases()]
    assert len(found.points) == len(rows) == count
    for point, (labels, verdict) in zip(found.points, rows, strict=True):
        distance, speed = (float(text.split(" ")[0]) for text in labels.values())
        assert (point.x, point.y, point.verdict) == (distance, speed, verdict)
    assert (found.x.unit, found.y.unit, found.x.log) == ("m", "m/s", False)
    svg = sampled_cases(found, "EUR").svg
    missed = sum(verdict != "meets" for _, verdict in rows)
    if missed:
        assert f"does not meet ({missed})" in svg
    if missed < count:
        assert f">meets ({count - missed})<" in svg
    page = str(render_study("html", result))
    assert "no case meets" not in page
    assert "Least cost" not in console(on_study(result))


def test_where_a_sensor_wins_has_the_digits_that_its_cases_have(tmp_path: Path) -> None:
    """Drawn values to four figures, here by decimal arithmetic, in that table as in the cases."""
    result = done(tmp_path, SAMPLE.format(count=40, more=""))
    labels = [text.split() for case in result.cases() for text in case.labels.values()]
    listed = {
        f"{Context(4, tie).plus(Decimal(figure)).normalize():f} {unit}"
        for figure, unit in labels for tie in (ROUND_HALF_UP, ROUND_HALF_DOWN)
    }  # fmt: skip
    rows = winners_table(summarise(result)).rows
    ends = [end for row in rows for cell in row[4:] for end in re.split(" to |, ", cell.text)]
    told = {end.replace("\u00a0", " ") for end in ends} - {"everywhere", "..."}
    assert len(told) > 2
    assert told <= listed


def test_named_axes_and_words_are_kept(tmp_path: Path) -> None:
    axes = 'heat_map: {x: "stages[uav].distance", y: "stages[uav].ranging.sensor"}\n'
    result = done(tmp_path, SAMPLE.format(count=9, more=WORDS + axes))
    found = scatter(summarise(result))
    assert found is not None
    assert found.y.words == ("velodyne_hdl32e", "riegl_vux1uav")
    assert {point.y for point in found.points} <= {0.0, 1.0}
    assert found.others == ("stages[uav].v_max",)
    picture = sampled_cases(found, "EUR").svg
    assert "velodyne_hdl32e" in picture


def test_a_scale_of_few_prices_shows_them_and_a_mark_that_meets_is_filled(tmp_path: Path) -> None:
    found = scatter(summarise(done(tmp_path, SAMPLE.format(count=40, more=WORDS), SPEC)))
    assert found is not None
    svg = sampled_cases(found, "EUR").svg
    costs = {point.cost for point in found.points if point.cost is not None}
    assert 1 < len(costs) < 4
    for cost in costs:
        assert f"{cost:,.0f}".replace(",", "\u00a0") in svg
    strengths = {float(one) for one in re.findall(r"fill-opacity: ([\d.]+)", svg)}
    assert strengths
    assert min(strengths) > 0.15


@pytest.mark.parametrize(
    ("key", "shown"),
    [
        ("stages[uav].distance", "uav.distance"),
        ("stages[uav].ranging.sensor", "uav.ranging.sensor"),
        ("requirements[ACC-1].limit", "ACC-1 limit"),
        ("catalog.sensors[apogee].cost", "apogee cost"),
        ("stages[0].distance", "stages[0].distance"),
        ("coverage_factor", "coverage_factor"),
    ],
)
def test_a_key_path_has_a_short_name_that_no_other_has(key: str, shown: str) -> None:
    assert short_key(key) == shown


def test_a_front_of_a_case_that_many_keys_tell_apart_is_named_by_its_number(
    tmp_path: Path,
) -> None:
    """Of four keys a legend would be cut before it says what differs."""
    more = '    "stages[uav].omega_max": 9 deg/s .. 60 deg/s\n    "coverage_factor": 1 .. 2\n'
    result = done(tmp_path, SAMPLE.format(count=9, more=more), SPEC)
    page = html(on_study(result))
    legend = page[page.index('id="fig-fronts-legend') :]
    names = set(re.findall(r">(case \d)<", legend.partition("</svg>")[0]))
    assert names == {f"case {case.number}" for case in result.cases() if case.record.front}
    assert len(names) > 1
    told = page[page.index("What varies</h2>") :]
    assert "stages[uav].omega_max" in told
    assert "stages[" not in page.partition("What varies</h2>")[0]


def test_a_sample_crossed_with_a_grid_keeps_its_map(tmp_path: Path) -> None:
    """Every sampled height is computed at every limit: no cell of that map is empty."""
    grid = 'grid: {"requirements[ACC-1].limit": [0.2 m, 0.3 m]}\n'
    text = SAMPLE.format(count=5, more=grid)
    speed = '    "stages[uav].v_max": {low: 1 m/s, high: 60 m/s, scale: log}\n'
    result = done(tmp_path, text.replace(speed, ""))
    heat = heat_map(summarise(result))
    assert heat is not None
    assert (len(heat.x_values), len(heat.y_values)) == (2, 5)


ONE = """\
study: 1
name: One key
base: [spec.yaml]
grid:
  {key}
meets_when: decided
"""


@pytest.mark.parametrize(
    "key",
    ['"stages[uav].distance": [30 m, 80 m, 500 m]',
     '"stages[uav].ranging.sensor": [velodyne_hdl32e, riegl_vux1uav]'],
)  # fmt: skip
def test_a_study_of_one_key_shows_every_case_over_it(tmp_path: Path, key: str) -> None:
    """Price and error of each case once a panel; without a design it has a place at the edge."""
    result = done(tmp_path, ONE.format(key=key))
    summary = summarise(result)
    data = along(summary)
    assert data is not None
    drawn = over_key(data, "EUR", summary.accuracy, [[("Case", str(b.number))] for b in
                                                    summary.briefs])  # fmt: skip
    told = [place.says["Case"] for place in drawn.told]
    assert sorted(told) == sorted([str(b.number) for b in summary.briefs] * 2)
    across = bool(data.axis.words)  # words stand below one another, values run to the right
    for panel in (drawn.told[: len(summary.briefs)], drawn.told[len(summary.briefs) :]):
        missing = [p for p, b in zip(panel, summary.briefs, strict=True) if b.error_m is None]
        having = [p for p, b in zip(panel, summary.briefs, strict=True) if b.error_m is not None]
        for without in missing:
            assert all(without.left < p.left if across else without.top > p.top for p in having)
    page = html(on_study(result))
    assert 'id="along"' in page
    values = page.partition('id="along"')[2].partition("</figure>")[0].partition("Values")[2]
    assert values.count("<tr>") == 1 + len(summary.briefs), "once, though in two panels"


def test_a_waived_miss_is_half_filled_and_said(tmp_path: Path) -> None:
    """It meets by a waiver alone: mark, legend and words tell it from what keeps every limit."""
    asked = "limit: 100000 EUR"
    spec = NARROW.replace(asked, "limit: 100 EUR, waiver: {reason: paper, expires: 2999-01-31}")
    assert spec != NARROW
    result = done(tmp_path, ONE.format(key='"stages[uav].distance": [30 m, 31 m]'), spec)
    assert [point.waived for point in getattr(along(summarise(result)), "points", ())] == [True] * 2
    page = html(on_study(result)).partition('id="along"')[2].partition("</section>")[0]
    assert "meets, waived (2)" in page
    assert "meets, COST-1 waived" in page, "the words of the figure"
    assert "Fails" not in page


def test_a_front_that_some_cases_share_is_not_said_to_be_of_every_case(tmp_path: Path) -> None:
    result = done(tmp_path, ONE.format(key='"stages[uav].distance": [30 m, 60 m, 90 m]'))
    summary = summarise(result)
    numbers_of = [brief.number for brief in summary.briefs]
    shared = replace(summary.fronts[0], cases=tuple(numbers_of[:2]))
    assert _common(summary, shared) == "case 1 and 1 more"
    assert _common(summary, replace(shared, cases=tuple(numbers_of))) == "every case"
    assert _common(summary, replace(shared, cases=(2,))) == "uav.distance 60 m"


def test_a_terminal_and_a_page_tell_why_cases_cannot_be_as_combined(tmp_path: Path) -> None:
    key = '"stages[uav].position.timestamping": [gpio, ntp]'
    document = on_study(done(tmp_path, ONE.format(key=key)))
    shown = " ".join(console(document, colour=False).split())
    assert "ntp cannot stamp ublox_f9p_rtk" in shown
    assert "(1 of 2)" in shown
    assert "Which cases cannot be as combined" in html(document)


def test_a_study_of_two_keys_has_no_such_figure(tmp_path: Path) -> None:
    result = done(tmp_path, GRID.format(across=2, up=2))
    assert along(summarise(result)) is None
    assert 'id="along"' not in html(on_study(result))


def test_dearer_cells_are_stronger_whatever_the_theme(tmp_path: Path) -> None:
    result = done(tmp_path, GRID.format(across=4, up=5))
    heat = heat_map(summarise(result))
    assert heat is not None
    svg = cost_map(heat).svg
    cells = svg.partition('id="fig-heat-legend')[0]
    strengths = [
        float(found) for found in re.findall(r"fill: var\(--series-1\); opacity: ([\d.]+)", cells)
    ]
    costs = [cost for row in heat.least_cost for cost in row if cost is not None]
    assert len(strengths) == len(costs)
    assert len(set(costs)) > 1
    order = sorted(range(len(costs)), key=lambda i: costs[i])
    assert [strengths[i] for i in order] == sorted(strengths)
    assert svg.count("\u2715") == sum(cost is None for row in heat.least_cost for cost in row)
    assert "darker" not in str(render_study("html", result))


def drawn_map(across: int, up: int) -> HeatMap:
    """A map of costs drawn at random, a third of its cells empty."""
    drawn = random.Random(across + 100 * up)
    cost = tuple(
        tuple(drawn.choice([None, drawn.uniform(1e3, 9e4), 5e4]) for _ in range(across))
        for _ in range(up)
    )
    names = [tuple(f"{k} m" for k in range(n)) for n in (across, up)]
    return HeatMap(
        "a.x", "b.y", "EUR", names[0], names[1], cost, tuple(("",) * across for _ in range(up))
    )


@pytest.mark.parametrize(("across", "up"), [(3, 12), (12, 3), (8, 40), (40, 8), (12, 12)])
def test_tables_of_costs_have_few_columns_and_every_cost(across: int, up: int) -> None:
    heat = drawn_map(across, up)
    shown = heat_table(heat)
    assert len(shown.heads) <= MOST_ACROSS + 1
    assert markdown_table(shown)
    costs = sorted(cost for row in heat.least_cost for cost in row if cost is not None)
    sorts = [cell.sort for row in shown.rows for cell in row if cell.text.endswith("EUR")]
    assert sorted(sort for sort in sorts if sort is not None) == costs
    if (across, up) == (40, 8):  # turned round: the column of a row's own value
        assert [cell.text for cell in shown.rows[7][:1]] == ["7 m"]
        values = [cell.sort for cell in shown.rows[7][1:]]
        assert values == [heat.least_cost[y][7] for y in range(8)]


def test_a_cell_without_a_verdict_is_not_said_to_fail(tmp_path: Path) -> None:
    summary = summarise(done(tmp_path, GRID.format(across=3, up=3)))
    unmet = [i for i, brief in enumerate(summary.briefs) if not brief.meets]
    assert unmet
    briefs = list(summary.briefs)
    briefs[unmet[0]] = replace(briefs[unmet[0]], verdict="indeterminate")
    heat = heat_map(replace(summary, briefs=tuple(briefs)))
    assert heat is not None
    assert heat.undecided == 1
    shown = heat_table(heat)
    assert shown.note == "In 1 cell a case got no verdict: what costs less may meet."
    assert [c.text for row in shown.rows for c in row if c.mark == "?"] == ["not known"]


def test_a_cell_says_of_its_price_and_of_none_what_they_rest_on(tmp_path: Path) -> None:
    """Of what is waived, refused and without a verdict: by the verdicts of its cases, here set."""
    summary = summarise(done(tmp_path, GRID.format(across=4, up=4)))
    meeting = [i for i, brief in enumerate(summary.briefs) if brief.meets]
    briefs = list(summary.briefs)
    first, second, third = meeting[:3]
    briefs[first] = replace(briefs[first], waived=("ACC-1",))
    briefs[second] = replace(briefs[second], verdict="refused", cost=None, picks=())
    briefs[third] = replace(briefs[third], verdict="indeterminate", cost=None, picks=())
    heat = heat_map(replace(summary, briefs=tuple(briefs)))
    assert heat is not None
    assert heat.cells is not None
    found = {(x, y): word for y, line in zip(heat.y_values, heat.cells, strict=True)
             for x, word in zip(heat.x_values, line, strict=True)}  # fmt: skip
    assert [found[briefs[k].labels] for k in meeting[:3]] == ["waived", "refused", "undecided"]
    shown = heat_table(heat)
    marks = {cell.mark for row in shown.rows for cell in row[1:]}
    assert marks >= {"\u25d0", "\u2013", "?"}
    for words in ("waived requirement missed", "cannot be as combined", "got no verdict"):
        assert words in shown.note
    told = {t.says["Least cost"] for t in cost_map(heat).told}
    assert {"cannot be as combined", "not known: a case got no verdict"} <= told
    assert any("with a waived requirement missed" in text for text in told)


DISTANCE, LIMIT = '"stages[uav].distance"', '"requirements[ACC-1].limit"'


def summary_of(folder: Path, *keys: str, more: str = "") -> StudySummary:
    """The summary of a grid as it would be, without a case computed: each meets at its price."""
    rows = "".join(f"  {key}\n" for key in keys)
    text = f"study: 1\nname: Grid\nbase: [spec.yaml]\ngrid:\n{rows}{more}meets_when: decided\n"
    study = load_study(write(folder, text, NARROW))
    briefs = tuple(
        Brief(k + 1, base, tuple(label(value) for _, value in settings), "meets", 1e3 + k, "EUR",
              0.1, ())
        for k, (base, settings) in enumerate(map(study.case, range(len(study))))
    )  # fmt: skip
    result = Computed(study)
    return StudySummary(result, briefs, ())  # type: ignore[arg-type]


@dataclass(frozen=True)
class Computed:
    """Of a finished study what its maps ask for."""

    study: Study


@pytest.mark.parametrize(("across", "up"), [(41, 3), (41, 41), (100, 100), (3, 200)])
def test_a_grid_of_two_keys_is_a_map_however_fine(tmp_path: Path, across: int, up: int) -> None:
    heat = heat_map(summary_of(tmp_path, f"{DISTANCE}: {{low: 30 m, high: 140 m, count: {across}}}",
                               f"{LIMIT}: {{low: 0.05 m, high: 0.5 m, count: {up}}}"))  # fmt: skip
    assert heat is not None
    assert (len(heat.x_values), len(heat.y_values)) == (across, up)
    assert heat.least_cost == tuple(
        tuple(1e3 + up * x + y for x in range(across)) for y in range(up)
    )


def test_the_factors_of_a_map_are_those_that_had_one_before(tmp_path: Path) -> None:
    """Of 60, 3 and 2 values those of 3 and 2; only where these are no two, the finer ones."""
    fine = f"{DISTANCE}: {{low: 30 m, high: 140 m, count: 60}}"
    few = f"{LIMIT}: [0.1 m, 0.2 m, 0.3 m]", "coverage_factor: [1, 2]"
    heat = heat_map(summary_of(tmp_path, fine, *few))
    assert heat is not None
    assert (heat.x, heat.y) == ("requirements[ACC-1].limit", "coverage_factor")
    heat = heat_map(summary_of(tmp_path, fine, few[0]))
    assert heat is not None
    assert (heat.x, heat.y) == ("stages[uav].distance", "requirements[ACC-1].limit")
    many = f"{DISTANCE}: {{low: 30 m, high: 140 m, count: 201}}"
    assert heat_map(summary_of(tmp_path, many, few[0])) is None


def test_a_fine_map_tells_every_cell_in_few_elements() -> None:
    """100 x 100: areas of the paths of each look, from their corners, against its cells."""
    heat = drawn_map(100, 100)
    start = time.process_time()
    drawn = cost_map(heat)
    assert time.process_time() - start < 10.0
    assert len(drawn.told) == 10_000
    assert {tip.says["Least cost"] for tip in drawn.told} >= {"no case is known to meet"}
    assert drawn.svg.count("<path") < 200
    assert len(drawn.svg) < 1_000_000
    assert "\u2715" not in drawn.svg
    empty = sum(cost is None for row in heat.least_cost for cost in row)
    grounds = re.findall(r"<pattern .*?</pattern>", drawn.svg)
    assert grounds
    for pattern in grounds:  # lines in the colour of the theme, on no ground that hides them
        assert re.search(r'<rect [^>]*fill="none"', pattern)
        assert "stroke: var(--bad)" in pattern
    assert f"no case meets ({empty:,})".replace(",", "\u00a0") in drawn.svg


@pytest.mark.parametrize("seed", range(5))
def test_the_outline_of_cells_covers_them_and_no_other(seed: int) -> None:
    drawn = random.Random(seed)
    every = [(x, y) for x in range(9) for y in range(7)]
    chosen = drawn.sample(every, 30)
    outline = _outline(chosen)
    inside = [cell for cell in every if outline.contains_point(cell)]
    assert sorted(inside) == sorted(chosen)
    corners = outline.vertices.reshape(-1, 5, 2)  # of rectangles, the first corner twice
    assert sum((c[2] - c[0]).prod() for c in corners) == len(chosen)


@pytest.mark.parametrize(
    ("values", "log"),
    [
        ("{low: 1 m, high: 140 m, count: 100}", False),
        ("{low: 1 m, high: 140 m, count: 9, scale: log}", True),
        ("{low: 30 m, high: 140 m, count: 5, scale: log}", True),
        ("[1 m, 10 m, 100 m]", True),
        ("[1 m, 3 m, 10 m, 30 m]", True),
        ("[1 m, 100 m]", False),
        ("[1 m, 2 m, 140 m]", False),
        ("[100 m, 101 m, 102 m]", False),
    ],
)
def test_an_axis_is_logarithmic_where_its_values_were_spaced_so(
    tmp_path: Path, values: str, log: bool
) -> None:
    data = along(summary_of(tmp_path, f"{DISTANCE}: {values}"))
    assert data is not None
    assert data.axis.log is log


def test_a_sample_is_logarithmic_only_where_it_says_so(tmp_path: Path) -> None:
    """1 to 140 m drawn evenly: linear, whatever the ratio of the ends; speeds as they say."""
    text = SAMPLE.format(count=6, more="").replace("30 m .. 140 m", "1 m .. 140 m")
    found = scatter(summarise(done(tmp_path, text)))
    assert found is not None
    assert (found.x.log, found.y.log) == (False, True)
    drawn = sampled_cases(found, "EUR").svg
    assert ">Sampled cases over two factors<" in drawn
    assert "6 sampled cases meet" in drawn


def test_a_grid_that_is_drawn_as_points_is_not_called_sampled(tmp_path: Path) -> None:
    found = scatter(summary_of(tmp_path, f"{DISTANCE}: {{low: 30 m, high: 140 m, count: 201}}",
                               f"{LIMIT}: [0.1 m, 0.2 m]"))  # fmt: skip
    assert found is not None
    drawn = sampled_cases(found, "EUR").svg
    assert ">Cases over two factors<" in drawn
    assert "sampled" not in drawn.lower().replace("fig-sampled", "")


@pytest.mark.browser
def test_no_table_of_a_study_is_wider_than_the_page(
    browser: Any,
    tmp_path: Path,
) -> None:
    more = WORDS + (
        '    "stages[uav].omega_max": 10 deg/s .. 90 deg/s\n'
        '    "requirements[ACC-1].limit": 0.1 m .. 0.5 m\n'
    )
    studies = {"sample": SAMPLE.format(count=6, more=more), "grid": GRID.format(across=9, up=3)}
    for name, text in studies.items():
        page = tmp_path / f"{name}.html"
        page.write_text(str(render_study("html", done(tmp_path, text))), encoding="utf-8")
        for theme in ("light", "dark"):
            size = {"width": 1200, "height": 900}
            with Opened(browser, page, viewport=size, color_scheme=theme) as opened:
                widths = opened.page.evaluate(
                    "[...document.querySelectorAll('.scroll')]"
                    ".map(e => e.scrollWidth - e.clientWidth)"
                )
                assert widths
                assert max(widths) <= 0, name
                assert opened.console == []


def _two_currencies(folder: Path, more: str) -> StudyResult:
    """The same payload priced in euros and, at 1 EUR = 1.25 USD, in dollars."""
    money = "currency: USD\nexchange_rates: {EUR: 1.25 USD}\nrequirements:\n"
    dollars = NARROW.replace("requirements:\n", money)
    (folder / "dollars.yaml").write_text(dollars, encoding="utf-8")
    study = "study: 1\nname: Two\nbase: [dollars.yaml, spec.yaml]\n" + more
    return done(folder, study + "meets_when: decided\n")


OVER_A_GRID = 'grid:\n  "stages[uav].distance": [40 m, 90 m]\n  coverage_factor: [2, 3]\n'
OVER_A_SAMPLE = (
    "sample:\n  count: 3\n  seed: 2\n  over:\n"
    '    "stages[uav].distance": 40 m .. 90 m\n    "stages[uav].v_max": 5 m/s .. 9 m/s\n'
)


@pytest.mark.parametrize("more", [OVER_A_GRID, OVER_A_SAMPLE], ids=["grid", "sample"])
def test_prices_in_two_currencies_are_never_compared(tmp_path: Path, more: str) -> None:
    """Oracle: the rate.  A price of 100 EUR stood as 100 USD and won against 125 USD."""
    result = _two_currencies(tmp_path, more)
    data = json.loads(render_study("json", result))
    euros = {r["cost"] for r in data["cases"] if r["base"].endswith("spec.yaml") and r["cost"]}
    dollars = {r["cost"] for r in data["cases"] if not r["base"].endswith("spec.yaml")} - {None}
    # the price of each piece is converted and rounded to the cent: six pieces, half a cent each
    for euro, dollar in zip(sorted(euros), sorted(dollars), strict=True):
        assert dollar == pytest.approx(1.25 * euro, rel=0, abs=0.03)
    assert data["heat_map"] is None
    for front in data["fronts"]:  # of the same cents
        of = {"EUR": euros, "USD": dollars}[front["currency"]]
        assert front["points"][0]["cost"] in of
    assert {front["currency"] for front in data["fronts"]} == {"EUR", "USD"}
    said = "Prices are in USD and EUR, so there is no least cost among them."
    page = render_study("html", result).replace("\N{NO-BREAK SPACE}", " ")
    for text in (
        " ".join(console(on_study(result)).split()),
        render_study("markdown", result),
        page,
    ):
        assert said in text
    for cost in euros:
        shown = f"{cost:,.2f}".replace(",", " ").removesuffix(".00")
        assert f"{shown} EUR" in page
        assert f"{shown} USD" not in page
    assert "cost [" not in page
    assert "fig-fronts" not in page


@pytest.mark.parametrize("width", [80, 100, 160])
def test_a_map_names_both_factors_on_a_narrow_console(
    tmp_path: Path, width: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rows that become records would else be figures of nobody knows what."""
    monkeypatch.setenv("COLUMNS", str(width))
    text = console(on_study(done(tmp_path, GRID.format(across=5, up=5))), colour=False)
    block = text[text.index("Least cost of a payload") :].split("\n\n")[0]
    assert "uav.distance" in block
    assert "ACC-1 limit" in block
    assert max(map(len, block.splitlines())) <= width
