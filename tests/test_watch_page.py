"""The page of `watch`: what it says of runs, evidence and courses."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from browsing import flaws_of
from html_page import Page
from syncline_design.campaign.watch_result import RunValue, WatchedRun, e_value_text
from syncline_design.model.figure_text import format_estimate, format_interval
from syncline_design.report.charts_watch import courses, evidence
from watched_series import (
    BOUND,
    LABELS,
    car_spec,
    kept,
    run_of,
    series,
    statistics,
    told,
    watch,
)


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return car_spec(tmp_path_factory.mktemp("watch") / "spec.yaml")


def test_its_page_is_sound(browser: object, spec: Path, tmp_path: Path) -> None:
    change = np.array([9.0, 0, 0, 0, 0]) * BOUND
    runs = [run_of(one, day) for day, one in enumerate(series(11, 5, change, 3))]
    path = tmp_path / "watch.html"
    watch(kept(spec, tmp_path, runs), spec, "-o", f"html:{path}")
    page = path.read_text("utf-8")
    assert "fig-courses-2" in page
    for label in ("syncline-design", "Spec, SHA-256", "Catalogs, SHA-256"):
        assert label in Page(page).text
    assert flaws_of(browser, path) == []


def test_the_courses_are_not_shifted_by_what_changed(spec: Path, tmp_path: Path) -> None:
    """A build with a datum that is off, of which the latency is moved by 30 bounds with run 7.

    Where the mean change is taken for the build's own, the datum's north, which moves runs nearly
    alike, is off by ten standard deviations on every day.  Of 50 values one is beyond 4.2 of them
    with a chance of 0.13 %.
    """
    rng, change = np.random.default_rng(51), 30.0 * BOUND[0]
    build = np.array([0, 0, 25.0, 0, -40.0]) * BOUND
    moved = build + np.array([change, 0, 0, 0, 0])
    found = [statistics(rng, moved if day >= 6 else build, 0.9) for day in range(10)]
    store = kept(spec, tmp_path, [run_of(one, day) for day, one in enumerate(found)])
    runs = told(spec, store, tmp_path, 1)["runs"]
    for (effect, _, _, name), true in zip(LABELS, build, strict=True):
        every = [v for run in runs for v in run["values"] if v["parameter"] == name]
        values, spread = (np.array([v[k] for v in every])
                          for k in ("value", "standard_uncertainty"))  # fmt: skip
        expected = true + np.where((np.arange(10) >= 6) & (effect == "latency"), change, 0.0)
        assert np.max(np.abs(values - expected) / spread) < 4.2, name


def test_evidence_beyond_the_figure_is_told_as_it_is(spec: Path, tmp_path: Path) -> None:
    """The figure ends at 1e12 and says so; its words are the e-values of the answer."""
    runs = series(21, 26, np.array([30.0, 0, 0, 0, 0]) * BOUND, 6)
    store = kept(spec, tmp_path, [run_of(one, day) for day, one in enumerate(runs)])
    last = told(spec, store, tmp_path, 1)["e_value"]
    assert last > 1e20
    page = Page((tmp_path / "watch.html").read_text("utf-8"))
    assert "Drawn up to 1e+12" in page.text
    assert page.text.count(e_value_text(last)) >= 3  # headline, values of the figure, runs


def evidence_of(*values: float | None) -> str:
    runs = [cast(WatchedRun, SimpleNamespace(run=k, e_value=v)) for k, v in enumerate(values, 1)]
    return evidence(runs, 20.0).svg.replace("\u00a0", " ")


@pytest.mark.parametrize("last", [3.4e15, 1e204, 1e300])
def test_the_spoken_evidence_is_that_of_the_last_run_not_of_the_drawn_end(last: float) -> None:
    spoken = re.findall(r"<desc[^>]*>([^<]*)<", evidence_of(None, 0.5, 1e13, last))[0]
    assert spoken.startswith(f"{e_value_text(last)} after run 4, alarm from 20 on")
    assert spoken.endswith("; 2 runs above the drawn range")


def test_a_run_above_the_drawn_range_has_a_mark_of_its_own() -> None:
    """At the end of the range, 1e12, is a run still drawn where it belongs."""
    within, beyond = evidence_of(None, 0.5, 1e12), evidence_of(None, 0.5, 1.01e12)
    assert "above the drawn range" not in within
    assert "; 1 run above the drawn range" in beyond
    assert beyond.count("<use ") == within.count("<use ") + 1


def test_one_parameter_and_one_run_are_spoken_of_as_one() -> None:
    value = RunValue("tilt", "attitude", "usv", "gain", 1e-4, 2e-4, (-3e-4, 5e-4))
    one = cast(WatchedRun, SimpleNamespace(run=1, values=[value]))
    two = cast(WatchedRun, SimpleNamespace(run=2, values=[value]))
    keys = [("tilt", "attitude", "usv", "gain")]
    assert ">1 parameter over 1 run; " in courses([one], keys, {}).svg.replace("\u00a0", " ")
    assert ">1 parameter over 2 runs; " in courses([one, two], keys, {}).svg.replace("\u00a0", " ")


def test_courses_have_the_digits_of_their_uncertainty(spec: Path, tmp_path: Path) -> None:
    """Two digits of half of the middle interval, the same places in every row."""
    runs = [run_of(one, day) for day, one in enumerate(series(21, 9, 50.0 * BOUND, 0))]
    found = told(spec, kept(spec, tmp_path, runs), tmp_path, 0)
    values = [v for run in found["runs"] for v in run["values"] if v["parameter"] == "latency_s"]
    half = 1e3 * np.median([v["interval95"][1] - v["interval95"][0] for v in values]) / 2.0
    assert 0.1 < half < 1.0  # ms, so that two digits are two places
    page = Page((tmp_path / "watch.html").read_text("utf-8"))
    text = page.text.replace("\u00a0", " ").replace("\u2212", "-")
    assert all(f"{1e3 * v['value']:.2f} ms" in text for v in values)


def test_no_power_of_ten_stands_for_a_unit_in_words() -> None:
    """An axis of small values may say 1e-3; a value and its interval read as they are."""
    values = [[RunValue("tilt", "attitude", "usv", "gain", 1.3e-4 + 1e-6 * k, 2.5e-4,
                        (-3.6e-4, 6.2e-4))]
              for k in range(4)]  # fmt: skip
    runs = [cast(WatchedRun, SimpleNamespace(run=k, values=v)) for k, v in enumerate(values, 1)]
    drawn = courses(runs, [("tilt", "attitude", "usv", "gain")], {})
    says = drawn.told[0].says
    assert says["Parameter"] == "gain"
    told = [says[label].replace("\u2212", "-") for label in ("Value", "95 % interval")]
    assert told == ["0.00013", "-0.00036 to 0.00062"]


def test_many_runs_have_round_ticks_and_a_table_of_bounded_height(
    spec: Path, tmp_path: Path
) -> None:
    runs = [run_of(one, day) for day, one in enumerate(series(21, 75, 0.0 * BOUND, 99))]
    path = tmp_path / "watch.html"
    watch(kept(spec, tmp_path, runs), spec, "-o", f"html:{path}")
    page = path.read_text("utf-8")
    svg = page.partition('id="fig-evidence')[2].partition("</svg>")[0]
    ticks = [t for t in re.findall(r"<text[^>]*>\s*(\d+)\s*</text>", svg) if int(t) > 1]
    assert {"20", "40", "60"} <= set(ticks)
    assert not {"21", "22", "42", "62"} & set(ticks)
    assert 'class="scroll long' in page
    drawn = "".join(page.split('id="fig-courses')[1:])
    assert drawn.count("<path") < 75 * len(LABELS)  # not one for every run and parameter


def test_an_interval_has_the_place_of_its_estimate() -> None:
    """`1.54 ± 0.10 ms` goes from 1.34 to 1.74 ms, not from 1.345 to 1.74."""
    assert format_estimate(1.5425e-3, 0.1e-3, "s") == "1.54 ± 0.10 ms"
    assert format_interval(1.5425e-3, 0.1e-3, (1.344e-3, 1.74e-3), "s") == "1.34 ms to 1.74 ms"
    assert format_interval(2.0, 0.0, (1.0, 3.25), "m") == "1 m to 3.25 m"


def test_evidence_is_told_in_one_way() -> None:
    told = [
        e_value_text(value) for value in (0.784, 40.2, 990.0, 996.0, 1.1e5, 3.5e7, 4.5e44, 1e300)
    ]
    assert told == ["0.78", "40", "990", "1.0e+03", "1.1e+05", "3.5e+07", "4.5e+44",
                    "more than 1e+299"]  # fmt: skip


@pytest.mark.parametrize(
    ("parameter", "size", "unit", "per_unit"),
    [("rate", 1.3e-6, "ppm", 1e6), ("rate_radps", 3e-7, "deg/h", 3600.0 * 180.0 / np.pi),
     ("scale", 0.25, "", 1.0), ("rate_mps", 4e-4, "mm/s", 1e3), ("latency_s", 4e-3, "ms", 1e3)],
)  # fmt: skip
def test_a_value_is_told_in_a_unit_that_leaves_no_zeros_before_it(
    parameter: str, size: float, unit: str, per_unit: float
) -> None:
    values = [RunValue("clock_drift", "attitude", "usv", parameter, 0.8 * size, 0.1 * size,
                       (0.6 * size, size))]  # fmt: skip
    runs = [cast(WatchedRun, SimpleNamespace(run=1, values=values))]
    drawn = courses(runs, [("clock_drift", "attitude", "usv", parameter)], {})
    told, _, named = drawn.told[0].says["Value"].partition(" ")
    assert named == unit
    assert float(told) == pytest.approx(0.8 * size * per_unit, rel=0.06)
    assert not told.startswith("0.00")
