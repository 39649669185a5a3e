"""One piece of evidence on one assumption, and several of them together."""

from __future__ import annotations

from collections.abc import Sequence

from syncline_design.comparison.acceptance import (
    AssumptionResult,
    AssumptionStatus,
    MeasuredFigure,
    worst,
)
from syncline_design.comparison.assumptions import Assumed
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Case


@dataclass(frozen=True, slots=True)
class Judgement:
    """What one piece of evidence says: the status, in words why, and the figure if it has one.

    from_s, to_s: the stretch that it is about; least_stretch_s: the shortest that it speaks about.
    in_doubt: which of what the log shows in several ways it may be, by their order.
    """

    status: AssumptionStatus
    words: str
    measured: MeasuredFigure | None = None
    from_s: float | None = None
    to_s: float | None = None
    least_stretch_s: float | None = None
    in_doubt: tuple[int, ...] = ()


NO_EVIDENCE = Judgement("not_shown", "none of these logs tells of it")
OF_PLACES = Judgement("not_shown", "a log of places alone does not show a bound of stamps")


def together(case: Case, one: Assumed, said: Sequence[Judgement]) -> AssumptionResult:
    """A row: what breaks it decides, else what shows it, else that nothing does."""
    statuses = [each.status for each in said]
    status = "holds" if "holds" in statuses and "broken" not in statuses else worst(statuses)
    telling = [each for each in said if each.status == status] or [NO_EVIDENCE]
    telling = [each for each in telling if each != OF_PLACES] or telling  # where it is not alone
    line, column = case.position(one.key)
    place = next((each for each in telling if each.from_s is not None), telling[0])
    return AssumptionResult(
        one.stage, one.role, one.name, one.value,
        next((each.measured for each in telling if each.measured is not None), None),
        one.unit, status, "; ".join(each.words for each in telling), line, column,
        place.from_s, place.to_s, place.least_stretch_s,
    )  # fmt: skip
