"""The written report in a real browser: no network, no console errors, sliders, themes, axe."""

from __future__ import annotations

import csv
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import report_samples as samples
import syncline_design as sd
from browsing import Opened, flaws_of
from checked import check_file
from clock_logs import START, tracking
from diagnosis_samples import diagnosis
from family_specs import drawn, written
from flown_specs import flown
from study_specs import write
from syncline_design.auditing.run import audit
from syncline_design.campaign.joint import JointRequest, diagnose_joint
from syncline_design.comparison.accept import AcceptSettings, accept
from syncline_design.comparison.diff import diff
from syncline_design.comparison.meaning import with_design
from syncline_design.logs.inspection import inspect_logs
from syncline_design.report.document import Document, Outcome, section, show
from syncline_design.report.on_acceptance import on_acceptance
from syncline_design.report.on_audit import on_audit
from syncline_design.report.on_diagnosis import on_diagnosis
from syncline_design.report.on_diff import on_diff
from syncline_design.report.on_log import on_log
from syncline_design.report.on_paper import on_paper
from syncline_design.report.on_timing import on_timing
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.on_verdicts import on_verdicts
from syncline_design.report.render_html import html
from syncline_design.report.rendered import chart_files
from syncline_design.report.studies import render_study
from syncline_design.report.table import table
from syncline_design.spec.load import load, load_text
from syncline_design.studies import StudySettings, run_study
from syncline_design.verdict.cloud import cloud
from syncline_design.verdict.settings import CheckSettings, build_of
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import check_loaded
from tests.world import hidden, make_log, scenario

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(html(on_verdict(samples.fixed_wing())), encoding="utf-8")
    return path


def move(page: Any, selector: str, value: float) -> None:
    """Set a slider as a user's drag does: value, then the input event."""
    page.eval_on_selector(
        selector,
        "(e, v) => { e.value = v; e.dispatchEvent(new Event('input', {bubbles: true})); }",
        value,
    )


def test_no_console_message_and_no_request_but_the_file(browser: Any, report: Path) -> None:
    with Opened(browser, report) as opened:
        opened.page.keyboard.press("Tab")
        opened.page.click("thead button >> nth=0")
        assert opened.console == []
        assert opened.requests == [report.as_uri()]
        assert opened.dialogs == []


def test_slider_moves_the_point_along_the_drawn_curve(browser: Any, report: Path) -> None:
    """After each move the marker still lies on the curve that matplotlib drew."""
    distance = """() => {
        const marker = document.getElementById('fig-syncline-operating-point');
        const path = document.querySelector('#fig-syncline-curve path');
        const at = e => { const b = e.getBoundingClientRect();
                          return [b.x + b.width / 2, b.y + b.height / 2]; };
        const [x, y] = at(marker), m = path.getScreenCTM();
        let best = 1e9;
        for (let i = 0; i <= 4000; i++) {
            const p = path.getPointAtLength(path.getTotalLength() * i / 4000).matrixTransform(m);
            best = Math.min(best, Math.hypot(p.x - x, p.y - y));
        }
        return [best, x, y];
    }"""
    with Opened(browser, report, viewport={"width": 1280, "height": 900}) as opened:
        start = opened.page.evaluate(distance)
        assert start[0] < 1.5
        seen = [start[1]]
        for exponent in (-5.5, -4.0, -3.2, -2.5):
            move(opened.page, "#tau-slider", exponent)
            off, x, _ = opened.page.evaluate(distance)
            assert off < 1.5, exponent
            seen.append(x)
        assert seen[1] > seen[0] > seen[2] > seen[3] > seen[4]  # larger tau lies further left


def test_slider_recolours_the_verdict(browser: Any, report: Path) -> None:
    with Opened(browser, report) as opened:
        page = opened.page
        colour = "e => getComputedStyle(e).borderLeftColor"
        good = page.eval_on_selector("#banner", colour)
        assert page.is_hidden("#what-if")
        move(page, "#tau-slider", -2.0)
        assert "would not meet" in page.inner_text("#explorer-verdict")
        assert "the error exceeds the limit" in page.inner_text("#explorer-verdict")
        assert page.is_visible("#what-if")
        assert page.eval_on_selector("#banner", colour) != good
        assert page.inner_text("#verdict-word") == "Meets every requirement"  # the proven one stays
        page.click("#explorer-reset")
        assert "would meet" in page.inner_text("#explorer-verdict")
        assert page.is_hidden("#what-if")
        assert page.eval_on_selector("#banner", colour) == good


