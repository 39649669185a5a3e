"""Why no payload meets a family: a mission that none meets, or missions that cannot share one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from syncline_design.choice.outcome import Conflict, Explanation
from syncline_design.spec.case import Mission
from syncline_design.verdict.family import ALL, Build, Work, choose_family, work_of
from syncline_design.verdict.family_choice import cannot_share
from syncline_design.verdict.family_named import ruled_out_of
from syncline_design.verdict.named import ChoiceResult
from syncline_design.verdict.no_design import infeasible_verdict, unmet
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.tree import MissionVerdict, RequirementResult, Verdict
from syncline_design.verdict.verified import frame


def infeasible_family(work: Work, settings: CheckSettings, build: Callable[[], Build]) -> Verdict:
    """Which mission cannot be flown, or which of them not with one payload, and why."""
    for mission in work.missions:
        own = work_of(replace(mission.case, missions=()), build, settings.seed)
        if choose_family(own) is None and work.case.spec.choose_for == "nominal":
            problem = own.scenarios[0].problem
            found = infeasible_verdict(mission.case, problem, settings, build())
            why = found.infeasibility
            if mission.name != ALL and why is not None:
                told = (f"Mission {mission.name} alone:", *why.text)
                why = replace(why, text=told, missions=(mission.name,))
            return replace(
                found, **frame(work.case, problem, settings.seed), infeasibility=why,
                requirements=_rows_without_design(mission, found),
                missions=_without_design(work, mission.name),
            )  # fmt: skip
    names = cannot_share(work, build)
    text: tuple[str, ...] = (
        f"Each mission can be met alone, but {', '.join(names)} not with one payload.",
        "What would help: per_mission: yes for a role, a looser limit, or fewer missions.",
    )
    if work.case.spec.choose_for != "nominal":
        text = ("No payload holds at both ends of every datasheet interval.",)
    if not isinstance(work.case.spec.choose_for, str):
        text = (f"No payload holds with probability {work.case.spec.choose_for}.",)
    why = Explanation((), Conflict((), False), (), (), (), False, text, names or None)
    first = work.missions[0].case
    excluded, count = ruled_out_of(work)
    return Verdict(
        verdict="infeasible",
        **frame(work.case, work.scenarios[0].problem, settings.seed),
        requirements=tuple(
            replace(unmet(first, one, in_conflict=False), line=None, column=None)
            for one in first.spec.requirements
        ),
        infeasibility=why,
        choice=ChoiceResult(excluded=excluded, excluded_count=count),
        missions=_without_design(work, None),
    )


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
