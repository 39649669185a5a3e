"""A spec simulated: the system it stands for, and what the simulator says of it."""

from __future__ import annotations

from dataclasses import replace

from syncline_design.choice.chosen_system import system_of
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import System
from syncline_design.simulation import Simulation, SimulationError, simulate
from syncline_design.simulation.results import SpecContent, SpecName
from syncline_design.spec.case import Case
from syncline_design.verdict.acceptance import refuse_trajectory, simulation_settings
from syncline_design.verdict.pinned import picked_design


@dataclass(frozen=True, slots=True)
class SimulatedSpec:
    """The system of a spec (its best design when something is open) and its simulation."""

    system: System
    result: Simulation


def simulate_spec(
    case: Case, seed: int, samples: int | None = None, workers: int | None = None
) -> SimulatedSpec:
    """Simulate a spec as its `monte_carlo` part says; samples and workers override."""
    in_force().doing("choosing")
    system = system_of(case, *picked_design(case, seed))
    settings = replace(simulation_settings(case, seed), workers=workers)
    if samples is not None:
        settings = replace(settings, samples=samples)
    in_force().doing("simulating")
    try:
        found = simulate(system, settings)
    except SimulationError as error:
        if case.spec.monte_carlo.trajectory is not None:
            refuse_trajectory(case, str(error))
        raise
    content = SpecContent(case.spec_sha256, case.catalogs_sha256, case.files)
    named = replace(found, spec=SpecName(case.spec.name, str(case.path)), provenance=content)
    return SimulatedSpec(system, named)
