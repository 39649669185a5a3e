"""What a verdict says of waivers: one is made use of, one is not needed, one is over."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from syncline_design.spec.case import Case
from syncline_design.spec.requirement import JUDGED_KINDS
from syncline_design.verdict.tree import Caution, RequirementResult

_SAME = "front and other designs are held to what it reaches"
NEAREST = f"no design that keeps the others is nearer to it; {_SAME}"
NEAREST_FOUND = f"the nearest to it that was found among those that keep the others; {_SAME}"
NOT_NEEDED = "it is met, so the waiver is not needed"


def waiver_cautions(case: Case, rows: Sequence[RequirementResult]) -> Iterator[Caution]:
    """Every waiver of a spec, in force or not."""
    for row in rows:
        if row.waiver is None:
            continue
        state = "expired on" if row.waiver.expired else "in force until"
        text = f"{row.id}: waiver {state} {row.waiver.expires}: {row.waiver.reason}"
        told = _told(case, row)
        yield Caution("waiver", f"{text}; {told}" if told else text, requirement=row.id)


def _told(case: Case, row: RequirementResult) -> str:
    """What the waiver does for this design."""
    if row.status == "pass":
        return NOT_NEEDED
    if row.status == "fail" and row.is_waived and case.eased.get(row.id) is not None:
        return NEAREST_FOUND if row.kind in JUDGED_KINDS else NEAREST
    return ""
