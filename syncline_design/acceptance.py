"""Simulated requirements as part of the choice: the judge of a design problem.

One `Simulations` serves a whole command: systems that differ in names alone are simulated once, and
a what-if (another distance, another limit) meets the same random numbers as the verdict.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from datetime import date
from typing import NoReturn

from syncline_design.choose.outcome import Unfinished
from syncline_design.chosen_system import system_of
from syncline_design.design_space import Design, Judge, Judgement, Option
from syncline_design.design_space import Problem as DesignProblem
from syncline_design.effect_tables import problem_of
from syncline_design.input_files import FileContent
from syncline_design.known_effects import effect_entries
from syncline_design.loading import BadInput, LoadedSpec, Problem
from syncline_design.model.system import ROLES, UTC, RoleName, Sensor, Stage, System
from syncline_design.simulate import Decision, SimulationError, SimulationSettings, decide
from syncline_design.spec import Requirement
from syncline_design.timing import NO_ERROR

HOPELESS = 1.01  # a sensor is ruled out when its noise alone fails a limit by this factor
MOST_SIMULATED = 1000  # different systems simulated for one command before it gives up


def simulation_settings(loaded: LoadedSpec, seed: int) -> SimulationSettings:
    """How a spec wants to be simulated; the target is its tightest accuracy (or other) limit."""
    choice = loaded.spec.monte_carlo
    limits = [float(r.limit) for r in loaded.spec.requirements if r.kind == "accuracy"]
    limits = limits or [float(r.limit) for r in loaded.spec.requirements if r.kind == "monte_carlo"]
    trajectory: str | FileContent | None = loaded.trajectory
    if trajectory is None and choice.trajectory is not None:
        trajectory = choice.trajectory.manoeuvre
    return SimulationSettings(
        samples=choice.samples,
        seed=seed,
        envelope=choice.envelope,
        limit_m=min(limits) if limits else None,
        trajectory=trajectory,
    )


def refuse_trajectory(loaded: LoadedSpec, message: str) -> NoReturn:
    """A trajectory that cannot be flown, as bad input at its place."""
    place = ("monte_carlo", "trajectory")
    line, column = loaded.positions.get(place, (0, 0))
    raise BadInput((Problem(str(loaded.path), line, column, ".".join(place), message),))


@dataclass
class Simulations:
    """Decisions of one command, by what was simulated.

    today: the day on which waivers are judged; a waived requirement decides nothing.
    """

    seed: int = 0
    today: date | None = None
    most: int = MOST_SIMULATED
    known: dict[tuple[System, SimulationSettings, float, float], Decision] = field(
        default_factory=dict
    )
    systems: set[System] = field(default_factory=set)
    gave_up: bool = False

    def decide(
        self, loaded: LoadedSpec, system: System, quantile: float, limit_m: float
    ) -> Decision:
        """Whether a system's quantile keeps a limit; Unfinished once too many were simulated."""
        settings = replace(simulation_settings(loaded, self.seed), limit_m=None)
        nameless = _nameless(system)
        key = (nameless, settings, quantile, limit_m)
        if key not in self.known:
            self.systems.add(nameless)
            if len(self.systems) > self.most:
                self.gave_up = True
                raise Unfinished(f"the search stopped after {self.most} simulated designs")
            self.known[key] = decide(nameless, settings, quantile, limit_m)
        return self.known[key]

    def problem_of(self, loaded: LoadedSpec) -> DesignProblem:
        """The design problem of a spec, its simulated requirements included."""
        wanted = [r for r in loaded.spec.requirements if r.kind == "monte_carlo"]
        wanted = [r for r in wanted if not self._is_waived(r)]
        problem = problem_of(loaded)
        if not wanted:
            return problem
        limits = tuple((r.id, float(r.limit)) for r in wanted)
        return replace(problem, judge=_SpecJudge(self, loaded, tuple(wanted), limits))

    def _is_waived(self, requirement: Requirement) -> bool:
        waiver = requirement.waiver
        return waiver is not None and waiver.holds_on(self.today or date.today())


