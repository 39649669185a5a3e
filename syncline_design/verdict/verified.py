"""A design verified, and the parts of a verdict that are made from it and from its spec."""

from __future__ import annotations

from dataclasses import replace

from syncline_design import __version__
from syncline_design.choice.table import Design, Problem
from syncline_design.machine.deadline import OutOfTime, in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.budget import Budget, SyncModelName
from syncline_design.model.system import System
from syncline_design.simulation import MonteCarlo, SimulationError
from syncline_design.simulation.certified import certified_worst_case_m
from syncline_design.simulation.figures import error_statistics, worst_case_m
from syncline_design.spec.case import Case, StageCase
from syncline_design.spec.known_effects import describe
from syncline_design.spec.load import BadInput, Flaw
from syncline_design.verdict.recheck import Recheck
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.syncline_figures import (
    LedgerRow,
    LeverArmFigures,
    ModelTotal,
    ModelTotals,
    StageSyncline,
    SynclineFigures,
)
from syncline_design.verdict.tree import (
    ErrorFigures,
    FileProblem,
    KnownEffect,
    MissionHorizon,
    PlatformFigures,
    Provenance,
    Refused,
    RequirementResult,
    SpecFrame,
    StageFrame,
    Verdict,
    Word,
    finite,
    word_of,
)


@dataclass(frozen=True, slots=True)
class Verified:
    """One design, verified: budget, exact recheck, Monte Carlo where it ran, requirements."""

    design: Design
    system: System
    figures: Budget
    exact: Recheck
    monte_carlo: MonteCarlo | None
    requirements: tuple[RequirementResult, ...]
    trouble: str = ""  # why the Monte Carlo part is missing

    @property
    def worst_case_1sigma_m(self) -> float | None:
        """Certified worst case [m], sensors at one sigma; None of a system without sense."""
        try:
            return certified_worst_case_m(self.system)
        except SimulationError:
            return None

    @property
    def word(self) -> Word:
        """meets, fails or indeterminate."""
        return word_of(self.requirements)


def syncline_figures(verified: Verified, model: SyncModelName) -> SynclineFigures:
    """What the Syncline says; the total is the rechecked one of the spec's own model."""
    budget = verified.figures
    return SynclineFigures(
        model=model,
        sensor_error_m=budget.sensor_error_m,
        sync_rate_mps=budget.sync_rate_mps,
        tau_s=budget.tau_s,
        tau_crit_s=finite(budget.tau_crit_s),
        sync_error_m=budget.sync_error(model),
        systematic_error_m=budget.systematic_m,
        total_m=float(verified.exact.total_m),
        models=ModelTotals(
            ModelTotal(budget.sync_error_m, budget.total_m),
            ModelTotal(budget.sync_error_per_sensor_m, budget.total_per_sensor_m),
        ),
        lever_arm=_lever_arm(budget, model),
        stages=tuple(
            StageSyncline(
                row.stage, row.sensor_error_m, row.sync_rate_mps, row.tau_s, finite(row.tau_crit_s)
            )
            for row in budget.stages
        ),
        ledger=tuple(
            LedgerRow(term.term, term.stage, term.value_m, term.kind, term.share)
            for term in budget.ledger_of(model)
        ),
    )


def _lever_arm(budget: Budget, model: SyncModelName) -> LeverArmFigures:
    arm = budget.lever_arm
    total = arm.total_m if model == "syncline" else arm.total_per_sensor_m
    return LeverArmFigures(finite(arm.tau_crit_s), total, arm.sync_rate_mps, arm.differs)


def error_figures(verified: Verified, seed: int, statistics: bool) -> ErrorFigures:
    """The errors of a design by their conventions; what is infinite or has no sense is left out.

    statistics: whether the statistical budget is wanted, which takes a tenth of a second or more.
    """
    system = verified.system
    plain = ErrorFigures(
        syncline_m=finite(float(verified.exact.total_m)),
        worst_case_1sigma_m=verified.worst_case_1sigma_m,
    )
    if not statistics or plain.worst_case_1sigma_m is None:
        return plain
    plain = replace(
        plain,
        worst_case_m=finite(worst_case_m(system, system.coverage_factor)),
        worst_case_k=system.coverage_factor,
    )
    try:
        in_force().doing("working out the statistical budget")
        found = error_statistics(system, seed)
    except OutOfTime:
        return plain
    over = found.over_missions
    return replace(
        plain,
        rmse_m=over.rmse_m,
        thu95_m=over.thu95_m,
        tvu95_m=over.tvu95_m,
        quantile95_3d_m=over.quantile95_3d_m,
        ensemble="over_missions",
        one_mission=found.one_mission,
        worst_at=found.worst_at,
    )


def known_effects(system: System) -> tuple[KnownEffect, ...]:
    """Every known effect with what it does."""
    return tuple(
        KnownEffect(one.effect, one.sensor, one.stage, dict(one.parameters), describe(one))
        for one in system.effects
    )


def framed(word: Word, case: Case, problem: Problem | None, settings: CheckSettings) -> Verdict:
    """A verdict with the fields that every one has; problem: None where time ended first."""
    horizon = case.spec.horizon.horizon()
    return Verdict(
        verdict=word,
        spec=_spec_frame(case, problem),
        horizon=MissionHorizon(horizon.duration_s, horizon.extent_m, horizon.tilt_rad),
        provenance=_provenance(case, settings),
    )


def _spec_frame(case: Case, problem: Problem | None) -> SpecFrame:
    spec = case.spec
    return SpecFrame(
        name=spec.name,
        file=str(case.path),
        currency=spec.currency,
        sync_model=spec.sync_model,
        objective=spec.objective,
        coverage_factor=float(spec.coverage_factor),
        open_roles=tuple(
            f"{table.stage_name}.{table.role}"
            for table in (problem.roles if problem is not None else ())
            if len(table.options) + len(table.excluded) > 1
        ),
        combinations=None if problem is None else str(problem.combinations),
        stages=tuple(_stage_frame(stage) for stage in case.stages),
    )


def _stage_frame(stage: StageCase) -> StageFrame:
    platform = stage.platform.entry
    return StageFrame(
        stage.choice.name,
        stage.choice.vehicle_name,
        PlatformFigures(
            stage.platform.id,
            platform.name or stage.platform.id,
            float(platform.v_max),
            float(platform.omega_max),
            float(platform.distance),
            float(platform.baseline),
            None if stage.choice.distance is None else float(stage.distances[0]),
        ),
    )


def _provenance(case: Case, settings: CheckSettings) -> Provenance:
    import platform

    import numpy as np

    return Provenance(
        __version__,
        case.spec_sha256,
        case.catalogs_sha256,
        case.files,
        settings.seed,
        platform.python_version(),
        np.__version__,
        case.judged_on(settings.day),
    )


def refused(file: str, error: BadInput) -> Refused:
    """A file that could not be read, among several."""
    problems = tuple(_file_problem(problem) for problem in error.problems)
    return Refused(file=file, problems=problems, text=str(error))


def _file_problem(problem: Flaw) -> FileProblem:
    wanted = f"expected {problem.expected}" if problem.expected else ""
    found = f"found {problem.found}" if problem.found else ""
    parts = (problem.message, wanted, found, problem.hint)
    message = "; ".join(part for part in parts if part)
    return FileProblem(problem.file, problem.line, problem.column, problem.path, message)
