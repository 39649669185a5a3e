"""Warnings of a verdict: their codes, what they are about, and that every format shows them."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from pathlib import Path

import pytest

from syncline_design.report.checks import render_checks
from syncline_design.report.on_choice import on_choice
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.optimizations import render_optimize
from syncline_design.report.render_console import console
from syncline_design.spec.load import load, load_text
from syncline_design.verdict.optimize import OptimizeSettings, optimize
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import CheckSettings, check_loaded

SPEC = """\
syncline: 1
name: tow boat
requirements:
  - {{id: FAR, kind: accuracy, limit: 2 m}}
  - {{id: NEAR, kind: accuracy, limit: {limit}}}
{more}
monte_carlo: {{samples: 2000}}
horizon: {{tilt: 0 deg}}
stages:
  - name: boat
    platform: {{v_max: 2 m/s, omega_max: 30 deg/s, distance: 10 m, baseline: 1 m}}
    position:
      sensor: {{modality: position, sigma_position: 5 cm, primitives: [pps], basis: assumption}}
      timestamping: {{error: {{distribution: uniform, low: -20 ms, high: 20 ms}}}}
      lever_arm: [8 m, 0 m, 0 m]
    attitude:
      sensor: {{modality: attitude, sigma_attitude: 1 deg, primitives: [pps]}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}}}
    ranging:
      sensor: {{modality: ranging, sigma_range: 1 mm, sigma_bearing: 1 mdeg, primitives: [pps]}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}}}
      lever_arm: [-8 m, 0 m, 0 m]