@dataclass(frozen=True, slots=True)
class _SpecJudge:
    """The simulated requirements of one spec, at limits that may be moved or lifted."""

    simulations: Simulations
    loaded: LoadedSpec
    requirements: tuple[Requirement, ...]
    limits: tuple[tuple[str, float], ...]

    @property
    def gave_up(self) -> bool:
        """Whether too many designs were simulated for one command."""
        return self.simulations.gave_up

    def hopeless(self, problem: DesignProblem, role: int, option: Option) -> bool:
        """Whether the noise of a sensor alone, with all else perfect, fails a limit by 1 %.

        Independent errors never make a symmetric, unimodal one less dispersed (T. W. Anderson,
        Proc. AMS 6, 1955): whatever is added, P(|error| <= limit) is no larger.  The margin is for
        what the simulator's angles do beyond first order.
        """
        if self._noise_is_changed():
            return False
        places = [0] * len(problem.roles)
        places[role] = problem.roles[role].options.index(option)
        design = Design(tuple(places), (0,) * len(problem.vehicles))
        table = problem.roles[role]
        bare = _noise_alone(system_of(self.loaded, problem, design), table.stage, table.role)
        return any(
            self._status(bare, name, HOPELESS * limit) == "fail" for name, limit in self.limits
        )

    def _noise_is_changed(self) -> bool:
        """Whether a known effect changes the noise of a sensor."""
        from syncline_design.effects import registry

        kinds = [registry()[one.effect].kind for one in effect_entries(self.loaded)]
        return "stochastic" in kinds

    def judge(self, problem: DesignProblem, design: Design) -> Judgement:
        """Every limit in turn; the first that fails settles it."""
        left_open: list[str] = []
        system = system_of(self.loaded, problem, design, effect_entries(self.loaded))
        for name, limit in self.limits:
            status = self._status(system, name, limit)
            if status == "fail":
                return Judgement(failed=(name,))
            left_open += [name] if status == "indeterminate" else []
        return Judgement(undecided=tuple(left_open))

    def _status(self, system: System, name: str, limit_m: float) -> str:
        try:
            return self._decision(system, name, limit_m).status
        except SimulationError as error:
            if self.loaded.spec.monte_carlo.trajectory is not None:
                refuse_trajectory(self.loaded, str(error))
            return "indeterminate"

    def _decision(self, system: System, name: str, limit_m: float) -> Decision:
        quantile = next(float(r.quantile or 0.0) for r in self.requirements if r.id == name)
        return self.simulations.decide(self.loaded, system, quantile, limit_m)

    def reached_m(self, problem: DesignProblem, design: Design, requirement: str) -> float:
        """Upper end of the interval of the quantile that the requirement limits [m]."""
        limit = next(float(r.limit) for r in self.requirements if r.id == requirement)
        system = system_of(self.loaded, problem, design, effect_entries(self.loaded))
        return self._decision(system, requirement, limit).estimate.high_m

    def with_limits(self, limits: tuple[tuple[str, float], ...]) -> Judge:
        """The same at other limits."""
        return replace(self, limits=limits)


def _noise_alone(system: System, stage: int, role: RoleName) -> System:
    """A system whose only error is the noise of one sensor; speeds then matter to nothing."""
    stages = []
    for index, one in enumerate(system.stages):
        perfect = {
            name: replace(sensor, timing=NO_ERROR, timeline=UTC)
            if (index, name) == (stage, role)
            else replace(sensor, sigma=(0.0, 0.0, 0.0), timing=NO_ERROR, timeline=UTC)
            for name in ROLES
            if (sensor := getattr(one, name)) is not None
        }
        platform = replace(one.platform, v_max_mps=1.0, omega_max_radps=1.0)
        if role == "position":
            platform = replace(platform, distance_m=1.0)
        stages.append(replace(one, platform=platform, **perfect))
    return replace(system, stages=tuple(stages), clock_offsets=(), effects=())


def _nameless(system: System) -> System:
    """A system without the names of its sensors, which no simulation looks at."""
    return replace(system, stages=tuple(_nameless_stage(stage) for stage in system.stages))


def _nameless_stage(stage: Stage) -> Stage:
    def bare(sensor: Sensor | None) -> Sensor | None:
        return None if sensor is None else replace(sensor, id="")

    return replace(
        stage,
        position=bare(stage.position),
        attitude=bare(stage.attitude),
        ranging=bare(stage.ranging),
    )