def test_sliders_agree_with_the_model(browser: Any, report: Path) -> None:
    """Error at tau = 1 ms, and the target at which the verdict turns, from plain sums."""
    syncline = samples.fixed_wing().syncline
    assert syncline is not None
    error = syncline.sensor_error_m + 1e-3 * syncline.sync_rate_mps
    with Opened(browser, report) as opened:
        page = opened.page
        move(page, "#tau-slider", -3.0)
        assert f"{error:.4g}\u00a0m " in page.inner_text("#explorer-verdict")
        assert page.inner_text("#tau-value") == "1\u00a0ms"
        page.click("#explorer-reset")
        total = syncline.total_m
        for factor, word in ((1.001, "would meet"), (0.999, "would not meet")):
            page.evaluate("() => 0")
            move(page, "#limit-slider", page.evaluate("v => Math.log10(v)", total * factor))
            assert word in page.inner_text("#explorer-verdict")


def test_slider_works_by_keyboard(browser: Any, report: Path) -> None:
    with Opened(browser, report) as opened:
        opened.page.focus("#tau-slider")
        opened.page.keyboard.press("End")
        assert "would not meet" in opened.page.inner_text("#explorer-verdict")
        spoken = opened.page.get_attribute("#tau-slider", "aria-valuetext")
        assert spoken == opened.page.inner_text("#tau-value")


def test_tables_sort_and_return(browser: Any, report: Path) -> None:
    with Opened(browser, report) as opened:
        page = opened.page
        names = (
            "() => [...document.querySelectorAll('#ledger tbody tr')]"
            ".map(r => parseFloat(r.cells[3].dataset.sort))"
        )
        before = page.evaluate(names)
        button = page.locator("#ledger thead button").nth(3)
        head = page.locator("#ledger thead th").nth(3)
        for expected, order in (
            ("ascending", sorted(before)),
            ("descending", sorted(before)[::-1]),
        ):
            button.focus()
            page.keyboard.press("Enter")
            assert page.evaluate(names) == order
            assert head.get_attribute("aria-sort") == expected
        button.click()
        assert page.evaluate(names) == before
        assert head.get_attribute("aria-sort") is None


def test_sorting_text(browser: Any, report: Path) -> None:
    with Opened(browser, report) as opened:
        page = opened.page
        page.locator("#requirements thead button").first.click()
        ids = page.eval_on_selector_all(
            "#requirements > .scroll tbody th", "all => all.map(e => e.textContent.trim())"
        )
        assert ids == sorted(ids)


def luminance(colour: str) -> float:
    """Relative luminance (WCAG 2.2) of a CSS rgb() colour."""
    parts = [float(p) / 255 for p in colour[colour.index("(") + 1 : -1].split(",")[:3]]
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_dark_and_light_follow_the_reader(browser: Any, report: Path) -> None:
    found = {}
    for scheme in ("light", "dark"):
        with Opened(browser, report, color_scheme=scheme) as opened:
            background = opened.page.eval_on_selector(
                "section", "e => getComputedStyle(e).backgroundColor"
            )
            text = opened.page.eval_on_selector(
                "#syncline figure text", "e => getComputedStyle(e).fill"
            )
            found[scheme] = (luminance(background), luminance(text))
    for back, ink in found.values():
        high, low = max(back, ink), min(back, ink)
        assert (high + 0.05) / (low + 0.05) > 4.5
    assert found["light"][0] > 0.8 > 0.1 > found["dark"][0]


TORN = """() => {
  const torn = [];
  document.querySelectorAll("td:not(.lengthy), tbody th").forEach(cell => {
    const walker = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT);
    for (let text = walker.nextNode(); text; text = walker.nextNode()) {
      for (const word of text.data.matchAll(/[\\w.,%\u2212\u00a0]+/g)) {
        const range = document.createRange();
        range.setStart(text, word.index); range.setEnd(text, word.index + word[0].length);
        const tops = new Set([...range.getClientRects()].map(r => Math.round(r.top)));
        if (tops.size > 1) torn.push(word[0]);
      }
    }
  });
  return torn;
}"""