"""
ROOT = Path(__file__).resolve().parent.parent
WORST = "worst-case-above-limit"


def verdict(limit: str, more: str = "") -> Verdict:
    text = SPEC.format(limit=limit, more=more)
    return check_loaded(load_text(text, "boat.yaml"), CheckSettings())


def worst_by_hand_m() -> float:
    """Level, all in one line: the turned attitude acts on 10 m and 16 m of arms.

    v tau + sigma_p + w tau 8 m (the antenna) + 1 deg sqrt(3) 26 m, to first order; only the
    position's stamp is uncertain.
    """
    tau, rate = 0.02, math.radians(30.0)
    turned = math.radians(1.0) * math.sqrt(3.0)
    return 2.0 * tau + 0.05 * math.sqrt(3.0) + rate * tau * 8.0 + turned * 26.0


def test_a_design_that_meets_while_its_worst_case_does_not_is_warned_of() -> None:
    found = verdict("0.80 m")
    assert found.verdict == "meets"
    assert found.syncline.total_m < 0.80 < worst_by_hand_m()
    (warned,) = [w for w in found.warnings if w.code == WORST]
    assert warned.requirement == "NEAR"
    certified = found.figures.worst_case_1sigma_m
    assert worst_by_hand_m() < certified < 1.02 * worst_by_hand_m()  # Euler noise at its own pitch
    assert found.figures.syncline_m == pytest.approx(found.syncline.total_m)
    assert f"certified worst case is {certified:.3f} m" in warned.message


def test_no_warning_above_the_worst_case_nor_where_the_limit_is_missed() -> None:
    for limit, word in (("1.9 m", "meets"), ("0.2 m", "fails")):
        found = verdict(limit)
        assert found.verdict == word
        assert not [w for w in found.warnings if w.code == WORST]


def test_noise_that_is_known_to_be_larger_counts_in_the_worst_case() -> None:
    """Positions that scatter three times as much add 2 sigma_p, all in one line, by hand."""
    true = worst_by_hand_m() + 2.0 * 0.05 * math.sqrt(3.0)
    known = "effects: [{effect: noise_understated, sensor: position, parameters: {factor: 3}}]"
    for limit, warns in ((true - 0.03, True), (true + 0.03, False)):
        found = verdict(f"{limit} m", known)
        assert found.verdict == "meets"
        assert limit > worst_by_hand_m()
        assert [w.requirement for w in found.warnings if w.code == WORST] == (
            ["NEAR"] if warns else []
        )
        headline = console(on_verdict(found), colour=False).splitlines()[0]
        assert ("its certified worst case at one sigma exceeds" in headline) == warns


def test_a_waived_limit_does_not_hide_that_a_kept_one_is_exceeded() -> None:
    kept = "  - {id: KEPT, kind: accuracy, limit: 0.9 m}"
    found = verdict("0.2 m, waiver: {reason: trial, expires: 2999-01-01}", kept)
    assert found.verdict == "meets"
    assert 0.9 < worst_by_hand_m() < 2.0
    assert [w.requirement for w in found.warnings if w.code == WORST] == ["KEPT"]


def test_warnings_say_what_they_are_about() -> None:
    more = "  - {id: LOW, kind: sync, limit: 0.0001, waiver: {reason: trial, expires: 2999-01-01}}"
    for warned in verdict("0.80 m", more).warnings:
        assert warned.code
        assert warned.message
        if warned.code == "assumption":
            assert warned.entry
            assert warned.key
        if warned.code == "waiver":
            assert warned.requirement == "LOW"


def test_figures_without_a_source_are_listed_once_with_their_entries() -> None:
    """Of the relayed ROV: JSON has a warning an entry, readers get one for the same figures."""
    found = check_loaded(load(ROOT / "specs" / "rov_relay.yaml"), CheckSettings())
    told = [one for one in found.warnings if one.code == "assumption"]
    shown = " ".join(console(on_verdict(found), colour=False).split())
    lines = re.findall(r"! assumption, no public source: .*? \(assumption\)", shown)
    assert len(lines) == len({one.key for one in told}) < len(told)
    for one in told:
        (line,) = [line for line in lines if f"source: {one.key} of " in line]
        assert str(one.entry) in line.replace(",", " ").split()


@pytest.mark.parametrize("form", ["json", "html", "junit", "sarif", "github", "markdown", "csv"])
def test_every_format_shows_the_warning(form: str) -> None:
    found = verdict("0.80 m")
    shown = render_checks(form, [found])
    assert WORST in shown
    if form not in ("csv", "json"):
        figure = f"worst case is {found.figures.worst_case_1sigma_m:.3f} m"
        assert figure in shown.replace("\u00a0", " ")  # on a page figure and unit never part


def test_the_console_shows_warning_horizon_envelope_and_ensemble() -> None:
    shown = " ".join(console(on_verdict(verdict("0.80 m")), colour=False).split())
    assert f"({WORST})" in shown
    for text in ("charged for 1 h, extent 1 km, tilt 0 deg", "tilt up to 0 deg", "over missions"):
        assert text in shown


HEAD = "exceeds the limit of NEAR (worst-case-above-limit)"


def headlines(found: Verdict) -> dict[str, str]:
    """The line of each format that gives the verdict, alone and beside another spec's."""
    shown = {form: render_checks(form, [found]) for form in ("markdown", "junit", "github")}
    page = render_checks("html", [found])
    overview = render_checks("html", [found, verdict("1.9 m")])
    return {
        "console": console(on_verdict(found), colour=False).splitlines()[0],
        "markdown": shown["markdown"].splitlines()[0].replace("\\", ""),
        "junit": shown["junit"].split("<system-out>")[1].splitlines()[0],
        "github": next(x for x in shown["github"].splitlines() if x.startswith("::notice")),
        "html": page.split("<h1")[1].split("<h2")[0],
        "overview": overview.split("<h1")[1],
    }


def test_every_headline_of_a_qualified_meets_says_so() -> None:
    for form, line in headlines(verdict("0.80 m")).items():
        assert HEAD in line, form


def test_no_other_headline_does() -> None:
    for limit in ("1.9 m", "0.2 m"):
        for form, line in headlines(verdict(limit)).items():
            assert "exceeds the limit of" not in line, form


EXCEEDED = {0.5: "61.7 %", 1.0: "31.7 %", 1.96: "5 %", 1e-9: "100 %"}  # tables of the normal law


