"""Why no payload meets a family: a mission that none meets, or missions that cannot share one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from syncline_design.choice.explain import even_waived, listed, told
from syncline_design.choice.outcome import Explanation, Fix
from syncline_design.choice.variations import Build
from syncline_design.machine.deadline import Pieces
from syncline_design.spec.case import Mission
from syncline_design.verdict.cautions_of_waivers import waiver_cautions
from syncline_design.verdict.family import ALL, Work, choose_family, work_of
from syncline_design.verdict.family_choice import cannot_share
from syncline_design.verdict.family_fixes import (
    FamilyLimit,
    conflict,
    conflict_of,
    limit_fixes,
    sharing_fixes,
)
from syncline_design.verdict.family_named import ruled_out_of
from syncline_design.verdict.held import placed
from syncline_design.verdict.named import ChoiceResult
from syncline_design.verdict.no_design import LATE, infeasible_verdict, unmet
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.tree import Caution, MissionVerdict, RequirementResult, Verdict
from syncline_design.verdict.verified import framed

NOT_TRIED = Caution(
    "missions",
    "what would help the whole family is looked for among its limits, sensors of its own for each "
    "mission and missions left out; other platform figures, several changes together and the "
    "nearest payload are looked for in one mission at a time",
)


def infeasible_family(work: Work, settings: CheckSettings, build: Callable[[], Build]) -> Verdict:
    """Which mission cannot be flown, or which of them not with one payload, and why."""
    for mission in work.missions:
        own = work_of(replace(mission.case, missions=()), build, settings.seed)
        if choose_family(own) is None and work.case.spec.choose_for == "nominal":
            problem = own.scenarios[0].problem
            found = infeasible_verdict(mission.case, problem, settings, build())
            why = found.infeasibility
            if mission.name != ALL and why is not None:
                why = _of_one(work, mission, why, settings, build)
            made = framed(found.verdict, work.case, problem, settings)
            return replace(
                found, spec=made.spec, horizon=made.horizon, provenance=made.provenance,
                infeasibility=why,
                requirements=_rows_without_design(mission, found),
                missions=_without_design(work, mission.name),
                warnings=(*found.warnings, *([] if mission.name == ALL else [NOT_TRIED])),
            )  # fmt: skip
    why = _explained(work, settings, build)
    first = work.missions[0].case
    ids = {member.id for member in why.conflict.requirements}
    excluded, count = ruled_out_of(work)
    unmet_rows = (
        unmet(first, one, one.id in ids, why.conflict.minimal) for one in first.spec.requirements
    )
    rows = tuple(
        replace(placed(first, i, one, row, settings), line=None, column=None)
        for i, (one, row) in enumerate(zip(first.spec.requirements, unmet_rows, strict=True))
    )
    return replace(
        framed("infeasible", work.case, work.scenarios[0].problem, settings),
        requirements=rows,
        warnings=(
            *((LATE,) if why.cut_short else ()),
            NOT_TRIED,
            *waiver_cautions(first, rows),
        ),
        infeasibility=why,
        choice=ChoiceResult(excluded=excluded, excluded_count=count),
        missions=_without_design(work, None),
    )


def _of_one(
    work: Work, mission: Mission, why: Explanation, settings: CheckSettings,
    build: Callable[[], Build],
) -> Explanation:  # fmt: skip
    """The reasons of a mission that nothing meets; fixes are those that let the family be met.

    Where none does (another mission may not be met either), those of the mission by itself.
    """
    pieces, name = Pieces(), mission.name
    fixes = pieces.listed("fixes", lambda: limit_fixes(work, build, settings.seed))
    if fixes:
        fixes += pieces.listed("fixes", lambda: sharing_fixes(work, build, settings.seed))
    else:
        fixes = [_alone(name, fix) for fix in why.fixes]
    alone = [
        (_alone(name, first), *(replace(fix, mission=name) for fix in others))
        for first, *others in why.joint_fixes
    ]
    return told(replace(
        why, about=f"Mission {name} alone{even_waived(mission.case)}:", missions=(name,),
        fixes=tuple(fixes), joint_fixes=tuple(alone),
        cut_short=why.cut_short or bool(pieces.cut_short),
    ))  # fmt: skip


def _alone(mission: str, fix: Fix) -> Fix:
    """A change that helps a mission by itself; whether it helps the family was not tried."""
    return replace(fix, mission=mission, text=f"for mission {mission} by itself, {fix.text}")


def _explained(work: Work, settings: CheckSettings, build: Callable[[], Build]) -> Explanation:
    """Which missions and limits cannot go together, and which changes help, as far as time goes."""
    pieces = Pieces()
    nothing: tuple[tuple[FamilyLimit, ...], bool] = ((), False)
    names: tuple[str, ...] = ()
    if work.case.missions:
        names = pieces.made("missions that cannot share", lambda: cannot_share(work, build), ())
    found = pieces.made("the conflict", lambda: conflict_of(work), nothing)
    fixes = pieces.listed("fixes", lambda: limit_fixes(work, build, settings.seed))
    fixes += pieces.listed("fixes", lambda: sharing_fixes(work, build, settings.seed))
    return told(Explanation(
        (), conflict(work, found), (), tuple(fixes), (), bool(pieces.cut_short),
        missions=names or None, about=_about(work, names),
    ))  # fmt: skip


def _about(work: Work, missions: Sequence[str]) -> str:
    """What no payload does."""
    wanted, even = work.case.spec.choose_for, even_waived(work.missions[0].case)
    if missions:
        return f"Each mission can be met alone, but {listed(missions)} not with one payload{even}."
    if wanted == "nominal":
        return f"No payload meets every mission{even}."
    how = "at both ends of every datasheet interval"
    how = how if isinstance(wanted, str) else f"with probability {wanted}"
    return f"No payload holds {how}{even}."


def _rows_without_design(mission: Mission, found: Verdict) -> tuple[RequirementResult, ...]:
    if mission.name == ALL:
        return found.requirements
    return tuple(
        replace(row, note="; ".join(p for p in (f"in mission {mission.name}", row.note) if p))
        for row in found.requirements
    )


def _without_design(work: Work, alone: str | None) -> tuple[MissionVerdict, ...] | None:
    """Missions of a family without a payload; alone: one that no payload meets."""
    if not work.case.missions:
        return None
    return tuple(
        MissionVerdict(
            name=one.name,
            verdict="infeasible" if one.name == alone else "indeterminate",
            requirements=tuple(
                unmet(one.case, row, in_conflict=False) for row in one.case.spec.requirements
            ),
            figures=None,
        )
        for one in work.missions
    )
