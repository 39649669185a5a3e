"""A spec simulated: the system it stands for, and what the simulator says of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from syncline_design.choice.chosen_system import system_of
from syncline_design.machine.records import json_of
from syncline_design.model.system import System
from syncline_design.simulation import SimulationError, SimulationResult, simulate
from syncline_design.spec.known_effects import effect_entries
from syncline_design.spec.load import Case
from syncline_design.verdict.acceptance import refuse_trajectory, simulation_settings
from syncline_design.verdict.verify import picked_design


@dataclass(frozen=True, slots=True)
class SimulatedSpec:
    """The system of a spec (its best design when something is open) and its simulation."""

    case: Case
    system: System
    result: SimulationResult

    def to_json(self) -> dict[str, Any]:
        """The simulation's JSON with the spec it belongs to."""
        spec = {"name": self.case.spec.name, "file": str(self.case.path)}
        provenance = {
            "spec_sha256": self.case.spec_sha256,
            "catalogs_sha256": self.case.catalogs_sha256,
            "files": json_of(self.case.files),
        }
        return {**self.result.to_json(), "spec": spec, "provenance": provenance}


def simulate_spec(
    case: Case, seed: int = 0, samples: int | None = None, workers: int | None = None
) -> SimulatedSpec:
    """Simulate a spec as its `monte_carlo` part says; samples and workers override."""
    system = system_of(case, *picked_design(case, seed), effect_entries(case))
    settings = replace(simulation_settings(case, seed), workers=workers)
    if samples is not None:
        settings = replace(settings, samples=samples)
    try:
        return SimulatedSpec(case, system, simulate(system, settings))
    except SimulationError as error:
        if case.spec.monte_carlo.trajectory is not None:
            refuse_trajectory(case, str(error))
        raise
