"""A verdict as data: the JSON of `check`, schema syncline-design/verdict/v1."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from syncline_design import __version__
from syncline_design.choice.table import Design
from syncline_design.choice.table import Problem as DesignProblem
from syncline_design.machine.records import json_of
from syncline_design.model.budget import Budget, LeverArm
from syncline_design.model.horizon import Horizon
from syncline_design.model.system import System
from syncline_design.simulation import MonteCarlo, SimulationError
from syncline_design.simulation.certified import certified_worst_case_m
from syncline_design.spec.known_effects import describe
from syncline_design.spec.load import Case, Problem
from syncline_design.spec.resolve import platform_of
from syncline_design.verdict.recheck import Recheck

Json = dict[str, Any]
SCHEMA = "syncline-design/verdict/v1"
Status = Literal["pass", "fail", "indeterminate"]
Word = Literal["meets", "fails", "infeasible", "indeterminate"]
EXIT_CODES: Mapping[str, int] = {
    "meets": 0,
    "fails": 1,
    "infeasible": 1,
    "refused": 2,
    "indeterminate": 3,
}
UNITS = {
    "accuracy": "m",
    "monte_carlo": "m",
    "sync": "1",
    "feasible": "1",
    "mass": "kg",
    "power": "W",
}


@dataclass(frozen=True, slots=True)
class RequirementResult:
    """One requirement, decided: value against limit; margin = limit - value."""

    id: str
    kind: str
    status: Status
    value: float | None
    limit: float
    unit: str
    line: int | None = None
    column: int | None = None
    implied: bool = False
    quantile: float | None = None
    low: float | None = None
    high: float | None = None
    note: str = ""
    waiver: Mapping[str, Any] | None = None

    @property
    def is_waived(self) -> bool:
        """Whether a waiver in force covers this requirement."""
        return self.waiver is not None and not self.waiver["expired"]

    def to_json(self) -> Json:
        """The entry under `requirements`."""
        margin = None if self.value is None else self.limit - self.value
        data: Json = {
            "id": self.id,
            "kind": self.kind,
            "status": self.status,
            "value": finite(self.value),
            "limit": self.limit,
            "unit": self.unit,
            "margin": finite(margin),
            "line": self.line,
            "column": self.column,
            "implied": self.implied,
            "note": self.note,
        }
        optional = {
            "quantile": self.quantile,
            "low": self.low,
            "high": self.high,
            "waiver": self.waiver,
        }
        return data | {key: value for key, value in optional.items() if value is not None}


def finite(value: float | None) -> float | None:
    """JSON has no infinity: what is unlimited or unknown is null."""
    return value if value is not None and math.isfinite(value) else None


def word_of(results: Iterable[RequirementResult]) -> Word:
    """One failed requirement fails the whole; one undecided one leaves it open; else it meets.

    A failure with a valid waiver does not count.
    """
    statuses = {r.status for r in results if not (r.status == "fail" and r.is_waived)}
    if "fail" in statuses:
        return "fails"
    return "indeterminate" if "indeterminate" in statuses else "meets"


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


def syncline_json(budget: Budget, model: str, total_m: float) -> Json:
    """The `syncline` key; total_m is the rechecked total of the spec's own model."""
    per_sensor = model == "per_sensor"
    ledger = budget.ledger_per_sensor if per_sensor else budget.ledger
    return {
        "model": model,
        "sensor_error_m": budget.sensor_error_m,
        "sync_rate_mps": budget.sync_rate_mps,
        "tau_s": budget.tau_s,
        "tau_crit_s": finite(budget.tau_crit_s),
        "sync_error_m": budget.sync_error_per_sensor_m if per_sensor else budget.sync_error_m,
        "systematic_error_m": budget.systematic_m,
        "total_m": total_m,
        "models": {
            "syncline": {"sync_error_m": budget.sync_error_m, "total_m": budget.total_m},
            "per_sensor": {
                "sync_error_m": budget.sync_error_per_sensor_m,
                "total_m": budget.total_per_sensor_m,
            },
        },
        "lever_arm": _lever_arm_json(budget.lever_arm, per_sensor),
        "stages": [
            {
                "name": row.stage,
                "sensor_error_m": row.sensor_error_m,
                "sync_rate_mps": row.sync_rate_mps,
                "tau_s": row.tau_s,
                "tau_crit_s": finite(row.tau_crit_s),
            }
            for row in budget.stages
        ],
        "ledger": [
            {
                "term": term.term,
                "stage": term.stage,
                "value_m": term.value_m,
                "kind": term.kind,
                "share": term.share,
            }
            for term in ledger
        ],
    }


