"""What a log cannot tell apart: groups of which one is broken, and what may be undone."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import jsonschema
import pytest

from syncline_design.comparison.assumptions import assumptions
from syncline_design.comparison.by_log import by_log
from syncline_design.comparison.log_evidence import LogEvidence
from syncline_design.comparison.on_paper import OnPaper
from syncline_design.diagnosis.built import Sighted
from syncline_design.diagnosis.instead import InItsPlace
from syncline_design.diagnosis.result import (
    Diagnosis,
)
from syncline_design.diagnosis.undone import LeftOpen
from syncline_design.report.on_acceptance import render_acceptance
from syncline_design.report.result_schemas import result_schema
from syncline_design.spec.load import load
from syncline_design.verdict.verify import CheckSettings, check_loaded
from tests.acceptance_samples import (
    EXAMPLE,
    LATENCY_S,
    aliased,
    first_rows,
    found_in_first_rows,
    rival,
    rows_of,
    seen_as,
)


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first rows of the example's log."""
    return first_rows(tmp_path_factory.mktemp("log"))


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return found_in_first_rows()


def test_of_what_a_log_cannot_tell_apart_one_is_broken_and_each_has_its_figure(
    found: Diagnosis, short: Path
) -> None:
    """A delay or an arm: no row is the wrong one, the exit code is that of a broken one."""
    arm = rival("lever_arm", "position", 0.3, x_m=0.5, y_m=0.0, z_m=0.0)
    survey = rival("datum_offset", "target", 0.1, north_m=0.5, east_m=0.0, down_m=0.0)
    either = seen_as(aliased(found, arm, survey), short)
    rows = rows_of(either)
    assert (either.verdict, either.exit_code) == ("broken", 1)
    assert not [row for row in either.assumptions if row.status == "broken"]
    (group,) = either.groups
    names = ("multirotor/position/latency", "multirotor/position/lever_arm")
    assert group.rows == names
    assert either.broken_by == (" or ".join(names),)
    assert {key for key, row in rows.items() if row.one_of == 1} == {
        ("position", "latency"), ("position", "lever_arm"),
    }  # fmt: skip
    for name, value in (("latency", LATENCY_S), ("lever_arm", 0.5)):
        measured = rows["position", name].measured
        assert measured is not None
        assert measured.value == pytest.approx(value, abs=1e-3)
    assert [one.departures[0].rows for one in group.ways] == [(names[0],), (names[1],), ()]
    assert "position" in group.look_first
    assert group.tell_apart is not None
    assert group.tell_apart.endswith("--separate 'latency(position)' 'lever_arm(position)'")


@pytest.mark.parametrize(("to_s", "alone"), [(20.0, True), (29.9, False)])
def test_an_arm_does_not_come_and_go(
    to_s: float, alone: bool, found: Diagnosis, short: Path
) -> None:
    """A delay from 8 s to 20 s of 30 s is no arm; one that lasts to the end may be an arm moved."""
    arm = rival("lever_arm", "position", 0.3, x_m=0.5, y_m=0.0, z_m=0.0)
    told = aliased(found, arm)
    (late,) = told.findings
    told = replace(told, findings=(replace(late, from_s=8.0, to_s=to_s),))
    either = seen_as(told, short, ends_s=(0.0, 30.0))
    assert either.exit_code == 1
    assert (rows_of(either)["position", "latency"].status == "broken") is alone
    assert len(either.groups) == (0 if alone else 1)
    assert rows_of(either)["position", "lever_arm"].status == "not_shown"


