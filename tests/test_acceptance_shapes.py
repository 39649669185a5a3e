"""Rows of `accept` where a diagnosis has but a word for what is so."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.assumptions import Assumed, assumptions
from syncline_design.comparison.by_log import by_log
from syncline_design.comparison.departing import amount
from syncline_design.comparison.judgement import Judgement
from syncline_design.comparison.log_evidence import LogEvidence
from syncline_design.comparison.on_paper import OnPaper
from syncline_design.comparison.shapes import beside_shapes, once_changed
from syncline_design.diagnosis.built import Sighted
from syncline_design.diagnosis.noise_split import NoiseFactor, NoiseFactors
from syncline_design.diagnosis.one_course import OneCourse
from syncline_design.diagnosis.result import Diagnosis, Finding
from syncline_design.diagnosis.stretches import ShownSize, Stands, Stretches
from syncline_design.diagnosis.undone import LeftOpen
from syncline_design.spec.load import load
from syncline_design.verdict.verify import CheckSettings, check_loaded
from tests.acceptance_samples import (
    EXAMPLE,
    first_rows,
    found_in_first_rows,
    rival,
    rows_of,
    seen_as,
)


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return found_in_first_rows()


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return first_rows(tmp_path_factory.mktemp("log"))


def row_of(role: str, name: str) -> Assumed:
    case = load(EXAMPLE)
    verdict = check_loaded(case, CheckSettings(monte_carlo=False))
    return next(a for a in assumptions(case, verdict) if (a.role, a.name) == (role, name))


@pytest.mark.parametrize("high", [0.93, 1.0])
def test_no_noise_is_broken_whose_figure_stays_within_the_spec_s(
    found: Diagnosis, high: float
) -> None:
    """A delay that sways looks like slow noise of positions, which scatter less than they may."""
    slow = replace(found.findings[0], effect="correlated_noise", sensor="position", also=None,
                   parameters={}, kind="noise", material=True, aliases=())  # fmt: skip
    split = NoiseFactors((NoiseFactor(0.44, 0.0, high),), (1.0,), (0.012, 0.012, 0.02))
    one = row_of("position", "noise")
    told = replace(found, findings=(slow,), verdict="explained")
    sight = Sighted(told, factors={f"{one.stage}/position": split})
    row = by_log(one, LogEvidence(told, OnPaper(load(EXAMPLE), ()), one.stage, sight=sight))
    assert row.status == "not_shown", row
    assert "cannot tell whose it is" in row.words
    assert row.measured == MeasuredFigure(0.44, 0.0, high)


LOUD = NoiseFactors((NoiseFactor(3.0, 2.5, 3.5),), (1.0,), (5e-4, 5e-4, 1e-3))
SOUND = NoiseFactors((NoiseFactor(1.0, 0.9, 1.05),), (1.0,), (0.012, 0.012, 0.02))
ON_THE_EDGE = NoiseFactors((NoiseFactor(1.05, 0.4, 3.0),), (1.0,), (0.02, 1e-3, 1e-3))
MOVED = Stands(("mounting", "attitude", 0), "multirotor", 10.0, 90.0, ("x_rad", "y_rad", "z_rad"),
               (0.0, 0.01, 0.0), (1e-4, 1e-4, 1e-4), -40.0, sure=True)  # fmt: skip


def noisy(found: Diagnosis, factor: float, effect: str = "noise_understated") -> Diagnosis:
    """A diagnosis that lays noise on the attitude, with a standard uncertainty of 2 %."""
    part = replace(found.findings[0].parameters["latency_s"], value=factor, unit="",
                   standard_uncertainty=0.02 * factor, interval95=None)  # fmt: skip
    loud = replace(found.findings[0], effect=effect, sensor="attitude", also=None, kind="noise",
                   parameters={"factor": part}, material=True, aliases=(),
                   from_s=20.0, to_s=20.0 + 0.2 * found.log.duration_s)  # fmt: skip
    return replace(found, findings=(loud,), verdict="explained")


def noise_rows(told: Diagnosis, split: dict[str, NoiseFactors],
               **seen: Any) -> dict[str, Judgement]:  # fmt: skip
    factors = {f"multirotor/{role}": own for role, own in split.items()}
    sight = Sighted(told, factors=factors, **seen)
    log = LogEvidence(told, OnPaper(load(EXAMPLE), ()), "multirotor", sight=sight)
    return {role: by_log(row_of(role, "noise"), log) for role in split}


def test_noise_beside_a_drift_that_is_undone_keeps_its_interval(found: Diagnosis) -> None:
    """The drift that an arm hides is no part of how far readings scatter; it is said."""
    drift = LeftOpen(("heading_drift", "attitude", 0), "multirotor", "rate_radps", "rad/s", 9.0,
                     1e-6, ("lever_arm", "position", 0))  # fmt: skip
    row = noise_rows(noisy(found, 3.0), {"attitude": LOUD}, open=(drift,))["attitude"]
    assert row.status == "broken"
    assert row.measured == MeasuredFigure(3.0, 2.5, 3.5)
    assert "more of it may be there: heading_drift" in row.words


def test_noise_that_may_be_another_sensor_s_holds_for_neither(found: Diagnosis) -> None:
    """The attitude's figure may keep the spec's; then the position has what is beyond it."""
    told = noisy(found, 1.9)
    either = NoiseFactors((NoiseFactor(1.43, 0.97, 1.95),), (1.0,), (5e-4, 5e-4, 1e-3))
    louder = NoiseFactors((NoiseFactor(1.55, 1.22, 1.83),), (1.0,), (0.012, 0.012, 0.02))
    rows = noise_rows(told, {"attitude": either, "position": louder})
    assert [row.status for row in rows.values()] == ["not_shown", "not_shown"], rows
    assert "cannot tell whose" in rows["position"].words
    sound = noise_rows(told, {"attitude": either, "position": SOUND})["position"]
    assert "cannot tell whose" not in sound.words


def test_noise_without_an_interval_holds_of_no_log(found: Diagnosis) -> None:
    """Of fewer rows than tell the sensors apart there is a figure, and nothing bounds it."""
    told = replace(found, findings=(), verdict="agrees")
    one = row_of("position", "noise")
    log = LogEvidence(told, OnPaper(load(EXAMPLE), ()), one.stage, sight=Sighted(told))
    row = by_log(one, log)
    assert row.status == "not_shown", row
    assert row.measured is not None
    assert row.measured.high is None
    assert "bounds none" in row.words


@pytest.mark.parametrize(
    ("seen", "status"),
    [
        ({}, "broken"),
        ({"course": OneCourse(("mounting", "attitude", 0), 40.0, 90.0, 0.9)}, "not_shown"),
        ({"stretches": Stretches((MOVED,))}, "not_shown"),
        ({"stretches": Stretches((MOVED,)), "taken": (MOVED,)}, "broken"),
    ],
)
def test_noise_is_broken_unless_one_course_or_what_stands_out_makes_it(
    found: Diagnosis, seen: dict[str, Any], status: str
) -> None:
    """An attitude that was turned for most of a log scatters 3 times as much as it may."""
    row = noise_rows(noisy(found, 3.0), {"attitude": LOUD}, **seen)["attitude"]
    assert row.status == status, row
    if "course" in seen:
        assert "90 %" in row.words


@pytest.mark.parametrize(("share", "status"), [(0.4, "holds"), (0.55, "not_shown")])
def test_no_row_holds_of_a_log_of_which_most_was_left_out(
    found: Diagnosis, share: float, status: str
) -> None:
    told = replace(found, findings=(), verdict="agrees")
    row = noise_rows(told, {"position": SOUND}, left_out=share)["position"]
    assert row.status == status, row
    assert ("55 % of the log" in row.words) is (status == "not_shown")


@pytest.mark.parametrize(("share", "status"), [(0.3, "broken"), (0.1, "holds")])
def test_what_stands_out_breaks_its_row_where_it_is_as_large_as_what_matters(
    found: Diagnosis, share: float, status: str
) -> None:
    """A turn of 10 urad turns no verdict of this spec: by its share of the spec's noise, then."""
    slight = replace(MOVED, values=(0.0, 1e-5, 0.0), spreads=(1e-6,) * 3, share=share)
    one = row_of("attitude", "mounting")
    told = replace(found, findings=(), verdict="agrees")
    reach = ShownSize(MOVED.label, "multirotor", "y_rad", "rad", 0.1, (1.0, 2.0), (2e-6, 1e-6))
    seen = Sighted(told, Stretches((slight,), (reach,)), taken=(slight,))
    log = LogEvidence(told, OnPaper(load(EXAMPLE), ()), "multirotor", sight=seen)
    row = by_log(one, log)
    assert row.status == status, row
    assert row.measured is not None
    assert row.measured.high is not None
    assert row.measured.high >= 1e-5
    assert ("is slight" in row.words) is (status == "holds")


