"""`optimize`: the choice itself with its front, runners-up, prices and what they hinge on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from syncline_design.choice.decide import best
from syncline_design.choice.explain import explain
from syncline_design.choice.front import front, staircase
from syncline_design.choice.judged import refusals
from syncline_design.choice.outcome import (
    FrontPoint,
    Proof,
    Unfinished,
)
from syncline_design.choice.problem import sole_design
from syncline_design.choice.slack import slack_ledger
from syncline_design.choice.table import Design, Problem
from syncline_design.choice.tolerance import (
    ToleranceVerdict,
    measure_next,
    tolerance_verdict,
)
from syncline_design.choice.variations import Build
from syncline_design.machine.deadline import OutOfTime, Pieces, in_force
from syncline_design.simulation.results import SpecName
from syncline_design.spec.case import Case
from syncline_design.spec.references import names_candidates
from syncline_design.verdict.acceptance import Simulations
from syncline_design.verdict.admitted import Kinds
from syncline_design.verdict.alternatives import alternatives, bargains
from syncline_design.verdict.cautions import assumption_cautions, design_cautions
from syncline_design.verdict.cautions_of_facts import lifecycle_cautions
from syncline_design.verdict.cautions_of_waivers import waiver_cautions
from syncline_design.verdict.choice_data import (
    front_designs,
    left_out,
    ranked_designs,
    ruled_out,
)
from syncline_design.verdict.design_data import assumptions, used_entries
from syncline_design.verdict.figure_front import (
    drawn_requirement,
    figure_front,
    figure_words,
)
from syncline_design.verdict.measured import claim_cautions
from syncline_design.verdict.nearest import nearest
from syncline_design.verdict.no_design import unfinished_verdict
from syncline_design.verdict.open_choice import Picked, chosen_of, pick
from syncline_design.verdict.optimization import (
    NO_TABLES,
    Hinged,
    Optimization,
    Optimized,
    OptimizeSettings,
    made_from,
)
from syncline_design.verdict.optimize_family import optimize_family
from syncline_design.verdict.scenarios import is_family
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.tree import Caution, Word, waived_misses
from syncline_design.verdict.verified import Verified, error_figures
from syncline_design.verdict.verify import open_verdict
from syncline_design.verdict.why_not import AskedSpec, questions_of, why_not


def optimize(case: Case, settings: OptimizeSettings) -> Optimized:
    """The best designs of a spec; pinned roles stay as they are."""
    if is_family(case):
        return optimize_family(case, settings)
    questions = questions_of(case, settings.why_not)
    simulated = any(r.kind == "monte_carlo" for r in case.spec.requirements)
    checking = CheckSettings(
        settings.seed,
        settings.road,
        monte_carlo=simulated or settings.report,
        cloud=settings.report,
    )
    problem = NO_TABLES
    try:
        build = _fresh(settings)
        problem = build(case)
        in_force().doing("choosing")
        builds = (build, lambda: _fresh(settings))
        picked = pick(chosen_of(case, problem, builds, settings.road, checking.day), checking)
    except OutOfTime as error:
        return _unfinished(case, problem, settings, checking, str(error))
    return _told(picked, settings, checking, questions)


def _fresh(settings: OptimizeSettings) -> Build:
    return Simulations(settings.seed).problem_of


def _told(
    picked: Picked,
    settings: OptimizeSettings,
    checking: CheckSettings,
    questions: tuple[Case, Kinds],
) -> Optimized:
    """Everything that is asked about a choice."""
    case, problem, build = picked.chosen.case, picked.chosen.problem, picked.chosen.build
    pieces = Pieces(lambda: refusals(problem))
    points = _points(case, problem, settings, pieces)
    designs: tuple[Design, ...] = ()
    word = _word(case, problem, picked)
    kind = Hinged if word == "meets" and picked.exhausted else Optimization
    result = _begun(kind, case, problem, checking, picked.choice.proof)
    if picked.verified is None:
        result = _with_reasons(result, case, problem, build, pieces)
    elif picked.exhausted:
        designs = _designs(problem, picked.verified.design, settings, pieces)
        if word == "meets":
            result = _with_hinges(result, (case, problem, designs[0], build), pieces)
            result = _with_others(result, case, problem, designs[0], settings, points, pieces)
    if settings.why_not:
        whole = replace(questions[0], eased=case.eased)
        asked = AskedSpec(case, problem, designs[0] if designs else None, build, whole)
        answers = tuple(pieces.listed("why not", lambda: why_not(asked, questions[1])))
        result = replace(result, why_not=answers)
    result = replace(
        result,
        verdict=word,
        designs=ranked_designs(case, problem, designs, folded=not settings.every),
        warnings=_cautions(case, problem, picked.verified, settings) if designs else (),
        waived=_waived(picked.verified) if word == "meets" else None,
        cut_short=tuple(pieces.cut_short),
        gave_up=tuple(pieces.gave_up),
    )
    result = _with_front(result, case, problem, settings, points)
    found = Optimized(case, problem, settings, designs, points, result)
    if not settings.report:
        return found
    of_error = settings.pareto and settings.resource == "cost" and settings.figure is None
    of_cost = points if of_error else None
    return replace(found, verdict=open_verdict(picked, checking, of_cost))


def _waived(verified: Verified | None) -> tuple[str, ...] | None:
    return None if verified is None else waived_misses(verified.requirements) or None


def _cautions(
    case: Case, problem: Problem, verified: Verified | None, settings: OptimizeSettings
) -> tuple[Caution, ...]:
    """What a reader has to know of the best design, and of the entries that it rests on."""
    if verified is None:
        return ()
    figures = error_figures(verified, settings.seed, statistics=True)
    entries = used_entries(case, problem, verified.design)
    return (
        *design_cautions(case, verified, figures),
        *waiver_cautions(case, verified.requirements),
        *assumption_cautions(assumptions(entries)),
        *claim_cautions(case, entries),
        *lifecycle_cautions(entries),
    )


def _unfinished(
    case: Case,
    problem: Problem,
    settings: OptimizeSettings,
    checking: CheckSettings,
    why: str,
) -> Optimized:
    """What there is to say when the time limit came before any design."""
    known = None if problem is NO_TABLES else problem
    verdict = unfinished_verdict(case, known, checking, why) if settings.report else None
    result = replace(
        _begun(Optimization, case, problem, checking, Proof(settings.road, False, False)),
        cut_short=("choosing",),
        message=f"No verdict: {why}; no design was found by then.",
    )
    result = _with_front(result, case, problem, settings, ())
    return Optimized(case, problem, settings, (), (), result, verdict)


def _word(case: Case, problem: Problem, picked: Picked) -> Word:
    """Whether there is a design; open where simulation leaves it open.

    As in `check`, a spec that pins everything fails; one that leaves a choice is infeasible.
    """
    if picked.verified is None:
        pinned_all = sole_design(problem) is not None and not names_candidates(case)
        return "fails" if pinned_all else "infeasible"
    return "meets" if picked.verified.word == "meets" else "indeterminate"


def _begun(
    kind: type[Optimization],
    case: Case,
    problem: Problem,
    checking: CheckSettings,
    proof: Proof,
) -> Optimization:
    """A result with the parts that every one has, nothing decided yet."""
    excluded, count = ruled_out(problem)
    return kind(
        verdict="indeterminate",
        spec=SpecName(case.spec.name, str(case.path)),
        proof=proof,
        combinations=None if problem is NO_TABLES else str(problem.combinations),
        excluded=excluded,
        excluded_count=count,
        provenance=made_from(case, checking),
    )


def _points(
    case: Case, problem: Problem, settings: OptimizeSettings, pieces: Pieces
) -> tuple[FrontPoint, ...]:
    nothing: tuple[FrontPoint, ...] = ()
    if not settings.pareto:
        return nothing
    if settings.figure is not None:
        asked = drawn_requirement(case, settings.figure)
        made = figure_front(case, asked, settings.resource, settings.seed)
        return tuple(pieces.listed("front", lambda: made))
    return pieces.made("front", lambda: tuple(front(problem, settings.resource)), nothing)


def _drawn(case: Case, settings: OptimizeSettings) -> str | None:
    """The figure that a front is drawn over, in words."""
    if settings.figure is None:
        return None
    return figure_words(drawn_requirement(case, settings.figure))


def _with_front(
    result: Optimization,
    case: Case,
    problem: Problem,
    settings: OptimizeSettings,
    points: Sequence[FrontPoint],
) -> Optimization:
    """The result with the parts that `--pareto` asks for."""
    if not settings.pareto:
        return result
    return replace(
        result,
        front=front_designs(case, problem, points, settings.resource),
        front_figure=_drawn(case, settings),
        front_left_out=left_out(case, problem, settings.resource),
        staircase=staircase([point for point in points if not point.undecided]),
    )


def _designs(
    problem: Problem, chosen: Design, settings: OptimizeSettings, pieces: Pieces
) -> tuple[Design, ...]:
    """The chosen design, then the next best others."""
    count = settings.count
    if count == 1:
        return (chosen,)

    def others() -> Iterator[Design]:
        return (d for d in best(problem, count + 1, every=settings.every) if d != chosen)

    return (chosen, *pieces.listed("next best designs", others)[: count - 1])


def _with_reasons(
    result: Optimization, case: Case, problem: Problem, build: Build, pieces: Pieces
) -> Optimization:
    """The result with why there is no design."""
    found = explain(case, problem, build)
    if found.cut_short:
        pieces.cut_short.append("reasons and remedies")
    return replace(result, infeasibility=found, nearest=nearest(case, problem, found, build))


def _with_hinges(
    result: Optimization, given: tuple[Case, Problem, Design, Build], pieces: Pieces
) -> Optimization:
    """The result with what it hinges on: slack of every figure, tolerances, what to measure."""
    return replace(
        result,
        slack=pieces.made("slack ledger", lambda: slack_ledger(*given), None),
        tolerances=pieces.made("tolerances", lambda: _tolerances(*given), None),
        measure_next=pieces.made("what to measure next", lambda: measure_next(*given), None),
    )


def _with_others(
    result: Optimization, case: Case, problem: Problem, chosen: Design, settings: OptimizeSettings,
    points: tuple[FrontPoint, ...], pieces: Pieces,
) -> Optimization:  # fmt: skip
    """What if a sensor cannot be had, and what a little more money would buy."""
    if not settings.pareto or settings.resource != "cost":
        nothing: tuple[FrontPoint, ...] = ()
        points = pieces.made("bargains", lambda: tuple(front(problem)), nothing)
    without = pieces.listed("alternatives", lambda: alternatives(case, problem, chosen))
    found = tuple(bargains(case, problem, chosen, points))
    return replace(result, alternatives=tuple(without), bargains=found)


def _tolerances(
    case: Case, problem: Problem, design: Design, build: Build
) -> ToleranceVerdict | None:
    """The verdict under tolerances; None where simulation is refused it."""
    try:
        return tolerance_verdict(case, problem, design, build)
    except Unfinished:
        return None