@pytest.mark.parametrize("factor", [*EXCEEDED, 2.0, 3.0])
@pytest.mark.parametrize("where", ["stamp", "clock", "jitter", "nowhere"])
def test_a_bound_that_normal_errors_often_exceed_is_told_of(factor: float, where: str) -> None:
    """coverage_factor 1e-9 made every normal error a bound of nothing, without a word."""
    text = SPEC.format(limit="1.9 m", more=f"coverage_factor: {factor}")
    normal = "{distribution: normal, mean: 0 s, std: 1 us}"
    uniform = "{distribution: uniform, low: -20 ms, high: 20 ms}"
    if where == "stamp":
        text = text.replace(uniform, normal)
    if where == "clock":
        text = text.replace("    position:\n", "    clock: pps_gpio\n    position:\n")
    if where == "jitter":
        text += "effects:\n  - {effect: timestamp_jitter, sensor: attitude, "
        text += "parameters: {std_s: 1 us}}\n"
    found = check_loaded(load_text(text, "boat.yaml"), CheckSettings(monte_carlo=False))
    told = [one.message for one in found.warnings if one.code == "coverage-factor"]
    assert len(told) == (where != "nowhere" and factor in EXCEEDED)
    assert all(f"{EXCEEDED[factor]} of normal timestamp errors" in words for words in told)


CHAIN_OF_ONE_VEHICLE = """\
syncline: 1
name: mast and winch
requirements: [{{id: A, kind: accuracy, limit: 10 m}}]
stages:
  - name: mast
    vehicle: ship
    platform: {{v_max: 2 m/s, omega_max: 3 deg/s, distance: 10 m, baseline: 1 m}}
    position: {{sensor: {{modality: position, sigma_position: 5 cm, primitives: []}}, {0}}}
    attitude: {{sensor: {{modality: attitude, sigma_attitude: 1 deg, primitives: []}}, {0}}}
    ranging:
      sensor: {{modality: ranging, sigma_range: 1 cm, sigma_bearing: 1 deg, primitives: []}}
      {0}
  - name: winch
    vehicle: ship
    platform: {{v_max: 2 m/s, omega_max: 3 deg/s, distance: 10 m, baseline: 1 m}}
    attitude: {{sensor: {{modality: attitude, sigma_attitude: 1 deg, primitives: []}}, {1}}}
    ranging:
      sensor: {{modality: ranging, sigma_range: 1 cm, sigma_bearing: 1 deg, primitives: []}}
      {1}
"""


@pytest.mark.parametrize(
    ("lines", "told"), [("uh", True), ("hu", True), ("uu", False), ("hh", False)]
)
@pytest.mark.parametrize("clock", [True, False])
def test_timelines_that_differ_between_stages_of_one_vehicle_are_told_of(
    lines: str, told: bool, clock: bool
) -> None:
    """The two ranging sensors meet: without a named clock their offset is taken as 0."""
    names = {"u": "utc", "h": "host"}
    stamps = [
        f"timestamping: {{error: {{distribution: constant, value: 1 ms}}, timeline: {names[line]}}}"
        for line in lines
    ]
    text = CHAIN_OF_ONE_VEHICLE.format(*stamps)
    if clock:
        text = text.replace("    vehicle: ship\n", "    vehicle: ship\n    clock: ntp_internet\n")
    found = check_loaded(load_text(text, "ship.yaml"), CheckSettings(monte_carlo=False))
    codes = [one.code for one in found.warnings]
    assert ("common-clock" in codes) == (told and not clock)
    offset = 0.005 if told and clock else 0.0  # ntp_internet: within 5 ms
    assert found.syncline.tau_s == pytest.approx(0.002 + offset, rel=1e-12)


