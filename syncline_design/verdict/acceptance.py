"""Simulated requirements as part of the choice: the judge of a design problem.

One `Simulations` serves a whole command: systems that differ in names alone are simulated once, and
a what-if (another distance, another limit) meets the same random numbers as the verdict.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import field, replace
from fractions import Fraction
from typing import NoReturn

from syncline_design.choice.chosen_system import system_of
from syncline_design.choice.effect_tables import problem_of
from syncline_design.choice.option import Option
from syncline_design.choice.outcome import Unfinished
from syncline_design.choice.stage_motion import may_be_underway
from syncline_design.choice.table import Cut, Design, Judge, Problem, RoleTable, SimulatedJudgement
from syncline_design.effects import registry
from syncline_design.machine.input_files import FileContent
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import System
from syncline_design.simulation import Decision, SimulationError, SimulationSettings, decide
from syncline_design.simulation.run import DEFAULT_CAP
from syncline_design.simulation.statistical import Wanted, Worst
from syncline_design.spec.case import Case
from syncline_design.spec.load import BadInput, Flaw
from syncline_design.spec.requirement import JUDGED_KINDS, STATED_KINDS, Requirement
from syncline_design.verdict.cuts import MOST_LEARNED, Failed, Learned, learned
from syncline_design.verdict.grown import noise_alone, with_grown, without_names
from syncline_design.verdict.stated import Certified, reached, stated, value_m, wanted_of
from syncline_design.verdict.worst_cuts import Taught, taught

HOPELESS = 1.01  # a sensor is ruled out when its noise alone fails a limit by this factor
WHAT_IF_CAP = 400_000  # samples after which a what-if is left open, and so not offered
MOST_REMEMBERED = 2  # situations of a figure in which the last designs were worst
MOST_SIMULATED = 1000  # different systems simulated for one command before it gives up


def simulation_settings(case: Case, seed: int) -> SimulationSettings:
    """How a spec wants to be simulated; held against its tightest accuracy (or other) limit."""
    choice = case.spec.monte_carlo
    asked = [r for r in case.spec.requirements if r.kind == "accuracy"]
    asked = asked or [r for r in case.spec.requirements if r.kind == "monte_carlo"]
    limit = min(asked, key=lambda r: float(r.limit), default=None)
    trajectory: str | FileContent | None = case.trajectory
    if trajectory is None and choice.trajectory is not None:
        trajectory = choice.trajectory.manoeuvre
    return SimulationSettings(
        samples=choice.samples,
        seed=seed,
        envelope=choice.envelope,
        limit_m=None if limit is None else float(limit.limit),
        limit_written=None if limit is None else limit.limit_written,
        trajectory=trajectory,
    )


def refuse_trajectory(case: Case, message: str) -> NoReturn:
    """A trajectory that cannot be flown, as bad input at its place."""
    place = ("monte_carlo", "trajectory")
    line, column = case.positions.get(place, (0, 0))
    raise BadInput((Flaw(str(case.path), line, column, ".".join(place), message),))


@dataclass
class Simulations:
    """Decisions of one command, by what was simulated.

    kinds: of requirements that are judged design by design.
    """

    seed: int = 0
    kinds: tuple[str, ...] = JUDGED_KINDS
    most: int = MOST_SIMULATED
    known: dict[tuple[System, SimulationSettings, float, float], Decision] = field(
        default_factory=dict
    )
    guessed: dict[tuple[System, SimulationSettings, float, float], Decision] = field(
        default_factory=dict
    )
    systems: set[System] = field(default_factory=set)
    refusals: int = 0  # of systems beyond the most
    asked: Case | None = None  # the spec itself; every other one is a what-if
    learned: list[Learned | Taught] = field(default_factory=list)
    figures: dict[tuple[System, Wanted | Certified], float] = field(default_factory=dict)
    kept: dict[tuple[System, Wanted | Certified], float] = field(default_factory=dict)
    worst: dict[Wanted | Certified, tuple[Worst, ...]] = field(default_factory=dict)

    def decide(
        self, case: Case, system: System, quantile: float, limit_m: float, *, what_if: bool
    ) -> Decision:
        """Whether a system's quantile keeps a limit; Unfinished once too many were simulated.

        what_if: the system or the limit is not one of the spec itself; what is close stays open.
        """
        settings = replace(simulation_settings(case, self.seed), limit_m=None, limit_written=None)
        nameless = without_names(system)
        key = (nameless, settings, quantile, limit_m)
        if key in self.known:
            return self.known[key]
        kept = self.guessed if what_if else self.known
        if key not in kept:
            self.count(nameless)
            cap = WHAT_IF_CAP if what_if or case is not self.asked else DEFAULT_CAP
            kept[key] = decide(*key, cap)
        return kept[key]

    def figure_keeps(self, system: System, wanted: Wanted | Certified, limit_m: float) -> bool:
        """Whether a figure of the error keeps a limit; one that exceeded a larger one does not,
        one that kept a smaller one does."""
        key = (without_names(system), wanted)
        if self.figures.get(key, 0.0) > limit_m:
            return False
        if isinstance(wanted, Wanted):  # the certified one takes next to no time
            self.count(system)
        if self.kept.get(key, math.inf) <= limit_m:
            return True
        found = self._reached_m(key[0], wanted, limit_m)
        self.figures[key] = max(found, self.figures.get(key, 0.0))
        if found <= limit_m:
            self.kept[key] = limit_m
        return found <= limit_m

    def _reached_m(self, system: System, wanted: Wanted | Certified, limit_m: float) -> float:
        """What a figure reaches; situations that were worst for others are looked at first."""
        known = self.worst.get(wanted, ())
        value, worst = reached(system, wanted, limit_m, self.seed, known)
        if worst is not None:
            self.worst[worst.wanted] = (worst, *known)[:MOST_REMEMBERED]
        return value

    def count(self, system: System) -> None:
        """One more system to simulate; Unfinished once there were too many."""
        self.systems.add(without_names(system))
        if len(self.systems) > self.most:
            self.refusals += 1
            raise Unfinished(f"the search stopped after {self.most} simulated designs")

    def problem_of(self, case: Case) -> Problem:
        """The design problem of a spec, its simulated requirements included."""
        wanted = tuple(r for r in case.spec.requirements if r.kind in self.kinds)
        problem = problem_of(case)
        self.asked = self.asked or case
        known = [(one.id, case.choice_limit(one)) for one in wanted]
        limits = tuple((name, float(limit)) for name, limit in known if limit is not None)
        if not limits:
            return problem
        return replace(problem, judge=_SpecJudge(self, case, wanted, limits, problem))


def _as_asked(table: RoleTable, option: Option) -> tuple[Fraction, Fraction]:
    """Error [m] and tau [s] that an option of the same names has in a table."""
    for options in (table.options, table.excluded.poor, table.excluded.beyond):
        if (place := options.place_of(option.names)) is not None:
            return options[place].error(), options[place].tau()
    raise KeyError(option.names)


@dataclass(frozen=True, slots=True)
class _SpecJudge:
    """The simulated requirements of one spec, at limits that may be moved or lifted."""

    simulations: Simulations
    case: Case
    requirements: tuple[Requirement, ...]
    limits: tuple[tuple[str, float], ...]
    asked: Problem  # as the spec has it: a what-if may have grown an error or a tau

    @property
    def refusals(self) -> int:
        """How often a design was not simulated because the command had simulated too many."""
        return self.simulations.refusals

    def hopeless(self, problem: Problem, role: int, place: int) -> bool:
        """Whether the noise of a sensor alone, with all else perfect, fails a limit by 1 %.

        Independent errors never make a symmetric, unimodal one less dispersed (T. W. Anderson,
        Proc. AMS 6, 1955): whatever is added, P(|error| <= limit) is no larger.  The margin is for
        what the simulator's angles do beyond first order.
        """
        if self._noise_is_changed():
            return False
        places = [0] * len(problem.roles)
        places[role] = place
        design = Design(tuple(places), (0,) * len(problem.vehicles))
        table = problem.roles[role]
        bare = noise_alone(system_of(self.case, problem, design), table.stage, table.role)
        return any(
            self._status(bare, name, HOPELESS * limit, what_if=True) == "fail"
            for name, limit in self.limits
        )

    def _noise_is_changed(self) -> bool:
        """Whether a known effect changes the noise of a sensor."""
        kinds = [registry()[one.effect].kind for one in self.case.effects]
        return "stochastic" in kinds

    def _noise_depends(self) -> bool:
        """Whether some sensor's noise is another in another situation: by range, or by angle."""
        return any(
            table.of == "angle" or stage.choice.distance is not None
            for stage in self.case.stages
            for role in stage.roles
            for one in role.sensors
            for table in one.entry.tables.values()
        )

    def cuts(self, problem: Problem, known: int = 0) -> Sequence[Cut]:
        """Sums of noise that rule designs out, from those that have failed."""
        limits = dict(self.limits)
        own = [one for one in self.simulations.learned if one.case is self.case]
        return [one.cut(problem, limits.get(one.requirement, math.inf)) for one in own[known:]]

    def judge(self, problem: Problem, design: Design) -> SimulatedJudgement:
        """Every limit in turn; the first that fails settles it."""
        limits = dict(self.limits)
        for one in self.simulations.learned:
            limit = limits.get(one.requirement)
            if (
                one.case is self.case
                and limit is not None
                and one.rules_out(problem, design, limit)
            ):
                return SimulatedJudgement(failed=(one.requirement,))
        left_open: list[str] = []
        system, grown = self._system(problem, design)
        what_if = grown or self.case is not self.simulations.asked
        for name, limit in self.limits:
            status = self._status(system, name, limit, what_if=what_if)
            if status == "fail":
                self._learn(problem, design, system, name)
                return SimulatedJudgement(failed=(name,))
            left_open += [name] if status == "indeterminate" else []
        return SimulatedJudgement(undecided=tuple(left_open))

    def _system(self, problem: Problem, design: Design) -> tuple[System, bool]:
        """The design's system, and whether it is not the spec's own.

        An option whose error or tau was grown has its sensor's grown.
        """
        system, grown = system_of(self.case, problem, design), False
        for table, whole, place in zip(
            problem.roles, self.asked.roles, design.options, strict=True
        ):
            option = table.options[place]
            error, tau = _as_asked(whole, option)
            noise = option.error() / error if error else Fraction(1)
            shift = option.tau() / tau if tau else Fraction(1)
            if noise != 1 or shift != 1:
                grown = True
                system = with_grown(system, table.stage, table.role, float(noise), float(shift))
        return system, grown

    def _status(self, system: System, name: str, limit_m: float, *, what_if: bool) -> str:
        requirement = self._requirement(name)
        try:
            if requirement.kind in STATED_KINDS:
                kept = self.simulations.figure_keeps(system, wanted_of(requirement), limit_m)
                return "pass" if kept else "fail"
            return self._decision(system, name, limit_m, what_if=what_if).status
        except SimulationError as error:
            if self.case.spec.monte_carlo.trajectory is not None:
                refuse_trajectory(self.case, str(error))
            return "indeterminate"

    def _learn(self, problem: Problem, design: Design, system: System, name: str) -> None:
        """Remember where a system failed a figure, for all that come after it.

        Known effects that displace by their own only make errors larger (T. W. Anderson); those
        that change the noise, or turn some designs only, leave the sums of noise without a say.
        """
        known, requirement = self.simulations.learned, self._requirement(name)
        if requirement.kind not in STATED_KINDS or self._noise_depends():
            return
        wanted, bare, seed = wanted_of(requirement), without_names(system), self.simulations.seed
        alike = [one for one in known if one.requirement == name]
        if sum(1 for one in alike if one.case is self.case) >= MOST_LEARNED:
            return
        if isinstance(wanted, Certified):
            at = stated(bare, wanted, float(requirement.limit), seed)
            known.append(taught(self.case, self.asked, bare, name, (wanted, at)))
        elif not self._noise_is_changed() and not may_be_underway(self.case):
            limit_m = dict(self.limits)[name]
            failed = Failed(self.case, self.asked, problem, design, bare, name, wanted, limit_m)
            lessons = [one for one in alike if isinstance(one, Learned) and one.wanted == wanted]
            lesson = learned(failed, lessons, seed)
            known += [] if lesson is None else [lesson]

    def _requirement(self, name: str) -> Requirement:
        return next(one for one in self.requirements if one.id == name)

    def _decision(
        self, system: System, name: str, limit_m: float, *, what_if: bool = False
    ) -> Decision:
        own = self._requirement(name)
        asked = self.case.choice_limit(own)
        moved = what_if or asked is None or limit_m != float(asked)
        quantile = float(own.quantile or 0.0)
        return self.simulations.decide(self.case, system, quantile, limit_m, what_if=moved)

    def reached_m(self, problem: Problem, design: Design, requirement: str) -> float:
        """What the requirement limits [m], of a simulated quantile the interval's upper end."""
        return self._figure(problem, design, requirement)[1]

    def estimate_m(self, problem: Problem, design: Design, requirement: str) -> float:
        """The same, of a simulated quantile its estimate."""
        return self._figure(problem, design, requirement)[0]

    def _figure(self, problem: Problem, design: Design, requirement: str) -> tuple[float, float]:
        """What the requirement limits [m], and a limit that surely is above."""
        one = self._requirement(requirement)
        if one.kind in STATED_KINDS:
            system = without_names(self._system(problem, design)[0])
            try:
                found = value_m(system, wanted_of(one), float(one.limit), self.simulations.seed)
            except SimulationError as error:
                raise Unfinished(str(error)) from None
            return found, found
        limit = next(float(r.limit) for r in self.requirements if r.id == requirement)
        system, _ = self._system(problem, design)
        estimate = self._decision(system, requirement, limit).estimate
        return estimate.value_m, estimate.high_m

    def with_limits(self, limits: tuple[tuple[str, float], ...]) -> Judge:
        """The same at other limits."""
        return replace(self, limits=limits)

    @contextmanager
    def spending(self, most: int) -> Iterator[None]:
        """See `Judge`."""
        simulations = self.simulations
        before = simulations.most
        simulations.most = min(before, len(simulations.systems) + most)
        try:
            yield
        finally:
            simulations.most = before
