"""Evidence of clock logs: a measured bound against the one that the spec assumes."""

from __future__ import annotations

from syncline_design.clocks.study import TimingStudy
from syncline_design.comparison.acceptance import MeasuredFigure, Status
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.judgement import Judgement
from syncline_design.model.quantity import format_duration


def by_clock(one: Assumed, study: TimingStudy) -> Judgement:
    """Holds only with a claim about future sessions; beyond the assumed bound it is broken."""
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
    status: Status = "holds" if found.claim.made else "not_shown"
    why = "" if found.claim.made else f", but no claim: {found.claim.why_not}"
    return Judgement(status, f"measured bound {measured} within the {asked} assumed{why}", figure)
