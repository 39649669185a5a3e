"""Spec to verdict: choose what is open, recheck exactly, cross-check by Monte Carlo."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from syncline_design.choice.chosen_system import system_of
from syncline_design.choice.judged import refusals
from syncline_design.choice.outcome import Proof
from syncline_design.choice.problem import selection_of, sole_design
from syncline_design.choice.table import Design, Problem
from syncline_design.effects.acting import known_of
from syncline_design.machine.deadline import OutOfTime, Pieces, in_force
from syncline_design.model.budget import budget
from syncline_design.model.quantity import Quantity
from syncline_design.model.system import System
from syncline_design.simulation import CrossCheck, SimulationError, cross_check
from syncline_design.spec.case import Case
from syncline_design.spec.load import BadInput, Flaw, load
from syncline_design.spec.references import names_candidates
from syncline_design.spec.requirement import JUDGED_KINDS, STATED_KINDS, Requirement
from syncline_design.verdict.acceptance import (
    MOST_SIMULATED,
    Simulations,
    refuse_trajectory,
    simulation_settings,
)
from syncline_design.verdict.bill import bill_of_materials
from syncline_design.verdict.cautions import cautions
from syncline_design.verdict.cautions_of_facts import implausible_cautions, lifecycle_cautions
from syncline_design.verdict.choice_data import choice_of, left_out_text, without_choice
from syncline_design.verdict.design_data import (
    assumptions,
    named_design,
    sources,
    transcripts,
    used_entries,
)
from syncline_design.verdict.explain import Worked, explained
from syncline_design.verdict.family import is_family, refuse_missions
from syncline_design.verdict.held import placed
from syncline_design.verdict.held import results as held_results
from syncline_design.verdict.measured import claim_cautions, measured
from syncline_design.verdict.named import ChoiceResult
from syncline_design.verdict.recheck import recheck
from syncline_design.verdict.tree import (
    UNITS,
    Caution,
    Checked,
    Refused,
    RequirementResult,
    Status,
    Verdict,
    decided,
)
from syncline_design.verdict.verified import (
    Verified,
    error_figures,
    frame,
    known_effects,
    refused,
    syncline_figures,
)

if TYPE_CHECKING:
    from syncline_design.choice.outcome import FrontPoint, Road
    from syncline_design.choice.variations import Build
    from syncline_design.verdict.open_choice import Picked

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class CheckSettings:
    """How to check: seed of the random numbers and road of the choice.

    monte_carlo: whether to simulate (a monte_carlo requirement stays undecided without).
    explain: ids of requirements to work out step by step.
    today: the day on which waivers are judged; None: the machine's date.
    """

    seed: int = 0
    method: Road = "auto"
    monte_carlo: bool = True
    explain: tuple[str, ...] = ()
    today: date | None = None


def check_files(paths: Sequence[Path], settings: CheckSettings) -> list[Checked]:
    """Verdicts of specs, in the order given; a refused file stands among them as such.

    Of a refused file nothing is computed.  A time limit binds all of them together.
    """
    read = [_or_refused(path, load) for path in paths]  # all before anything is computed
    return [_check_or_refuse(item, settings) for item in read]


def _check_or_refuse(read: Case | Refused, settings: CheckSettings) -> Checked:
    if isinstance(read, Refused):
        return read
    return _or_refused(read.path, lambda _: check_loaded(read, settings))


def _or_refused(path: Path, work: Callable[[Path], T]) -> T | Refused:
    try:
        return work(path)
    except BadInput as error:
        return refused(str(path), error)


def check_loaded(case: Case, settings: CheckSettings) -> Verdict:
    """The verdict of a loaded spec; without any design when the time is over, indeterminate."""
    if is_family(case):
        from syncline_design.verdict.missions import check_family

        return check_family(case, settings)
    build = build_of(settings)
    problem: Problem | None = None
    try:
        problem = build(case)
        if sole_design(problem) is not None:
            return _sole_verdict(case, problem, settings, build)
        return _check_open(case, problem, settings, build)
    except OutOfTime as error:
        return unfinished_verdict(case, problem, settings, str(error))


def _sole_verdict(case: Case, problem: Problem, settings: CheckSettings, build: Build) -> Verdict:
    """The verdict on the only design that a spec leaves.

    Where the spec names candidates, that no design meets it is said as for any number of designs.
    """
    sole = sole_design(problem)
    assert sole is not None
    everything, design = sole
    verified = verify(case, everything, design, settings)
    if verified.word == "fails" and names_candidates(case):
        return infeasible_verdict(case, problem, settings, build)
    return verdict_on(case, everything, verified, settings, without_choice(problem))


def unfinished_verdict(
    case: Case, problem: Problem | None, settings: CheckSettings, why: str
) -> Verdict:
    """A verdict that the time limit left without a design."""
    return Verdict(
        verdict="indeterminate",
        **frame(case, problem, settings.seed),
        requirements=tuple(
            placed(case, index, one, unmet(case, one, in_conflict=False), settings)
            for index, one in enumerate(case.spec.requirements)
        ),
        warnings=(Caution("time-limit", f"{why}; no design was found by then"),),
        choice=ChoiceResult(Proof(settings.method, False, False)),
    )


def build_of(settings: CheckSettings) -> Build:
    """How a spec becomes a problem: with simulated requirements, unless nothing is simulated."""
    kinds = JUDGED_KINDS if settings.monte_carlo else STATED_KINDS
    return Simulations(settings.seed, settings.today, kinds).problem_of


def picked_design(case: Case, seed: int = 0) -> tuple[Problem, Design]:
    """The only design of a pinned spec, or the best of an open one; BadInput when there is none.

    By its figures as given, whatever it is chosen for.
    """
    refuse_missions(case)
    problem = Simulations(seed).problem_of(case)
    sole = sole_design(problem)
    if sole is not None:
        return sole
    from syncline_design.choice.decide import choose
    from syncline_design.choice.outcome import Infeasible

    choice = choose(problem)
    if isinstance(choice, Infeasible):
        line, column = case.positions.get(("stages",), (0, 0))
        message = "no design meets this spec, so there is no system to work with"
        hint = f"see `syncline-design check {case.path.name}`, or pin the sensors"
        place = (str(case.path), line, column, "stages")
        raise BadInput((Flaw(*place, message, hint=hint),))
    return problem, choice.design


def _check_open(case: Case, problem: Problem, settings: CheckSettings, build: Build) -> Verdict:
    """Choose, then verify; without any design say why and what would help."""
    from syncline_design.verdict.open_choice import pick

    picked = pick(
        problem,
        settings.method,
        lambda design: verify(case, problem, design, settings),
    )
    return open_verdict(case, problem, picked, settings, build)


def open_verdict(
    case: Case,
    problem: Problem,
    picked: Picked,
    settings: CheckSettings,
    build: Build | None = None,
    points: Sequence[FrontPoint] | None = None,
) -> Verdict:
    """The verdict on what was picked for a spec; points: its front of cost, where known."""
    build = build or build_of(settings)
    if sole_design(problem) is not None:
        return _sole_verdict(case, problem, settings, build)
    if picked.verified is None:
        return infeasible_verdict(case, problem, settings, build)
    pieces = Pieces(lambda: refusals(problem))
    choice = choice_of(case, problem, picked, pieces, points)
    found = verdict_on(case, problem, picked.verified, settings, choice)
    missing = choice.front_left_out
    warnings = (
        *_passed_over(picked),
        *unproven(picked.choice.proof),
        *(Caution(code, message) for code, message in pieces.cautions),
        *found.warnings,
        *([Caution("unpriced", left_out_text(missing, "cost"))] if missing else ()),
    )
    is_open = picked.verified.word != "meets" and not picked.exhausted
    return replace(found, verdict="indeterminate" if is_open else found.verdict, warnings=warnings)


def unproven(proof: Proof) -> Iterator[Caution]:
    """What the time limit left open about a design that meets."""
    if not proof.optimal:
        gap = "" if proof.gap is None else f" (by {100 * proof.gap:.3g} % at most)"
        message = f"the time limit ended the search: a better design than this may exist{gap}"
        yield Caution("not-proven-optimal", message)


def infeasible_verdict(
    case: Case, problem: Problem, settings: CheckSettings, build: Build
) -> Verdict:
    """Why there is no design, and which single changes would help."""
    from syncline_design.choice.explain import explain
    from syncline_design.verdict.nearest import nearest

    found = explain(case, problem, build)
    conflict = {member.id for members in found.conflicts for member in members}
    minimal = found.conflict.minimal
    late = Caution("time-limit", "the time limit ended the search for reasons and remedies")
    return Verdict(
        verdict="infeasible",
        **frame(case, problem, settings.seed),
        requirements=tuple(
            placed(case, i, one, unmet(case, one, one.id in conflict, minimal), settings)
            for i, one in enumerate(case.spec.requirements)
        ),
        warnings=(*((late,) if found.cut_short else ()), *implausible_cautions(case)),
        infeasibility=found,
        nearest=nearest(case, problem, found, build),
        choice=without_choice(problem),
    )


def unmet(
    case: Case, one: Requirement, in_conflict: bool, minimal: bool = True
) -> RequirementResult:
    """A requirement of a spec without a design: part of the conflict, or not reached."""
    unit = UNITS.get(one.kind, case.spec.currency)
    quantile = one.share
    status: Status = "fail" if in_conflict else "indeterminate"
    part = "part of the conflict" if minimal else "perhaps part of the conflict"
    note = part if in_conflict else "no design to judge it by"
    limit = one.limit
    if one.kind == "cost" and isinstance(limit, Quantity):
        limit = float(case.spec.in_currency(limit))
    return decided(
        id=one.id, kind=one.kind, status=status, value=None, limit=float(limit), unit=unit,
        quantile=quantile, note=note,
    )  # fmt: skip


def _passed_over(picked: Picked) -> Iterator[Caution]:
    passed_over = picked.choice.proof.passed_over
    if not passed_over:
        return
    count = f"{passed_over} design{'s' if passed_over > 1 else ''}"
    rows = () if picked.verified is None else picked.verified.requirements
    stated = [row.id for row in rows if row.kind in STATED_KINDS]
    judged = [row.id for row in rows if row.kind in JUDGED_KINDS]
    limits = f"the limits of {', '.join(judged)}" if stated else "the Monte Carlo limits"
    message = f"{count} that come before this one keep every sum but not {limits}"
    if not picked.exhausted:
        message = (
            f"{count} keep every sum but not {limits}; shown is the first; the "
            f"search stopped after {MOST_SIMULATED} simulated designs"
        )
    yield Caution("passed-over", message)


def verify(case: Case, problem: Problem, design: Design, settings: CheckSettings) -> Verified:
    """Budget, exact recheck, Monte Carlo and every requirement of one design."""
    system = system_of(case, problem, design)
    known = known_of(system)
    figures = budget(system, known)
    exact = recheck(case, selection_of(problem, design), known)
    found, trouble = _monte_carlo(case, system, settings)
    results = tuple(held_results(case, system, exact, found, settings))
    simulated = None if found is None else found.monte_carlo
    return Verified(design, system, figures, exact, simulated, results, trouble)


def _monte_carlo(
    case: Case, system: System, settings: CheckSettings
) -> tuple[CrossCheck | None, str]:
    """The cross-check, or why there is none; a trajectory that cannot be used is bad input."""
    if not settings.monte_carlo:
        return None, "left out on request"
    try:
        in_force().doing("simulating")
        return cross_check(system, simulation_settings(case, settings.seed)), ""
    except OutOfTime:
        return None, "the time limit ended it"
    except SimulationError as error:
        if case.spec.monte_carlo.trajectory is not None:
            refuse_trajectory(case, str(error))
        return None, str(error)


def verdict_on(
    case: Case,
    problem: Problem,
    verified: Verified,
    settings: CheckSettings,
    choice: ChoiceResult,
) -> Verdict:
    """The whole verdict on a verified design."""
    entries = used_entries(case, problem, verified.design)
    assumed = assumptions(entries)
    figures = error_figures(verified, settings.seed, settings.monte_carlo)
    told = sources(entries)
    bill = bill_of_materials(case, problem, verified.design)
    shown = named_design(case, problem, verified.design, verified.figures)
    worked = Worked(verified.system, case.spec.sync_model, shown, figures, told)
    asked = [row for row in verified.requirements if row.id in settings.explain]
    return Verdict(
        verdict=verified.word,
        **frame(case, problem, settings.seed),
        requirements=verified.requirements,
        design=shown,
        syncline=syncline_figures(verified, case.spec.sync_model),
        monte_carlo=verified.monte_carlo,
        warnings=(
            *cautions(case, verified, figures, assumed, transcripts(entries)),
            *claim_cautions(case, entries),
            *lifecycle_cautions(entries),
        ),
        figures=figures,
        assumptions=assumed,
        sources=told,
        effects=known_effects(verified.system),
        choice=choice or None,
        measured=measured(case, entries),
        explained=explained(worked, asked) if asked else None,
        bill_of_materials=bill,
    )