def test_print_is_light_and_complete(browser: Any, report: Path) -> None:
    with Opened(browser, report, color_scheme="dark") as opened:
        opened.page.emulate_media(media="print")
        background = opened.page.eval_on_selector(
            "body", "e => getComputedStyle(e).backgroundColor"
        )
        assert luminance(background) > 0.99
        assert opened.page.is_hidden("nav")
        assert opened.page.is_hidden("#explorer")
        assert opened.page.is_visible("#provenance")
        opened.page.set_viewport_size({"width": 688, "height": 900})  # A4 less its margins
        assert opened.page.evaluate("() => document.documentElement.scrollWidth") <= 688
        # else Chromium prints what follows a figure on it
        kinds = "all => [...new Set(all.map(e => getComputedStyle(e).containerType))]"
        assert opened.page.eval_on_selector_all("section, .beneath, .drawing", kinds) == ["normal"]
        # a button in a head keeps Chromium from printing the head on every sheet
        buttons = "all => [...new Set(all.map(e => getComputedStyle(e).display))]"
        assert opened.page.eval_on_selector_all("thead button", buttons) == ["contents"]
        assert opened.page.eval_on_selector_all(".scroll table", buttons) == ["table"]
        assert opened.page.evaluate(TORN) == []
        pdf = opened.page.pdf(format="A4")
        assert pdf.startswith(b"%PDF")
        assert 2 <= pdf.count(b"/Type /Page\n") <= 16


def test_all_is_there_without_javascript(browser: Any, report: Path) -> None:
    with Opened(browser, report, java_script_enabled=False) as opened:
        assert opened.page.is_hidden("#explorer")
        assert opened.page.locator("section:visible").count() == 13
        assert opened.page.locator("figure svg:visible").count() == 3
        opened.page.click("#syncline summary >> nth=0")
        opened.page.click("#choice summary >> nth=0")
        assert opened.page.locator("figure svg:visible").count() == 5
        assert opened.page.locator("thead button").count() == 0


@pytest.mark.parametrize("width", [320, 400, 768, 1280])
def test_page_fits_the_window(browser: Any, report: Path, width: int) -> None:
    with Opened(browser, report, viewport={"width": width, "height": 800}) as opened:
        assert opened.page.evaluate("() => document.documentElement.scrollWidth") <= width


GRID = """\
study: 1
name: Grid
base: [spec.yaml]
grid:
  "stages[uav].distance": {low: 30 m, high: 140 m, count: 5}
  "requirements[ACC-1].limit": {low: 0.05 m, high: 0.5 m, count: 3}
meets_when: decided
"""
SAMPLE = """\
study: 1
name: Sample
base: [spec.yaml]
sample:
  count: 8
  seed: 3
  over:
    "stages[uav].distance": 30 m .. 140 m
    "stages[uav].v_max": {low: 1 m/s, high: 60 m/s, scale: log}
    "stages[uav].ranging.sensor": [velodyne_hdl32e, riegl_vux1uav]
meets_when: decided
"""


def around(verdict: Verdict) -> Verdict:
    """As a command makes it that writes a page: with the designs around the front."""
    found = cloud(build_of(CheckSettings())(load_text(samples.OPEN, samples.FILE)))
    assert verdict.choice is not None
    return replace(verdict, choice=replace(verdict.choice, cloud=found))


def study_page(folder: Path, text: str) -> str:
    return str(render_study("html", run_study(write(folder, text), StudySettings(workers=1))))


