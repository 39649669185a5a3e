"""HTML pages without a browser: structure, escaping, policy, bytes, what is left out."""

from __future__ import annotations

import base64
import hashlib
import math
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any, get_args, get_type_hints
from xml.etree import ElementTree

import pytest

import report_samples as samples
from drawn_once import Kept
from html_page import Page
from syncline_design.machine.records import Record
from syncline_design.paper.errata import ERRATA
from syncline_design.report import charts, errata, verdict_charts
from syncline_design.report.document import Document, Explorer, Outcome, section, show
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.on_verdicts import on_verdicts
from syncline_design.report.render_html import html
from syncline_design.report.table import table
from syncline_design.report.text import unbroken, visible
from syncline_design.simulation.results import ProportionEstimate
from syncline_design.verdict.tree import FileProblem, Refused

pytestmark = pytest.mark.usefixtures("figures_drawn_once")


@pytest.fixture(scope="module")
def page() -> Page:
    return Page(html(on_verdict(samples.fixed_wing())))


def test_page_is_balanced_and_its_ids_are_unique(page: Page) -> None:
    assert page.unbalanced == []
    assert page.open == []
    ids = [found["id"] for _, found in page.tags if "id" in found]
    assert len(ids) == len(set(ids)) > 20


def test_every_reference_inside_the_page_leads_somewhere() -> None:
    shown = html(on_verdict(samples.fixed_wing()))
    page = Page(shown)
    ids = {found["id"] for _, found in page.tags if "id" in found}
    targets = set(re.findall(r'href="#([^"]+)"', shown)) | set(
        re.findall(r"url\(#([^)]+)\)", shown)
    )
    for name in ("aria-labelledby", "for"):
        for _, found in page.tags:
            targets |= set((found.get(name) or "").split())
    assert targets
    assert targets <= ids


def test_nothing_is_fetched(page: Page) -> None:
    fetching = {"src", "srcset", "href", "xlink:href", "action", "data", "poster", "ping"}
    for tag, found in page.tags:
        for name in fetching & found.keys():
            assert (found[name] or "").startswith("#"), (tag, name, found[name])
    shown = html(on_verdict(samples.fixed_wing()))
    assert not re.search(r"@import|url\((?!#)", shown)


def test_policy_allows_exactly_the_pages_own_script(page: Page) -> None:
    (policy,) = [
        found["content"] or ""
        for tag, found in page.tags
        if tag == "meta" and found.get("http-equiv") == "Content-Security-Policy"
    ]
    (script,) = page.scripts
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in policy
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy
    assert not [name for _, found in page.tags for name in found if name.startswith("on")]


def test_answer_comes_first(page: Page) -> None:
    words = (
        "UAV corridor mapping", "Meets every requirement", "u-blox F9P", "127\u00a0862.35",
        "ACC-1", "to spare",
    )  # fmt: skip
    places = [page.text.index(word) for word in words]
    assert places == sorted(places)


def by_hand() -> list[str]:
    """What the sums of the data sheets come to: total error, tau_crit, slope."""
    attitude = math.radians(math.hypot(0.008, 0.008, 0.03)) * 100.0
    bearing = math.radians(math.hypot(0.006, 0.006)) * 100.0
    sensors = math.sqrt(3.0) * 0.01 + attitude + 0.01 + bearing
    rate = 21.0 + 100.0 * math.radians(77.9)
    tau = 2 * 12.08e-6 + 2e-6  # two stamps by GPIO, the latency of one
    return [
        f"{sensors + rate * tau:.4g}\u00a0m",
        f"{1e6 * sensors / rate:.4g}\u00a0\u00b5s",
        f"{rate:.4g}\u00a0m/s",
    ]


def as_the_verdict_has_it() -> list[str]:
    """Figures and sentences of the verdict itself."""
    verdict = samples.fixed_wing()
    assert verdict.monte_carlo is not None
    assert verdict.choice is not None
    median = verdict.monte_carlo.quantiles["0.5"]
    within = verdict.monte_carlo.probability_within_target
    assert within is not None
    dearer, cheaper = (verdict.choice.staircase or ())[1::-1]
    up = math.ceil(1e5 * dearer.tightest_m) / 1e5, math.ceil(1e4 * cheaper.tightest_m) / 1e4
    return [
        f"{median.low_m:.4g}\u00a0m to {median.high_m:.4g}\u00a0m",
        f"{100.0 * within.low:.4g}\u00a0%",
        f"{up[0]:.4g}\u00a0m to below {up[1]:.4g}\u00a0m",
        verdict.provenance.spec_sha256,
        verdict.warnings[0].message,
        (verdict.choice.excluded or ())[0].reason,
        (verdict.effects or ())[0].sentence.replace(" us", "\u00a0\u00b5s"),
    ]


