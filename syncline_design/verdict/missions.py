"""The verdict on a family: every mission judged by itself, one payload bought for all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from syncline_design.choice.family import FamilyEvaluation
from syncline_design.choice.outcome import (
    NoVerdict,
    OutOfTime,
)
from syncline_design.choice.problem import selection_of, with_everything
from syncline_design.choice.table import Design, Problem
from syncline_design.choice.variations import Build
from syncline_design.machine.deadline import Pieces, in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import percent, to_digits
from syncline_design.spec.case import Case, Mission
from syncline_design.spec.references import names_candidates
from syncline_design.spec.selection import Selection
from syncline_design.verdict.cautions import unproven
from syncline_design.verdict.cautions_of_waivers import waiver_cautions
from syncline_design.verdict.family import (
    Chosen,
    Work,
    choose_family,
    pinned_family,
    work_of,
)
from syncline_design.verdict.family_bill import bill_of, bought
from syncline_design.verdict.family_choice import choice_of_family, robustness_of
from syncline_design.verdict.family_infeasible import infeasible_family
from syncline_design.verdict.family_named import Sums, ranked
from syncline_design.verdict.family_waived import (
    eased_anywhere,
    eased_family,
    lifted_family,
    waived_of,
)
from syncline_design.verdict.likely import CONFIDENCE
from syncline_design.verdict.mission_rows import (
    JudgedMission,
    family_rows,
    least_own_margin,
    with_sums,
    worst_rows,
)
from syncline_design.verdict.named import (
    ChoiceResult,
    RankedDesign,
)
from syncline_design.verdict.no_design import unfinished_verdict
from syncline_design.verdict.one_design import verdict_on, verify
from syncline_design.verdict.recheck_family import family_sums
from syncline_design.verdict.recheck_sums import BUDGETS
from syncline_design.verdict.settings import CheckSettings, build_of
from syncline_design.verdict.tree import (
    Caution,
    MissionVerdict,
    RequirementResult,
    Robustness,
    Verdict,
    Word,
    decided,
    word_of,
)
from syncline_design.verdict.verified import framed

_WORST_FIRST: dict[str, int] = {"fails": 0, "infeasible": 0, "indeterminate": 1, "meets": 2}
SHARE = "CHOOSE_FOR"  # the implied requirement of a choice for a probability


@dataclass(frozen=True, slots=True)
class FamilyOutcome:
    """A family's verdict; work and chosen: where it came to a choice."""

    verdict: Verdict
    work: Work | None = None
    chosen: Chosen | None = None


def check_family(case: Case, settings: CheckSettings) -> Verdict:
    """The verdict on a spec of several missions, or one chosen for figures in their intervals."""
    return judged_family(case, settings).verdict


def judged_family(case: Case, settings: CheckSettings) -> FamilyOutcome:
    """The verdict, with the choice that it is on."""

    def build() -> Build:
        return build_of(settings)

    work: Work | None = None
    try:
        in_force().doing("choosing")
        work = work_of(case, build, settings.seed)
        pinned = pinned_family(work)
        if pinned is not None:
            found = _verdict_on(work, pinned, settings, build, ChoiceResult())
            if found.verdict != "fails" or not any(
                names_candidates(one.case) for one in work.missions
            ):
                return FamilyOutcome(found, work, pinned)
        work, chosen = _chosen(work, pinned, settings, build)
        if chosen is None:
            return FamilyOutcome(infeasible_family(work, settings, build), work)
        choice = ChoiceResult(proof=chosen.proof)
        return FamilyOutcome(_verdict_on(work, chosen, settings, build, choice), work, chosen)
    except OutOfTime as error:
        return FamilyOutcome(unfinished_verdict(case, None, settings, str(error)), work)


def _chosen(
    work: Work, pinned: Chosen | None, settings: CheckSettings, build: Callable[[], Build]
) -> tuple[Work, Chosen | None]:
    """The choice by every limit; where no payload keeps them all, with waived ones eased."""
    chosen = choose_family(work, settings.road) if pinned is None else None
    ids = waived_of(work, settings.day)
    if chosen is not None or not ids:
        return work, chosen
    in_force().doing("choosing with what is waived")
    eased = None if pinned is not None else eased_family(work, build, ids)
    if eased is None:
        return lifted_family(work, build, ids), None
    return eased, choose_family(eased, settings.road)


