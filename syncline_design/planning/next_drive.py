"""The short plan at the end of a diagnosis whose log left a finding with aliases."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from typing import Final

from syncline_design.diagnosis.result import Diagnosis, Finding, NextDrive, Rival
from syncline_design.effects import registry
from syncline_design.machine.deadline import NoVerdict, within_s
from syncline_design.model.figure_text import to_places
from syncline_design.planning.run import plan
from syncline_design.planning.setup import PlanRequest
from syncline_design.planning.telling import PlanRun
from syncline_design.planning.wanted import EffectPair, NamedEffect, PlanError, PlanWanted
from syncline_design.spec.case import Case
from syncline_design.spec.load import BadInput

LIMIT_S: Final = 20.0  # of the command's time; without a plan by then, the diagnosis stands alone
MOST_TRIED: Final = 3


def next_drive(case: Case, found: Diagnosis) -> NextDrive | None:
    """The drive that tells the strongest finding from what this log left in its place.

    case: pinned.  None where no finding is a class that a drive could tell.  Where none could be
    planned, the reason and the command that looks for it: a diagnosis never fails for want of a
    plan, and never ends without a word on it.
    """
    pairs = list(_pairs(found, len(case.stages) > 1))[:MOST_TRIED]
    untold: list[EffectPair] = []
    now = None
    try:
        with within_s(LIMIT_S):
            for now in (EffectPair(*pair) for pair in pairs):
                run = plan(case, PlanRequest(PlanWanted((), (now,))))
                if run.result.least_minutes is not None:
                    return _short(case, run, now.first, now.second)
                untold.append(now)
    except NoVerdict:
        return _none(case, now, _TOO_LATE) if now else None
    except (BadInput, PlanError) as error:
        return _none(case, now, f"No test drive could be planned, {error}") if now else None
    return _none(case, untold[0], _untold_words(untold)) if untold else None


_TOO_LATE: Final = (
    "This log cannot tell {first} from {second}. No drive that does was found in the time that a "
    "diagnosis gives it; this looks on"
)


def _untold_words(untold: Sequence[EffectPair]) -> str:
    pairs = "; ".join(f"{one.first.text} from {one.second.text}" for one in untold)
    return (
        f"No test drive of this platform was found that tells {pairs}, as far as their "
        "effects of first order go. What one shows"
    )


def _none(case: Case, pair: EffectPair, why: str) -> NextDrive:
    """No drive, and the command that looks for it."""
    first, second = pair.first.text, pair.second.text
    return NextDrive(
        first=first,
        second=second,
        minutes=None,
        least_minutes=None,
        reached=False,
        legs=(),
        targets=0,
        command=shlex.join(_command(case, pair.first, pair.second)),
        why_none=why.replace("{first}", first).replace("{second}", second),
    )


def _command(case: Case, first: NamedEffect, second: NamedEffect) -> list[str]:
    return ["syncline-design", "plan", str(case.path), "--separate", first.text, second.text]


def _pairs(found: Diagnosis, several: bool) -> Iterator[tuple[NamedEffect, NamedEffect]]:
    """Causes that matter with their aliases, the commonest first, as far as a drive can help."""
    for one in found.findings:
        if one.kind == "noise" or not one.material or not _moves(one.effect):
            continue
        for rival in sorted(one.aliases, key=lambda r: registry()[r.effect].rarity):
            if _moves(rival.effect):
                yield _named(one, several), _named(rival, several)


def _moves(effect: str) -> bool:
    known = registry().get(effect)
    return known is not None and known.sensitivity is not None


def _named(one: Finding | Rival, several: bool) -> NamedEffect:
    return NamedEffect(one.effect, one.sensor, one.stage if several else None)


def _short(case: Case, run: PlanRun, first: NamedEffect, second: NamedEffect) -> NextDrive:
    result = run.result
    command = _command(case, first, second)
    if not result.reached and result.least_minutes is not None:
        command += ["--minutes", to_places(result.least_minutes * 1.05 + 0.1, 1)]
    return NextDrive(
        first=first.text,
        second=second.text,
        minutes=result.duration_s / 60.0,
        least_minutes=result.least_minutes,
        reached=result.reached,
        legs=tuple(f"{leg.name}: {leg.words}" for leg in result.legs),
        targets=len(result.targets),
        command=shlex.join(command),
    )
