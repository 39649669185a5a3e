"""What the first screen of a page holds where a log is held against a spec: the answer."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import report_samples as samples
import syncline_design as sd
from browsing import Opened
from clock_logs import START, tracking
from syncline_design.auditing.result import Audit
from syncline_design.comparison.clock_meaning import TimingAndSpec
from syncline_design.report.charts_timing import in_sight
from syncline_design.report.on_audit import on_audit
from syncline_design.report.on_timing import on_timing
from syncline_design.report.render_console import console
from syncline_design.report.render_html import html

SPEC = "".join(line for line in samples.PINNED.splitlines(True) if "MC-1" not in line)
ARRIVAL = """\
syncline: 1
name: Track
requirements: [{id: ACC-1, kind: accuracy, limit: 10 m}, {id: SYNC-1, kind: sync, limit: 1000}]
stages:
  - name: car
    platform: {v_max: 20 m/s, omega_max: 0 deg/s, distance: 1 m, baseline: 1 m}
    position: {sensor: ublox_f9p_rtk, primitive: arrival, timestamping: arrival}
"""
ENDS = "all => all.map(e => e.getBoundingClientRect().bottom)"


def tracked(folder: Path, days: int, hard_s: float = 0.0) -> Path:
    """So many mornings of a clock that is late by half a microsecond, give or take."""
    rng = np.random.default_rng(4)
    lines: list[str] = []
    for day in range(days):
        times = START + 86400.0 * day + 16.0 * np.arange(60)
        lines += tracking(times, 5e-7 + 1e-7 * rng.standard_normal(60), hard_s)
    path = folder / "tracking.log"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def timed(folder: Path, days: int = 20, text: str = SPEC) -> TimingAndSpec:
    spec = folder / "spec.yaml"
    spec.write_text(text, encoding="utf-8")
    return sd.timing([tracked(folder, days)], spec=spec)


def audited(folder: Path) -> Audit:
    """A receiver whose stamps slip by a second, held against what its verdict allows."""
    rng = np.random.default_rng(3)
    late = rng.gamma(2.0, 5e-4, 400)
    stamps = [1_700_000_000.0 + 0.1 * k + (1.0 if 100 <= k < 180 else 0.0) for k in range(400)]
    rows = [f"{s:.6f},{1_700_000_000.0 + 0.1 * k + late[k]:.6f}" for k, s in enumerate(stamps)]
    log, spec = folder / "gnss.csv", folder / "track.yaml"
    log.write_text("stamp_s,receive_s\n" + "\n".join(rows) + "\n", encoding="utf-8")
    spec.write_text(ARRIVAL, encoding="utf-8")
    return sd.audit([log], spec=spec)


SCREENS: dict[str, tuple[Callable[[Path], str], tuple[str, ...], tuple[str, ...]]] = {
    "timing": (
        lambda folder: html(on_timing(timed(folder))),
        ("#banner", "#spec > p", "#spec > .scroll", "#claim"),
        ("#banner", "#spec > dl", "#spec tbody tr:first-child th"),
    ),
    "audit": (
        lambda folder: html(on_audit(audited(folder))),
        ("#banner", "#faults", "#left > .scroll", "#streams > .scroll"),
        ("#banner", "#faults", "#left > h2"),
    ),
}


@pytest.mark.browser
@pytest.mark.parametrize("kind", SCREENS)
def test_the_answer_is_on_the_first_screen(browser: Any, tmp_path: Path, kind: str) -> None:
    """1300 x 900: headline, table and what it means; 420 x 900: headline, and how it goes on."""
    write, wide, narrow = SCREENS[kind]
    path = tmp_path / "page.html"
    path.write_text(write(tmp_path), encoding="utf-8")
    size = {"width": 1300, "height": 900}
    with Opened(browser, path, unfolded=False, viewport=size) as opened:
        for width, parts in ((1300, wide), (420, narrow)):
            opened.page.set_viewport_size({"width": width, "height": 900})
            for part in parts:
                ends = opened.page.eval_on_selector_all(part, ENDS)
                assert ends, (width, part)
                assert max(ends) <= 900, (width, part, ends)


@pytest.mark.browser
def test_offsets_and_sessions_of_a_clock_share_a_row(browser: Any, tmp_path: Path) -> None:
    """No third of the card is left to a caption: two figures beside one another fill it."""
    path = tmp_path / "page.html"
    path.write_text(html(on_timing(timed(tmp_path, 4))), encoding="utf-8")
    boxes = "all => all.map(e => e.getBoundingClientRect()).map(b => [b.left, b.width, b.top])"
    with Opened(browser, path, viewport={"width": 1300, "height": 900}) as opened:
        (card,) = opened.page.eval_on_selector_all("#offsets", boxes)
        (left, one, top), (right, other, beside) = opened.page.eval_on_selector_all(
            "#offsets figure svg", boxes
        )
    assert right > left + one
    assert abs(top - beside) < 20
    assert one + other > 0.9 * card[1]


def test_what_it_means_stands_before_what_it_rests_on(tmp_path: Path) -> None:
    parts = [part.key for part in on_timing(timed(tmp_path)).sections]
    assert parts.index("spec") < parts.index("claim") < parts.index("offsets")
    parts = [part.key for part in on_audit(audited(tmp_path)).sections]
    assert parts.index("faults") < parts.index("left") < parts.index("streams")
    assert parts.index("streams") < parts.index("offsets")


def test_evidence_of_a_clock_is_folded_and_a_long_table_with_it(tmp_path: Path) -> None:
    document = on_timing(timed(tmp_path))
    folded = {part.key for part in document.sections if part.folded}
    assert {"noise", "sources", "evidence", "provenance"} <= folded
    assert not folded & {"spec", "claim", "offsets", "sessions"}
    page = html(document)
    assert "<summary>Every session (20 rows)</summary>" in page
    assert "Every session" not in html(on_timing(sd.timing([tracked(tmp_path, 6)])))


def test_errors_stand_in_the_unit_of_the_limit(tmp_path: Path) -> None:
    told = console(on_timing(timed(tmp_path, 4)))
    assert re.search(r"Error of the system  \d\.\d+ cm, with this clock \d\.\d+ cm", told)
    metres = timed(tmp_path, 4, SPEC.replace("limit: 5 cm", "limit: 0.05 m"))
    assert re.search(r"Error of the system  0\.0\d+ m, with this", console(on_timing(metres)))
    assert metres.spec is not None
    assert metres.spec.accuracy is not None
    assert metres.spec.accuracy.limit == 0.05


def test_a_bound_far_away_does_not_flatten_the_offsets(tmp_path: Path) -> None:
    """The trace fills its axis; a bound beyond ten times the largest offset is said instead."""
    near = sd.timing([tracked(tmp_path, 6)])
    page = html(on_timing(near))
    worst = max(max(abs(p.low_s), abs(p.high_s)) for p in near.trace)
    assert in_sight(near.trace, 9.9 * worst)
    assert not in_sight(near.trace, 10.1 * worst)
    assert not in_sight(near.trace, None)
    assert near.bound_s is not None
    assert near.bound_s > 10.0 * worst  # the daemon's own hard bound
    assert "lies far beyond what is drawn" in page
    assert "Dashed: the bound." not in page


def test_operation_is_told_in_hours(tmp_path: Path) -> None:
    facts = dict(on_timing(sd.timing([tracked(tmp_path, 20)])).facts)
    hours = 20 * 59 * 16.0 / 3600.0
    assert facts["Sessions"] == f"20, {hours:.2f}\N{NO-BREAK SPACE}h"


def test_one_stream_has_faults(tmp_path: Path) -> None:
    assert "1 of 1 stream has faults: gnss." in console(on_audit(audited(tmp_path)))


def test_what_to_measure_again_can_be_copied(tmp_path: Path) -> None:
    """The option as code; no line ends before a percent sign."""
    page = html(on_timing(timed(tmp_path, 4)))
    assert "99.73\N{NO-BREAK SPACE}%: measure with <code" in page
    assert ">--coverage 0.9973</code>" in page