def _verdict_on(
    work: Work,
    chosen: Chosen,
    settings: CheckSettings,
    build: Callable[[], Build],
    choice: ChoiceResult,
) -> Verdict:
    selections = [
        selection_of(problem, design)
        for problem, design in zip(chosen.problems, chosen.designs, strict=True)
    ]
    sums = family_sums(
        [(one.case, own) for one, own in zip(work.scenarios, selections, strict=True)]
    )
    _demand_agreement(chosen, sums)
    judged = [_judged(work, one, chosen, selections, sums, settings) for one in work.missions]
    pieces = Pieces()
    if work.case.missions:
        judged = [
            replace(one, alone=pieces.made(f"{one.mission.name} alone", choose, None))
            for one, choose in ((one, _alone(one, build, work.seed)) for one in judged)
        ]
    shown = min(judged, key=lambda one: (_WORST_FIRST[one.word], least_own_margin(one.rows)))
    nothing: Robustness | None = None
    robust = nothing
    if work.case.spec.choose_for != "nominal":
        robust = pieces.made(
            "the choice at given figures", lambda: robustness_of(work, sums, build), nothing
        )
    told = choice
    if choice.proof is not None:
        told = choice_of_family(work, chosen, pieces)
    found = _assembled(work, judged, shown, sums, settings, told)
    found = replace(
        found,
        robustness=robust,
        warnings=(
            *unproven(chosen.proof),
            *(Caution(*one) for one in pieces.cautions),
            *found.warnings,
        ),
    )
    return found if work.likelihood is None else _with_probability(work, chosen, found)


def _with_probability(work: Work, chosen: Chosen, found: Verdict) -> Verdict:
    """The verdict with the share of figures for which the design fails, and what is left open."""
    assert work.likelihood is not None
    one = work.likelihood.of(chosen.problems, chosen.designs)
    row = decided(
        id=SHARE, kind="failing_share", status=one.status, value=1.0 - one.value,
        limit=1.0 - work.likelihood.asked, unit="1", implied=True,
        note=f"{one.samples} samples of the datasheet figures, with {percent(CONFIDENCE)} "
             f"confidence "
        f"between {to_digits(1.0 - one.high, 3)} and {to_digits(1.0 - one.low, 3)}",
    )  # fmt: skip
    word = min((found.verdict, word_of([row])), key=lambda word: _WORST_FIRST[word])
    warnings = found.warnings
    if chosen.passed_open and found.verdict == "meets":
        plural = "" if chosen.passed_open == 1 else "s"
        message = (
            f"{chosen.passed_open} design{plural} that come before this one in the order are left "
            "open: samples do not tell whether they reach the probability"
        )
        warnings = (Caution("undecided-before", message), *warnings)
    robust = found.robustness and replace(found.robustness, probability=one)
    return replace(
        found, verdict=word, requirements=(*found.requirements, row), warnings=warnings,
        robustness=robust,
    )  # fmt: skip


def _demand_agreement(chosen: Chosen, sums: Sums) -> None:
    """The sums of the choice and those added up anew from the names have to be the same."""
    if chosen.found is None:
        return
    found: FamilyEvaluation = chosen.found.sums
    if any(found.amount(name) != sums[name] for name in BUDGETS):
        raise NoVerdict("the chosen payload does not stand up to the independent recheck")


def _judged(
    work: Work,
    mission: Mission,
    chosen: Chosen,
    selections: Sequence[Selection],
    sums: Sums,
    settings: CheckSettings,
) -> JudgedMission:
    """A mission's verdict at its figures as given; its rows at whichever end is worst."""
    places = work.of(mission.name)
    selection = selections[places[0]]
    rows: list[tuple[RequirementResult, ...]] = []
    simulated = any(one.kind == "monte_carlo" for one in mission.case.spec.requirements)
    plain = replace(settings, monte_carlo=settings.monte_carlo and simulated)
    for place in places:
        scenario = work.scenarios[place]
        if scenario.end is not None:
            at_end = verify(scenario.case, chosen.problems[place], chosen.designs[place], plain)
            rows.append(at_end.requirements)
    problem, design = chosen.problems[places[0]], chosen.designs[places[0]]
    if rows:
        problem = with_everything(build_of(settings)(mission.case))
        design = _named_in(problem, selection)
    verified = verify(mission.case, problem, design, settings)
    verdict = verdict_on(mission.case, problem, verified, settings, ChoiceResult())
    rows.append(verified.requirements)
    worst = worst_rows(rows)
    rows_here = _in_place(work.case, mission.case, with_sums(mission.case, worst, sums))
    return JudgedMission(mission, selection, verdict, rows_here)


def _in_place(
    spec: Case, case: Case, rows: Sequence[RequirementResult]
) -> tuple[RequirementResult, ...]:
    """Rows at the place of the limit that the mission gives itself."""
    places = {}
    for index, one in enumerate(case.spec.requirements):
        at = ("requirements", index, "limit")
        if case.positions.get(at) != spec.positions.get(at):
            places[one.id] = case.positions[at]
    return tuple(
        replace(row, line=places[row.id][0], column=places[row.id][1]) if row.id in places else row
        for row in rows
    )