WORDS = (
    "proven optimal",
    "recomputed exactly",
    "position data are 2\u00a0\u00b5s older than their stamps",
    "Errata of the paper that bear on this design",
    "77.9 deg/s is a rounding of 45 sqrt(3)",
    "2\u00a0000",
    "900\u00a0EUR",
    "kongsberg_mru5",
)


@pytest.mark.parametrize("wanted", [by_hand, as_the_verdict_has_it, lambda: WORDS])
def test_page_says(page: Page, wanted: Callable[[], Sequence[str]]) -> None:
    assert [words for words in wanted() if unbroken(words) not in page.text] == []


def test_every_section_is_there_and_listed(page: Page) -> None:
    sections = page.attribute("section", "id")
    listed = [target[1:] for target in page.attribute("a", "href") if target != "#main"]
    assert sections == listed
    assert len(sections) == 13


def test_missing_parts_are_left_out() -> None:
    page = Page(html(on_verdict(samples.two_stages())))
    sections = page.attribute("section", "id")
    assert {"simulation", "choice", "effects", "infeasibility"}.isdisjoint(sections)
    assert "unlimited" in page.text


def _optional(record: Record) -> list[str]:
    """Fields that may be None."""
    hints = get_type_hints(type(record))
    return [f.name for f in fields(record) if type(None) in get_args(hints[f.name])]  # type: ignore[arg-type]


@pytest.mark.parametrize("start", range(5))
def test_any_part_may_be_missing(start: int) -> None:
    """Every part that may be None, a fifth of them at a time, and all lists empty."""
    full = samples.fixed_wing()
    without: dict[str, Any] = dict.fromkeys(_optional(full)[start::5])
    assert without
    empty: dict[str, Any] = {"requirements": (), "warnings": ()}
    for verdict in (replace(full, **without), replace(full, **without, **empty)):
        assert Page(html(on_verdict(verdict))).unbalanced == []


def _bare(value: Any) -> Any:
    """A record in which everything that may be None is."""
    if isinstance(value, tuple):
        return tuple(_bare(entry) for entry in value)
    if not isinstance(value, Record):
        return value
    kept = {f.name: _bare(getattr(value, f.name)) for f in fields(value)}  # type: ignore[arg-type]
    return type(value)(**kept | dict.fromkeys(_optional(value)))


def test_every_optional_figure_may_be_unknown() -> None:
    """Below the first level: never a crash."""
    full = samples.fixed_wing()
    parts = {f.name: _bare(getattr(full, f.name)) for f in fields(full)}
    assert parts["syncline"].tau_crit_s is None
    assert parts["requirements"][0].margin is None
    page = Page(html(on_verdict(replace(full, **parts))))
    assert page.unbalanced == []
    assert "unlimited" in page.text


def test_errata_follow_the_design() -> None:
    verdict = samples.fixed_wing()
    assert set(errata.NEEDED) | {"lever_arm"} <= {entry.id for entry in ERRATA}
    assert any("45 sqrt(3)" in text for text in errata.relevant(verdict))
    assert not any("1.4127 m" in text for text in errata.relevant(verdict))
    (stage,) = verdict.spec.stages
    stage = replace(stage, platform=replace(stage.platform, id="auv_printed"))
    found = errata.relevant(replace(verdict, spec=replace(verdict.spec, stages=(stage,))))
    assert any("1.4127 m" in text for text in found)
    assert not any("45 sqrt(3)" in text for text in found)


def test_infeasible_says_why_first() -> None:
    page = Page(html(on_verdict(samples.infeasible())))
    assert page.attribute("section", "id")[0] == "infeasibility"
    assert "Infeasible: no design meets the requirements" in page.text
    assert "ACC-1 and COST-1 cannot hold together" in page.text
    why = samples.infeasible().infeasibility
    assert why is not None
    assert all(unbroken(fix.text) in page.text for fix in why.fixes)
    gap = Page(html(on_verdict(samples.without_option()))).text
    assert "velodyne_hdl32e stamped by arrival, has 11.5 times the timestamp error" in gap


def test_failing_verdict_shows_word_and_symbol() -> None:
    page = Page(html(on_verdict(samples.failing())))
    assert "Does not meet its requirements" in page.text
    assert "\u2717" in page.text
    total = samples.failing().requirements[0].value
    assert total is not None
    assert f"{100.0 * (total / 0.05 - 1.0):.3g}\u00a0% over" in page.text


@pytest.mark.parametrize("text", [*samples.HOSTILE[:3], "".join(samples.HOSTILE)])
def test_hostile_text_stays_text(text: str) -> None:
    shown = html(on_verdict(samples.with_hostile_text(text)))
    page = Page(shown)
    assert len(page.scripts) == 1
    assert "alert(" not in page.scripts[0]
    assert page.attribute("img", "src") == []
    assert page.unbalanced == []
    assert visible(text).strip() in " ".join(page.texts)
    shown.encode("utf-8")
    assert not re.search(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e]", shown)


