"""Evidence of a clock that the spec does not name: its timelines are taken as common then."""

from __future__ import annotations

from dataclasses import replace

from syncline_design.clocks.study import TimingStudy
from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.by_clock import Resting, by_clock, narrowed_by, seen_s
from syncline_design.comparison.clock_meaning import on_clock
from syncline_design.comparison.judgement import Judgement
from syncline_design.model.figure_text import format_duration
from syncline_design.spec.case import Case
from syncline_design.verdict.pinned import as_measured
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import check_loaded

_ID = "measured_clock"


def by_unnamed_clock(
    case: Case, one: Assumed, vehicle: str, study: TimingStudy, seed: int
) -> Judgement:
    """The offset that the verdict takes as 0 is broken where the measured one turns the verdict.

    As of a clock that is named, a bound that no session reached is no proof.
    """
    bound_s = study.timing.bound_s
    if study.timing.doubts or bound_s is None:
        return by_clock(one, study, Resting.of(case))
    own = as_measured(case, seed)

    def checked(study: TimingStudy | None) -> Verdict:
        spec = own if study is None else on_clock(own, study, _ID, vehicle)
        return check_loaded(spec, CheckSettings(seed=seed))

    after = checked(study)
    least_s = min(seen_s(study.timing), bound_s)
    figure = MeasuredFigure(bound_s, least_s, bound_s)
    measured = format_duration(bound_s)
    lead = f"the spec names no clock of {vehicle}; its measured bound of {measured}"
    if _tau(checked(None)) == _tau(after):
        words = f"{lead} cancels: all sensors stand on this clock, or none"
        return Judgement("holds", words, figure)
    if after.verdict == "meets":
        rest = by_clock(replace(one, value=bound_s), study, Resting.of(case))
        words = f"{lead}, in place of 0 s, does not turn the verdict"
        if rest.status == "holds":
            return Judgement("holds", words, figure)
        return Judgement("not_shown", f"{words}: {rest.words}", figure)
    if checked(replace(study, timing=replace(study.timing, bound_s=least_s))).verdict == "meets":
        words = (
            f"would turn the verdict, but no session was as far off: {narrowed_by(study.timing)}"
        )
        return Judgement("not_shown", f"{lead} {words}", figure)
    failed = ", ".join(row.id for row in after.requirements if row.status == "fail")
    words = f"{lead}, in place of 0 s, fails {failed}: name the clock in the spec (timing --as)"
    return Judgement("broken", words, figure)


def _tau(verdict: Verdict) -> float | None:
    return None if verdict.syncline is None else verdict.syncline.tau_s
