"""What a verdict says in words: outcome, one-sentence design, margins, reasons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from syncline_design.machine.sentences import sentence_list
from syncline_design.report import numbers
from syncline_design.report.document import Inline, Items, Node, Outcome, code, given, pins
from syncline_design.report.text import visible
from syncline_design.report.words import (
    AXES,
    KINDS,
    OBJECTIVES,
    OUTCOMES,
    PRIMITIVES,
    QUALIFYING,
    SINCE,
    STATUSES,
    TERMS,
)
from syncline_design.verdict.obstacle import obstacle_sentence
from syncline_design.verdict.tree import waived_misses

JUDGED_ON: Final = "Waivers judged on"
LOOKED_OVER: Final = 8  # requirements that a reader takes in at a glance
MANY_TIMES: Final = 11.0  # a limit that is missed by more is told so, not by per cent
NAMED: Final = 6  # of those that fail, by name

if TYPE_CHECKING:
    from syncline_design.verdict.named import NamedRole
    from syncline_design.verdict.optimization import Optimization
    from syncline_design.verdict.since import Baseline, Earlier, RequirementSince
    from syncline_design.verdict.syncline_figures import LedgerRow
    from syncline_design.verdict.tree import (
        Caution,
        Checked,
        Provenance,
        RequirementResult,
        Status,
        Verdict,
        Word,
    )


SEEN_SHARE = 0.001  # of the total: smaller terms have no row
OF_FIGURES: Final = ("assumption", "transcript")  # warnings that name figures of an entry


def larger(entries: Sequence[LedgerRow]) -> list[LedgerRow]:
    """The terms that are not too small to be seen; all of them where nothing is."""
    return [e for e in entries if abs(e.share) >= SEEN_SHARE] or list(entries)


def outcome(verdict: Checked) -> Outcome:
    """The verdict's outcome.

    A design that meets while a larger figure of its own does not, or while a miss is waived, says
    so in the same breath, and so does a miss whose waiver is over.
    """
    found = OUTCOMES[verdict.verdict]
    if verdict.verdict == "refused":
        return found
    found = with_waived(found, waived_of(verdict.verdict, verdict.requirements))
    more = qualification(verdict) + _expired(verdict.requirements)
    return replace(found, word=found.word + more)


def _expired(rows: Sequence[RequirementResult]) -> str:
    """Whose waiver is over, of what is missed; nothing where there is none."""
    over = [row for row in rows if row.status == "fail" and row.waiver and row.waiver.expired]
    return expired_text([row.id for row in over])


def expired_text(ids: Sequence[str]) -> str:
    """`, waiver of R8 expired`; nothing where there is none."""
    names = sentence_list([visible(one) for one in ids])
    return f", {'waiver' if len(ids) == 1 else 'waivers'} of {names} expired" if ids else ""


def waived_of(word: Word, rows: Sequence[RequirementResult]) -> tuple[str, ...]:
    """Ids of what a design misses that meets all the same."""
    return waived_misses(rows) if word == "meets" else ()


def with_waived(found: Outcome, ids: Sequence[str]) -> Outcome:
    """An outcome in which missed requirements are waived: it says so, and is not a clean one."""
    if not ids:
        return found
    names = sentence_list([visible(one) for one in ids])
    return replace(STATUSES["waived"], word=f"{found.word}, {names} waived")


def qualification(verdict: Verdict | Optimization) -> str:
    """What a headline adds to `meets`: warnings that a figure exceeds the limit; else nothing."""
    if verdict.verdict != "meets":
        return ""
    told = [
        f"{figure} exceeds the limit of {visible(entry.requirement or 'accuracy')} ({code})"
        for code, figure in QUALIFYING.items()
        for entry in verdict.warnings
        if entry.code == code
    ]
    return f", but {sentence_list(told)}" if told else ""


def warning_nodes(cautions: Sequence[Caution]) -> list[Node]:
    """Warnings as a list: the sentence, then the code to filter by."""
    entries: tuple[Inline, ...] = tuple(
        (given(message), " (", code(kind), ")") for kind, message in _once(cautions)
    )
    return [Items(entries, "!", "warn")] if entries else []


def _once(cautions: Sequence[Caution]) -> list[tuple[str, str]]:
    """Codes and messages; of those that say the same figures of several entries, one for all."""
    named: dict[tuple[str, str], list[str]] = {}
    for one in cautions:
        said, tail = one.message, f" of {one.entry}"
        if one.code in OF_FIGURES and said.endswith(tail):
            named.setdefault((one.code, said.removesuffix(tail)), []).append(str(one.entry))
        else:
            named.setdefault((one.code, said), [])
    return [
        (kind, f"{said} of {sentence_list(entries)}" if entries else said)
        for (kind, said), entries in named.items()
    ]


def status_of(row: RequirementResult) -> Outcome:
    """A requirement's outcome; a failing one with a waiver in force is waived."""
    return status_word(row.status, waived=row.is_waived)