def test_noise_of_a_while_that_its_sensor_cannot_have_may_be_of_the_others(
    found: Diagnosis,
) -> None:
    """4 times for a fifth of the log makes 2 in all of it, and attitudes scatter 1.2 at most."""
    quiet = NoiseFactors((NoiseFactor(1.1, 1.01, 1.2),), (1.0,), (5e-4, 5e-4, 1e-3))
    told = noisy(found, 4.0, "noise_episode")
    rows = noise_rows(told, {"attitude": quiet, "ranging": ON_THE_EDGE, "position": SOUND})
    assert [rows[role].status for role in ("attitude", "ranging")] == ["not_shown", "not_shown"]
    assert "those of ranging" in rows["ranging"].words
    assert rows["position"].status == "holds"
    loud = NoiseFactors((NoiseFactor(2.0, 0.9, 2.9),), (1.0,), (5e-4, 5e-4, 1e-3))
    rows = noise_rows(told, {"attitude": loud, "ranging": ON_THE_EDGE})
    assert rows["attitude"].status == "broken"  # by the finding itself: 1.93 and more
    assert rows["attitude"].measured is not None
    assert rows["attitude"].measured.low == pytest.approx(math.sqrt(1 + 0.2 * (3.843**2 - 1)), 1e-3)
    assert "those of ranging" not in rows["ranging"].words