@pytest.mark.parametrize("text", [*samples.HOSTILE, "$x^2$", "a_b", "\\alpha", "%d"])
def test_hostile_text_is_literal_in_figures(text: str) -> None:
    bars = [charts.TauBar(visible(text)[:30], 1e-6, 1e-3, True)]
    svg = charts.tau_bars(bars).svg
    root = ElementTree.fromstring(svg)
    texts = ["".join(node.itertext()) for node in root.iter("{http://www.w3.org/2000/svg}text")]
    assert visible(text)[:30] in texts


@pytest.mark.parametrize("make", [samples.fixed_wing, samples.infeasible])
def test_same_input_same_bytes(make: Any, figures_drawn_once: Kept) -> None:
    first = html(on_verdict(make()))
    figures_drawn_once.clear()
    assert html(on_verdict(make())) == first


def test_same_bytes_in_another_process() -> None:
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); import hashlib\n"
        "from tests import report_samples\n"
        "from syncline_design.report.on_verdict import on_verdict\n"
        "from syncline_design.report.render_html import html\n"
        "page = html(on_verdict(report_samples.fixed_wing()))\n"
        "print(hashlib.sha256(page.encode()).hexdigest())"
    )
    root = str(__import__("pathlib").Path(__file__).parents[1])
    out = subprocess.run(
        [sys.executable, "-c", code, root],
        env={"PYTHONHASHSEED": "7", "PATH": "/usr/bin:/bin", "TZ": "Asia/Tokyo"},
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    here = hashlib.sha256(html(on_verdict(samples.fixed_wing())).encode()).hexdigest()
    assert out == here


def test_size_is_far_below_three_megabytes() -> None:
    verdict = samples.fixed_wing()
    assert verdict.choice is not None
    (entry, *_), (point, *_) = verdict.choice.excluded or (), verdict.choice.front or ()
    front = [replace(point, cost=1000.0 + i, error_m=1.0 / (i + 1)) for i in range(500)]
    excluded = [replace(entry, sensor=f"sensor_{i}") for i in range(2000)]
    choice = replace(verdict.choice, excluded=tuple(excluded), front=tuple(front))
    long = replace(verdict, choice=choice)
    assert len(html(on_verdict(long)).encode()) < 3_000_000


def test_importing_the_report_package_loads_nothing_heavy() -> None:
    """Renderers know no result; the words of a verdict know its types, and these know arrays."""
    code = (
        "import sys\n"
        "import syncline_design.report.formats, syncline_design.report.write\n"
        "import syncline_design.report.render_html, syncline_design.report.render_console\n"
        "import syncline_design.report.render_markdown\n"
        "heavy = {'jinja2', 'matplotlib', 'numpy', 'scipy', 'cvxpy', 'polars'}\n"
        "print(sorted(heavy & set(sys.modules)))\n"
        "import syncline_design.report.checks\n"
        "print(sorted((heavy - {'numpy'}) & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.stdout.split(), done.stderr) == (["[]", "[]"], "")


def test_several_verdicts_get_an_overview() -> None:
    problem = FileProblem("bad.yaml", 2, 1, "stages", "missing key")
    refused = Refused(file="bad.yaml", problems=(problem,), text="bad.yaml:2:1: missing key")
    page = Page(html(on_verdicts([samples.fixed_wing(), samples.infeasible(), refused])))
    assert "1 of 3 specs meet every requirement" in page.text
    assert "missing key" in page.text
    assert page.unbalanced == []


def curve(**changes: Any) -> charts.SynclineCurve:
    values: dict[str, Any] = {
        "floor_m": 0.1,
        "rate_mps": 45.0,
        "tau_crit_s": 0.1 / 45.0,
        "tau_s": 1e-3,
        "total_m": 0.145,
        "limit": ProportionEstimate(0.2, 0.9, 0.8, 1.0, "20.0 cm"),
    }
    return charts.SynclineCurve(**(values | changes))


def test_operating_point_lies_where_the_axes_say() -> None:
    """The marker's place in the SVG against the place its own tick labels give."""
    drawn = charts.syncline(curve())
    box = drawn.box
    assert box is not None
    root = ElementTree.fromstring(drawn.svg)
    (group,) = [g for g in root.iter() if g.get("id") == "fig-syncline-operating-point"]
    (marker,) = [g for g in group.iter() if g.get("x") is not None]
    across = (3.0 - box.log_left) / (box.log_right - box.log_left)  # 1/tau = 1000 per second
    assert float(marker.attrib["x"]) == pytest.approx(
        box.left + across * (box.right - box.left), abs=0.01
    )
    ticks = {
        "".join(text.itertext()): text
        for text in root.iter("{http://www.w3.org/2000/svg}text")
        if "".join(text.itertext()) == "10\u00b3"
    }
    assert float(ticks["10\u00b3"].attrib["x"]) == pytest.approx(float(marker.attrib["x"]), abs=0.5)


@pytest.mark.parametrize(
    "changes",
    [
        {"tau_crit_s": None, "rate_mps": 0.0, "total_m": 0.1},
        {"tau_s": 0.0, "total_m": 0.1},
        {"tau_s": None, "total_m": None},
        {"limit": None},
        {"limit": ProportionEstimate(50.0, 0.9, 0.8, 1.0)},
        {"limit": ProportionEstimate(1e-6, 0.9, 0.8, 1.0)},
        {"tau_s": 1e3, "total_m": 45_000.1},
        {"tau_s": 1e-12},
        {"floor_m": 1e-9, "tau_crit_s": 1e-9 / 45.0, "total_m": 0.045},
        {"tau_crit_s": None, "rate_mps": 0.0, "tau_s": None, "total_m": None, "limit": None},
    ],
)
def test_syncline_figure_takes_extreme_systems(changes: dict[str, Any]) -> None:
    drawn = charts.syncline(curve(**changes))
    ElementTree.fromstring(drawn.svg)
    assert drawn.box is not None
    assert "nan" not in drawn.svg.lower().replace("nano", "")


def test_tables_that_a_tablet_has_no_room_for_are_told() -> None:
    """Six columns with a sentence, or eight of figures that do not break; not words that do."""
    said = "a sentence that goes on for much longer than a column of a tablet is wide"
    six = ("Status", "Where", "Assumption", "Assumed #", "Measured #", "Evidence")
    row = ("holds", "car, position", "lever arm", "0 m", "0 m (-3.047 mm to 3.047 mm)", said)
    eight = [str(k) for k in range(8)]
    for one, wide in (
        (table("x", six, [row]), True),
        (table("x", [f"{head} #" for head in eight], [["65 000.00 EUR"] * 8]), True),
        (table("x", ("A", "B", "C", "D"), [("x", said, "y", "1")]), False),
        (table("x", eight, [eight]), False),
    ):
        part = section("part", "Part", show(one))
        page = html(Document("x", Outcome("good", "x", "x"), "x", (), (), tuple(part)))
        assert ('class="scroll cards wide' in page) is wide


def test_a_table_of_one_column_names_no_row_and_one_of_short_figures_stays_a_table() -> None:
    """A list is not all in bold; four short columns fit a phone, and no card has one figure."""
    heads = ("Target", "North [m] #", "East [m] #", "Down [m] #")
    short, long = ["1", "2.5", "3.5", "4.5"], ["1", *3 * ["65 000.00 EUR"]]
    for one, named, cards in (
        (table("x", ["Change"], [["limit 2 m to 1 m"], ["platform car to van"]]), False, False),
        (table("x", heads, [short]), True, False),
        (table("x", heads, [long]), True, True),
    ):
        part = section("part", "Part", show(one))
        page = html(Document("x", Outcome("good", "x", "x"), "x", (), (), tuple(part)))
        assert ('<th scope="row"' in page) is named
        assert ('class="scroll cards' in page) is cards


@pytest.mark.parametrize(("old", "new", "word"), [
    ("limit: 50 cm", "limit: 50 cm", "meets"),
    ("limit: 50 cm", "limit: 5 cm", "fails"),
    ("sync, limit: 1.0", "sync, limit: 0.00005", "fails"),  # 6.3e-5 of one sensor, 3.2e-5 of all
    ("sync, limit: 1.0", "sync, limit: 0.00007", "meets"),
    ("limit: 0.30 m", "limit: 0.01 m", "fails"),  # simulated
])  # fmt: skip
def test_the_sliders_begin_with_the_verdict(old: str, new: str, word: str) -> None:
    """`would meet` stood below a verdict that one sensor's timestamps, or the simulation, fails."""
    text = samples.PINNED.replace("limit: 5 cm", "limit: 50 cm")
    assert old in text
    verdict = samples.checked(text.replace(old, new))
    assert verdict.verdict == word
    (node,) = verdict_charts.explorer(verdict)
    assert isinstance(node, Explorer)
    assert node.limit is not None
    accurate = node.floor_m + node.rate_mps * node.tau_s <= node.limit.limit_m
    crit = math.inf if node.tau_crit_s is None else node.tau_crit_s
    met = accurate and node.tau_s < node.sync_limit * crit and node.others_pass
    assert met is (word == "meets")