def status_word(status: Status, *, waived: bool) -> Outcome:
    """The outcome of a requirement, by whether a waiver in force covers it."""
    return STATUSES["waived" if waived and status == "fail" else status]


def status_id(row: RequirementResult) -> str:
    """A requirement's status for tables and test reports: a miss that is waived is no `fail`."""
    return "waived" if waived_misses([row]) else row.status


def since_word(one: RequirementSince, verdict: Verdict) -> Outcome:
    """What became of a requirement; of one that no design is there to judge, that it is not."""
    row = row_now(one, verdict)
    word, since = None if row is None else status_of(row), SINCE[one.change]
    if one.judged is False and word is not None:
        return replace(word, word="not judged")
    if one.change == "worse" and word is STATUSES["waived"]:
        return replace(since, tone=word.tone, word=f"{since.word}, {word.word}")
    if one.was is not None and one.was.kind is not None:
        return replace(since, word=f"{since.word}: limited {quantity_then(one.was)} then")
    return since


def of_mission(mission: str | None, requirement: str) -> str:
    """`high ACC-1`: a requirement by its id, after the mission whose it is, if it is one's."""
    return f"{mission} {requirement}" if mission else requirement


def row_now(one: RequirementSince, verdict: Verdict) -> RequirementResult | None:
    """A requirement as it stands now: of its mission, or of all together; None where it is gone."""
    rows = verdict.requirements
    if one.mission is not None:
        own = [m.requirements for m in verdict.missions or () if m.name == one.mission]
        rows = own[0] if own else ()
    return next((row for row in rows if row.id == one.id), None)


def quantity_then(was: Earlier) -> str:
    """What a requirement limited in the baseline; nothing where it is what it limits now."""
    return "" if was.kind is None else kind_words(was.kind, was.quantile, was.axis)


def waiver_text(row: RequirementResult, mission: str | None = None) -> str:
    """`waived until 2027-01-31: reason`, or why it does not count; in a mission where it is of one:
    another may need it."""
    waiver = row.waiver
    if waiver is None:
        return ""
    if row.status == "pass":
        where = "" if mission is None else " in this mission"
        return f"its waiver (until {waiver.expires}: {waiver.reason}) is not needed{where}"
    state = "waiver expired on" if waiver.expired else "waived until"
    return f"{state} {waiver.expires}: {waiver.reason}"


def since_sentence(baseline: Baseline, verdict: Verdict) -> str:
    """What counts against a baseline, and what that makes of the exit code."""
    file = visible(baseline.file)
    if baseline.verdict is None:
        return f"{file} holds no verdict on this spec: it is judged as it is."
    waived = [one.id for one in baseline.requirements
              if one.was and one.was.waived and one.mission is None]  # fmt: skip
    then = with_waived(OUTCOMES[baseline.verdict], waived if baseline.verdict == "meets" else ())
    was = f"Then ({file}): {then.word}."
    if baseline.worse:
        return f"{was} Since then it got worse."
    waived_now = worse_but_waived(verdict)
    if verdict.verdict == "meets":
        but = f" Since then {sentence_list(waived_now)} got worse, waived." if waived_now else ""
        return was + but
    but = f" but what is waived ({sentence_list(waived_now)})" if waived_now else ""
    return f"{was} Since then nothing got worse{but}: the exit code is 0."


def worse_but_waived(verdict: Verdict) -> list[str]:
    """Ids of what got worse since the baseline and does not count, by a waiver in force."""
    since = verdict.baseline.requirements if verdict.baseline else ()
    worse = {(one.mission, one.id) for one in since if one.change == "worse"}
    found = [of_mission(mission, row.id) for mission, row in verdict.judged_rows
             if row.status == "fail" and row.is_waived and (mission, row.id) in worse]  # fmt: skip
    return list(map(visible, found))


def kind_text(row: RequirementResult) -> str:
    """What a requirement limits."""
    return kind_words(row.kind, row.quantile, row.axis)