def knocked(found: Diagnosis, *, once: bool, noise_left: bool) -> Diagnosis:
    """A diagnosis that has but a word for a ranging sensor that is turned by 0.5 deg later on."""
    part = found.findings[0].parameters["latency_s"]
    turn = {f"{axis}_rad": replace(part, value=size, unit="rad",
                                   interval95=(size - 2e-4, size + 2e-4))
            for axis, size in zip("xyz", (0.0, 9e-3, 0.0), strict=True)}  # fmt: skip
    other = rival("mounting", "attitude", 0.4, x_rad=1e-9, y_rad=-9e-3, z_rad=1e-9)
    word = replace(found.findings[0], effect="boresight", sensor="ranging", also=None,
                   parameters=turn, kind="stand_in", material=True, aliases=(other,),
                   from_s=60.0, to_s=99.9, changed_once=once or None)  # fmt: skip
    left = replace(found.remaining, unexplained=True, material=True, beyond_noise=not noise_left)
    return replace(found, findings=(word,), verdict="unexplained", remaining=left)


def test_a_knock_is_broken_from_then_on(found: Diagnosis, short: Path) -> None:
    told = seen_as(knocked(found, once=True, noise_left=True), short, ends_s=(0.0, 99.9))
    rows = rows_of(told)
    assert told.exit_code == 1
    (group,) = told.groups
    assert {row.rsplit("/", 2)[1:][0] for row in group.rows} == {"ranging", "attitude"}
    for role in ("ranging", "attitude"):
        row = rows[role, "mounting"]
        assert row.one_of == 1
        assert row.measured is not None
        assert row.measured.value == pytest.approx(9e-3)
        assert (row.from_s, row.to_s) == (60.0, 99.9)
    assert rows["position", "noise"].status == "holds"


