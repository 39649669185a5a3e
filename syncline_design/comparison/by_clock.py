"""Evidence of clock logs: a measured bound against the one that the spec assumes."""

from __future__ import annotations

from typing import Final

from syncline_design.clocks.result import Timing
from syncline_design.clocks.sessions import DISTURBANCES
from syncline_design.clocks.study import TimingStudy
from syncline_design.comparison.acceptance import AssumptionStatus, MeasuredFigure
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.free_run import no_free_run
from syncline_design.comparison.judgement import Judgement
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import format_duration, percent, to_digits
from syncline_design.spec.case import Case
from syncline_design.verdict.measured import COMMONLY, coverage_of, coverage_words

LONGER: Final = 1.001  # than the sessions: a horizon that they do not show


_ALONE: Final = {
    "servo": ", but by the servo's own offsets, which hide a constant error of the path",
    "unknown": ", but these offsets may be what steers the clock, and then do not show it to be "
    "off; if they are not, --independent says so",
}


@dataclass(frozen=True, slots=True)
class Resting:
    """What a spec rests its clocks' bounds on: for which share of the time, and for how long."""

    coverage: float
    horizon_s: float

    @classmethod
    def of(cls, case: Case) -> Resting:
        """Of one spec."""
        return cls(coverage_of(case), float(case.spec.horizon.duration))


def by_clock(one: Assumed, study: TimingStudy, resting: Resting) -> Judgement:
    """Holds only with a claim about future sessions; broken by a session beyond the bound."""
    found = study.timing
    if found.doubts:
        return Judgement("not_shown", f"the clock logs are in doubt: {found.doubts[0]}")
    seen = seen_s(found)
    if one.value is not None and seen > one.value:
        return _beyond(one.value, seen, found)
    if found.bound_s is None or one.value is None:
        return Judgement("not_shown", f"the clock logs bound nothing: {found.claim.why_not}")
    figure = MeasuredFigure(found.bound_s, min(seen, found.bound_s), found.bound_s)
    asked, measured = format_duration(one.value), format_duration(found.bound_s)
    if found.bound_s > one.value:
        said = f"measured bound {measured}, more than the {asked} assumed, but no session was "
        return Judgement("not_shown", f"{said}{_not_beyond(one.value, found)}", figure)
    why = _why_not(one.value, found, resting) or _of_what(one, found)
    if not why and one.holdover_s is not None:
        why = no_free_run(one.holdover_s, found)
    status: AssumptionStatus = "not_shown" if why else "holds"
    lead = f"measured bound {measured} within the {asked} assumed"
    return Judgement(status, lead + (why or _rests_on(found)), figure)


def _beyond(assumed_s: float, seen: float, found: Timing) -> Judgement:
    """A session that was beyond what is assumed: by how much, and up to where others may be.

    A bound over few sessions of which one is unlike the others says how little is known of the next
    one (a hundred times as much as any was), not how far the clock is off.
    """
    times = f", {to_digits(seen / assumed_s, 3)} times" if assumed_s else ", more than"
    said = (
        f"a session was {format_duration(seen)} off{times} the {format_duration(assumed_s)} assumed"
    )
    most = max(seen, found.bound_s or 0.0)
    if most > seen:
        said += f"; measured bound of all sessions {format_duration(most)}"
    return Judgement("broken", said, MeasuredFigure(seen, seen, most))


def seen_s(found: Timing) -> float:
    """What these logs themselves show the clock to be off by: the worst session.

    The daemon's own bound is none of it: half a round trip is how far the clock may be off, not
    how far it is.
    """
    return max((s.quantile_s or 0.0 for s in found.sessions if s.counted), default=0.0)


def _not_beyond(bound_s: float, found: Timing) -> str:
    """Of logs with a bound beyond the assumed one, and no session that was: what would do."""
    disturbed = [e for e in found.events if e.kind in DISTURBANCES and e.size_s > bound_s]
    if not disturbed:
        return f"beyond that: {narrowed_by(found)}"
    worst = max(disturbed, key=lambda event: event.size_s)
    share, kind = percent(found.claim.coverage, 3), worst.kind.replace("_", " ")
    return (f"beyond that for {share} of its time; a {kind} at {worst.from_} was, with "
            f"{format_duration(worst.size_s)}: see what made it")  # fmt: skip


def narrowed_by(found: Timing) -> str:
    """What would make a bound less that no session reached."""
    if found.reservations:
        return f"{found.reservations[0]}; more sessions would not narrow the bound"
    if found.bound_s != found.hard_bound_s:
        return "more sessions would narrow the bound"
    return ("it is the daemon's own, of the delays and dispersions of the path; a shorter path, or "
            "a measurement that does not take it (a pulse), would narrow it")  # fmt: skip


def _why_not(bound_s: float, found: Timing, resting: Resting) -> str:
    """Why a bound within the assumed one does not bear it out; "" where it does."""
    claim = found.claim
    if not claim.made:
        return f", but no claim: {claim.why_not}"
    if found.event_bound_s is not None and found.event_bound_s > bound_s:
        most = format_duration(found.event_bound_s)
        return f", but {most} with the starts, steps, unlocks and holdover in these logs"
    if found.reservations:
        return f", but {found.reservations[0]}"
    if 1.0 - claim.coverage > COMMONLY * (1.0 - resting.coverage):
        return f", but {coverage_words(claim.coverage, resting.coverage)}"
    if claim.session_s is not None and resting.horizon_s > LONGER * claim.session_s:
        lasts, asked = format_duration(claim.session_s), format_duration(resting.horizon_s)
        return f", but in sessions of {lasts}, where the spec's horizon is {asked}"
    if claim.rests_on in _ALONE and found.hard_bound_s is None:
        return _ALONE[claim.rests_on]
    if not found.source.whole_way:
        return (f", but by {found.source.name} alone: nothing in these logs bounds the rest of the "
                "way to the reference (a card's own error, the delay of a pulse that steers)"
                )  # fmt: skip
    return ""


def _of_what(one: Assumed, found: Timing) -> str:
    """Why what bounds a card does not bear out the host's clock; "" where it is that one."""
    if one.name != "clock" or found.source.of_host:
        return ""
    return (f", but {found.source.name} tells of a card's clock, or does not say of which: nothing "
            "in these logs says how far the host's is from it (phc2sys does)")  # fmt: skip


def _rests_on(found: Timing) -> str:
    """What a bound that holds still takes on trust."""
    if found.claim.rests_on == "unknown":
        return ", if these offsets are not what steers the clock"
    return ""