def kind_words(kind: str, quantile: float | None = None, axis: str | None = None) -> str:
    """What a kind of requirement limits."""
    if kind == "monte_carlo" and quantile is not None:
        return f"simulated error, {numbers.percent(quantile)} quantile"
    if kind in ("thu", "tvu", "quantile") and quantile is not None:
        error = {"thu": "horizontal", "tvu": "vertical"}.get(kind, axis or "3d")
        return f"{numbers.percent(quantile)} of {AXES[error]} errors"
    if kind == "rmse":
        return f"RMS of {AXES[axis or '3d']} errors"
    return KINDS.get(kind, kind)


def relative_margin(row: RequirementResult) -> float | None:
    """(limit - value) / limit: what is left of the limit; None where it cannot be said."""
    value, limit = row.value, row.limit
    return None if value is None or not limit else (limit - value) / limit


def margin_text(row: RequirementResult) -> str:
    """`12.4 % to spare` or `8.1 % over`; far beyond a limit `17 600 times the limit`."""
    margin = relative_margin(row)
    if margin is None:
        return numbers.MISSING
    if margin == 0.0:
        return "exactly at the limit"
    if 1.0 - margin >= MANY_TIMES:
        return f"{numbers.times(1.0 - margin)} the limit"
    word = "to spare" if margin > 0 else "over"
    return f"{numbers.percent(abs(margin))} {word}"


def failing_text(rows: Sequence[RequirementResult]) -> str:
    """`10 of 60: R5, R8 and 8 more`, where the table is too long to be looked over; else ""."""
    names = [row.id for row in rows if row.status == "fail"]
    if not names or len(rows) <= LOOKED_OVER:
        return ""
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return f"{len(names)} of {len(rows)}: {', '.join(names[:NAMED])}{more}"


def tightest(rows: Sequence[RequirementResult]) -> RequirementResult | None:
    """The requirement with the least relative margin; a waived one where there is no other."""
    known = [(row.is_waived, margin, k) for k, row in enumerate(rows)
             if (margin := relative_margin(row)) is not None]  # fmt: skip
    return rows[min(known)[2]] if known else None


def term_text(entry: LedgerRow) -> str:
    """A ledger term in words with its symbol; a known effect as it stands."""
    return TERMS.get(entry.term, entry.term)


def role_phrase(entry: NamedRole) -> str:
    """`SBG Apogee (1PPS input, timer capture)`."""
    primitive = PRIMITIVES.get(entry.primitive, entry.primitive)
    return f"{entry.name} ({primitive}, {entry.timestamping_name})"


def design_sentence(verdict: Checked) -> str:
    """The design in one sentence; without one, what stands in the way."""
    if verdict.verdict == "refused":
        plural = "problem" if len(verdict.problems) == 1 else "problems"
        return f"{len(verdict.problems)} {plural} in the file; nothing was computed."
    if verdict.design is None:
        return obstacle_sentence(verdict.infeasibility)
    stages = verdict.design.stages
    phrases = []
    for stage in stages:
        roles = [role_phrase(entry) for entry in stage.roles.values()]
        where = f" on {stage.name}" if len(stages) > 1 else ""
        phrases.append(sentence_list(roles) + where)
    platforms = sentence_list([stage.platform.name for stage in verdict.spec.stages])
    lead = "Chosen payload" if verdict.spec.open_roles else "Payload as pinned"
    return f"{lead} for {platforms}: {'; '.join(phrases)}."


def selection_reason(verdict: Verdict, stage: str, role: str) -> str:
    """Why this option stands in the design: pinned, or chosen among how many."""
    if f"{stage}.{role}" not in verdict.spec.open_roles:
        return "pinned in the spec"
    word = OBJECTIVES[verdict.spec.objective]
    choice = verdict.choice
    listed = () if choice is None else choice.excluded or ()
    count = sum((entry.stage, entry.role) == (stage, role) for entry in listed)
    if not count:
        return f"chosen for {word} of the whole design"
    plural = "option" if count == 1 else "options"
    return f"chosen for {word} of the whole design; {count} {plural} ruled out before"


def pinned_by(found: Provenance) -> list[tuple[str, str]]:
    """What a verdict's figures are pinned by, for the last lines of a report."""
    return [
        *pins(found.version, found.spec_sha256, found.catalogs_sha256, found.seed),
        ("Python", found.python),
        ("NumPy", found.numpy),
        *([(JUDGED_ON, found.judged_on)] if found.judged_on else []),
    ]