def test_data_younger_than_their_stamps_may_be_all_others_that_are_late(
    found: Diagnosis, short: Path
) -> None:
    """An INS late as one device is the same log as ranges that are early: neither is said alone."""
    (late,) = [f for f in found.findings if f.effect == "latency"]
    own = late.parameters["latency_s"]
    early = replace(own, value=-float(own.value), interval95=(-LATENCY_S - 1e-3, -LATENCY_S + 1e-3))
    ranges = replace(late, sensor="ranging", parameters={"latency_s": early}, aliases=())
    told = seen_as(replace(found, findings=(ranges,)), short)
    assert (told.verdict, told.exit_code) == ("broken", 1)
    (group,) = told.groups
    assert group.rows == tuple(f"multirotor/{role}/latency"
                               for role in ("attitude", "position", "ranging"))  # fmt: skip
    assert [len(way.departures[0].rows) for way in group.ways] == [1, 2]
    assert group.tell_apart is None  # a delay common to all sensors moves nothing that stands still
    for role, sign in (("position", 1.0), ("attitude", 1.0), ("ranging", -1.0)):
        row = rows_of(told)[role, "latency"]
        assert row.status == "not_shown"
        assert row.measured is not None
        assert row.measured.value == pytest.approx(sign * LATENCY_S, abs=1e-3)
        assert row.measured.low is not None
        assert row.measured.high is not None
        assert row.measured.low < row.measured.value < row.measured.high


def test_a_row_that_every_explanation_breaks_is_broken(found: Diagnosis, short: Path) -> None:
    """A delay that grows with the frequency is one as well: the row is the same."""
    lag = rival("filter_lag", "position", 0.4, time_constant_s=0.087)
    told = seen_as(aliased(found, lag), short)
    assert rows_of(told)["position", "latency"].status == "broken"
    assert told.groups == ()


def test_what_was_not_asked_may_be_what_is_broken(found: Diagnosis, short: Path) -> None:
    """Of a delay or an arm only the delay is asked: it is not shown, not broken."""
    arm = rival("lever_arm", "position", 0.3, x_m=0.5, y_m=0.0, z_m=0.0)
    told = seen_as(aliased(found, arm), short, ("latency",))
    assert (told.verdict, told.exit_code, told.groups) == ("not_shown", 3, ())
    assert "lever_arm (position)" in rows_of(told)["position", "latency"].evidence


def test_no_drive_tells_two_arms_apart(found: Diagnosis, short: Path) -> None:
    """Errors of both arms that are equal move no object: a tape does."""
    (late,) = [f for f in found.findings if f.effect == "latency"]
    figures = {f"{axis}_m": replace(late.parameters["latency_s"], unit="m") for axis in "xyz"}
    other = rival("lever_arm", "ranging", 0.5, x_m=0.1, y_m=0.1, z_m=0.1)
    off = replace(late, effect="lever_arm", parameters=figures, aliases=(other,))
    told = seen_as(replace(found, findings=(off,)), short)
    (group,) = told.groups
    assert group.tell_apart is None
    text = render_acceptance("markdown", told)
    assert "No drive tells these apart" in text
    alone = [row for row in told.assumptions if row.status == "not_shown" and not row.one_of]
    assert f"at least one of 2 broken, 0 broken, {len(alone)} more not shown" in text


def test_every_format_names_the_group(found: Diagnosis, short: Path) -> None:
    arm = rival("lever_arm", "position", 0.3, x_m=0.5, y_m=0.0, z_m=0.0)
    told = seen_as(aliased(found, arm), short)
    written = json.loads(render_acceptance("json", told))
    jsonschema.validate(written, result_schema("acceptance"))
    assert [row["one_of"] for row in written["assumptions"] if "one_of" in row] == [1, 1]
    suite = ElementTree.fromstring(render_acceptance("junit", told))[0]
    assert suite.get("failures") == "1"
    (failed,) = [case for case in suite if case.find("failure") is not None]
    assert "multirotor/position/latency or multirotor/position/lever_arm" in failed.get("name", "")
    results = json.loads(render_acceptance("sarif", told))["runs"][0]["results"]
    (said,) = [one["message"]["text"] for one in results if one["ruleId"] == "one_of"]
    (line,) = [one for one in render_acceptance("github", told).splitlines() if "one_of::" in one]
    for text in (said, line, render_acceptance("markdown", told), render_acceptance("html", told)):
        assert "at least one of these is broken" in text
        assert re.search(r"position lever arm \W*500\Wmm", text)
        assert "plan" in text