@pytest.mark.parametrize(
    ("limit_m", "expires", "state", "said"),
    [
        (0.2, "2999-01-01", "\u25d0 waived", "waived until 2999-01-01: trial"),
        (0.2, "2021-01-01", "\u2717 fail", "waiver expired on 2021-01-01: trial"),
        (9.0, "2999-01-01", "\u2713 pass", "its waiver (until 2999-01-01: trial) is not needed"),
    ],
)
def test_console_and_csv_tell_a_waived_requirement_from_a_failed_one(
    limit_m: float, expires: str, state: str, said: str
) -> None:
    """Both said FAIL alone; the boat's Syncline is above 0.2 m and below 9 m."""
    found = verdict(f"{limit_m} m, waiver: {{reason: trial, expires: {expires}}}")
    (line,) = [
        x for x in console(on_verdict(found), colour=False).splitlines() if x.startswith("  NEAR  ")
    ]
    assert line.split()[1:3] == state.split()
    headline = console(on_verdict(found), colour=False).splitlines()[0]
    assert ("Meets every requirement, NEAR waived" in headline) is (state == "\u25d0 waived")
    rows = {row["requirement"]: row for row in csv.DictReader(io.StringIO(csv_of(found)))}
    waived = state == "\u25d0 waived"
    assert rows["NEAR"]["status"] == ("pass" if limit_m > 1.0 else "waived" if waived else "fail")
    assert rows["NEAR"]["waiver"] == said
    assert rows["FAR"]["waiver"] == ""


def csv_of(found: Verdict) -> str:
    return render_checks("csv", [found])


@pytest.mark.parametrize(("limit", "warns"), [("0.80 m", True), ("1.9 m", False)])
def test_optimize_warns_as_check_does(limit: str, warns: bool) -> None:
    """In text, JSON and headline, where the worst case by hand exceeds the limit and only there."""
    found = optimize(load_text(SPEC.format(limit=limit, more=""), "boat.yaml"), OptimizeSettings())
    assert found.result.verdict == "meets"
    assert (worst_by_hand_m() > float(limit.split()[0])) == warns
    codes = [w["code"] for w in json.loads(render_optimize("json", found))["warnings"]]
    assert (WORST in codes) == warns
    told = " ".join(console(on_choice(found), colour=False).split())
    assert (f"({WORST})" in told) == warns
    assert ("its certified worst case at one sigma exceeds the limit of NEAR" in told) == warns
    # what check says of the design and its entries, in the same words (simulation apart)
    checked = {w.message for w in verdict(limit).warnings}
    assert {w.message for w in found.result.warnings} == checked


def test_a_spec_that_pins_everything_fails_in_check_and_optimize() -> None:
    """2 (m/s) 20 ms alone are 4 cm: nothing to choose, nothing infeasible, the same exit code."""
    found = optimize(
        load_text(SPEC.format(limit="3 cm", more=""), "boat.yaml"), OptimizeSettings()
    ).result
    assert (found.verdict, found.exit_code) == ("fails", 1)
    assert found.designs == ()
    assert found.infeasibility is not None
    checked = verdict("3 cm")
    assert (checked.verdict, checked.exit_code) == ("fails", 1)


@pytest.mark.parametrize("timelines", [("utc", "utc"), ("host", "utc"), ("utc", "host")])
def test_only_who_stamps_on_its_host_is_asked_for_a_clock(timelines: tuple[str, str]) -> None:
    """A tow fish behind a boat with a clock: its offset enters where a stamp of its is the host's.

    Its attitude and sonar on UTC are on the boat's time whatever its own clock shows.
    """
    attitude, ranging = timelines
    fish = f"""\
  - name: fish
    platform: {{v_max: 1 m/s, omega_max: 5 deg/s, distance: 5 m, baseline: 0 m}}
    attitude:
      sensor: {{modality: attitude, sigma_attitude: 1 deg, primitives: [pps]}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}, timeline: {attitude}}}
    ranging:
      sensor: {{modality: ranging, sigma_range: 1 mm, sigma_bearing: 1 mdeg, primitives: [pps]}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}, timeline: {ranging}}}
"""
    boat = SPEC.format(limit="9 m", more="").replace(
        "- name: boat", "- name: boat\n    clock: tcxo"
    )
    found = check_loaded(load_text(boat + fish, "tow.yaml"), CheckSettings(monte_carlo=False))
    told = [w.message for w in found.warnings if w.code == "common-clock"]
    assert len(told) == (1 if "host" in timelines else 0)
    assert all("fish gives no `clock`" in message for message in told)
