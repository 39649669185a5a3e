"""One design to its verdict: budget, exact recheck, Monte Carlo, everything told of it."""

from __future__ import annotations

from dataclasses import replace

from syncline_design.choice.chosen_system import system_of
from syncline_design.choice.problem import selection_of
from syncline_design.choice.table import Design, Problem
from syncline_design.effects.acting import known_of
from syncline_design.machine.deadline import OutOfTime, Pieces, in_force
from syncline_design.model.budget import budget
from syncline_design.model.system import System
from syncline_design.simulation import CrossCheck, MonteCarlo, SimulationError, cross_check
from syncline_design.simulation.along import along
from syncline_design.spec.case import Case
from syncline_design.verdict.acceptance import (
    refuse_trajectory,
    simulation_settings,
)
from syncline_design.verdict.agreed_figures import agreed
from syncline_design.verdict.bill import bill_of_materials
from syncline_design.verdict.cautions import cautions
from syncline_design.verdict.cautions_of_facts import lifecycle_cautions
from syncline_design.verdict.design_data import (
    assumptions,
    named_design,
    sources,
    transcripts,
    used_entries,
)
from syncline_design.verdict.explain import explained
from syncline_design.verdict.explain_shared import Worked
from syncline_design.verdict.held import results as held_results
from syncline_design.verdict.measured import claim_cautions, measured
from syncline_design.verdict.named import ChoiceResult
from syncline_design.verdict.recheck import recheck
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.tree import Caution, Verdict, word_of
from syncline_design.verdict.verified import (
    Verified,
    error_figures,
    framed,
    known_effects,
    syncline_figures,
)


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


def _pictured(
    case: Case, verified: Verified, settings: CheckSettings, pieces: Pieces
) -> MonteCarlo | None:
    """The simulation; for a picture with the errors along the trajectory of a file."""
    found = verified.monte_carlo
    if found is None or not settings.cloud:
        return found
    asked = simulation_settings(case, settings.seed)
    told = pieces.made("errors along the way", lambda: along(found, verified.system, asked), None)
    return replace(found, along=told)


def _decided(
    case: Case,
    problem: Problem,
    verified: Verified,
    settings: CheckSettings,
    choice: ChoiceResult,
) -> Verdict:
    """What decides a verdict, and the design that it is about."""
    return replace(
        framed(verified.word, case, problem, settings),
        requirements=verified.requirements,
        design=named_design(case, problem, verified.design, verified.figures),
        syncline=syncline_figures(verified, case.spec.sync_model),
        monte_carlo=verified.monte_carlo,
        choice=choice or None,
    )


def verdict_on(
    case: Case,
    problem: Problem,
    verified: Verified,
    settings: CheckSettings,
    choice: ChoiceResult,
) -> Verdict:
    """The whole verdict on a verified design."""
    decided = _decided(case, problem, verified, settings, choice)
    if settings.brief:
        return decided
    entries = used_entries(case, problem, verified.design)
    assumed = assumptions(entries)
    rows, figures = agreed(
        case, verified.requirements, error_figures(verified, settings.seed, settings.monte_carlo)
    )
    told = sources(entries)
    bill = bill_of_materials(case, problem, verified.design)
    assert decided.design is not None
    by_id = {one.id: one for one in case.spec.requirements}
    worked = Worked(
        verified.system, case.spec.sync_model, decided.design, told, by_id, settings.seed
    )
    asked = [row for row in verified.requirements if row.id in settings.explain]
    pieces = Pieces()
    simulated = _pictured(case, verified, settings, pieces)
    return replace(
        decided,
        verdict=word_of(rows),
        requirements=rows,
        monte_carlo=simulated,
        warnings=(
            *cautions(case, verified, figures, assumed, transcripts(entries)),
            *claim_cautions(case, entries),
            *lifecycle_cautions(entries),
            *(Caution(*one) for one in pieces.cautions),
        ),
        figures=figures,
        assumptions=assumed,
        sources=told,
        effects=known_effects(verified.system),
        measured=measured(case, entries),
        explained=explained(worked, asked) if asked else None,
        bill_of_materials=bill,
    )