def figures_json(verified: Verified) -> Json:
    """The `figures` key: the errors of a design by their convention, those that are computed."""
    worst = verified.worst_case_1sigma_m
    figures: Json = {"syncline_m": finite(float(verified.exact.total_m))}
    return figures if worst is None else figures | {"worst_case_1sigma_m": finite(worst)}


def _lever_arm_json(lever_arm: LeverArm, per_sensor: bool) -> Json:
    return {
        "tau_crit_s": finite(lever_arm.tau_crit_s),
        "total_m": lever_arm.total_per_sensor_m if per_sensor else lever_arm.total_m,
        "sync_rate_mps": lever_arm.sync_rate_mps,
        "differs": lever_arm.differs,
    }


def frame(case: Case, problem: DesignProblem | None, word: str, seed: int) -> Json:
    """What every verdict holds, with or without a design; problem: None where time ended first."""
    spec = case.spec
    stages = []
    for stage in spec.stages:
        platform = platform_of(stage.platform, case.catalog)
        identity = stage.platform.use or stage.platform.name or stage.name
        stages.append(
            {
                "name": stage.name,
                "vehicle": stage.vehicle_name,
                "platform": {
                    "id": identity,
                    "name": platform.name or identity,
                    "v_max_mps": float(platform.v_max),
                    "omega_max_radps": float(platform.omega_max),
                    "distance_m": float(platform.distance),
                    "baseline_m": float(platform.baseline),
                },
            }
        )
    return {
        "schema": SCHEMA,
        "verdict": word,
        "spec": {
            "name": spec.name,
            "file": str(case.path),
            "currency": spec.currency,
            "sync_model": spec.sync_model,
            "objective": spec.objective,
            "coverage_factor": float(spec.coverage_factor),
            "open_roles": [
                f"{table.stage_name}.{table.role}"
                for table in (problem.roles if problem is not None else ())
                if len(table.options) + len(table.excluded) > 1
            ],
            "combinations": None if problem is None else str(problem.combinations),
            "stages": stages,
        },
        "horizon": horizon_json(spec.horizon.horizon()),
        "requirements": [],
        "design": None,
        "syncline": None,
        "monte_carlo": None,
        "warnings": [],
        "provenance": _provenance(case, seed),
    }


def horizon_json(horizon: Horizon) -> Json:
    """The `horizon` key: what drifts, grids and heave are charged for."""
    return {
        "duration_s": horizon.duration_s,
        "extent_m": horizon.extent_m,
        "tilt_rad": horizon.tilt_rad,
    }


def _provenance(case: Case, seed: int) -> Json:
    import platform

    import numpy as np

    return {
        "version": __version__,
        "spec_sha256": case.spec_sha256,
        "catalogs_sha256": case.catalogs_sha256,
        "files": json_of(case.files),
        "seed": seed,
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def effects_json(system: System) -> list[Json]:
    return [
        {
            "effect": entry.effect,
            "sensor": entry.sensor,
            "stage": entry.stage,
            "parameters": dict(entry.parameters),
            "sentence": describe(entry),
        }
        for entry in system.effects
    ]


def problem_json(problem: Problem) -> Json:
    wanted = f"expected {problem.expected}" if problem.expected else ""
    found = f"found {problem.found}" if problem.found else ""
    parts = (problem.message, wanted, found, problem.hint)
    return {
        "file": problem.file,
        "line": problem.line,
        "column": problem.column,
        "path": problem.path,
        "message": "; ".join(part for part in parts if part),
    }