@pytest.mark.parametrize(("once", "noise_left"), [(False, True), (True, False)])
def test_what_comes_and_goes_or_leaves_more_than_noise_stays_a_word(
    found: Diagnosis, short: Path, once: bool, noise_left: bool
) -> None:
    told = knocked(found, once=once, noise_left=noise_left)
    assert once_changed(told) is told
    result = seen_as(told, short, ends_s=(0.0, 99.9))
    assert (result.verdict, result.groups) == ("not_shown", ())
    jump = replace(told.findings[0], effect="datum_offset", sensor="target", changed_once=True)
    wrong_fix = replace(knocked(found, once=True, noise_left=True), findings=(jump,))
    assert once_changed(wrong_fix) is wrong_fix
    assert "has no name" in rows_of(result)["ranging", "mounting"].evidence


def test_a_step_of_stamps_is_measured_by_its_size_not_by_its_moment(found: Diagnosis) -> None:
    """30 ms from 100 s on are 30 ms, not 100 s, in the row of the stamps' bound as well."""
    step = stepping(found)
    told = replace(found, findings=(step,), verdict="explained")
    one = row_of("position", "timing")
    row = by_log(one, LogEvidence(told, OnPaper(load(EXAMPLE), ()), one.stage))
    assert row.status == "broken"
    assert row.measured == MeasuredFigure(0.03, 0.029, 0.031)


def test_a_delay_that_a_step_makes_has_the_room_of_a_word_for_a_drift(found: Diagnosis) -> None:
    """Ranges that come ever later until they stay so: 30 ms by a step, the rest by a drift."""
    told = replace(found, findings=(stepping(found), drifting(found)), verdict="unexplained")
    one = row_of("position", "latency")
    row = by_log(one, LogEvidence(told, OnPaper(load(EXAMPLE), ()), one.stage))
    assert row.status == "broken"
    assert row.measured is not None
    assert row.measured.low == pytest.approx(0.029)
    assert row.measured.high == pytest.approx(0.031 + 4e-4 * found.log.duration_s)


def stepping(found: Diagnosis) -> Finding:
    """Stamps that are ahead by 29 to 31 ms from 100 s on."""
    part = found.findings[0].parameters["latency_s"]
    step = replace(part, value=0.03, interval95=(0.029, 0.031))
    moment = replace(part, value=100.0, interval95=None)
    return replace(found.findings[0], effect="timestamp_step", sensor="position", also=None,
                   parameters={"step_s": step, "time_s": moment}, kind="cause",
                   material=True, aliases=())  # fmt: skip


def drifting(found: Diagnosis) -> Finding:
    """What has no name, in the words of a clock that runs fast by 200 to 400 ppm."""
    part = found.findings[0].parameters["latency_s"]
    rate = replace(part, value=3e-4, unit="", interval95=(2e-4, 4e-4))
    return replace(found.findings[0], effect="clock_drift", sensor="position", also=None,
                   parameters={"rate": rate}, kind="stand_in", aliases=())  # fmt: skip


def test_a_delay_on_top_of_a_word_for_a_drift_has_the_room_of_both(found: Diagnosis) -> None:
    """12 ms stand out beside a drift of 0.2 to 0.4 ms a second, of which the log lasts so many."""
    one = row_of("position", "latency")
    word = drifting(found)
    told = replace(found, findings=(word,), verdict="unexplained")
    log = LogEvidence(told, OnPaper(load(EXAMPLE), ()), one.stage)
    said = Judgement("broken", "12 ms stand out", MeasuredFigure(0.012, 0.010, 0.014), 40.0, 90.0)
    row = beside_shapes(one, said, log, signed=True)
    lasts_s = found.log.duration_s
    assert row.measured is not None
    assert row.measured.low == pytest.approx(0.010)
    assert row.measured.high == pytest.approx(0.014 + 4e-4 * lasts_s)
    assert word.sentence in row.words
    largest_s = 0.012 + 3e-4 * lasts_s
    assert row.measured.value == pytest.approx(largest_s)
    assert row.words.endswith(f"in all up to {amount(largest_s, 's')}")
    later = replace(word, from_s=95.0, to_s=None)  # the 12 ms are over by then
    alone = beside_shapes(one, said, replace(log, found=replace(told, findings=(later,))),
                          signed=True)  # fmt: skip
    assert alone.measured is not None
    assert alone.measured.value == pytest.approx(0.012)
    other = row_of("ranging", "latency")
    assert beside_shapes(other, said, log, signed=True) is said