def audit_page(folder: Path) -> str:
    """A stream of stamps that slip by a second for a while."""
    stamps = [1_700_000_000.0 + 0.1 * k + (1.0 if 100 <= k < 180 else 0.0) for k in range(400)]
    rows = [f"{s:.6f},{1_700_000_000.001 + 0.1 * k:.6f}" for k, s in enumerate(stamps)]
    path = folder / "gnss.csv"
    path.write_text("stamp_s,receive_s\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return html(on_audit(audit([path])))


def clock_log(folder: Path) -> Path:
    """Four mornings of a clock that is late by half a microsecond, give or take."""
    rng = np.random.default_rng(4)
    lines: list[str] = []
    for day in range(4):
        times = START + 86400.0 * day + 16.0 * np.arange(120)
        lines += tracking(times, 5e-7 + 1e-7 * rng.standard_normal(120))
    path = folder / "tracking.log"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def timing_page(folder: Path) -> str:
    return html(on_timing(sd.timing([clock_log(folder)])))


def acceptance_page(folder: Path) -> str:
    spec = folder / "spec.yaml"
    spec.write_text(samples.PINNED, encoding="utf-8")
    settings = AcceptSettings(("timing", "clock"), {"uav": (clock_log(folder),)})
    return html(on_acceptance(accept(load(spec), [], settings, seed=0)))


def difference_page(folder: Path) -> str:
    old, new = folder / "old.yaml", folder / "new.yaml"
    text = samples.PINNED.replace("monte_carlo: {samples: 2000}\n", "")
    text = "".join(line for line in text.splitlines(True) if "MC-1" not in line)
    old.write_text(text, encoding="utf-8")
    text = text.replace("riegl_vux1uav", "velodyne_hdl32e").replace("5 cm", "0.4 m")
    new.write_text(text.replace("kind: mass, limit: 6 kg", "kind: power, limit: 60 W"), "utf-8")
    return html(on_diff(diff(old, new, CheckSettings(monte_carlo=False))))


def log_page(folder: Path) -> str:
    path = folder / "places.csv"
    rows = [f"{0.1 * k:.1f},{k % 7}.0,{k % 5}.0,0.0,0.1,0.2,0.3" for k in range(200)]
    head = "time_s,position_north_m,position_east_m,position_down_m,roll_deg,pitch_deg,yaw_deg"
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return html(on_log(inspect_logs([path])))


def flight_page(folder: Path) -> str:
    """The simulated error along the way that a vehicle flies."""
    return html(on_verdict(check_loaded(load(flown(folder)), CheckSettings(cloud=True))))


def joint_page(folder: Path) -> str:
    """Three logs of one system: a delay of all of them, a bias that is another in each."""
    late, bias = (
        hidden("latency", "position", latency_s=0.05), hidden("range_bias", "ranging", bias_m=0.0)
    )  # fmt: skip
    paths = []
    for k, size_m in enumerate((0.5, -0.4, 0.3)):
        run = scenario("multirotor_lines", 70 + k, 8.0, 5.0)
        log = make_log(run, (late, bias.with_values({"bias_m": size_m})))
        paths.append(folder / f"log{k}.csv")
        log.to_csv(paths[-1])
    spec = folder / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    found = diagnose_joint(load(spec), JointRequest(tuple(paths)))
    assert {one.scope for one in found.findings} == {"build", "log"}
    return html(on_diagnosis(with_design(found, None)))


def family_page(folder: Path) -> str:
    """Two missions with limits of their own, and every payload's front."""
    path = written(folder, *drawn(3))
    return html(on_verdict(check_file(path, CheckSettings(monte_carlo=False))))


KINDS: dict[str, Callable[[Path], str]] = {
    "verdict": lambda _: html(on_verdict(around(samples.fixed_wing()))),
    "chain": lambda _: html(on_verdict(samples.two_stages())),
    "infeasible": lambda _: html(on_verdict(samples.infeasible())),
    "several": lambda _: html(on_verdicts([samples.fixed_wing(), samples.failing()])),
    "paper": lambda _: html(on_paper(samples.reproduction())),
    "simulation": lambda _: html(samples.simulation()[0]),
    "diagnosis": lambda _: html(on_diagnosis(diagnosis())),
    "joint": joint_page,
    "flight": flight_page,
    "audit": audit_page,
    "timing": lambda folder: timing_page(folder),
    "acceptance": lambda folder: acceptance_page(folder),
    "difference": lambda folder: difference_page(folder),
    "log": lambda folder: log_page(folder),
    "family": lambda folder: family_page(folder),
    "grid": lambda folder: study_page(folder, GRID),
    "sample": lambda folder: study_page(folder, SAMPLE),
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_page_is_sound(browser: Any, tmp_path: Path, kind: str) -> None:
    """One load a kind: flaws at three widths, axe in both themes, no word to the console."""
    path = tmp_path / "report.html"
    path.write_text(KINDS[kind](tmp_path), encoding="utf-8")
    assert flaws_of(browser, path) == []


def test_a_verdict_fits_a_screen(browser: Any, report: Path) -> None:
    """Headline, requirements and three figures within 1300 by 900; the rest is folded."""
    size = {"width": 1300, "height": 900}
    with Opened(browser, report, unfolded=False, viewport=size) as opened:
        page = opened.page
        ends = page.eval_on_selector_all(
            "#banner, #requirements > .scroll, #requirements figure .drawing",
            "all => all.map(e => e.getBoundingClientRect().bottom)",
        )
        assert len(ends) == 5
        assert max(ends) <= 900
        assert page.locator("details.part[open]").count() == 0
        page.click("nav a[href='#bill']")
        page.wait_for_selector("#bill table:visible")
        page.emulate_media(media="print")
        shown = "e => e.checkVisibility() && e.getBoundingClientRect().height > 20"
        assert page.eval_on_selector("#payload table", shown)


def test_what_a_bar_says_shows_under_the_pointer_and_by_keys(browser: Any, report: Path) -> None:
    syncline = samples.fixed_wing().syncline
    assert syncline is not None
    with Opened(browser, report, viewport={"width": 1300, "height": 900}) as opened:
        page, tip = opened.page, "#requirements .tip"
        drawing = page.locator("#requirements .drawing").first
        drawing.focus()
        said = []
        for _ in syncline.ledger:
            page.keyboard.press("ArrowRight")
            said.append(page.inner_text(tip))
        assert page.locator("#requirements svg .here").count() == 0  # or all marks are painted anew
        ring, frame = page.locator("#requirements .here").bounding_box(), drawing.bounding_box()
        assert ring is not None
        assert frame is not None
        assert page.locator(tip).count() == 1
        for at, size in (("x", "width"), ("y", "height")):
            assert frame[at] <= ring[at] < ring[at] + ring[size] <= frame[at] + frame[size] + 2
        largest = max(syncline.ledger, key=lambda term: term.value_m)
        in_limit_unit = f"{largest.value_m:.4g} m"  # the accuracy limit is written in metres
        assert sum(in_limit_unit in text.replace("\u00a0", " ") for text in said) == 1
        page.keyboard.press("Escape")
        assert page.locator(f"{tip}, #requirements .here").count() == 0
        box = drawing.bounding_box()
        assert box is not None
        page.mouse.move(box["x"] + 0.42 * box["width"], box["y"] + 0.88 * box["height"])
        assert "total" in page.inner_text(tip)


def test_on_a_phone_what_is_bought_heads_its_card(browser: Any, report: Path) -> None:
    """The item stands above its stage there, and beside it on a wide screen."""
    verdict = samples.fixed_wing()
    assert verdict.bill_of_materials is not None
    items = [line.item for line in verdict.bill_of_materials]
    with Opened(browser, report, viewport={"width": 420, "height": 900}) as opened:
        page, rows = opened.page, "#bill .cards tbody tr"
        told = """all => all.map(row => {
            const top = e => e.getBoundingClientRect().top, head = row.querySelector('th');
            const below = [...row.querySelectorAll('td:not(.void)')];
            return [head.innerText, row.cells[0].innerText, below.every(d => top(d) > top(head))];
        })"""
        found = page.eval_on_selector_all(rows, told)
        assert [head for head, _, _ in found] == [*items, "Total"]
        assert all(headed for _, _, headed in found)
        page.set_viewport_size({"width": 1300, "height": 900})
        first = [name for _, name, _ in page.eval_on_selector_all(rows, told)]
        assert first == [*(line.stage for line in verdict.bill_of_materials), "Total"]


def test_figures_and_tables_can_be_taken_away(browser: Any, report: Path, tmp_path: Path) -> None:
    """SVG that stands alone, PNG of three times its size, CSV with the cells; no request."""
    with Opened(browser, report, accept_downloads=True) as opened:
        page, taken = opened.page, {}
        for word in ("SVG", "PNG", "CSV"):
            with page.expect_download() as waiting:
                page.locator("#requirements").get_by_role("button", name=f"as {word}").first.click()
            taken[word] = tmp_path / waiting.value.suggested_filename
            waiting.value.save_as(taken[word])
        figures = {name for name, _ in chart_files({"": on_verdict(samples.fixed_wing())}, "svg")}
        assert taken["SVG"].name in {f"uav-corridor-mapping-{name}" for name in figures}
        assert taken["PNG"].stem == taken["SVG"].stem
        assert taken["CSV"].name == "uav-corridor-mapping-requirements.csv"
        drawing = ElementTree.parse(taken["SVG"]).getroot()
        assert "var(" not in taken["SVG"].read_text("utf-8")
        width, height = float(drawing.attrib["width"]), float(drawing.attrib["height"])
        head = taken["PNG"].read_bytes()
        assert head.startswith(b"\x89PNG")
        assert struct.unpack(">II", head[16:24]) == (round(3 * width), round(3 * height))
        rows = list(csv.reader(taken["CSV"].read_text("utf-8").splitlines()))
        verdict = samples.fixed_wing()
        assert [row[0] for row in rows] == ["Requirement", *(r.id for r in verdict.requirements)]
        assert {row[1] for row in rows[1:]} <= {"pass", "fail"}
        assert [url for url in opened.requests if not url.startswith("data:")] == [report.as_uri()]
        assert opened.console == []


def test_a_figure_has_one_name_whatever_it_is_taken_away_as(browser: Any, tmp_path: Path) -> None:
    """That of `--output svg`; what the page is about before it, cut where a word ends."""
    path = tmp_path / "page.html"
    verdict = samples.fixed_wing()
    words = "Größte Drohne 2 <b>für</b> die Vermessung von Leitungen; " + "Trassen und Deiche " * 9
    said = replace(on_verdict(verdict), name=words)
    path.write_text(html(said), encoding="utf-8")
    figures = {name for name, _ in chart_files({"": said}, "svg")}
    about = "größte-drohne-2-b-für-b-die-vermessung-von-leitungen-trassen"
    taken = set()
    with Opened(browser, path, accept_downloads=True) as opened:
        page = opened.page
        page.evaluate("() => document.querySelectorAll('details').forEach(d => { d.open = true })")
        for button in page.locator("figure .take button").all():
            with page.expect_download() as waiting:
                button.click()
            taken.add(waiting.value.suggested_filename)
    assert {name for name in taken if name.endswith(".svg")} == {f"{about}-{f}" for f in figures}
    stems = {name.rpartition(".")[0] for name in taken}
    assert stems == {Path(f"{about}-{name}").stem for name in figures}
    assert any(name.endswith(".csv") for name in taken)


@pytest.mark.parametrize("text", ["".join(samples.HOSTILE), samples.HOSTILE[0], samples.HOSTILE[7]])
def test_hostile_names_run_nothing(browser: Any, tmp_path: Path, text: str) -> None:
    path = tmp_path / "report.html"
    path.write_text(html(on_verdict(samples.with_hostile_text(text))), encoding="utf-8")
    with Opened(browser, path, viewport={"width": 400, "height": 800}) as opened:
        assert opened.page.evaluate("() => document.scripts.length") == 1
        assert opened.page.evaluate("() => document.images.length") == 0
        assert opened.page.evaluate("() => document.documentElement.scrollWidth") <= 400
        assert opened.dialogs == []
        assert opened.console == []
        assert opened.requests == [path.as_uri()]


def test_injected_script_is_stopped_by_the_policy(browser: Any, tmp_path: Path) -> None:
    """Second line of defence: had something slipped through the escaping, it would not run."""
    path = tmp_path / "report.html"
    page = html(on_verdict(samples.fixed_wing()))
    hole = "<script>window.owned = 1</script><img src='https://example.invalid/x.png'>"
    path.write_text(page.replace('<main id="main">', '<main id="main">' + hole), "utf-8")
    with Opened(browser, path) as opened:
        assert opened.page.evaluate("() => window.owned") is None
        assert opened.failed == {"https://example.invalid/x.png": "csp"}
        assert len(opened.console) == 2  # the browser reports both refusals


def test_a_table_of_short_figures_fits_a_phone(browser: Any, tmp_path: Path) -> None:
    """The targets of a drive: rows, not a card of four lines each, and nothing is cut."""
    path = tmp_path / "page.html"
    rows = [[str(k), f"-{100.5 + k}", f"{10.5 + k}", "-1.6"] for k in range(36)]
    heads = ("Target", "North [m] #", "East [m] #", "Down [m] #")
    part = section("targets", "Targets", show(table("Targets", heads, rows)))
    path.write_text(
        html(Document("x", Outcome("good", "x", "x"), "x", (), (), tuple(part))), "utf-8"
    )
    with Opened(browser, path, viewport={"width": 420, "height": 900}) as opened:
        frame = opened.page.locator("#targets .scroll")
        assert frame.evaluate("e => e.scrollWidth - e.clientWidth") == 0
        row = opened.page.locator("#targets tbody tr").first
        assert row.evaluate("e => getComputedStyle(e).display") == "table-row"
