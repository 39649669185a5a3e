"""Evidence of clock logs: a measured bound against the one that the spec assumes."""

from __future__ import annotations

from syncline_design.clocks.result import Timing
from syncline_design.clocks.study import TimingStudy
from syncline_design.comparison.acceptance import MeasuredFigure, Status
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.judgement import Judgement
from syncline_design.model.quantity import format_duration
from syncline_design.verdict.measured import COMMONLY


def by_clock(one: Assumed, study: TimingStudy, coverage: float) -> Judgement:
    """Holds only with a claim about future sessions; beyond the assumed bound it is broken.

    coverage: share of the time for which the spec takes its bounds to hold.
    """
    found = study.timing
    if found.doubts:
        return Judgement("not_shown", f"the clock logs are in doubt: {found.doubts[0]}")
    if found.bound_s is None or one.value is None:
        return Judgement("not_shown", f"the clock logs bound nothing: {found.claim.why_not}")
    figure = MeasuredFigure(found.bound_s)
    asked, measured = format_duration(one.value), format_duration(found.bound_s)
    if found.bound_s > one.value:
        times = f"{found.bound_s / one.value:.3g} times" if one.value else "not"
        said = f"measured bound {measured}, {times} the {asked} assumed"
        return Judgement("broken", said, figure)
    why = _why_not(one.value, found, coverage)
    status: Status = "not_shown" if why else "holds"
    return Judgement(status, f"measured bound {measured} within the {asked} assumed{why}", figure)


def _why_not(bound_s: float, found: Timing, coverage: float) -> str:
    """Why a bound within the assumed one does not bear it out; "" where it does."""
    if not found.claim.made:
        return f", but no claim: {found.claim.why_not}"
    if found.event_bound_s is not None and found.event_bound_s > bound_s:
        most = format_duration(found.event_bound_s)
        return f", but {most} with the steps, unlocks and holdover in these logs"
    if 1.0 - found.claim.coverage > COMMONLY * (1.0 - coverage):
        return (f", but for {100.0 * found.claim.coverage:.4g} % of the time, where the spec's "
                f"coverage_factor asks for {100.0 * coverage:.4g} %")  # fmt: skip
    return ""
