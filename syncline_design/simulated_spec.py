"""A spec simulated: the system it stands for, and what the simulator says of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from syncline_design.chosen_system import system_of
from syncline_design.known_effects import effect_entries, known_of
from syncline_design.loading import BadInput, LoadedSpec, Problem
from syncline_design.model.system import System
from syncline_design.problem import build_problem, sole_design
from syncline_design.simulate import SimulationResult, simulate
from syncline_design.verify import simulation_settings


@dataclass(frozen=True, slots=True)
class SimulatedSpec:
    """The system of a spec (its best design when something is open) and its simulation."""

    loaded: LoadedSpec
    system: System
    result: SimulationResult

    def to_json(self) -> dict[str, Any]:
        """The simulation's JSON with the spec it belongs to."""
        spec = {"name": self.loaded.spec.name, "file": str(self.loaded.path)}
        provenance = {
            "spec_sha256": self.loaded.spec_sha256,
            "catalogs_sha256": self.loaded.catalogs_sha256,
        }
        return {**self.result.to_json(), "spec": spec, "provenance": provenance}


def simulate_spec(
    loaded: LoadedSpec, seed: int = 0, samples: int | None = None, workers: int | None = None
) -> SimulatedSpec:
    """Simulate a spec as its `monte_carlo` part says; samples and workers override."""
    system = chosen_system(loaded)
    settings = replace(simulation_settings(loaded, seed), workers=workers)
    if samples is not None:
        settings = replace(settings, samples=samples)
    return SimulatedSpec(loaded, system, simulate(system, settings))


def chosen_system(loaded: LoadedSpec) -> System:
    """The system of a pinned spec, or of the best design; BadInput when there is none."""
    known = known_of(loaded)
    problem = build_problem(loaded, known.extra_tau_s, known.systematic)
    sole = sole_design(problem)
    if sole is not None:
        return system_of(loaded, *sole, effect_entries(loaded))
    from syncline_design.choose.decide import choose
    from syncline_design.choose.outcome import Infeasible

    choice = choose(problem)
    if isinstance(choice, Infeasible):
        line, column = loaded.positions.get(("stages",), (0, 0))
        hint = f"see `syncline-design check {loaded.path.name}`, or pin the sensors"
        raise BadInput(
            (Problem(str(loaded.path), line, column, "stages", "no design meets this spec, so "
                     "there is no system to simulate", hint=hint),)
        )  # fmt: skip
    return system_of(loaded, problem, choice.design, effect_entries(loaded))
