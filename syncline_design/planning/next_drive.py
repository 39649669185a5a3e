"""The short plan at the end of a diagnosis whose log left a finding with aliases."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from typing import Final

from syncline_design.diagnosis.result import Diagnosis, Finding, NextDrive, Rival
from syncline_design.effects import registry
from syncline_design.machine.deadline import NoVerdict
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import format_duration, to_places
from syncline_design.planning.effort import Effort
from syncline_design.planning.from_diagnosis import moves, sizes_of
from syncline_design.planning.run import LONGEST_S, plan
from syncline_design.planning.setup import SECONDS, PlanRequest
from syncline_design.planning.telling import PlanRun
from syncline_design.planning.wanted import (
    EffectPair,
    NamedEffect,
    PlanError,
    PlanWanted,
    separate_of,
    sized_text,
)
from syncline_design.spec.case import Case
from syncline_design.spec.load import BadInput

MOST_JUDGED: Final = 8000  # drives that a diagnosis looks at: some 20 s of a processor
MOST_A_PLAN: Final = 4000  # of these for one plan
MOST_TRIED: Final = 3


def next_drive(case: Case, found: Diagnosis) -> NextDrive | None:
    """The drive that tells the strongest finding from all that this log left in its place.

    case: pinned.  None where no finding is a class that a drive could tell.  Where none could be
    planned, the reason and the command that looks for it: a diagnosis never fails for want of a
    plan, and never ends without a word on it.
    """
    classes = list(_classes(found, len(case.stages) > 1))[:MOST_TRIED]
    untold: list[AliasClass] = []
    who, now = "This log" if found.joint is None else "These logs", None
    looked = _Looked(Effort(MOST_JUDGED))
    try:
        for now in classes:
            drive = _told(case, now, looked)
            if drive is not None:
                return drive
            untold.append(now)
    except NoVerdict:
        return _none(case, now, _TOO_LATE.replace("{who}", who)) if now else None
    except (BadInput, PlanError) as error:
        return _none(case, now, f"No test drive could be planned, {error}") if now else None
    if not untold:
        return None
    words = _untold_words(untold, looked)
    return _none(case, untold[0], words, untold[0].rivals, looked.alike_of(untold[0]))


@dataclass(frozen=True, slots=True)
class _Looked:
    """What a diagnosis has looked at: how much, and which pairs no drive can tell apart."""

    effort: Effort
    alike: list[str] = field(default_factory=list)

    def alike_of(self, one: AliasClass) -> tuple[str, ...]:
        """The rivals that are one with a finding on every leg."""
        return tuple(r.text for r in one.rivals if f"{one.first.text} and {r.text}" in self.alike)


@dataclass(frozen=True, slots=True)
class AliasClass:
    """A finding with its size, and what this log left in its place, the commonest first."""

    first: NamedEffect
    sizes: Mapping[str, float]
    rivals: tuple[NamedEffect, ...]

    @property
    def second(self) -> str:
        return ", ".join(one.text for one in self.rivals)

    @property
    def pairs(self) -> tuple[EffectPair, ...]:
        """As the command that is printed has them."""
        return separate_of(sized_text(self.first, self.sizes), self.second)

    def only(self, rivals: Sequence[NamedEffect]) -> AliasClass:
        """The same with some of the rivals."""
        return replace(self, rivals=tuple(rivals))


def _told(case: Case, one: AliasClass, looked: _Looked) -> NextDrive | None:
    """The drive that tells a finding from all of its class that some drive tells it from.

    Where none does in the minutes and with the effort of a diagnosis, the one that tells it from
    the commonest that can be told.  What would take longer than `LONGEST_S` is no drive.
    """
    lost: list[NamedEffect] = []
    for rival in one.rivals[:MOST_TRIED]:
        commonest = one.only([rival])
        run = _planned(case, commonest, looked)
        least = run.result.least_minutes
        if least is not None and SECONDS * least <= LONGEST_S:
            rest = one.only([r for r in one.rivals if r not in lost])
            return _whole(case, rest, lost, looked) or _short(case, run, commonest, lost, looked)
        lost.append(rival)
    return None


def _whole(
    case: Case, one: AliasClass, lost: Sequence[NamedEffect], looked: _Looked
) -> NextDrive | None:
    """The drive that tells a finding from several at once; None where none is found."""
    if len(one.rivals) < 2:
        return None
    try:
        run = _planned(case, one, looked)
    except NoVerdict:
        return None
    more = [r for r in one.rivals if f"{one.first.text} and {r.text}" in run.result.inseparable]
    kept = one.only([r for r in one.rivals if r not in more])
    if not run.result.reached or not kept.rivals:
        return None
    return _short(case, run, kept, [*lost, *more], looked)


def _planned(case: Case, one: AliasClass, looked: _Looked) -> PlanRun:
    """The drive alone: nothing is said here of the field's line plans.

    NoVerdict where the search ended before it came to one: none is known to be missing then.
    """
    own = looked.effort.part(MOST_A_PLAN)
    run = plan(case, PlanRequest(PlanWanted((), one.pairs), line_plans=False, effort=own))
    looked.effort.add(own)
    looked.alike.extend(run.result.alike or ())
    return run


_TOO_LATE: Final = (
    "{who} cannot tell {first} from {second}. No drive that does was found among those that a "
    "diagnosis looks at; this looks on"
)


def _untold_words(untold: Sequence[AliasClass], looked: _Looked) -> str:
    """That none can, where legs show none a difference; else that none was found."""
    pairs = [(one.first.text, r.text) for one in untold for r in one.rivals]
    alike = [pair for pair in pairs if " and ".join(pair) in looked.alike]
    others = [pair for pair in pairs if pair not in alike]
    words = []
    if alike:
        words.append(
            f"No drive of this platform can tell {_from_words(alike)}: on every leg that it can "
            "drive they make the same error"
        )
    if others:
        most = format_duration(LONGEST_S)
        words.append(
            f"No test drive of this platform of up to {most} was found that tells "
            f"{_from_words(others)}, at the size that was found"
        )
    return f"{'. '.join(words)}. What one shows"


def _from_words(pairs: Sequence[tuple[str, str]]) -> str:
    return "; ".join(f"{one} from {other}" for one, other in pairs)


def _none(
    case: Case,
    one: AliasClass,
    why: str,
    inseparable: Sequence[NamedEffect] = (),
    alike: Sequence[str] = (),
) -> NextDrive:
    """No drive, and the command that looks for it."""
    return NextDrive(
        first=one.first.text,
        second=one.rivals[0].text,
        minutes=None,
        least_minutes=None,
        reached=False,
        legs=(),
        targets=0,
        command=shlex.join(_command(case, one)),
        why_none=why.replace("{first}", one.first.text).replace("{second}", one.second),
        others=tuple(r.text for r in one.rivals[1:]) or None,
        inseparable=tuple(r.text for r in inseparable) or None,
        alike=tuple(alike) or None,
    )


def _command(case: Case, one: AliasClass) -> list[str]:
    first = sized_text(one.first, one.sizes)
    return ["syncline-design", "plan", str(case.path), "--separate", first, one.second]


def _classes(found: Diagnosis, several: bool) -> Iterator[AliasClass]:
    """Causes that matter with their aliases, the commonest first, as far as a drive can help."""
    for one in found.findings:
        if one.kind == "noise" or not one.material or not moves(one.effect):
            continue
        aliases = sorted(one.open_aliases, key=lambda r: registry()[r.effect].rarity)
        rivals = tuple(_named(r, several) for r in aliases if moves(r.effect))
        if rivals:
            yield AliasClass(_named(one, several), sizes_of(one), rivals)


def _named(one: Finding | Rival, several: bool) -> NamedEffect:
    return NamedEffect(one.effect, one.sensor, one.stage if several else None)


def _short(
    case: Case, run: PlanRun, one: AliasClass, lost: Sequence[NamedEffect], looked: _Looked
) -> NextDrive:
    result = run.result
    command = _command(case, one)
    if not result.reached and result.least_minutes is not None:
        command += ["--minutes", to_places(result.least_minutes * 1.02 + 0.05, 1)]
    return NextDrive(
        first=one.first.text,
        second=one.rivals[0].text,
        minutes=result.duration_s / 60.0,
        least_minutes=result.least_minutes,
        reached=result.reached,
        legs=tuple(f"{leg.name}: {leg.words}" for leg in result.legs),
        targets=len(result.targets),
        command=shlex.join(command),
        others=tuple(r.text for r in one.rivals[1:]) or None,
        inseparable=tuple(r.text for r in lost) or None,
        alike=looked.alike_of(one.only(lost)) or None,
    )
