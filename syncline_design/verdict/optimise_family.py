"""`optimize` for several missions, or for figures within their intervals."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from syncline_design import __version__
from syncline_design.choice.family_best import Found
from syncline_design.choice.front import staircase
from syncline_design.choice.outcome import Proof
from syncline_design.choice.problem import selection_of
from syncline_design.machine.deadline import OutOfTime, in_force
from syncline_design.simulation.results import SpecName
from syncline_design.spec.case import Case
from syncline_design.spec.edit import pinned_spec_text
from syncline_design.spec.edit_missions import pinned_missions_text
from syncline_design.spec.load import BadInput, Flaw
from syncline_design.verdict.acceptance import Simulations
from syncline_design.verdict.family import Build, Chosen, Work, accepted, front_of, work_of
from syncline_design.verdict.family_choice import as_point, front_design, ranked, ruled_out_of
from syncline_design.verdict.missions import check_family
from syncline_design.verdict.optimise import (
    MadeFrom,
    Optimisation,
    Optimised,
    OptimizeSettings,
    pinned_role,
)
from syncline_design.verdict.tree import Caution
from syncline_design.verdict.verify import CheckSettings

LEFT_OUT = Caution(
    "missions",
    "what the design hinges on (slack, tolerances, what to measure next) is worked out for specs "
    "of one mission chosen at given figures",
)


def optimize_family(case: Case, settings: OptimizeSettings) -> Optimised:
    """The best payloads of a family, with its front where that is asked for."""
    _refuse_unanswered(case, settings)

    def build() -> Build:
        return Simulations(settings.seed).problem_of

    simulated = any(r.kind == "monte_carlo" for r in case.spec.requirements)
    checking = CheckSettings(
        settings.seed, settings.method, monte_carlo=simulated or settings.report
    )
    verdict = check_family(case, checking)
    work = work_of(case, build, settings.seed)
    more: dict[str, Any] = {"infeasibility": verdict.infeasibility}
    found: list[Found] = []
    cut_short: list[str] = []
    if verdict.design is not None and verdict.verdict in ("meets", "indeterminate"):
        try:
            in_force().doing("choosing")
            found = list(_differing(work, settings))
        except OutOfTime:
            cut_short.append("next best designs")
        more = _front(work, settings) if settings.pareto else {}
    designs = [Chosen(work.family.designs(o.design), work.family.problems, o) for o in found]
    excluded, count = ruled_out_of(work)
    result = Optimisation(
        verdict=verdict.verdict,
        spec=SpecName(case.spec.name, str(case.path)),
        proof=Proof("front", optimal=verdict.verdict != "indeterminate", rechecked=True),
        combinations=str(work.family.combinations),
        designs=tuple(ranked(work, one) for one in designs),
        warnings=(*verdict.warnings, LEFT_OUT),
        excluded=excluded,
        excluded_count=count,
        cut_short=tuple(cut_short),
        provenance=MadeFrom(
            __version__, case.spec_sha256, case.catalogs_sha256, case.files, settings.seed
        ),
        **more,
    )
    text = _pinned_text(work, designs[0]) if designs else None
    first = work.scenarios[0].problem
    shown = verdict if settings.report else None
    return Optimised(case, first, settings, (), (), result, shown, text)


def _refuse_unanswered(case: Case, settings: OptimizeSettings) -> None:
    """What `optimize` answers for one mission only."""
    asked = "--why-not" if settings.why_not else "--against a figure" if settings.figure else ""
    if asked:
        key = "missions" if case.missions else "choose_for"
        message = f"{asked} is answered for one mission chosen at given figures"
        hint = "ask it of a spec with one mission's overrides in its stages"
        place = case.position((key,))
        raise BadInput((Flaw(str(case.path), *place, key, message, hint=hint),))


def _differing(work: Work, settings: OptimizeSettings) -> Iterator[Found]:
    """The best designs, each with other sensors than those before; `every`: all of them."""
    seen: set[tuple[str, ...]] = set()
    count = 0
    for one in accepted(work):
        names = _sensors(work, one)
        if settings.every or names not in seen:
            seen.add(names)
            yield one
            count += 1
        if count == settings.count:
            return


def _sensors(work: Work, one: Found) -> tuple[str, ...]:
    designs = zip(work.family.problems, work.family.designs(one.design), strict=True)
    return tuple(
        role.sensor for problem, design in designs for role in selection_of(problem, design).roles
    )


def _front(work: Work, settings: OptimizeSettings) -> dict[str, Any]:
    points = front_of(work, settings.resource)
    return {
        "front": tuple(front_design(work, point, settings.resource) for point in points),
        "staircase": staircase([as_point(work, point) for point in points]),
    }


def _pinned_text(work: Work, chosen: Chosen) -> str:
    """The spec with the payload pinned."""
    case = work.case
    roles, clocks = [], {}
    for mission in work.missions:
        place = work.of(mission.name)[0]
        selected = selection_of(chosen.problems[place], chosen.designs[place])
        index = {stage.choice.name: stage for stage in mission.case.stages}
        roles.append([pinned_role(index[one.stage], one) for one in selected.roles])
        for stage in case.stages:
            identity = selected.clock(stage.choice.vehicle_name)
            if stage.clocks and identity is not None:
                clocks[stage.index] = identity
    if not case.missions:
        return pinned_spec_text(case, roles[0], clocks)
    return pinned_missions_text(case, roles, clocks)
