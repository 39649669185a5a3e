"""Timing errors that were measured: shown with their claim, cautioned where it is too weak."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from syncline_design.machine.input_files import FileRead
from syncline_design.model.figure_text import format_duration, percent, to_digits
from syncline_design.spec.case import Case
from syncline_design.spec.catalog import ClockEntry, TimestampingEntry
from syncline_design.spec.exact import tau_bound
from syncline_design.spec.measured import MeasuredClaim, changed_logs
from syncline_design.spec.timestamp_errors import TimestampError
from syncline_design.verdict.design_data import UsedEntry
from syncline_design.verdict.tree import Caution, ClaimShown, MeasuredEntry

# k = 2 is commonly said to be 95 % (it is 95.45 %), k = 3 to be 99.7 % (99.73 %): JCGM 100, G.1.3
COMMONLY = 1.12


def coverage_words(claimed: float, asked: float) -> str:
    """A bound that holds for less of the time than a spec takes it to."""
    return (
        f"for {percent(claimed, 4)} of the time, where the spec's coverage_factor "
        f"asks for "
        f"{percent(asked, 4)}"
    )


def coverage_of(case: Case) -> float:
    """Share of the time for which a spec takes its bounds to hold: P(|z| <= coverage_factor)."""
    return math.erf(float(case.spec.coverage_factor) / math.sqrt(2.0))


def measured(case: Case, entries: Sequence[UsedEntry]) -> tuple[MeasuredEntry, ...] | None:
    """The measured errors that a design rests on; None where there are none.

    One whose figures were changed since they were measured is none of them.
    """
    k = case.spec.coverage_factor
    found = tuple(
        MeasuredEntry(
            used.id, used.section, float(tau_bound(error, k)), _claim(error.claim),
            error.conditions or "", tuple(FileRead(one.file, one.sha256) for one in error.evidence),
            sum(event.count or 1 for event in error.events),
        )
        for used, error in _errors(entries) if not error.why_not_measured
    )  # fmt: skip
    return found or None


def _errors(entries: Sequence[UsedEntry]) -> Iterator[tuple[UsedEntry, TimestampError]]:
    for used in entries:
        error = None
        if isinstance(used.entry, TimestampingEntry):
            error = used.entry.error
        elif isinstance(used.entry, ClockEntry):
            error = used.entry.offset
        if error is not None and error.is_measured:
            yield used, error


def _claim(claim: MeasuredClaim | None) -> ClaimShown | None:
    if claim is None:
        return None
    return ClaimShown(
        float(claim.coverage),
        None if claim.session_share is None else float(claim.session_share),
        None if claim.confidence is None else float(claim.confidence),
        claim.sessions, claim.session_s, claim.rests_on,
    )  # fmt: skip


def claim_words(claim: ClaimShown | None) -> str:
    """`95 % of the time in 95 % of sessions at 95 % confidence, from 7 sessions`."""
    if claim is None:
        return "no claim"
    text = f"{percent(claim.coverage, 4)} of the time"
    if claim.session_share is not None:
        text += f" in {percent(claim.session_share, 4)} of sessions"
    if claim.session_s is not None:
        text += f" of {format_duration(claim.session_s)}"
    if claim.confidence is not None:
        text += f" at {percent(claim.confidence, 4)} confidence"
    if claim.sessions is not None:
        text += f", from {claim.sessions} session{'s' if claim.sessions > 1 else ''}"
    return text


def claim_cautions(case: Case, entries: Sequence[UsedEntry]) -> Iterator[Caution]:
    """What a verdict takes from a measurement beyond what that claims."""
    for used, error in _errors(entries):
        key = "error" if used.section == "timestamping" else "offset"
        if why := error.why_not_measured:
            yield Caution("measured-altered", f"{used.id} is NOT taken as measured: {why}",
                          entry=used.id, key=key)  # fmt: skip
            continue
        if error.seal == "none":
            message = f"{used.id} says that it was measured, but carries no digest of its figures: "
            yield Caution("measured-unchecked", f"{message}whether they are those of its logs "
                          "cannot be checked (timing --as writes one)",
                          entry=used.id, key=key)  # fmt: skip
        yield from _changed_logs(case, used, error, key)
        yield from _of_entry(case, used, error.claim, key)
        yield from _of_its_logs(used, error, key)


def _of_its_logs(used: UsedEntry, error: TimestampError, key: str) -> Iterator[Caution]:
    """What `timing` said of the logs: events beyond the bound, and what it was reserved about."""
    bound, most = error.bound, error.event_bound
    if bound is not None and most is not None and most > bound:
        message = (
            f"{used.id}: its logs show up to {format_duration(float(most))}, or cannot exclude it, "
            "in slow starts, steps and without lock, beyond the bound of "
            f"{format_duration(float(bound))} that is taken"
        )
        yield Caution("measured-events", message, entry=used.id, key=key)
    for said in () if error.claim is None else error.claim.reservations:
        yield Caution("measured-reserved", f"{used.id}: {said}", entry=used.id, key=key)


def _changed_logs(
    case: Case, used: UsedEntry, error: TimestampError, key: str
) -> Iterator[Caution]:  # fmt: skip
    """Logs beside the catalog that are not any more what was measured from."""
    folder = _folder_of(case, used)
    changed = [] if folder is None else list(changed_logs(error, folder))
    if changed:
        yield Caution("measured-evidence", f"{used.id}: {', '.join(changed[:3])} beside its "
                      "catalog changed since it was measured: its figures are not of what "
                      "stands there now", entry=used.id, key=key)  # fmt: skip


def _folder_of(case: Case, used: UsedEntry) -> Path | None:
    """Where the catalog lies that an entry stands in; None of a shipped one, or one in place."""
    found: Iterator[tuple[str, str]] = (
        (one.id, one.origin)
        for stage in case.stages
        for one in (
            stage.clocks if used.section == "clocks"
            else [method for role in stage.roles for method in role.methods]
        )
    )  # fmt: skip
    origin = next((origin for name, origin in found if name == used.id), "")
    path = Path(origin.rsplit(":", 2)[0])
    return path.parent if origin and path.is_file() else None


def _of_entry(
    case: Case, used: UsedEntry, claim: MeasuredClaim | None, key: str
) -> Iterator[Caution]:  # fmt: skip
    if claim is None or claim.made is False:
        message = f"{used.id} was measured, but carries no claim about future sessions"
        yield Caution("measured-claim", message, entry=used.id, key=key)
        return
    asked_share = coverage_of(case)
    if 1.0 - float(claim.coverage) > COMMONLY * (1.0 - asked_share):
        yield Caution(
            "measured-claim",
            f"{used.id}: its bound was measured to hold "
            f"{coverage_words(float(claim.coverage), asked_share)}: measure with "
            f"`timing --coverage {to_digits(asked_share, 4)}`",
            entry=used.id, key=key,
        )  # fmt: skip
    session_s, asked = claim.session_s, float(case.spec.horizon.duration)
    if session_s is not None and asked > session_s * 1.001:
        yield Caution(
            "measured-horizon",
            f"{used.id}: measured over sessions of {format_duration(session_s)}, the horizon is "
            f"{format_duration(asked)}: what drifts may grow beyond the bound",
            entry=used.id, key=key,
        )  # fmt: skip
    if claim.rests_on in ("servo", "unknown"):
        yield Caution(
            "measured-servo",
            f"{used.id}: {_RESTS[claim.rests_on]}; a constant asymmetry of the path would not show",
            entry=used.id, key=key,
        )  # fmt: skip


_RESTS = {
    "servo": "rests on the offsets of the servo itself, which nulls what it measures",
    "unknown": "the logs do not say whether the clock is steered by these offsets",
}
