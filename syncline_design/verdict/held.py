"""Every requirement held against what a design reaches: recomputed, simulated, or stated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from syncline_design.machine.deadline import OutOfTime
from syncline_design.model.system import System
from syncline_design.simulation import CrossCheck, Decision, SimulationError, decide
from syncline_design.spec.case import Case
from syncline_design.spec.requirement import STATED_KINDS, Requirement
from syncline_design.verdict.acceptance import simulation_settings
from syncline_design.verdict.recheck import Recheck
from syncline_design.verdict.stated import stated, wanted_of
from syncline_design.verdict.tree import (
    UNITS,
    RequirementResult,
    Status,
    WaiverResult,
    decided,
    finite,
    settled,
)

if TYPE_CHECKING:
    from syncline_design.verdict.settings import CheckSettings


def results(
    case: Case,
    system: System,
    exact: Recheck,
    found: CrossCheck | None,
    settings: CheckSettings,
) -> Iterator[RequirementResult]:
    rechecked = {one.id: one for one in exact.requirements}
    for one in exact.requirements:
        if one.implied:
            yield decided(
                id=one.id, kind=one.kind, status="pass" if one.passed else "fail",
                value=one.value_float, limit=float(one.limit), unit=UNITS[one.kind], implied=True,
                note=one.note,
            )  # fmt: skip
    for index, requirement in enumerate(case.spec.requirements):
        if requirement.kind == "monte_carlo":
            result = _simulated(case, requirement, system, found, settings)
        elif requirement.kind in STATED_KINDS:
            result = _stated(case, requirement, system, settings)
        else:
            one = rechecked[requirement.id]
            result = decided(
                id=one.id,
                kind=one.kind,
                status="indeterminate" if one.left_open else "pass" if one.passed else "fail",
                value=one.value_float,
                limit=float(one.limit),
                unit=UNITS.get(one.kind, case.spec.currency),
                note=one.note
                or ("" if one.value is not None else f"a catalog entry gives no {one.kind}"),
            )
        yield placed(case, index, requirement, result, settings)


def _simulated(
    case: Case,
    requirement: Requirement,
    system: System,
    found: CrossCheck | None,
    settings: CheckSettings,
) -> RequirementResult:
    """A Monte Carlo requirement: sampled on until its interval leaves the limit."""
    limit, quantile = float(requirement.limit), float(requirement.quantile or 0.0)
    left_open = decided(
        id=requirement.id, kind="monte_carlo", limit=limit, status="indeterminate", value=None,
        unit=UNITS["monte_carlo"], quantile=quantile, note="not simulated",
    )  # fmt: skip
    if found is None:
        return left_open
    simulation = simulation_settings(case, settings.seed)
    try:
        decision = decide(system, simulation, quantile, limit, first=found)
    except OutOfTime:
        note = "the time limit ended the simulation before it was decided"
        return replace(left_open, note=note)
    estimate = decision.estimate
    return replace(
        settled(left_open, decision.status, estimate.value_m),
        low=estimate.low_m,
        high=estimate.high_m,
        note=_samples_note(decision, simulation.samples),
    )


def _stated(
    case: Case, requirement: Requirement, system: System, settings: CheckSettings
) -> RequirementResult:
    """A requirement on a figure of the error, at its worst situation."""
    limit = float(requirement.limit)
    left_open = decided(
        id=requirement.id, kind=requirement.kind, limit=limit, status="indeterminate", value=None,
        unit=UNITS[requirement.kind], quantile=requirement.share,
        axis=requirement.axis or requirement.of,
    )  # fmt: skip
    try:
        found = stated(system, wanted_of(requirement), limit, settings.seed)
    except OutOfTime:
        note = "the time limit ended the search for its worst situation"
        return replace(left_open, note=note)
    except SimulationError as error:
        return replace(left_open, note=str(error))
    status: Status = "pass" if found.weighted_m <= limit else "fail"
    if found.weighted_m > 0.0:  # its limit there, where the limit grows with the distance
        left_open = replace(left_open, limit=limit * (found.value_m / found.weighted_m))
    return replace(
        settled(left_open, status, finite(found.value_m)), at_distance_m=found.distance_m
    )


def _samples_note(decision: Decision, asked: int) -> str:
    if decision.status == "indeterminate":
        return f"the interval still holds the limit after {decision.samples} samples"
    return f"took {decision.samples} samples to decide" if decision.samples > asked else ""


def placed(
    case: Case,
    index: int,
    requirement: Requirement,
    result: RequirementResult,
    settings: CheckSettings,
) -> RequirementResult:
    """The result with its place in the spec, its note and its waiver."""
    line, column = case.positions.get(("requirements", index), (None, None))
    note = "; ".join(text for text in (requirement.note, result.note) if text)
    waiver = None
    if requirement.waiver is not None:
        given = requirement.waiver
        waiver = WaiverResult(given.reason, given.expires, not given.holds_on(settings.day))
    return replace(
        result, line=line, column=column, note=note, waiver=waiver,
        limit_written=requirement.limit_written,
    )  # fmt: skip
