"""The short plan at the end of a diagnosis whose log left a finding with aliases."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

from syncline_design.diagnosis.result import Diagnosis, Finding, NextDrive, Rival
from syncline_design.effects import registry
from syncline_design.machine.deadline import NoVerdict, within_s
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import format_duration, to_places
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

LIMIT_S: Final = 20.0  # of the command's time; without a plan by then, the diagnosis stands alone
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
    try:
        with within_s(LIMIT_S):
            for now in classes:
                drive = _told(case, now)
                if drive is not None:
                    return drive
                untold.append(now)
    except NoVerdict:
        return _none(case, now, _TOO_LATE.replace("{who}", who)) if now else None
    except (BadInput, PlanError) as error:
        return _none(case, now, f"No test drive could be planned, {error}") if now else None
    return _none(case, untold[0], _untold_words(untold), untold[0].rivals) if untold else None


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


def _told(case: Case, one: AliasClass) -> NextDrive | None:
    """The drive that tells a finding from all of its class that some drive tells it from.

    Where none does in the minutes and in the time of a diagnosis, the one that tells it from the
    commonest that can be told.  What would take longer than `LONGEST_S` is no drive.
    """
    lost: list[NamedEffect] = []
    for rival in one.rivals[:MOST_TRIED]:
        commonest = one.only([rival])
        run = _planned(case, commonest)
        least = run.result.least_minutes
        if least is not None and SECONDS * least <= LONGEST_S:
            return _whole(case, one.only([r for r in one.rivals if r not in lost]), lost) or (
                _short(case, run, commonest, lost)
            )
        lost.append(rival)
    return None


def _whole(case: Case, one: AliasClass, lost: Sequence[NamedEffect]) -> NextDrive | None:
    """The drive that tells a finding from several at once; None where there is none in time."""
    if len(one.rivals) < 2:
        return None
    try:
        run = _planned(case, one)
    except NoVerdict:
        return None
    more = [r for r in one.rivals if f"{one.first.text} and {r.text}" in run.result.inseparable]
    kept = one.only([r for r in one.rivals if r not in more])
    return _short(case, run, kept, [*lost, *more]) if run.result.reached and kept.rivals else None


def _planned(case: Case, one: AliasClass) -> PlanRun:
    """The drive alone: nothing is said here of the field's line plans."""
    return plan(case, PlanRequest(PlanWanted((), one.pairs), line_plans=False))


_TOO_LATE: Final = (
    "{who} cannot tell {first} from {second}. No drive that does was found in the time that a "
    "diagnosis gives it; this looks on"
)


def _untold_words(untold: Sequence[AliasClass]) -> str:
    pairs = "; ".join(f"{one.first.text} from {r.text}" for one in untold for r in one.rivals)
    most = format_duration(LONGEST_S)
    return (
        f"No test drive of this platform of up to {most} was found that tells {pairs}, at the size "
        "that was found. What one shows"
    )


def _none(
    case: Case, one: AliasClass, why: str, inseparable: Sequence[NamedEffect] = ()
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


def _short(case: Case, run: PlanRun, one: AliasClass, lost: Sequence[NamedEffect]) -> NextDrive:
    result = run.result
    command = _command(case, one)
    if not result.reached and result.least_minutes is not None:
        command += ["--minutes", to_places(result.least_minutes * 1.05 + 0.1, 1)]
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
    )