def _named_in(problem: Problem, selection: Selection) -> Design:
    """The design of these names in another problem."""
    options = []
    for table in problem.roles:
        own = selection.role(table.stage_name, table.role)
        place = None
        if own is not None:
            place = table.options.place_of((own.sensor, own.primitive, own.method))
        if place is None:
            raise NoVerdict(f"{table.role} of {table.stage_name} is not open at given figures")
        options.append(place)
    clocks = [
        [clock.id for clock in vehicle.clocks].index(selection.clock(vehicle.name))
        for vehicle in problem.vehicles
    ]
    return Design(tuple(options), tuple(clocks))


def _alone(
    one: JudgedMission, build: Callable[[], Build], seed: int
) -> Callable[[], RankedDesign | None]:
    """The best payload of a mission by itself."""

    def choose() -> RankedDesign | None:
        own = work_of(replace(one.mission.case, missions=()), build, seed)
        chosen = choose_family(own)
        return None if chosen is None or chosen.undecided else ranked(own, chosen)

    return choose


def _assembled(
    work: Work,
    judged: Sequence[JudgedMission],
    shown: JudgedMission,
    sums: Sums,
    settings: CheckSettings,
    choice: ChoiceResult,
) -> Verdict:
    """The family's verdict; what only one mission can show is that of the tightest one."""
    words = {one.word for one in judged}
    word: Word = min(words, key=lambda one: _WORST_FIRST[one])
    bill = bill_of([(one.mission.name, one.verdict) for one in judged])
    design = shown.verdict.design
    assert design is not None
    several = bool(work.case.missions)
    rows = family_rows(judged) if several else shown.rows
    made = framed(word, work.case, work.scenarios[0].problem, settings)
    return replace(
        shown.verdict,
        verdict=word,
        spec=replace(
            made.spec, combinations=str(work.family.combinations), open_roles=_open_roles(work)
        ),
        horizon=made.horizon,
        provenance=made.provenance,
        requirements=rows,
        design=bought(design, [one.verdict.design for one in judged], sums, bill),
        warnings=(
            *_warnings(judged, shown, several=several),
            *waiver_cautions(eased_anywhere(work), rows),
        ),
        choice=choice if choice.proof is not None else None,
        bill_of_materials=bill,
        missions=tuple(_mission_verdict(one) for one in judged) if several else None,
    )


def _open_roles(work: Work) -> tuple[str, ...]:
    tables = work.scenarios[0].problem.roles
    return tuple(
        f"{table.stage_name}.{table.role}"
        for table, role in zip(tables, work.family.roles, strict=True)
        if len(table.options) + len(table.excluded) > 1 or len(role) > 1
    )


def _differing_roles(judged: Sequence[JudgedMission]) -> Iterator[Caution]:
    """Roles in which missions have sensors, or ways of stamping them, of their own."""
    for picked in judged[0].selection.roles:
        own: dict[tuple[str, str, str], list[str]] = {}
        for one in judged:
            other = one.selection.role(picked.stage, picked.role)
            if other is not None:
                names = own.setdefault((other.sensor, other.primitive, other.method), [])
                names.append(one.mission.name)
        if len(own) > 1:
            told = "; ".join(
                f"{', '.join(names)}: {sensor} by {primitive}, {method}"
                for (sensor, primitive, method), names in own.items()
            )
            message = f"{picked.role} of {picked.stage} differs between missions: {told}"
            yield Caution("differs-by-mission", message)


def _mission_verdict(one: JudgedMission) -> MissionVerdict:
    return MissionVerdict(
        name=one.mission.name,
        verdict=one.word,
        requirements=one.rows,
        figures=one.verdict.figures,
        design=one.verdict.design,
        syncline=one.verdict.syncline,
        monte_carlo=one.verdict.monte_carlo,
        alone=one.alone,
    )


def _warnings(
    judged: Sequence[JudgedMission], shown: JudgedMission, *, several: bool
) -> Iterator[Caution]:
    """What any mission is cautioned of, once; which mission the page's figures are of."""
    if several:
        name = shown.mission.name
        yield Caution(
            "mission-shown",
            f"ledger, figures and simulation are those of mission {name}, the one nearest to a "
            "limit of its own; every mission's own are in the table of missions",
        )
    yield from _differing_roles(judged)
    seen: dict[Caution, list[str]] = {}
    for one in judged:
        for caution in one.verdict.warnings:
            if caution.code == "waiver":  # a mission's own sums are not those of the family
                continue
            seen.setdefault(caution, []).append(one.mission.name)
    for caution, names in seen.items():
        if not several or len(names) == len(judged):
            yield caution
        else:
            told = f"in mission {', '.join(names)}: {caution.message}"
            yield replace(caution, message=told, missions=tuple(names))
