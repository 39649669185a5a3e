"""`optimize` for several missions, or for figures within their intervals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from syncline_design.choice.front import staircase
from syncline_design.choice.outcome import PriceStep, Proof
from syncline_design.choice.problem import selection_of
from syncline_design.choice.slack import Slack
from syncline_design.choice.tolerance import MissionDesign, tolerance_over
from syncline_design.choice.variations import Build
from syncline_design.machine.deadline import Pieces
from syncline_design.simulation.results import SpecName
from syncline_design.spec.case import Case
from syncline_design.spec.edit import pinned_spec_text
from syncline_design.spec.edit_missions import pinned_missions_text
from syncline_design.spec.load import BadInput, Flaw
from syncline_design.spec.requirement import SUMMED_KINDS
from syncline_design.verdict.acceptance import Simulations
from syncline_design.verdict.family import MERGED, Chosen, Work, choose_family, front_of
from syncline_design.verdict.family_choice import as_far
from syncline_design.verdict.family_figure_front import family_figure_front
from syncline_design.verdict.family_measure import measure_next
from syncline_design.verdict.family_named import (
    as_point,
    front_design,
    front_left_out,
    ranked,
    ruled_out_of,
)
from syncline_design.verdict.family_others import next_best, with_stampings
from syncline_design.verdict.family_slack import family_slack
from syncline_design.verdict.family_why_not import Question, why_not_in_family
from syncline_design.verdict.figure_front import drawn_requirement, figure_words
from syncline_design.verdict.missions import FamilyOutcome as Judged
from syncline_design.verdict.missions import judged_family
from syncline_design.verdict.named import FrontDesign, RankedDesign
from syncline_design.verdict.optimization import (
    NO_TABLES,
    Hinges,
    Optimization,
    Optimized,
    OptimizeSettings,
    made_from,
    with_hinges,
)
from syncline_design.verdict.pinned import pinned_role
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.tree import Caution, Verdict, waived_misses
from syncline_design.verdict.why_not import Answer, questions_of

Front = tuple[tuple[FrontDesign, ...], tuple[PriceStep, ...]]
_HINGES = "what the design hinges on (slack, tolerances, what to measure next)"
NOT_JUDGED = Caution("missions", f"{_HINGES} is worked out where every limit is one of sums")
NOT_INTERVALS = Caution(
    "missions", f"{_HINGES} is worked out for designs chosen at given figures: choose_for: nominal"
)


def optimize_family(case: Case, settings: OptimizeSettings) -> Optimized:
    """The best payloads of a family, with its front where that is asked for."""
    _refuse_unanswered(case, settings)
    _, kinds = questions_of(case, settings.why_not)
    simulated = any(r.kind == "monte_carlo" for r in case.spec.requirements)
    checking = CheckSettings(settings.seed, settings.road, monte_carlo=simulated or settings.report)
    judged = judged_family(case, checking)
    verdict, work = judged.verdict, judged.work
    if work is None:
        return _unfinished(case, settings, checking, verdict)
    designs: list[RankedDesign] = []
    front: Front | None = None
    pieces = Pieces()
    found, choice = _with_sums(judged, pieces), verdict.choice
    if found is not None and found.found is not None:
        designs = _designs(work, found, settings, pieces)
        if settings.pareto:
            if settings.figure is not None:
                front = _figure_front(work, settings, pieces)
            else:
                front = pieces.made("front", lambda: _front(work, settings), front)
    answers: tuple[Answer, ...] | None = None
    if kinds:
        asked = Question(work, found, lambda: Simulations(settings.seed).problem_of, settings.seed)
        answers = tuple(pieces.listed("why not", lambda: why_not_in_family(asked, kinds)))
    excluded, count = ruled_out_of(work)
    has_design = found is not None and found.found is not None
    hinges = _hinges(work, found, verdict, settings, pieces)
    result = Optimization(
        verdict=verdict.verdict,
        spec=SpecName(case.spec.name, str(case.path)),
        proof=MERGED if found is None else found.proof,
        combinations=str(work.family.combinations),
        designs=tuple(designs),
        warnings=(*_told(verdict, settings), *_unhinged(case, verdict)),
        excluded=excluded,
        excluded_count=count,
        cut_short=tuple(pieces.cut_short),
        provenance=made_from(case, checking),
        infeasibility=None if has_design else verdict.infeasibility,
        nearest=None if has_design else verdict.nearest,
        alternatives=choice.alternatives if has_design and choice is not None else None,
        bargains=choice.bargains if has_design and choice is not None else None,
        front=front and front[0],
        front_figure=None
        if settings.figure is None or front is None
        else figure_words(drawn_requirement(case, settings.figure)),
        front_left_out=front and front_left_out(work, settings.resource),
        staircase=front and front[1],
        why_not=answers,
        waived=waived_misses(verdict.requirements) or None if verdict.verdict == "meets" else None,
    )
    result = with_hinges(result, hinges)
    text = _pinned_text(work, found) if designs and found is not None else None
    first = work.scenarios[0].problem
    shown = verdict if settings.report else None
    return Optimized(case, first, settings, (), (), result, shown, text)


def _unhinged(case: Case, verdict: Verdict) -> Iterator[Caution]:
    """Why a design that meets does not say what it hinges on."""
    if verdict.verdict != "meets":
        return
    if case.spec.choose_for != "nominal":
        yield NOT_INTERVALS
    elif any(one.kind not in SUMMED_KINDS for one in case.spec.requirements):
        yield NOT_JUDGED


def _hinges(
    work: Work, found: Chosen | None, verdict: Verdict, settings: OptimizeSettings, pieces: Pieces
) -> Hinges | None:
    """Slack of every figure, tolerances and what to measure, as far as time goes."""
    if verdict.verdict != "meets" or found is None or found.found is None:
        return None
    if next(_unhinged(work.case, verdict), None) is not None:
        return None

    def build() -> Build:
        return Simulations(settings.seed).problem_of

    parts = [
        MissionDesign(mission.case, problem, design, build())
        for mission, problem, design in zip(
            work.missions, found.problems, found.designs, strict=True
        )
    ]
    rows: tuple[Slack, ...] | None = None
    return Hinges(
        pieces.made("slack ledger", lambda: tuple(family_slack(work, found, build)), rows),
        pieces.made("tolerances", lambda: tolerance_over(parts), None),
        pieces.made("what to measure next", lambda: measure_next(work, found, build), None),
    )


def _with_sums(judged: Judged, pieces: Pieces) -> Chosen | None:
    """The payload of a verdict; one that the spec pins has its sums worked out."""
    found, work = judged.chosen, judged.work
    if found is None or work is None or found.found is not None or found.undecided:
        return found
    nothing: Chosen | None = None
    return pieces.made("choosing", lambda: choose_family(work), nothing)


def _told(verdict: Verdict, settings: OptimizeSettings) -> Iterator[Caution]:
    """What `check` warns of, but that nothing was simulated, where a page does not ask for it."""
    for one in verdict.warnings:
        if settings.report or one.code != "no-monte-carlo":
            yield one


def _unfinished(
    case: Case, settings: OptimizeSettings, checking: CheckSettings, verdict: Verdict
) -> Optimized:
    """What there is to say when the time limit came before any table."""
    result = Optimization(
        verdict="indeterminate",
        spec=SpecName(case.spec.name, str(case.path)),
        proof=Proof(settings.road, False, False),
        combinations=None,
        excluded=(),
        excluded_count=0,
        cut_short=("choosing",),
        provenance=made_from(case, checking),
        message=f"No verdict: {verdict.warnings[0].message}.",
    )
    shown = verdict if settings.report else None
    return Optimized(case, NO_TABLES, settings, (), (), result, shown)


def _refuse_unanswered(case: Case, settings: OptimizeSettings) -> None:
    """What `optimize` answers at given figures only."""
    if settings.figure is not None and case.spec.choose_for != "nominal":
        key = "choose_for"
        message = "--against a figure of the error is drawn for designs chosen at given figures"
        hint = "ask it of the spec with choose_for: nominal"
        place = case.position((key,))
        raise BadInput((Flaw(str(case.path), *place, key, message, hint=hint),))


def _designs(
    work: Work, chosen: Chosen, settings: OptimizeSettings, pieces: Pieces
) -> list[RankedDesign]:
    """The chosen payload, then the next best."""
    first = ranked(work, chosen) if settings.every else with_stampings(work, chosen)
    more = settings.count - 1
    if not more:
        return [first]
    following = pieces.listed(
        "next best designs",
        lambda: next_best(work, chosen, every=settings.every, count=more),
    )
    return [first, *following]


def _figure_front(work: Work, settings: OptimizeSettings, pieces: Pieces) -> Front:
    """The front over a figure of the error, as far as time and the search go."""
    assert settings.figure is not None
    asked = drawn_requirement(work.case, settings.figure)
    made = family_figure_front(work.case, asked, settings.resource, settings.seed)
    points = pieces.listed("front", lambda: as_far("front", lambda: made, pieces))
    drawn = [
        replace(front_design(work, one.point, settings.resource), figure_m=one.figure_m)
        for one in points
    ]
    steps = [replace(as_point(work, one.point), figure_m=one.figure_m) for one in points]
    return tuple(drawn), staircase(steps)


def _front(work: Work, settings: OptimizeSettings) -> Front:
    points = front_of(work, settings.resource)
    return (
        tuple(front_design(work, point, settings.resource) for point in points),
        staircase([as_point(work, point) for point in points]),
    )


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
