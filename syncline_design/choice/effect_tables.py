"""The design problem of a spec with its known effects, charged to the options they hang on.

What an effect adds is the same for every design (a bias), or it hangs on one sensor (an understated
noise is a share of that sensor's own).  Which it is, is found by asking the effect itself, one
candidate sensor at a time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field, replace
from fractions import Fraction

import numpy as np

from syncline_design.choice.candidates import SensorEffects
from syncline_design.choice.chosen_system import system_of
from syncline_design.choice.problem import build_problem, with_everything
from syncline_design.choice.table import Design, Problem, is_empty
from syncline_design.effects import registry
from syncline_design.effects.acting import known_of
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.budget import Budget, budget
from syncline_design.model.known import EffectEntry, Known
from syncline_design.model.roles import RoleName
from syncline_design.model.system import Sensor, System
from syncline_design.spec.case import Case
from syncline_design.spec.load import BadInput
from syncline_design.spec.yaml_text import Flaw as FileProblem
from syncline_design.spec.yaml_text import KeyPath, show_path

Key = tuple[str, RoleName, str]  # stage, role, sensor
Term = tuple[str, str, float]  # name, stage, value [m]


def problem_of(case: Case) -> Problem:
    """The design problem of a spec, its known effects taken for its own figures.

    A design's sums in these tables are those of its verification.
    """
    bare = build_problem(case)
    if not case.effects:
        return bare
    demand_budget(case)
    systems = _Systems(case, with_everything(bare))
    charges = _Charges()
    for entry in case.effects:
        charges.add(systems, entry)
    taus = {key: known_of(systems.of(key)).extra_tau_s for key in systems}
    by_sensor = {
        key: SensorEffects(
            taus[key].get((key[0], key[1]), 0.0),
            charges.by_sensor.get(key, Fraction(0)),
            charges.by_noise.get(key, Fraction(0)),
        )
        for key in systems
    }
    known = Known(systems.usual_tau_s(), tuple(charges.fixed))
    return build_problem(case, known, by_sensor)


class NoBudget(BadInput):
    """What no budget can hold, at its place in the spec; in a log it may have its place."""


def demand_budget(case: Case) -> None:
    """NoBudget where an effect has no place in a budget with its values."""
    problems = []
    for index, entry in enumerate(case.effects):
        why = registry()[entry.effect].unbudgeted(dict(entry.parameters))  # type: ignore[arg-type]
        if why:
            path: KeyPath = ("effects", index, "parameters")
            message, _, hint = why.partition("; ")
            place = case.position(path)
            problems.append(
                FileProblem(str(case.path), *place, show_path(path), message, hint=hint)
            )
    if problems:
        raise NoBudget(tuple(problems))


def design_budget(case: Case, problem: Problem, design: Design) -> Budget:
    """The budget of one design with the spec's known effects, as its verification sees it."""
    system = system_of(case, problem, design)
    return budget(system, known_of(system))


class _Systems:
    """Systems that differ from a first one in a single sensor."""

    def __init__(self, case: Case, problem: Problem) -> None:
        self.case, self.problem = case, problem
        filled = not is_empty(problem)
        self.first = Design((0,) * len(problem.roles), (0,) * len(problem.vehicles))
        self.places = dict(self._places()) if filled else {}
        self.built: dict[Key | None, System] = {}

    def _places(self) -> list[tuple[Key, tuple[int, int]]]:
        """Role and first option of every candidate sensor."""
        found: dict[Key, tuple[int, int]] = {}
        for r, table in enumerate(self.problem.roles):
            _, first = np.unique(table.options.sensor, return_index=True)
            for place in np.sort(first).tolist():
                sensor = table.options[place].sensor
                found[table.stage_name, table.role, sensor] = (r, place)
        return list(found.items())

    def __iter__(self) -> Iterator[Key]:
        """Every candidate sensor; none where a role has no candidate at all."""
        return iter(self.places)

    def of(self, key: Key | None) -> System:
        """The first system, with one sensor in place of its own."""
        if key not in self.built:
            options = list(self.first.options)
            if key is not None:
                role, place = self.places[key]
                options[role] = place
            design = replace(self.first, options=tuple(options))
            self.built[key] = system_of(self.case, self.problem, design)
        return self.built[key]

    def usual_tau_s(self) -> dict[tuple[str, RoleName], float]:
        """Extra tau of the first system."""
        return dict(known_of(self.of(None)).extra_tau_s) if self.places else {}


@dataclass
class _Charges:
    """Systematic terms of every design, and what hangs on a sensor [m]."""

    fixed: list[Term] = field(default_factory=list)
    by_sensor: dict[Key, Fraction] = field(default_factory=dict)
    by_noise: dict[Key, Fraction] = field(default_factory=dict)  # in proportion to its noise

    def add(self, systems: _Systems, entry: EffectEntry) -> None:
        """Charge one effect.

        What hangs on sensors of several roles is split: the first role carries the whole, each
        further one the difference to the first system, exact where the parts add up.
        """
        if not systems.places:
            return
        base = _terms(systems.of(None), entry)
        values = {key: _sum(_terms(systems.of(key), entry)) for key in systems}
        whole = _sum(base)
        moving = list(dict.fromkeys(key[:2] for key in values if values[key] != whole))
        if not moving:
            self.fixed += base
        for key, value in values.items():
            if key[:2] in moving:
                share = value if key[:2] == moving[0] else value - whole
                self.by_sensor[key] = self.by_sensor.get(key, Fraction(0)) + share
            if registry()[entry.effect].kind == "stochastic":
                twice = _sum(_terms(_noisier(systems.of(key), key), entry))
                self.by_noise[key] = self.by_noise.get(key, Fraction(0)) + twice - value


def _noisier(system: System, key: Key) -> System:
    """A system with the noise of one sensor doubled."""
    name, role, _ = key
    stages = (
        one.with_sensor(role, _doubled(getattr(one, role))) if one.name == name else one
        for one in system.stages
    )
    return replace(system, stages=tuple(stages))


def _doubled(sensor: Sensor) -> Sensor:
    first, second, third = sensor.sigma
    return replace(sensor, sigma=(2.0 * first, 2.0 * second, 2.0 * third))


def _terms(system: System, entry: EffectEntry) -> tuple[Term, ...]:
    return known_of(replace(system, effects=(entry,))).systematic


def _sum(terms: tuple[Term, ...]) -> Fraction:
    return sum((Fraction(value) for *_, value in terms), Fraction(0))
