"""Rows of `accept` where a diagnosis has but a word for what is so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.assumptions import Assumed, assumptions
from syncline_design.comparison.by_log import by_log
from syncline_design.comparison.judgement import Judgement
from syncline_design.comparison.log_evidence import LogEvidence
from syncline_design.comparison.on_paper import OnPaper
from syncline_design.comparison.shapes import beside_shapes, once_changed
from syncline_design.diagnosis.built import Sighted
from syncline_design.diagnosis.noise_split import NoiseFactor, NoiseFactors
from syncline_design.diagnosis.result import Diagnosis, Finding
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
    assert row.words.endswith(word.sentence)
    other = row_of("ranging", "latency")
    assert beside_shapes(other, said, log, signed=True) is said