@pytest.mark.parametrize(("size_s", "open_too"), [(0.02, True), (1e-5, False)])
def test_the_interval_of_what_is_broken_holds_what_may_be_undone_of_it(
    found: Diagnosis, size_s: float, open_too: bool
) -> None:
    """A lever arm that hides 20 ms of delay: its interval is 20 ms wider on both sides at least."""
    case = load(EXAMPLE)
    verdict = check_loaded(case, CheckSettings(monte_carlo=False))
    name = found.findings[0].stage
    position, arm = ("latency", "position", 0), ("lever_arm", "position", 0)
    more = LeftOpen(position, name, "latency_s", "s", size_s, 1e-4, arm)
    log = LogEvidence(found, OnPaper(case, ()), name, sight=Sighted(found, open=(more,)))
    [one] = [a for a in assumptions(case, verdict) if (a.role, a.name) == ("position", "latency")]
    row = by_log(one, log)
    assert row.status == "broken"
    assert row.measured is not None
    assert row.measured.value == pytest.approx(0.087, abs=0.003)
    assert row.measured.low is not None
    assert row.measured.high is not None
    wide = row.measured.low < 0.067 and row.measured.high > 0.107
    assert wide == open_too
    assert row.measured.high - row.measured.low < (0.05 if open_too else 0.002)
    assert ("undoes it on this log" in row.words) == open_too


def test_an_arm_that_a_delay_hides_most_of_has_an_interval_that_it_lies_in(
    found: Diagnosis,
) -> None:
    """7 mm are seen of an arm of 146 mm, the rest is undone: no length is left out, none below 0"""
    case = load(EXAMPLE)
    verdict = check_loaded(case, CheckSettings(monte_carlo=False))
    (late,) = [f for f in found.findings if f.effect == "latency"]
    seen = late.parameters["latency_s"]
    parts = {
        f"{axis}_m": replace(seen, value=v, unit="m", interval95=(v - 0.001, v + 0.001))
        for axis, v in (("x", 0.006), ("y", 0.003), ("z", -0.002))
    }
    arm = replace(late, effect="lever_arm", parameters=parts, aliases=())
    label, delay = ("lever_arm", "position", 0), ("latency", "position", 0)
    open_too = tuple(
        LeftOpen(label, late.stage, f"{axis}_m", "m", size, 1e-3, delay)
        for axis, size in (("x", 0.14), ("y", 0.02))
    )
    either = replace(found, findings=(arm,))
    log = LogEvidence(either, OnPaper(case, ()), late.stage, sight=Sighted(either, open=open_too))
    [one] = [a for a in assumptions(case, verdict) if (a.role, a.name) == ("position", "lever_arm")]
    row = by_log(one, log)
    assert row.status == "broken"
    assert row.measured is not None
    assert row.measured.value == pytest.approx(0.007)  # sqrt(6^2 + 3^2 + 2^2) mm
    assert row.measured.low == 0.0
    assert row.measured.high is not None
    assert math.hypot(0.146, 0.023, 0.002) < row.measured.high < 0.2


def test_what_others_do_together_in_its_place_is_of_its_group(
    found: Diagnosis, short: Path
) -> None:
    """A ranging delay beside an arm would do as well as the delay found: none is said alone."""
    case = load(EXAMPLE)
    verdict = check_loaded(case, CheckSettings(monte_carlo=False))
    (late,) = [f for f in found.findings if f.effect == "latency"]
    own = (late.effect, late.sensor, late.stage)
    others = (("latency", "ranging", late.stage), ("lever_arm", "ranging", late.stage))
    sight = Sighted(found, instead=(InItsPlace(own, others, 0.4),))
    log = LogEvidence(found, OnPaper(case, ()), late.stage, sight=sight)
    rows = {(a.role, a.name): by_log(a, log) for a in assumptions(case, verdict)}
    assert "or latency (ranging) with lever_arm (ranging)" in rows["position", "latency"].words
    doubted = (("position", "latency"), ("ranging", "latency"), ("ranging", "lever_arm"))
    assert [rows[one].status for one in doubted] == ["not_shown"] * 3
    assert rows["position", "lever_arm"].status == "holds"
    told = seen_as(found, short, instead=sight.instead)
    assert told.exit_code == 1
    (group,) = told.groups
    assert set(group.rows) == {f"multirotor/{role}/{name}" for role, name in doubted}
